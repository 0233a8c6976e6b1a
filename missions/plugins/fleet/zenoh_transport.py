"""A fleet's wire: tokens, states and questions over one session of Zenoh. Whatever comes in may be anything."""

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


# Who is in a fleet, as one of them sees it: from tokens that come and go, and from what each tells of itself.

MAX_ROBOTS = 4096
"""Robots that are kept in mind; of more, those that have gone are forgotten first, and further ones not let in."""


DUPLICATE_MEMORY = 15.0
"""Seconds for which two robots of one address are remembered as such."""


@dataclass(frozen=True, slots=True)
class RosterEntry:
    """A robot of the fleet: how it is connected, for how many seconds of the roster's clock, and what it told last."""

    address: Address
    connection: Connection
    since: float
    state: RobotState | None = None

    @property
    def is_online(self) -> bool:
        """Whether it is there, and has told what it is."""
        return self.connection == "ONLINE" and self.state is not None


class Roster:
    """The robots that were met, by address. From any thread; a message that is none of ours changes nothing.

    ``version`` grows with each change.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._lock = clock, Lock()
        self._members: dict[Address, RosterEntry] = {}
        self._former_sessions: dict[Address, str] = {}
        self._duplicate_until: dict[Address, float] = {}
        self.version = 0

    def members(self) -> Mapping[Address, RosterEntry]:
        """Return all, by address."""
        with self._lock:
            return dict(self._members)

    def get(self, address: Address) -> RosterEntry | None:
        """Return one; None for one that was never met."""
        return self._members.get(address)

    def is_duplicate(self, address: Address) -> bool:
        """Whether two robots tell of themselves under one address by turns, as after a card was copied."""
        return self._clock.now() < self._duplicate_until.get(address, 0.0)

    def on_token(self, key: str, *, alive: bool) -> None:
        """A robot has come, or has gone."""
        try:
            address = address_of_key(key)
        except CodecError:
            return
        with self._lock:
            known = self._members.get(address)
            state = None if known is None else known.state
            if alive:
                # What it told before it went says nothing of now; what came just ahead of its token does.
                fresh = state if known is not None and known.connection == "ONLINE" else None
                self._put(RosterEntry(address, "ONLINE", self._clock.now(), fresh))
            elif known is not None and known.connection == "ONLINE":
                gone: Connection = "OFFLINE" if state is not None and state.farewell else "CONNECTIONBROKEN"
                self._put(RosterEntry(address, gone, self._clock.now(), state))

    def on_state(self, key: str, data: bytes) -> None:
        """A robot tells of itself."""
        try:
            address, state = address_of_key(key), decode_message(RobotState, data)
        except CodecError:
            return
        with self._lock:
            known = self._members.get(address)
            before = None if known is None else known.state
            if known is None or (known.connection != "ONLINE" and not state.farewell):
                # Its token is still on its way, or comes anew: who speaks is there.
                self._put(RosterEntry(address, "ONLINE", self._clock.now(), state))
            elif before is None or before.session != state.session or before.number < state.number:
                if before is not None and before.session != state.session:
                    if self._former_sessions.get(address) == state.session:  # which was there before the other
                        self._duplicate_until[address] = self._clock.now() + DUPLICATE_MEMORY
                    self._former_sessions[address] = before.session
                self._put(RosterEntry(address, known.connection, known.since, state))

    def on_peer_report(self, address: Address, connection: Connection) -> None:
        """Another has met a robot; what one sees for oneself counts more."""
        with self._lock:
            if address not in self._members and connection != "ONLINE":
                self._put(RosterEntry(address, connection, self._clock.now()))

    def _put(self, member: RosterEntry) -> None:
        if member.address not in self._members and len(self._members) >= MAX_ROBOTS:
            gone = next((each.address for each in self._members.values() if each.connection != "ONLINE"), None)
            if gone is None:
                return
            del self._members[gone]
            self._former_sessions.pop(gone, None)
            self._duplicate_until.pop(gone, None)
        self._members[member.address] = member
        self.version += 1


Reply = Callable[[FleetAnswer], None]
"""Sends the answer to what was asked, once, from any thread."""

OnRequest = Callable[[FleetRequest, Reply], None]
"""Is asked something, on a thread of the wire."""

OnAnswer = Callable[[Address | None, FleetAnswer | None], None]
"""Gets each answer and whose it is, on a thread of the wire; in the end None."""


class ZenohTransport:
    """One in a fleet, over a ``session``, which it closes. What it hears of the others it tells the ``roster``."""

    def __init__(self, session: "zenoh.Session", fleet: str, roster: Roster) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._zenoh, self._fleet, self._roster = zenoh, fleet, roster
        self._session: Any = session  # whose own types know no Callback
        self._declarations: list[Any] = []  # what is declared ends with its object
        self._publisher: Any = None

    def subscribe(self) -> None:
        """Hear from now on who comes and goes, and what each tells."""

        def token(sample: Any) -> None:
            where, alive = str(sample.key_expr), sample.kind == self._zenoh.SampleKind.PUT
            self._roster.on_token(where, alive=alive)
            if alive:
                self._query_state("/".join(where.split("/")[-2:]))

        def told(sample: Any) -> None:
            self._roster.on_state(str(sample.key_expr), sample.payload.to_bytes())

        self._declarations.append(self._session.declare_subscriber(zenoh_key(self._fleet, "state"), told))
        liveliness = self._session.liveliness()
        self._declarations.append(liveliness.declare_subscriber(zenoh_key(self._fleet, "here"), token, history=True))

    def _query_state(self, where: str) -> None:
        """Ask a robot that has come how it is; returns at once."""

        def heard(reply: Any) -> None:
            if reply.ok is not None:
                self._roster.on_state(str(reply.ok.key_expr), reply.ok.payload.to_bytes())

        self._session.get(zenoh_key(self._fleet, "state", where), self._zenoh.handlers.Callback(heard), timeout=2.0)

    def announce(self, address: Address, on_stop: OnRequest, on_request: OnRequest, state: Callable[[], bytes]) -> None:
        """Be seen by all as the robot of this address, which answers and tells its ``state`` from now on.

        A stop has a thread of its own: nothing else that is asked holds it up.
        """
        where = self._address = str(address)

        def told(query: Any) -> None:
            query.reply(zenoh_key(self._fleet, "state", where), state())

        express = {"express": True, "priority": self._zenoh.Priority.DATA_HIGH}
        self._publisher = self._session.declare_publisher(
            zenoh_key(self._fleet, "state", where), congestion_control=self._zenoh.CongestionControl.DROP, **express
        )
        for kind, answer in (
            ("state", told),
            ("stop", self._make_handler(on_stop)),
            ("ask", self._make_handler(on_request)),
        ):
            self._declarations.append(self._session.declare_queryable(zenoh_key(self._fleet, kind, where), answer))
        self._declarations.append(self._session.liveliness().declare_token(zenoh_key(self._fleet, "here", where)))

    def _make_handler(self, on_request: OnRequest) -> Callable[[Any], None]:
        """Return what reads a question, and answers one that is none of ours with what is wrong with it."""

        def asked(query: Any) -> None:
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

        return asked

    def publish_state(self, state: bytes) -> None:
        """Tell all how it is."""
        self._publisher.put(state)

    def send_request(self, request: FleetRequest, where: str, on_answer: OnAnswer, timeout: float) -> None:
        """Ask a robot, or ``*/*`` all; returns at once."""

        def heard(reply: Any) -> None:
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
            self._zenoh.handlers.Callback(heard, lambda: on_answer(None, None)),
            payload=encode_message(request),
            target=self._zenoh.QueryTarget.ALL,
            consolidation=self._zenoh.ConsolidationMode.NONE,
            timeout=timeout,
            priority=self._zenoh.Priority.REAL_TIME,
            express=True,
        )

    def close(self) -> None:
        """Be gone."""
        self._session.close()
