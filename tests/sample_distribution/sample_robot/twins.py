"""Simulated devices for simulated time."""

from drivers.base.twin import BaseTwin, make
from drivers.servos.twin import NeckTwin
from drivers.sim.context import SimContext
from sample_robot.declared import PeriscopeKeys, RoverKeys
from sample_robot.periscope import axes


def rover(keys: RoverKeys, context: SimContext) -> BaseTwin:
    """Return the twin of the rover: that of any base on two wheels."""
    return make(keys, context)


def periscope(keys: PeriscopeKeys, context: SimContext) -> NeckTwin:
    """Return the twin of the periscope, over the arm's."""
    arm = context.parts["arm"]
    pan, tilt = axes(keys, arm)
    return NeckTwin(
        arm, context.clock, pan=pan, tilt=tilt, speed=keys.speed, acceleration=keys.acceleration, report=context.report
    )
