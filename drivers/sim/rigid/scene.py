"""Robot in MuJoCo, which computes contact forces: servos that move to goals, and a trunk that moves by their forces."""

from collections.abc import Mapping
from math import asin, atan2, cos, sin, sqrt
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from drivers.api import Pose2D
from drivers.errors import BadRequest
from drivers.sim.rigid.rigid_model import Floor

TIME_STEP = 0.002
"""Seconds of one physics step."""

GRAVITY = 9.81

FALLEN_COSINE = 0.5
"""Cosine of the lean from which on a robot has fallen."""

FLOOR_MATERIAL = "tiles of the floor"
"""Name of the floor's tiled material, which makes motion visible in films; unlikely in a user's model."""

START_CLEARANCE = 0.0005
"""Metres above the floor at which a robot is placed."""


def import_mujoco() -> Any:
    """Return the module ``mujoco``. Raises BadRequest if it is not installed."""
    try:
        import mujoco as found  # noqa: PLC0415 - 60 MB, for those who ask for physics
    except ImportError as error:
        raise BadRequest(
            f"physics needs MuJoCo, which is not installed ({error})", hint="pip install 'missiontree[physics]'"
        ) from error
    return found


class PhysicsScene:
    """Robot on a floor, simulated by MuJoCo. For one thread.

    ``model`` is MJCF text, or the path of a user's file. All times are those of the simulated clock. Physics advances
    in steps of ``TIME_STEP`` at fixed times, so the result does not depend on how often ``advance`` is called. The
    robot starts at the pose ``start`` with all joints at 0 and torque on. ``backlashes`` are the backlashes of the
    servos (rad) by joint name; the model must have each of these joints, with a position actuator. ``energy`` (J) is
    the work of the motors so far. Raises BadRequest without MuJoCo, and for an invalid model or a missing joint.
    """

    def __init__(
        self,
        model: str | Path,
        backlashes: Mapping[str, float],
        floor: Floor,
        *,
        start: Pose2D | None = None,
        seed: int = 0,
    ) -> None:
        self.engine = import_mujoco()
        self.model = _compile_model(self.engine, model)
        self.data = self.engine.MjData(self.model)
        self.energy = 0.0
        self._steps = 0
        self._floor = floor
        self._joint_index = {name: place for place, name in enumerate(backlashes)}
        self._half_backlash = np.array([*backlashes.values()]) / 2
        self._find_joints(model)
        self._apply_disturbances(seed)
        self._angle, self._rate = self.data.qpos[self._position_index], self.data.qvel[self._velocity_index]
        self._setpoint = np.zeros(len(backlashes))
        self._goal = np.zeros(len(backlashes))
        self._speed = np.zeros(len(backlashes))
        self._delayed_setpoints = [self._setpoint.copy() for _ in range(round(floor.servo_delay / TIME_STEP) + 1)]
        self._place_robot(start or Pose2D(0.0, 0.0, 0.0))

    # --- servos -------------------------------------------------------------------------------------------------------

    def set_goal(self, joint: str, goal: float, speed: float) -> None:
        """Move a servo to ``goal`` (rad) at ``speed`` (rad/s), and switch its torque on."""
        place = self._joint_index[joint]
        if not self.has_torque(joint):
            self._setpoint[place] = self.angle(joint)
            for sent in self._delayed_setpoints:
                sent[place] = self._setpoint[place]
            self._set_torque(place, 1.0)
        self._goal[place], self._speed[place] = goal, speed

    def turn_limp_joint(self, joint: str, angle: float) -> None:
        """Turn a joint without torque to ``angle`` (rad) by hand."""
        self.data.qpos[self._position_index[self._joint_index[joint]]] = angle

    def switch_torque_off(self, joint: str) -> None:
        """Switch the torque of a servo off, so that external forces turn its joint."""
        self._set_torque(self._joint_index[joint], 0.0)

    def has_torque(self, joint: str) -> bool:
        """Return whether the torque of a servo is on."""
        return bool(self.model.actuator_gainprm[self._servo[self._joint_index[joint]], 0])

    def angle(self, joint: str) -> float:
        """Return the angle of a joint in radians."""
        return float(self.data.qpos[self._position_index[self._joint_index[joint]]])

    def rate(self, joint: str) -> float:
        """Return the angular velocity of a joint in rad/s."""
        return float(self.data.qvel[self._velocity_index[self._joint_index[joint]]])

    def load(self, joint: str) -> float:
        """Return the torque of a servo as a share -1..1 of its maximum."""
        return self.torque(joint) / float(self._max_torque[self._joint_index[joint]])

    def torque(self, joint: str) -> float:
        """Return the torque of a servo in Nm."""
        return float(self.data.actuator_force[self._servo[self._joint_index[joint]]])

    # --- the body -----------------------------------------------------------------------------------------------------

    def pose(self) -> Pose2D:
        """Return position and heading of the trunk on the floor."""
        x, y, _ = self.data.xpos[self._trunk]
        turn = self.data.xmat[self._trunk]
        return Pose2D(float(x), float(y), atan2(turn[3], turn[0]))

    def lean(self) -> tuple[float, float]:
        """Return roll and pitch of the trunk in radians; positive if the robot leans to its right, and ahead."""
        turn = self.data.xmat[self._trunk]
        return atan2(turn[7], turn[8]), -asin(min(max(turn[6], -1.0), 1.0))

    def gyro_rates(self) -> tuple[float, float, float]:
        """Return the angular velocity of the trunk about its own axes in rad/s, as a gyro measures it."""
        x, y, z = self.data.qvel[self._free + 3 : self._free + 6]
        return float(x), float(y), float(z)

    def proper_acceleration(self) -> tuple[float, float, float]:
        """Return the acceleration of the trunk along its own axes, gravity included, in m/s2."""
        felt = self.data.qacc[self._free : self._free + 3] - self.model.opt.gravity
        x, y, z = self.data.xmat[self._trunk].reshape(3, 3).T @ felt
        return float(x), float(y), float(z)

    @property
    def has_fallen(self) -> bool:
        """True if the robot lies, or leans too far to recover."""
        return bool(self.data.xmat[self._trunk][8] < FALLEN_COSINE)

    def advance(self, now: float) -> None:
        """Advance physics to ``now`` (s), in whole steps; earlier times do nothing."""
        last = int(now / TIME_STEP + 1e-6)
        while self._steps < last:
            self._step()

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _step(self) -> None:
        data, reach = self.data, self._speed * TIME_STEP
        way = np.minimum(np.maximum(self._goal - self._setpoint, -reach), reach)
        self._setpoint = self._setpoint + way
        self._delayed_setpoints.append(self._setpoint)
        goal, angle, dead = self._delayed_setpoints.pop(0), data.qpos[self._position_index], self._half_backlash
        # Within the backlash nothing turns the joint.
        data.ctrl[self._servo] = np.minimum(np.maximum(angle, goal - dead), goal + dead)
        now = self._steps * TIME_STEP
        if self._floor.pushes:
            data.xfrc_applied[self._trunk, :2] = self._push_force(now)
        self.engine.mj_step(self.model, data)
        self.energy += float(np.maximum(data.actuator_force * data.actuator_velocity, 0.0).sum()) * TIME_STEP
        self._steps += 1

    def _push_force(self, now: float) -> tuple[float, float]:
        """Return the total force (N) of the pushes at time ``now``, in x and y of the world frame."""
        x = y = 0.0
        for push in self._floor.pushes:
            if push.at <= now < push.at + push.duration:
                force = self._mass * push.speed / push.duration
                x, y = x + force * cos(push.direction), y + force * sin(push.direction)
        return x, y

    def _set_torque(self, place: int, torque: float) -> None:
        """Switch a servo's torque on (1) or off (0)."""
        servo, stiffness = self._servo[place], self._stiffness[place]
        self.model.actuator_gainprm[servo, 0] = torque * stiffness
        self.model.actuator_biasprm[servo, 1] = -torque * stiffness

    def _find_joints(self, model: str | Path) -> None:
        """Find the indices of trunk, joints and actuators in the model."""
        mine, types = self.model, self.engine.mjtJoint
        free = [joint for joint in range(mine.njnt) if mine.jnt_type[joint] == types.mjJNT_FREE]
        if not free:
            raise BadRequest(f"{_model_name(model)}: no body has a freejoint: this robot could not fall")
        self._trunk, self._free = int(mine.jnt_bodyid[free[0]]), int(mine.jnt_dofadr[free[0]])
        joints = {mine.joint(joint).name: joint for joint in range(mine.njnt)}
        # Of the actuators those that are at a joint, which is kind 0.
        at_joints = [servo for servo in range(mine.nu) if not mine.actuator_trntype[servo]]
        servos = {int(mine.actuator_trnid[servo, 0]): servo for servo in at_joints}
        if lacking := [name for name in self._joint_index if name not in joints]:
            known = ", ".join(filter(None, joints))
            raise BadRequest(f"{_model_name(model)} has no joint '{lacking[0]}'", hint=f"it has {known}")
        found = [joints[name] for name in self._joint_index]
        for name, joint in zip(self._joint_index, found, strict=True):
            servo = servos.get(joint)
            if servo is None or not mine.actuator_gainprm[servo, 0] == -mine.actuator_biasprm[servo, 1] != 0:
                hint = f'<position joint="{name}" kp="20" forcerange="-4 4"/> under <actuator>'
                raise BadRequest(f"{_model_name(model)}: joint '{name}' has no position actuator", hint=hint)
        self._position_index, self._velocity_index = mine.jnt_qposadr[found], mine.jnt_dofadr[found]
        self._servo = np.array([servos[joint] for joint in found], dtype=int)
        self._stiffness = mine.actuator_gainprm[self._servo, 0].copy()
        most = mine.actuator_forcerange[self._servo, 1]
        self._max_torque = np.where(most > 0, most, self._stiffness)

    def _apply_disturbances(self, seed: int) -> None:
        """Set friction, slope, and the mass errors, which are drawn with ``seed``."""
        mine, floor = self.model, self._floor
        chance = Random(f"masses {seed}")  # noqa: S311 - no secret
        for body in range(1, mine.nbody):
            share = 1 + floor.mass_error * (2 * chance.random() - 1)
            mine.body_mass[body] *= share
            mine.body_inertia[body] *= share
        mine.geom_friction[:, 0] = floor.friction
        ahead, left = floor.slope  # the floor stays level, and gravity leans, which is the same
        down = sqrt(max(1 - sin(ahead) ** 2 - sin(left) ** 2, 0.0))
        mine.opt.gravity[:] = -GRAVITY * sin(ahead), -GRAVITY * sin(left), -GRAVITY * down
        self.engine.mj_setConst(mine, self.data)
        self._mass = float(mine.body_subtreemass[self._trunk])

    def _place_robot(self, start: Pose2D) -> None:
        """Place the robot on the floor, with its joints at 0."""
        mine, data, engine = self.model, self.data, self.engine
        at = int(mine.jnt_qposadr[mine.body_jntadr[self._trunk]])
        data.qpos[at : at + 7] = start.x, start.y, 1.0, cos(start.heading / 2), 0.0, 0.0, sin(start.heading / 2)
        engine.mj_kinematics(mine, data)
        floor = mine.geom("floor").id
        solid = [each for each in range(mine.ngeom) if each != floor and mine.geom_conaffinity[each]]
        lowest = min((engine.mj_geomDistance(mine, data, floor, each, 10.0, None) for each in solid), default=0.0)
        data.qpos[at + 2] -= lowest - START_CLEARANCE
        engine.mj_forward(mine, data)


def _compile_model(engine: Any, model: str | Path) -> Any:
    """Return a compiled model with a floor, our time step and our solver options."""
    try:
        own = isinstance(model, Path)
        spec = engine.MjSpec.from_file(str(model)) if own else engine.MjSpec.from_string(model)
        for geom in spec.geoms:
            if geom.type == engine.mjtGeom.mjGEOM_PLANE:
                geom.name = "floor"
                break
        else:
            plane = engine.mjtGeom.mjGEOM_PLANE
            tiles = {"rgb1": [0.8, 0.8, 0.8], "rgb2": [0.7, 0.7, 0.7], "width": 64, "height": 64}
            two, checker = engine.mjtTexture.mjTEXTURE_2D, engine.mjtBuiltin.mjBUILTIN_CHECKER
            spec.add_texture(name=FLOOR_MATERIAL, type=two, builtin=checker, **tiles)
            material = spec.add_material(name=FLOOR_MATERIAL, texrepeat=[2, 2], texuniform=True)
            material.textures[engine.mjtTextureRole.mjTEXROLE_RGB] = FLOOR_MATERIAL
            spec.worldbody.add_geom(
                name="floor", type=plane, size=[50, 50, 1], material=FLOOR_MATERIAL, rgba=[1, 1, 1, 1]
            )
        spec.worldbody.add_light(pos=[0, 0, 4])
        spec.option.timestep = TIME_STEP
        spec.option.integrator = engine.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone, spec.option.impratio = engine.mjtCone.mjCONE_ELLIPTIC, 10
        spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.4] * 3, [0.5] * 3
        spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
        return spec.compile()
    except ValueError as error:
        raise BadRequest(f"{_model_name(model)} is not a valid MuJoCo model: {error}") from error


def _model_name(model: str | Path) -> str:
    return str(model) if isinstance(model, Path) else "the robot's model"
