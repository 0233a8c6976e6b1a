"""Driver of the periscope: two joints of the arm, moved as MissionTree moves a neck."""

from drivers.api import Joints
from drivers.api.driver import DriverContext
from drivers.head.joints_head import JointAxis, NeckDriver
from sample_robot.declared import PeriscopeKeys


def make(keys: PeriscopeKeys, context: DriverContext) -> NeckDriver:
    """Return the driver."""
    arm: Joints = context.needed_parts["arm"]
    pan, tilt = axes(keys, arm)
    return NeckDriver(
        arm, context.clock, pan=pan, tilt=tilt, speed=keys.speed, acceleration=keys.acceleration, report=context.report
    )


def axes(keys: PeriscopeKeys, arm: Joints) -> tuple[JointAxis, JointAxis]:
    """Return the axes, with the ranges of their joints."""
    turned, tilted = (arm.limits[joint] for joint in (keys.turned_by, keys.tilted_by))
    return (
        JointAxis(keys.turned_by, turned.lower, turned.upper),
        JointAxis(keys.tilted_by, tilted.lower, tilted.upper),
    )
