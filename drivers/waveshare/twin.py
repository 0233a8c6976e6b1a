"""Simulated rover of Waveshare's."""

from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin, WheelTwinOdometry, make_plain
from drivers.sim.stage import Stage
from drivers.waveshare.declared import WaveshareKeys
from drivers.waveshare.wire import FASTEST


def make(keys: WaveshareKeys, stage: Stage) -> BaseTwin:
    """Return the twin of a robot file's section."""
    wheels = TwoWheels(keys.track, FASTEST if keys.encoders else keys.speed_at_full)
    return make_plain(keys, stage, WheelTwinOdometry(wheels, reckoned=not keys.encoders))
