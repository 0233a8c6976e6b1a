"""Simulated arms and heads of robots with ROS 2, whose joints always have torque."""

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
"""Servo model that simulates any ROS 2 joint: it is fast enough, and turns all the way round."""


MAX_ANGLE = 3.14
"""Maximum angle of the simulated servo model in either direction, in radians."""


class StiffJoints(JointsTwin):
    """Simulated joints of ROS 2: a ``JointsTwin`` of ``joints`` whose torque is always on."""

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
        """Hold the named joints, and report that ROS 2 cannot switch their torque off."""
        names = list(self._joints) if joints is None else list(joints)
        self.hold(names)
        if names:
            self._report(DeviceStatus(self.name, "fault", f"{', '.join(names)} {NO_TORQUE_OFF}", NO_TORQUE_OFF_HINT))

    def _report_runaway(self, finding: str) -> None:
        """Report that a joint moves away from its goal, and latch the whole part."""
        finding = f"{finding}: {RUNAWAY_NOTICE}"
        self._report(DeviceStatus(self.name, "fault", finding, RUNAWAY_HINT))
        self._reconnect.latch(finding, replace=True)
        self.hold([name for name, joint in self._joints.items() if not joint.progress.runs_away])


class Ros2HeadTwin(NeckTwin):
    """Simulated head of ROS 2: a ``NeckTwin`` that opens, steps and closes its own joints."""

    def open(self) -> None:
        """Connect at once, unless the simulated plug is pulled."""
        self._joints.open()
        super().open()

    def close(self) -> None:
        """Hold, and disconnect."""
        super().close()
        self._joints.close()

    def step(self) -> None:
        """Step the joints and the head."""
        self._joints.step()
        super().step()


def arm(keys: Ros2ArmKeys, stage: SimContext) -> StiffJoints:
    """Return the simulated arm."""
    return StiffJoints(arm_joints(keys), stage.clock, away=keys.away, report=stage.report, name=stage.part_name)


def head(keys: Ros2HeadKeys, stage: SimContext) -> Ros2HeadTwin:
    """Return the simulated head."""
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
