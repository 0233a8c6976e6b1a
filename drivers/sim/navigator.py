"""A stand-in for Nav2: drives straight from place to place, and gives up where it makes no headway. Pure."""

from collections import deque
from collections.abc import Sequence
from math import atan2, copysign, cos, hypot, remainder, tau

from drivers.api import Pose2D, Velocity

SPEED, TURN = 0.22, 1.0
"""m/s and rad/s that it drives at."""

NEAR, ASIDE, FACING = 0.05, 0.3, 0.03
"""Metres and radians: near enough to a place; too far aside to drive on; near enough to its heading."""

PATIENCE = 5.0
"""Seconds without headway after which it gives up."""

HEADWAY = 0.02
"""Metres, or radians, nearer that count as headway."""

SUCCEEDED, CANCELLED, ABORTED = 4, 5, 6
"""How a goal ends, as action_msgs numbers that."""

NO_PROGRESS = 105
"""The error code of Nav2's controller for a robot that makes none."""


class Navigator:
    """Drives through ``places``, in the frame of the poses that it is told. ``ended`` is how; None while it drives."""

    def __init__(self, places: Sequence[tuple[float, float, float]]) -> None:
        self._places = deque(places)
        self._best, self._best_at = float("inf"), -1.0
        self.ended: int | None = None if places else SUCCEEDED

    @property
    def left(self) -> int:
        """How many places are still to come."""
        return len(self._places)

    def distance(self, pose: Pose2D) -> float:
        """Return how far it is to the next place, in metres."""
        return hypot(self._places[0][0] - pose.x, self._places[0][1] - pose.y) if self._places else 0.0

    def velocity(self, now: float, pose: Pose2D) -> Velocity | None:
        """Return how to drive at time ``now`` from where the robot is; None once it has ended."""
        if self.ended is not None:
            return None
        x, y, heading = self._places[0]
        away = hypot(x - pose.x, y - pose.y)
        aside = remainder(atan2(y - pose.y, x - pose.x) - pose.heading, tau)
        last = len(self._places) == 1
        if away > NEAR:
            given = _turn(aside) if abs(aside) > ASIDE else Velocity(min(SPEED, away) * cos(aside), 1.5 * aside)
            todo = away + abs(aside)
        else:
            off = remainder(heading - pose.heading, tau) if last else 0.0
            if abs(off) <= FACING:
                self._places.popleft()
                self._best = float("inf")
                if not self._places:
                    self.ended = SUCCEEDED
                    return None
                return self.velocity(now, pose)
            given, todo = _turn(off), abs(off)
        if todo < self._best - HEADWAY:
            self._best, self._best_at = todo, now
        elif now - self._best_at > PATIENCE:
            self.ended = ABORTED
            return None
        return given

    def cancel(self) -> None:
        """End as it is asked to."""
        if self.ended is None:
            self.ended = CANCELLED


def _turn(angle: float) -> Velocity:
    return Velocity(0.0, copysign(min(TURN, max(0.15, 1.5 * abs(angle))), angle))
