"""The leaf that turns on the spot."""

import math

from py_trees.common import Status

from behaviours.driving.motion import Spin, Way, seconds_to_turn
from behaviours.leaf import argument
from drivers.api import Angle, BaseState, Pose2D


class Turn(Spin):
    """Turn on the spot: to the left for a positive angle, to the right for a negative one.

    Running until the angle is reached by the gyro and the base stands still, then succeeds.
    Fails at a cliff, where the only way is straight back, when a wheel drops, and while the base is stopped until
    somebody enables it. While somebody steers the base by hand it waits, then goes on to its angle.
    """

    word = "turn"
    stores = "how far it turned, by the gyro (rad)"
    keeps = Angle
    angle: float = argument("angle", "how far; positive is to the left", principal=True)
    speed: float = argument("turn rate", "how fast", default=math.radians(60), low=math.radians(1), high=math.pi)
    _direction = 1.0

    @property
    def way(self) -> Way:
        return Way.ROUND

    def initialise(self) -> None:
        super().initialise()
        self._direction = math.copysign(1.0, self.angle)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        return seconds_to_turn(start.heading + self.angle - state.pose.heading, self.speed, self.robot.base.limits)

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._start is not None:
            self._direction = math.copysign(1.0, self._start.heading + self.angle - state.pose.heading)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        turned = self.result = state.pose.heading - start.heading
        doing = f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.turn_to(start.heading + self.angle, self._direction, self.speed, state, doing)
