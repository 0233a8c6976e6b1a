"""Stand-in for Nav2: drives straight from waypoint to waypoint, and aborts without progress. No I/O."""

from collections import deque
from collections.abc import Sequence
from math import atan2, copysign, cos, hypot, remainder, tau

from drivers.api import Pose2D, Velocity

MAX_SPEED, MAX_TURN_RATE = 0.22, 1.0
"""m/s and rad/s."""

GOAL_DISTANCE, MAX_DRIVE_ANGLE, GOAL_ANGLE = 0.05, 0.3, 0.03
"""Metres and radians: distance to a reached waypoint, largest bearing for driving, error of a reached heading."""

PROGRESS_TIMEOUT = 5.0
"""Seconds without progress of the robot after which a navigation goal is aborted."""

MIN_PROGRESS = 0.02
"""Smallest decrease of the remaining distance (metres) or turn (radians) that counts as progress."""

SUCCEEDED, CANCELLED, ABORTED = 4, 5, 6
"""Goal results as numbered in action_msgs."""

NO_PROGRESS_ERROR = 105
"""Error code of Nav2's controller for a robot that makes no progress."""


class Navigator:
    """Drives through ``waypoints`` (x, y, heading) in the frame of the poses; ``result`` is None while it drives."""

    def __init__(self, waypoints: Sequence[tuple[float, float, float]]) -> None:
        self._waypoints = deque(waypoints)
        self._best, self._best_at = float("inf"), -1.0
        self.result: int | None = None if waypoints else SUCCEEDED

    @property
    def remaining(self) -> int:
        """Number of waypoints that are not reached yet."""
        return len(self._waypoints)

    def distance_to_next(self, pose: Pose2D) -> float:
        """Return the distance to the next waypoint, in metres."""
        return hypot(self._waypoints[0][0] - pose.x, self._waypoints[0][1] - pose.y) if self._waypoints else 0.0

    def next_velocity(self, now: float, pose: Pose2D) -> Velocity | None:
        """Return the velocity to drive at time ``now`` from ``pose``; None once the goal has ended."""
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
        """End the navigation with the result CANCELLED, unless the goal has ended."""
        if self.result is None:
            self.result = CANCELLED


def _turn_velocity(angle: float) -> Velocity:
    return Velocity(0.0, copysign(min(MAX_TURN_RATE, max(0.15, 1.5 * abs(angle))), angle))
