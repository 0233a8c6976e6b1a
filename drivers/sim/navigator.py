"""A stand-in for Nav2: drives straight from place to place, and gives up where it makes no headway. Pure."""

from collections import deque
from collections.abc import Sequence
from math import atan2, copysign, cos, hypot, remainder, tau

from drivers.api import Pose2D, Velocity

MAX_SPEED, MAX_TURN_RATE = 0.22, 1.0
"""m/s and rad/s that it drives at."""

GOAL_DISTANCE, MAX_DRIVE_ANGLE, GOAL_ANGLE = 0.05, 0.3, 0.03
"""Metres and radians: near enough to a place; too far aside to drive on; near enough to its heading."""

PROGRESS_TIMEOUT = 5.0
"""Seconds without headway after which it gives up."""

MIN_PROGRESS = 0.02
"""Metres, or radians, nearer that count as headway."""

SUCCEEDED, CANCELLED, ABORTED = 4, 5, 6
"""How a goal ends, as action_msgs numbers that."""

NO_PROGRESS_ERROR = 105
"""The error code of Nav2's controller for a robot that makes none."""


class Navigator:
    """Drives through ``places``, in the frame of the poses that it is told. ``result`` is how; None while it drives."""

    def __init__(self, waypoints: Sequence[tuple[float, float, float]]) -> None:
        self._waypoints = deque(waypoints)
        self._best, self._best_at = float("inf"), -1.0
        self.result: int | None = None if waypoints else SUCCEEDED

    @property
    def remaining(self) -> int:
        """How many places are still to come."""
        return len(self._waypoints)

    def distance_to_next(self, pose: Pose2D) -> float:
        """Return how far it is to the next place, in metres."""
        return hypot(self._waypoints[0][0] - pose.x, self._waypoints[0][1] - pose.y) if self._waypoints else 0.0

    def next_velocity(self, now: float, pose: Pose2D) -> Velocity | None:
        """Return how to drive at time ``now`` from where the robot is; None once it has ended."""
        if self.result is not None:
            return None
        x, y, heading = self._waypoints[0]
        away = hypot(x - pose.x, y - pose.y)
        aside = remainder(atan2(y - pose.y, x - pose.x) - pose.heading, tau)
        last = len(self._waypoints) == 1
        if away > GOAL_DISTANCE:
            given = (
                _turn_velocity(aside)
                if abs(aside) > MAX_DRIVE_ANGLE
                else Velocity(min(MAX_SPEED, away) * cos(aside), 1.5 * aside)
            )
            todo = away + abs(aside)
        else:
            off = remainder(heading - pose.heading, tau) if last else 0.0
            if abs(off) <= GOAL_ANGLE:
                self._waypoints.popleft()
                self._best = float("inf")
                if not self._waypoints:
                    self.result = SUCCEEDED
                    return None
                return self.next_velocity(now, pose)
            given, todo = _turn_velocity(off), abs(off)
        if todo < self._best - MIN_PROGRESS:
            self._best, self._best_at = todo, now
        elif now - self._best_at > PROGRESS_TIMEOUT:
            self.result = ABORTED
            return None
        return given

    def cancel(self) -> None:
        """End as it is asked to."""
        if self.result is None:
            self.result = CANCELLED


def _turn_velocity(angle: float) -> Velocity:
    return Velocity(0.0, copysign(min(MAX_TURN_RATE, max(0.15, 1.5 * abs(angle))), angle))
