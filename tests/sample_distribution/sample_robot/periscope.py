"""The periscope: two joints of the arm, led as the house leads a neck."""

from drivers.api import Joints
from drivers.api.driver import Site
from drivers.head.joints_head import JointAxis, NeckDriver
from sample_robot.declared import PeriscopeKeys


def make(keys: PeriscopeKeys, site: Site) -> NeckDriver:
    """Return the driver."""
    arm: Joints = site.parts["arm"]
    pan, tilt = axes(keys, arm)
    return NeckDriver(
        arm, site.clock, pan=pan, tilt=tilt, speed=keys.speed, acceleration=keys.acceleration, report=site.report
    )


def axes(keys: PeriscopeKeys, arm: Joints) -> tuple[JointAxis, JointAxis]:
    """Return its axes, which turn as far as their joints."""
    turned, tilted = (arm.limits[joint] for joint in (keys.turned_by, keys.tilted_by))
    return (
        JointAxis(keys.turned_by, turned.lower, turned.upper),
        JointAxis(keys.tilted_by, tilted.lower, tilted.upper),
    )
