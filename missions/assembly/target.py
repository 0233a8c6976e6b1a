"""The robot that a mission is checked for: what it is called, what it has, and how far its joints go."""

from behaviours.reach import Reach
from config.robot import RobotConfig
from drivers.api import JointLimits
from missions.language.claims import Target


def target_of(robot: RobotConfig) -> Target:
    """Return what the checker must know of a robot."""
    if robot.arm is None:
        return Target(robot.name, robot.parts)
    joints = {name: JointLimits(each.lower, each.upper, each.speed) for name, each in robot.arm.joints.items()}
    return Target(robot.name, robot.parts, Reach(joints, robot.arm.groups))
