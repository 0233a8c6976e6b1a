"""Virtual car of a Raspberry Pi: the guardian of its motors."""

from drivers.base.reckoning import TwoWheels
from drivers.pi_car.declared import PiCarKeys
from drivers.sim.stage import Stage
from drivers.virtual.guardian import VirtualCar
from drivers.virtual.plugged import Plugged, plugged_base


def make(keys: PiCarKeys, stage: Stage) -> Plugged:
    """Return the virtual device of a robot file's section."""
    return plugged_base(VirtualCar(stage.body(), TwoWheels(keys.track, keys.speed_at_full)), "car")
