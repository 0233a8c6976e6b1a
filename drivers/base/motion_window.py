"""Commanded and measured motion over a sliding window of time, as an interval for what the commands can have caused.

A base obeys late: after a dead time, along its own ramp, and its odometry comes late, too. So the true velocity is
taken to lie between the lowest and the highest velocity that was sent within the last moments (``lag``).
"""

from collections import deque
from math import cos, inf, remainder, sin, tau

from drivers.api import STILL, Pose2D, Velocity
from drivers.api.quick import dataclass


@dataclass(frozen=True, slots=True)
class MotionSums:
    """Sums since the beginning, at time ``at``: metres and radians.

    ``low`` and ``high`` bound what the commands can have caused, ``moved`` is what was measured.
    """

    at: float
    low: Velocity = STILL
    high: Velocity = STILL
    moved: Velocity = STILL

    def since(self, before: "MotionSums") -> "MotionSums":
        """Return the motion since ``before``; ``at`` is the time that it took."""
        return MotionSums(
            self.at - before.at,
            _minus(self.low, before.low),
            _minus(self.high, before.high),
            _minus(self.moved, before.moved),
        )


class SentVelocities:
    """The velocities sent within the last ``lag`` seconds."""

    def __init__(self, lag: float) -> None:
        self.lag = lag
        self._sent: deque[tuple[float, Velocity]] = deque([(-inf, STILL)])

    @property
    def standing(self) -> bool:
        """Whether nothing but standing still was sent within the lag."""
        return len(self._sent) == 1 and self._sent[0][1] == STILL

    def add(self, now: float, velocity: Velocity) -> None:
        """Note that ``velocity`` is sent from ``now`` on."""
        if self._sent[-1][1] != velocity:
            self._sent.append((now, velocity))

    def bounds(self, now: float) -> tuple[Velocity, Velocity]:
        """Return the lowest and the highest velocity in force within the lag before ``now``."""
        sent = self._sent
        while len(sent) > 1 and sent[1][0] <= now - self.lag:
            sent.popleft()
        if len(sent) < 2:
            return sent[0][1], sent[0][1]
        linear, angular = [each.linear for _, each in sent], [each.angular for _, each in sent]
        return Velocity(min(linear), min(angular)), Velocity(max(linear), max(angular))


class MotionWindow:
    """The sums of the last ``length`` seconds, one kept every ``spacing`` seconds."""

    def __init__(self, length: float, spacing: float) -> None:
        self._length, self._spacing = length, spacing
        self._kept: deque[MotionSums] = deque()

    def restart(self) -> None:
        """Forget all sums."""
        self._kept.clear()

    def add(self, sums: MotionSums) -> MotionSums:
        """Take the newest sums; return the motion within the window, or since the restart."""
        kept = self._kept
        if not kept or sums.at - kept[-1].at >= self._spacing:
            kept.append(sums)
        while len(kept) > 1 and kept[1].at <= sums.at - self._length:
            kept.popleft()
        return sums.since(kept[0])


def moved(before: Pose2D, after: Pose2D) -> Velocity:
    """Return the motion between two poses: metres along the mean heading, and radians."""
    turn = after.heading - before.heading
    along = before.heading + remainder(turn, tau) / 2
    way = (after.x - before.x) * cos(along) + (after.y - before.y) * sin(along)
    return Velocity(way, turn)


def plus(one: Velocity, other: Velocity, times: float = 1.0) -> Velocity:
    """Return the sum of two velocities or motions, the second one multiplied."""
    return Velocity(one.linear + times * other.linear, one.angular + times * other.angular)


def _minus(one: Velocity, other: Velocity) -> Velocity:
    return Velocity(one.linear - other.linear, one.angular - other.angular)
