"""The twin of a pan/tilt on a PCA9685."""

from drivers.head.twin import HeadTwin, twin_of
from drivers.pi_car.declared import PiHeadKeys
from drivers.sim.stage import Stage


def make(keys: PiHeadKeys, stage: Stage) -> HeadTwin:
    """Return the twin of the head."""
    return twin_of(keys, keys.away, stage)
