"""The leaf that drives along a part of a circle."""

import math

from py_trees.common import Status

from behaviours.driving.motion import CRAWL, TURN_CRAWL, Motion, seconds_to_drive, seconds_to_turn
from behaviours.leaf import argument
from drivers.api import Angle, BaseState, Pose2D, Velocity


class Arc(Motion):
    """Drive forwards along a part of a circle: to the left for a positive angle, to the right for a negative one.

    Running until the base has turned by the angle, by the gyro, and stands still, then succeeds.
    Fails when it bumps into something or comes to a cliff, when a wheel drops, and while the base is stopped until
    somebody enables it. While somebody steers the base by hand it waits, then goes on until it has turned so far.
    """

    word = "arc"
    stores = "how far round it went, by the gyro (rad)"
    keeps = Angle
    radius: float = argument("length", "of the circle", low=0.05, high=10.0)
    angle: float = argument("angle", "how far round; positive is to the left", default=math.tau)
    speed: float = argument("speed", "how fast along the circle", default=0.2, low=0.01, high=0.7)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        left, limits = self.angle - (state.pose.heading - start.heading), self.robot.base.limits
        driving = seconds_to_drive(left * self.radius, self.speed, limits)
        return max(driving, seconds_to_turn(left, self.speed / self.radius, limits))

    def go(self, state: BaseState, start: Pose2D) -> Status:
        direction = math.copysign(1.0, self.angle)
        turned = self.result = state.pose.heading - start.heading
        # Whichever of driving and turning needs more care on this circle says how fast it may go round.
        rate = self.approach(
            (self.angle - turned) * direction,
            braking=min(self.turn_braking, self.braking / self.radius),
            crawl=min(TURN_CRAWL, CRAWL / self.radius),
        )
        if rate == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        rate = min(rate, self.speed / self.radius)
        doing = f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.steer(Velocity(rate * self.radius, direction * rate), doing)
