"""Simulated car of a Raspberry Pi. It measures nothing, so its pose is dead reckoning."""

from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin, WheelTwinOdometry, make_wheel_base
from drivers.pi_car.declared import PiCarKeys
from drivers.sim.context import SimContext


def make(keys: PiCarKeys, context: SimContext) -> BaseTwin:
    """Return the twin of a Raspberry Pi car for its section of a robot file."""
    odometry = WheelTwinOdometry(TwoWheels(keys.track, keys.speed_at_full), reckoned=True)
    return make_wheel_base(keys, context, odometry, gauge=False)
