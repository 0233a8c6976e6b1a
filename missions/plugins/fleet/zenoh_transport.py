"""Transport of a fleet over one Zenoh session: liveliness tokens, states and requests. Received data is untrusted."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Any

from drivers.clock import Clock
from missions.codec import CodecError
from missions.plugins.fleet.messages import (
    MAX_ANSWER_BYTES,
    Address,
    Connection,
    FleetAnswer,
    FleetRequest,
    RobotState,
    address_of_key,
    decode_message,
    encode_message,
    read_request,
    zenoh_key,
)

if TYPE_CHECKING:
    import zenoh


# Members of a fleet as one member sees them: from liveliness tokens and from published states.

MAX_ROBOTS = 4096
"""Maximum number of robots in a roster; a new robot replaces an offline one, or is ignored if all are online."""


DUPLICATE_MEMORY = 15.0
"""Seconds for which a roster reports an address as duplicate, after two robots have sent states under it."""


@dataclass(frozen=True, slots=True)
class RosterEntry:
    """A robot of the fleet: its address, its connection, the time of its last change, and its last state.

    ``since`` is in seconds on the roster's clock.
    """

    address: Address
    connection: Connection
    since: float
    state: RobotState | None = None

    @property
    def is_online(self) -> bool:
        """Whether the robot is connected and has sent a state."""
        return self.connection == "ONLINE" and self.state is not None


class Roster:
    """Known robots of a fleet by address. Thread-safe; invalid messages are ignored.

    ``version`` grows with each change.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._lock = clock, Lock()
        self._members: dict[Address, RosterEntry] = {}
        self._former_sessions: dict[Address, str] = {}
        self._duplicate_until: dict[Address, float] = {}
        self.version = 0

    def members(self) -> Mapping[Address, RosterEntry]:
        """Return the known robots by address."""
        with self._lock:
            return dict(self._members)

    def get(self, address: Address) -> RosterEntry | None:
        """Return the entry of the robot with this address, or None if it is unknown."""
        return self._members.get(address)

    def is_duplicate(self, address: Address) -> bool:
        """Return whether two robots send states under one address, as after an SD card was copied."""
        return self._clock.now() < self._duplicate_until.get(address, 0.0)

    def on_token(self, key: str, *, alive: bool) -> None:
        """Mark a robot online or offline, for a liveliness token that appeared or disappeared."""
        try:
            address = address_of_key(key)
        except CodecError:
            return
        with self._lock:
            known = self._members.get(address)
            state = None if known is None else known.state
            if alive:
                # A state from before it left is stale; a state just before its token is valid.
                fresh = state if known is not None and known.connection == "ONLINE" else None
                self._put(RosterEntry(address, "ONLINE", self._clock.now(), fresh))
            elif known is not None and known.connection == "ONLINE":
                connection: Connection = "OFFLINE" if state is not None and state.farewell else "CONNECTIONBROKEN"
                self._put(RosterEntry(address, connection, self._clock.now(), state))

    def on_state(self, key: str, data: bytes) -> None:
        """Handle a state that a robot has published."""
        try:
            address, state = address_of_key(key), decode_message(RobotState, data)
        except CodecError:
            return
        with self._lock:
            known = self._members.get(address)
            before = None if known is None else known.state
            if before is not None and before.session == state.session and before.number >= state.number:
                return  # delayed: a newer state has arrived
            if known is None or known.connection != "ONLINE":
                # Its token is delayed or about to return, or its farewell is delayed.
                connection: Connection = "OFFLINE" if state.farewell else "ONLINE"
                self._put(RosterEntry(address, connection, self._clock.now(), state))
                return
            if before is not None and before.session != state.session:
                if self._former_sessions.get(address) == state.session:  # the earlier session
                    self._duplicate_until[address] = self._clock.now() + DUPLICATE_MEMORY
                self._former_sessions[address] = before.session
            self._put(RosterEntry(address, known.connection, known.since, state))

    def on_peer_report(self, address: Address, connection: Connection) -> None:
        """Add a robot that another robot has seen; a connection that this roster has observed itself is kept."""
        with self._lock:
            if address not in self._members and connection != "ONLINE":
                self._put(RosterEntry(address, connection, self._clock.now()))

    def _put(self, member: RosterEntry) -> None:
        if member.address not in self._members and len(self._members) >= MAX_ROBOTS:
            offline = next((each.address for each in self._members.values() if each.connection != "ONLINE"), None)
            if offline is None:
                return
            del self._members[offline]
            self._former_sessions.pop(offline, None)
            self._duplicate_until.pop(offline, None)
        self._members[member.address] = member
        self.version += 1


Reply = Callable[[FleetAnswer], None]
"""Callback that sends the answer to one fleet request; call it once, from any thread."""

OnRequest = Callable[[FleetRequest, Reply], None]
"""Callback that handles a fleet request, called on a Zenoh thread; it answers by calling ``Reply``."""

OnAnswer = Callable[[Address | None, FleetAnswer | None], None]
"""Callback for an answer to a fleet request, with the address of the answering robot; called on a Zenoh thread.

After the last answer it is called once with (None, None).
"""


class ZenohTransport:
    """Connection of a robot or operator to its fleet, over a Zenoh ``session``, which it closes.

    States that robots publish go to the ``roster``.
    """

    def __init__(self, session: "zenoh.Session", fleet: str, roster: Roster) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._zenoh, self._fleet, self._roster = zenoh, fleet, roster
        self._session: Any = session  # its type stubs lack Callback
        self._declarations: list[Any] = []  # a declaration ends with its object
        self._publisher: Any = None

    def subscribe(self) -> None:
        """Start to receive liveliness tokens and states."""

        def token(sample: Any) -> None:
            where, alive = str(sample.key_expr), sample.kind == self._zenoh.SampleKind.PUT
            self._roster.on_token(where, alive=alive)
            if alive:
                self._query_state("/".join(where.split("/")[-2:]))

        def on_state(sample: Any) -> None:
            self._roster.on_state(str(sample.key_expr), sample.payload.to_bytes())

        self._declarations.append(self._session.declare_subscriber(zenoh_key(self._fleet, "state"), on_state))
        liveliness = self._session.liveliness()
        self._declarations.append(liveliness.declare_subscriber(zenoh_key(self._fleet, "here"), token, history=True))

    def _query_state(self, where: str) -> None:
        """Request the state of a robot that has just appeared; returns at once."""

        def on_reply(reply: Any) -> None:
            if reply.ok is not None:
                self._roster.on_state(str(reply.ok.key_expr), reply.ok.payload.to_bytes())

        self._session.get(zenoh_key(self._fleet, "state", where), self._zenoh.handlers.Callback(on_reply), timeout=2.0)

    def announce(self, address: Address, on_stop: OnRequest, on_request: OnRequest, state: Callable[[], bytes]) -> None:
        """Announce the robot with this address, answer its requests, and publish its ``state`` on request.

        Stops use a queryable of their own, so no other request delays them.
        """
        where = self._address = str(address)

        def on_state(query: Any) -> None:
            query.reply(zenoh_key(self._fleet, "state", where), state())

        express = {"express": True, "priority": self._zenoh.Priority.DATA_HIGH}
        self._publisher = self._session.declare_publisher(
            zenoh_key(self._fleet, "state", where), congestion_control=self._zenoh.CongestionControl.DROP, **express
        )
        for kind, answer in (
            ("state", on_state),
            ("stop", self._make_handler(on_stop)),
            ("ask", self._make_handler(on_request)),
        ):
            self._declarations.append(self._session.declare_queryable(zenoh_key(self._fleet, kind, where), answer))
        self._declarations.append(self._session.liveliness().declare_token(zenoh_key(self._fleet, "here", where)))

    def _make_handler(self, on_request: OnRequest) -> Callable[[Any], None]:
        """Return a Zenoh callback that decodes a request, and answers an invalid one with its error."""

        def on_query(query: Any) -> None:
            kind = str(query.key_expr).split("/")[3]

            def reply(answer: FleetAnswer) -> None:
                query.reply(zenoh_key(self._fleet, kind, self._address), encode_message(answer), express=True)
                query.drop()

            payload = query.payload
            try:
                ask = read_request(b"" if payload is None else payload.to_bytes())
            except CodecError as error:
                reply(FleetAnswer(ok=False, reason=str(error)))
                return
            on_request(ask, reply)

        return on_query

    def publish_state(self, state: bytes) -> None:
        """Publish the encoded state to the fleet."""
        self._publisher.put(state)

    def send_request(self, request: FleetRequest, where: str, on_answer: OnAnswer, timeout: float) -> None:
        """Send a request to a robot, or to all with ``*/*``; returns at once."""

        def on_reply(reply: Any) -> None:
            if reply.ok is None:
                return
            try:
                address = address_of_key(str(reply.ok.key_expr))
                answer = decode_message(FleetAnswer, reply.ok.payload.to_bytes(), MAX_ANSWER_BYTES)
            except CodecError:
                return
            on_answer(address, answer)

        kind = "stop" if request.word == "stop" else "ask"
        self._session.get(
            zenoh_key(self._fleet, kind, where),
            self._zenoh.handlers.Callback(on_reply, lambda: on_answer(None, None)),
            payload=encode_message(request),
            target=self._zenoh.QueryTarget.ALL,
            consolidation=self._zenoh.ConsolidationMode.NONE,
            timeout=timeout,
            priority=self._zenoh.Priority.REAL_TIME,
            express=True,
        )

    def close(self) -> None:
        """Close the session."""
        self._session.close()
