"""The twin of a head of Dynamixel servos: the real driver's steps, over the twins of the servos."""

from drivers.api import HeadPose
from drivers.head.joints_head import JointsHead
from drivers.servos.twin import JointsTwin
from drivers.sim.plug import Plug


class NeckTwin(JointsHead[JointsTwin]):
    """A ``JointsHead`` over an arm's twin, with which it shares the plug. ``step`` is to be called every ``PERIOD``."""

    @property
    def plug(self) -> Plug:
        """The cable of the bus."""
        return self._joints.plug

    def fail(self, fault: str = "") -> None:
        """Give both joints a fault of ``drivers.servos.servo_twin.FAULTS``, or none."""
        for axis in self._built:
            self._joints.fail(axis.joint, fault)

    def true_pose(self, now: float) -> HeadPose:
        """Where the joints really are at time ``now``; what it is trimmed to later turns it in truth."""
        pan, tilt = (self._joints.true_angle(axis.joint, now) - axis.trim for axis in self._built)
        return HeadPose(pan, tilt)
