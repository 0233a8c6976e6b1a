"""Followers led by their leaders in the driver's own loop: each goal goes out in the round that read its leader."""

from collections.abc import Collection, Mapping, Sequence

from drivers.api import Coupling
from drivers.api.following import Following
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.commanded import Clamping
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.telling import Telling
from drivers.dynamixel.torque import go

UNHEARD = 0.25
"""Seconds without a reading of a leader after which it is worth a word that its follower stands still."""


class Leading:
    """The couplings of an arm. Whoever calls it holds the driver's lock."""

    def __init__(self, bus: Bus, joints: Mapping[str, Joint], clamping: Clamping, telling: Telling) -> None:
        self._bus = bus
        self._joints = joints
        self._clamping = clamping
        self._telling = telling
        self._following = Following()
        self._unheard: set[str] = set()

    @property
    def joints(self) -> frozenset[str]:
        """Those that lead or follow."""
        couplings = self._following.couplings
        return frozenset(name for coupling in couplings for name in (coupling.leader, coupling.follower))

    def begin(self, couplings: Sequence[Coupling]) -> list[str]:
        """Replace the couplings; return the joints that follow no more."""
        freed = self._following.freed_by(couplings)
        self._following = Following(couplings)
        self._unheard.clear()
        return freed

    def end(self, joints: Collection[str]) -> None:
        """Let those of ``joints`` that follow do so no more."""
        self._following.end(joints)

    def pause(self) -> None:
        """Take note that none was led for a while: the followers are brought over slowly before they go on."""
        self._following.pause()

    def lead(self, *, since: float, now: float) -> None:
        """Send every follower where it belongs whose leader was read ``since``. Raises NotConnected."""
        couplings = self._following.couplings
        if not couplings:
            return
        positions = {}
        for name in {name for coupling in couplings for name in (coupling.leader, coupling.follower)}:
            reading = self._joints[name].reading
            if reading.value is not None and reading.stamp >= since:
                positions[name] = reading.value.position
        goals = self._clamping.accept(self._following.goals(positions), now)
        if goals:
            followers = [self._joints[name] for name in goals]
            go(self._bus, followers, goals, self._following.speeds(goals, positions, now), now)
            self._following.pause([joint.name for joint in followers if joint.left_out])
        self._complain(couplings, now)

    def _complain(self, couplings: Sequence[Coupling], now: float) -> None:
        """Tell, once, of followers that stand still because nothing is heard of their leader."""
        for coupling in couplings:
            silent = now - self._joints[coupling.leader].reading.stamp > UNHEARD
            if silent and coupling.follower not in self._unheard:
                self._telling.unled(self._joints[coupling.follower], self._joints[coupling.leader])
            (self._unheard.add if silent else self._unheard.discard)(coupling.follower)
