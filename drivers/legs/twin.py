"""The twin of a base that walks: the real driver's rules and engine on the twins of the joints, in one thread."""

from math import cos, sin

from drivers.api import Pose2D, Velocity
from drivers.legs.driver import LegsBase


class LegsTwin(LegsBase):
    """A ``LegsBase`` without a thread. In the world it is where its steps have led it from its ``start``."""

    start = Pose2D(0.0, 0.0, 0.0)

    def true_pose(self, now: float) -> Pose2D:
        """Where it is at time ``now``, in the world's frame."""
        del now
        pose, start = self._engine.pose[0], self.start
        c, s = cos(start.heading), sin(start.heading)
        x, y = start.x + c * pose.x - s * pose.y, start.y + s * pose.x + c * pose.y
        return Pose2D(x, y, start.heading + pose.heading)

    @property
    def true_velocity(self) -> Velocity:
        """How fast it really goes."""
        ahead, _, turn = self._engine.pose[1]
        return Velocity(ahead, turn)
