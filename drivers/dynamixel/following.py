"""Joints that follow others: where the followers belong, given where the leaders are. Pure arithmetic."""

from collections.abc import Collection, Mapping, Sequence

from drivers.api import Coupling


class Following:
    """The couplings in force at present; none to begin with. For one thread at a time.

    A coupling with a threshold begins once its leader is that far from where it was first seen, and then goes on.
    """

    def __init__(self, couplings: Sequence[Coupling] = ()) -> None:
        self._couplings = {coupling.follower: coupling for coupling in couplings}
        self._origins: dict[str, float] = {}  # where the leader of a follower that still waits was first seen
        self._begun = {coupling.follower for coupling in couplings if not coupling.threshold}

    def __bool__(self) -> bool:
        return bool(self._couplings)

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Those in force, those included that have not begun."""
        return tuple(self._couplings.values())

    def freed_by(self, couplings: Sequence[Coupling]) -> list[str]:
        """Return the joints that would follow no more if ``couplings`` took the place of these."""
        kept = {coupling.follower for coupling in couplings}
        return [follower for follower in self._couplings if follower not in kept]

    def end(self, joints: Collection[str]) -> None:
        """Let those of ``joints`` that follow do so no more."""
        for joint in joints:
            self._couplings.pop(joint, None)

    def goals(self, positions: Mapping[str, float]) -> dict[str, float]:
        """Return where each follower belongs, in radians and without any limits.

        ``positions`` are those of the leaders that are known just now: a follower stays out whose leader is missing,
        or has not passed its threshold.
        """
        found = {}
        for follower, coupling in self._couplings.items():
            position = positions.get(coupling.leader)
            if position is not None and self._has_begun(coupling, position):
                found[follower] = coupling.scale * position + coupling.offset
        return found

    def _has_begun(self, coupling: Coupling, position: float) -> bool:
        follower = coupling.follower
        if follower not in self._begun:
            origin = self._origins.setdefault(follower, position)
            if abs(position - origin) >= coupling.threshold:
                self._begun.add(follower)
        return follower in self._begun
