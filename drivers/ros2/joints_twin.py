"""The twins of arms and heads of robots of ROS 2: joints that are always stiff, in simulated time."""

from collections.abc import Collection, Mapping

from drivers.api import DeviceStatus, ReconnectPolicy, StatusCallback, ignore
from drivers.clock import Clock
from drivers.ros2.declared import Ros2ArmKeys, Ros2HeadKeys
from drivers.ros2.joint_topics import NO_TORQUE_OFF, NO_TORQUE_OFF_HINT, RUNAWAY_HINT, RUNAWAY_NOTICE, TopicJoint
from drivers.ros2.make import arm_joints, head_joints, joint_axis
from drivers.servos.joint import JointSpec
from drivers.servos.twin import JointsTwin, NeckTwin
from drivers.sim.context import SimContext

STAND_IN_MODEL = "XL330-M077"
"""A servo that is quicker than any joint, and turns all the way round, to stand for whatever motor there is."""


MAX_ANGLE = 3.14
"""Radians that it turns either way."""


class StiffJoints(JointsTwin):
    """A ``JointsTwin`` of ``joints`` that hold their position from the beginning, and cannot be made limp."""

    def __init__(
        self,
        joints: Mapping[str, TopicJoint],
        clock: Clock,
        *,
        away: ReconnectPolicy | None = None,
        report: StatusCallback = ignore,
        name: str = "arm",
    ) -> None:
        specs = {
            name: JointSpec(
                number,
                STAND_IN_MODEL,
                lower=max(its.lower, -MAX_ANGLE),
                upper=min(its.upper, MAX_ANGLE),
                speed=its.speed,
            )
            for number, (name, its) in enumerate(((name, each.limits) for name, each in joints.items()), 1)
        }
        super().__init__(specs, clock, away=away, report=report, name=name)
        for servo in self._servos.values():
            servo.joint.torque_request = True

    always_stiff = True

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Let the named joints stand where they are, and tell that ROS 2 cannot make them limp."""
        names = list(self._joints) if joints is None else list(joints)
        self.hold(names)
        if names:
            self._report(DeviceStatus(self.name, "fault", f"{', '.join(names)} {NO_TORQUE_OFF}", NO_TORQUE_OFF_HINT))

    def _report_runaway(self, finding: str) -> None:
        """Report it, and stop the whole arm until somebody enables it."""
        finding = f"{finding}: {RUNAWAY_NOTICE}"
        self._report(DeviceStatus(self.name, "fault", finding, RUNAWAY_HINT))
        self._reconnect.latch(finding, replace=True)
        self.hold([name for name, joint in self._joints.items() if not joint.progress.runs_away])


class Ros2HeadTwin(NeckTwin):
    """A ``NeckTwin`` that opens and closes the joints that it is made of."""

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        self._joints.open()
        super().open()

    def close(self) -> None:
        """Hold at once, and go."""
        super().close()
        self._joints.close()

    def step(self) -> None:
        """Move on, joints and head."""
        self._joints.step()
        super().step()


def arm(keys: Ros2ArmKeys, stage: SimContext) -> StiffJoints:
    """Return the twin of an arm."""
    return StiffJoints(arm_joints(keys), stage.clock, away=keys.away, report=stage.report, name=stage.part_name)


def head(keys: Ros2HeadKeys, stage: SimContext) -> Ros2HeadTwin:
    """Return the twin of a head."""
    joints = StiffJoints(head_joints(keys), stage.clock, away=keys.away)
    return Ros2HeadTwin(
        joints,
        stage.clock,
        pan=joint_axis(keys.pan),
        tilt=joint_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        report=stage.report,
        name=stage.part_name,
    )
