"""Virtual car of a Raspberry Pi: an actuator guardian with simulated motors."""

from drivers.base.reckoning import TwoWheels
from drivers.pi_car.declared import PiCarKeys
from drivers.sim.context import SimContext
from drivers.virtual.device import VirtualDevice, make_virtual_base
from drivers.virtual.guardian import VirtualCar


def make(keys: PiCarKeys, context: SimContext) -> VirtualDevice:
    """Return the virtual Raspberry Pi car for its section of a robot file."""
    return make_virtual_base(VirtualCar(context.make_body(), TwoWheels(keys.track, keys.speed_at_full)), "car")
