"""Simulated arm whose servos carry a robot in the physics engine, which computes the joint angles.

The rules of hold, relax, limits and reconnection are those of the driver.
"""

from collections.abc import Callable, Mapping
from typing import Literal

from drivers.api import JointState, ReconnectPolicy, StatusCallback, ignore
from drivers.clock import Clock
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS
from drivers.servos.twin import TEMPERATURE, VOLTAGE, JointsTwin, ServoTwin
from drivers.sim.rigid.scene import PhysicsScene
from drivers.sim.servo import Shaft

ARRIVAL_TOLERANCE = 0.02
"""Radians from its goal within which a loaded servo no longer counts as moving."""


class RigidShaft(Shaft):
    """Output shaft of a servo in the physics engine; load and torque limit can keep it from its goal."""

    def __init__(self, scene: PhysicsScene, name: str) -> None:
        super().__init__(scene.angle(name), 0.0, 0.0)
        self._scene, self._name = scene, name

    def advance(self, now: float) -> float:
        """Advance the physics to time ``now``; return the position."""
        self._scene.advance(now)
        self.position = self._scene.angle(self._name)
        return self.position


class RigidServo(ServoTwin):
    """A servo of a robot in the physics engine. It starts with torque on and the joint at 0."""

    def __init__(self, name: str, spec: JointSpec, scene: PhysicsScene) -> None:
        super().__init__(name, spec)
        self._scene, self._name = scene, name
        self._shaft = RigidShaft(scene, name)
        self._stall = MODELS[spec.model].stall_torque
        self.joint.torque, self.joint.goal = True, 0.0

    def move_to(self, goal: float, speed: float, now: float) -> None:
        super().move_to(goal, speed, now)
        self._scene.set_goal(self._name, self._shaft.goal, self._shaft.speed)

    def relax(self, now: float) -> None:
        """Switch the torque off, so that gravity and other forces turn the joint."""
        super().relax(now)
        self._scene.switch_torque_off(self._name)

    def stop_at_setpoint(self, now: float) -> None:
        super().stop_at_setpoint(now)
        if self.joint.torque:
            self._scene.set_goal(self._name, self._shaft.goal, self._shaft.speed)

    def replace_servo(self, angle: float, now: float) -> None:
        super().replace_servo(angle, now)
        self._scene.turn_limp_joint(self._name, self._shaft.position)

    def turn_by_hand(self, angle: float, now: float) -> None:
        super().turn_by_hand(angle, now)
        if not self.joint.torque:
            self._scene.turn_limp_joint(self._name, self._shaft.position)

    def state(self, now: float) -> JointState:
        position, joint, scene = self.position(now), self.joint, self._scene
        return JointState(
            position=position,
            velocity=scene.rate(self._name),
            goal=joint.goal,
            load=min(max(scene.torque(self._name) / self._stall, -1.0), 1.0),
            voltage=VOLTAGE,
            temperature=TEMPERATURE,
            moving=joint.goal is not None and abs(joint.goal - position) > ARRIVAL_TOLERANCE,
            torque=joint.torque,
        )


class RigidJoints(JointsTwin):
    """A ``drivers.api.Joints`` whose servos carry the body of a ``scene``; see ``JointsTwin``."""

    STEP_INTERVAL = 0.01
    """Seconds between two steps of the arm, equal to the control interval of the walking engine."""

    def __init__(
        self,
        joints: Mapping[str, JointSpec],
        clock: Clock,
        scene: PhysicsScene,
        *,
        at_rest: Literal["hold", "relax"] = "hold",
        away: ReconnectPolicy | None = None,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
        name: str = "arm",
    ) -> None:
        self.scene = scene
        super().__init__(joints, clock, at_rest=at_rest, away=away, report=report, changed=changed, name=name)

    def _make_servo(self, name: str, spec: JointSpec) -> ServoTwin:
        return RigidServo(name, spec, self.scene)

    def step(self) -> None:
        """Advance the physics, update the followers, and signal new readings."""
        self.scene.advance(self._clock.now())
        super().step()
