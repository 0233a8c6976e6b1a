"""The leaf that drives straight ahead or back."""

import math

from py_trees.common import Status

from behaviours.driving.motion import CRAWL, Motion, Way
from behaviours.driving.time_limit import seconds_to_drive
from behaviours.leaf import argument
from drivers.api import BaseState, Length, Pose2D, Velocity

STEERING = 2.0
"""rad/s for each radian off the line: a degree is turned back within about a second."""

MOST_STEERING = 0.5
"""rad/s at most."""


class Drive(Motion):
    """Drive straight ahead, or back for a negative distance.

    Running until the distance is covered by odometry and the base stands still, then succeeds.
    Fails when it bumps into something or comes to a cliff, when a wheel drops, once the range guard has seen something
    in its way for 5 s, and while the base is stopped until somebody enables it. While somebody steers the base by hand
    it waits, then goes on along its line.
    """

    word = "drive"
    stores = "how far it went, by odometry (m; negative backwards)"
    keeps = Length
    distance: float = argument("length", "how far; negative is backwards", principal=True)
    speed: float = argument("speed", "how fast", default=0.2, low=0.01, high=0.7)
    _direction = 1.0

    @property
    def way(self) -> Way:
        return Way.AHEAD if self._direction > 0 else Way.BACK

    def initialise(self) -> None:
        super().initialise()
        self._direction = math.copysign(1.0, self.distance)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        return seconds_to_drive(self.distance - along(start, state.pose), self.speed, self.robot.base.limits)

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._start is not None:
            self._direction = math.copysign(1.0, self.distance - along(self._start, state.pose))

    def go(self, state: BaseState, start: Pose2D) -> Status:
        gone = self.result = along(start, state.pose)
        speed = self.approach((self.distance - gone) * self._direction, braking=self.braking, crawl=CRAWL)
        if speed == 0.0:
            return self.come_to_rest(state.velocity.linear)
        steer = STEERING * (start.heading - state.pose.heading)
        turn = max(-MOST_STEERING, min(MOST_STEERING, steer))
        return self.steer(
            Velocity(self._direction * min(speed, self.speed), turn), f"{gone:.2f} of {self.distance:.2f} m"
        )


def along(start: Pose2D, now: Pose2D) -> float:
    """Return how far ``now`` lies ahead of ``start`` along its heading, in metres."""
    return (now.x - start.x) * math.cos(start.heading) + (now.y - start.y) * math.sin(start.heading)
