"""Simulated pan/tilt head on a PCA9685 PWM chip."""

from drivers.head.twin import ServoHeadTwin, make_head_twin
from drivers.pi_car.declared import PiHeadKeys
from drivers.sim.context import SimContext


def make(keys: PiHeadKeys, context: SimContext) -> ServoHeadTwin:
    """Return the twin of a pan/tilt head on a PCA9685."""
    return make_head_twin(keys, keys.away, context)
