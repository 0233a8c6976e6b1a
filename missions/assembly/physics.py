"""Physical body of a robot: from the links and servos of its file, or from the user's own model."""

from pathlib import Path

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.api import Pose2D
from drivers.errors import BadRequest
from drivers.legs.body import body_of
from drivers.legs.declared import LegsKeys
from drivers.legs.figure import figure_of
from drivers.servos.declared import DynamixelKeys
from drivers.servos.models import motor_physics
from drivers.sim.rigid.rigid_model import Floor, TrunkPush, make_mjcf
from drivers.sim.rigid.scene import PhysicsScene


def scene_of(config: RobotConfig, world: WorldConfig, start: Pose2D, seed: int) -> PhysicsScene:
    """Return the physics scene of a robot's body on the floor of a world, standing at ``start``.

    Raises BadRequest for a robot whose base has no legs.
    """
    legs, arm = config.keys(LegsKeys), config.keys(DynamixelKeys)
    if legs is None or arm is None:
        raise BadRequest(
            f"physics: the robot '{config.name}' has no body that could fall",
            hint="physics are for robots whose base has `driver: legs`, such as --robot humanoid",
        )
    motors = {name: motor_physics(joint.servo_model, joint.torque) for name, joint in arm.servos.items()}
    body = body_of(legs.body)
    model = model_file(legs, config) or make_mjcf(figure_of(body, motors, arm.ranges))
    backlashes = {name: motors[name].backlash for name in body.joints}
    return PhysicsScene(model, backlashes, floor_of(world), start=start, seed=seed)


def model_file(legs: LegsKeys, config: RobotConfig) -> Path | None:
    """Return the path of the MuJoCo model that a robot file names, or None if it names none.

    Raises BadRequest if the file does not exist.
    """
    if not legs.model:
        return None
    path = (Path() if config.path is None else config.path.parent) / legs.model
    if not path.is_file():
        raise BadRequest(f"base: 'model': {path}: no such file", hint="give a model of MuJoCo's, such as op3.xml")
    return path


def floor_of(world: WorldConfig) -> Floor:
    """Return the floor of a world: friction, slope, and the disturbances of the robot, such as pushes."""
    physics = world.physics
    return Floor(
        friction=physics.friction,
        slope=physics.slope,
        mass_error=physics.masses,
        servo_delay=physics.servo_delay,
        pushes=tuple(TrunkPush(each.at, each.speed, each.towards, each.over) for each in physics.pushes),
    )
