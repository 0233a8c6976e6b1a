"""Who is in a fleet, as one of them sees it: from tokens that come and go, and from what each tells of itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock

from drivers.clock import Clock
from missions.codec import CodecError
from missions.plugins.fleet.words import Address, Connection, RobotState, address_in, read

MOST_ROBOTS = 4096
"""Robots that are kept in mind; of more, those that have gone are forgotten first, and further ones not let in."""


TWOFOLD = 15.0
"""Seconds for which two robots of one address are remembered as such."""


@dataclass(frozen=True, slots=True)
class Member:
    """A robot of the fleet: how it is connected, for how many seconds of the roster's clock, and what it told last."""

    address: Address
    connection: Connection
    since: float
    state: RobotState | None = None

    @property
    def online(self) -> bool:
        """Whether it is there, and has told what it is."""
        return self.connection == "ONLINE" and self.state is not None


class Roster:
    """The robots that were met, by address. From any thread; a message that is none of ours changes nothing.

    ``version`` grows with each change.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._lock = clock, Lock()
        self._members: dict[Address, Member] = {}
        self._former: dict[Address, str] = {}
        self._twofold: dict[Address, float] = {}
        self.version = 0

    def members(self) -> Mapping[Address, Member]:
        """Return all, by address."""
        with self._lock:
            return dict(self._members)

    def get(self, address: Address) -> Member | None:
        """Return one; None for one that was never met."""
        return self._members.get(address)

    def twofold(self, address: Address) -> bool:
        """Whether two robots tell of themselves under one address by turns, as after a card was copied."""
        return self._clock.now() < self._twofold.get(address, 0.0)

    def token(self, key: str, *, alive: bool) -> None:
        """A robot has come, or has gone."""
        try:
            address = address_in(key)
        except CodecError:
            return
        with self._lock:
            known = self._members.get(address)
            state = None if known is None else known.state
            if alive:
                # What it told before it went says nothing of now; what came just ahead of its token does.
                fresh = state if known is not None and known.connection == "ONLINE" else None
                self._put(Member(address, "ONLINE", self._clock.now(), fresh))
            elif known is not None and known.connection == "ONLINE":
                gone: Connection = "OFFLINE" if state is not None and state.farewell else "CONNECTIONBROKEN"
                self._put(Member(address, gone, self._clock.now(), state))

    def told(self, key: str, data: bytes) -> None:
        """A robot tells of itself."""
        try:
            address, state = address_in(key), read(RobotState, data)
        except CodecError:
            return
        with self._lock:
            known = self._members.get(address)
            before = None if known is None else known.state
            if known is None or (known.connection != "ONLINE" and not state.farewell):
                # Its token is still on its way, or comes anew: who speaks is there.
                self._put(Member(address, "ONLINE", self._clock.now(), state))
            elif before is None or before.session != state.session or before.number < state.number:
                if before is not None and before.session != state.session:
                    if self._former.get(address) == state.session:  # which was there before the other
                        self._twofold[address] = self._clock.now() + TWOFOLD
                    self._former[address] = before.session
                self._put(Member(address, known.connection, known.since, state))

    def heard_of(self, address: Address, connection: Connection) -> None:
        """Another has met a robot; what one sees for oneself counts more."""
        with self._lock:
            if address not in self._members and connection != "ONLINE":
                self._put(Member(address, connection, self._clock.now()))

    def _put(self, member: Member) -> None:
        if member.address not in self._members and len(self._members) >= MOST_ROBOTS:
            gone = next((each.address for each in self._members.values() if each.connection != "ONLINE"), None)
            if gone is None:
                return
            del self._members[gone]
            self._former.pop(gone, None)
            self._twofold.pop(gone, None)
        self._members[member.address] = member
        self.version += 1
