"""Simulated rover of Waveshare's."""

from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin, WheelTwinOdometry, make_wheel_base
from drivers.sim.context import SimContext
from drivers.waveshare.declared import WaveshareKeys
from drivers.waveshare.wire import MAX_WHEEL_SPEED


def make(keys: WaveshareKeys, context: SimContext) -> BaseTwin:
    """Return the twin of a Waveshare rover for its section of a robot file."""
    wheels = TwoWheels(keys.track, MAX_WHEEL_SPEED if keys.encoders else keys.speed_at_full)
    return make_wheel_base(keys, context, WheelTwinOdometry(wheels, reckoned=not keys.encoders))
