"""The leaf that keeps the base at a velocity."""

from py_trees.common import Status

from behaviours.driving.motion import Motion, Way
from behaviours.leaf import argument
from drivers.api import BaseState, Pose2D, Velocity


class Cruise(Motion):
    """Keep the base at a speed and a turn rate, until it is halted.

    Running all the time; it never succeeds. Fails when it bumps into something or comes to a cliff ahead, when a wheel
    drops, and while the base is stopped until somebody enables it. While somebody steers the base by hand it waits.
    """

    word = "velocity"
    ends = frozenset({"failure"})
    speed: float = argument("speed", "how fast; negative is backwards", default=0.0, low=-0.7, high=0.7)
    turn: float = argument("turn rate", "how fast to turn; positive is to the left", default=0.0, low=-3.5, high=3.5)

    @property
    def way(self) -> Way:
        if self.speed > 0.0:
            return Way.AHEAD
        return Way.BACK if self.turn == 0.0 else Way.ROUND

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        velocity = state.velocity
        doing = f"{velocity.linear:.2f} m/s, {velocity.angular:.2f} rad/s"
        return self.steer(Velocity(self.speed, self.turn), doing)
