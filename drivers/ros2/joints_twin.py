"""The twins of arms and heads of robots of ROS 2: joints that are always stiff, in simulated time."""

from collections.abc import Collection, Mapping

from drivers.api import Away, DeviceStatus, Report, ignore
from drivers.clock import Clock
from drivers.ros2.declared import Ros2ArmKeys, Ros2HeadKeys
from drivers.ros2.make import axis, joints_of_arm, joints_of_head
from drivers.ros2.ways import LIMP, RUNAWAY, RUNAWAY_HINT, STIFF, TopicJoint
from drivers.servos.joint import JointSpec
from drivers.servos.twin import JointsTwin, NeckTwin
from drivers.sim.stage import Stage

MOTOR = "XL330-M077"
"""A servo that is quicker than any joint, and turns all the way round, to stand for whatever motor there is."""


REACH = 3.14
"""Radians that it turns either way."""


class StiffJoints(JointsTwin):
    """A ``JointsTwin`` of ``joints`` that hold their position from the beginning, and cannot be made limp."""

    def __init__(
        self,
        joints: Mapping[str, TopicJoint],
        clock: Clock,
        *,
        away: Away | None = None,
        report: Report = ignore,
        name: str = "arm",
    ) -> None:
        specs = {
            name: JointSpec(number, MOTOR, lower=max(its.lower, -REACH), upper=min(its.upper, REACH), speed=its.speed)
            for number, (name, its) in enumerate(((name, each.limits) for name, each in joints.items()), 1)
        }
        super().__init__(specs, clock, away=away, report=report, name=name)
        for servo in self._servos.values():
            servo.joint.wanted = True

    always_stiff = True

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Let the named joints stand where they are, and tell that ROS 2 cannot make them limp."""
        names = list(self._joints) if joints is None else list(joints)
        self.hold(names)
        if names:
            self._report(DeviceStatus(self.name, "fault", f"{', '.join(names)} {STIFF}", LIMP))

    def _tell_runaway(self, said: str) -> None:
        """Report it, and stop the whole arm until somebody enables it."""
        said = f"{said}: {RUNAWAY}"
        self._report(DeviceStatus(self.name, "fault", said, RUNAWAY_HINT))
        self._absence.latch(said, graver=True)
        self.hold([name for name, joint in self._joints.items() if not joint.progress.runs_away])


class HeadTwin(NeckTwin):
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


def arm(keys: Ros2ArmKeys, stage: Stage) -> StiffJoints:
    """Return the twin of an arm."""
    return StiffJoints(joints_of_arm(keys), stage.clock, away=keys.away, report=stage.report, name=stage.part)


def head(keys: Ros2HeadKeys, stage: Stage) -> HeadTwin:
    """Return the twin of a head."""
    joints = StiffJoints(joints_of_head(keys), stage.clock, away=keys.away)
    return HeadTwin(
        joints,
        stage.clock,
        pan=axis(keys.pan),
        tilt=axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        report=stage.report,
        name=stage.part,
    )
