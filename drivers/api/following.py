"""Joints that follow others: where the followers belong, given where the leaders are. Pure arithmetic."""

from collections.abc import Collection, Mapping, Sequence
from math import inf, radians

from drivers.api.joints import Coupling

RUN_IN = radians(50)
"""rad/s at most for a follower that is brought over to where it is led."""

FOLLOWING_TOLERANCE = radians(5)
"""Within this angle of where it is led a follower has come over, and goes as fast as it may from then on."""

PAUSE = 0.25
"""Seconds without being led after which a follower is brought over anew: its leader may be anywhere by then.

An arm that is read less often leads slowly all the time.
"""


class Following:
    """The couplings in force at present; none to begin with. For one thread at a time.

    A follower is brought over slowly at first, and again after a pause, so that none leaps.
    """

    def __init__(self, couplings: Sequence[Coupling] = ()) -> None:
        self._couplings = {coupling.follower: coupling for coupling in couplings}
        self._led_at: dict[str, float] = {}
        self._come: set[str] = set()  # those that were brought over

    def __bool__(self) -> bool:
        return bool(self._couplings)

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Those in force."""
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

        ``positions`` are those of the leaders that are known just now: a follower stays out whose leader is missing.
        """
        found = {}
        for follower, coupling in self._couplings.items():
            position = positions.get(coupling.leader)
            if position is not None:
                found[follower] = coupling.scale * position + coupling.offset
        return found

    def speeds(self, goals: Mapping[str, float], positions: Mapping[str, float], now: float) -> dict[str, float]:
        """Return the speed (rad/s) of those followers that are brought over; the others go as fast as they may.

        ``goals`` are where all are led at time ``now`` (rad, within their limits), ``positions`` where joints are, as
        far as that is known just now.
        """
        for follower, goal in goals.items():
            if now - self._led_at.get(follower, -inf) > PAUSE:
                self._come.discard(follower)
            if abs(positions.get(follower, inf) - goal) <= FOLLOWING_TOLERANCE:
                self._come.add(follower)
            self._led_at[follower] = now
        return {follower: RUN_IN for follower in goals if follower not in self._come}

    def pause(self, followers: Collection[str] | None = None) -> None:
        """Take note that ``followers`` (None: all) did not follow: they are brought over anew."""
        for follower in self._couplings if followers is None else followers:
            self._led_at.pop(follower, None)
