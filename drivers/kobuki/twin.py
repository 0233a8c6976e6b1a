"""Simulated Kobuki, whose commands are rounded as the real ones on the wire."""

from drivers.api import Velocity
from drivers.base.twin import BaseTwin, GyroTwinOdometry
from drivers.base.twin import make as make_twin
from drivers.kobuki.commands import WHEEL_SEPARATION, BaseControl
from drivers.kobuki.declared import KobukiKeys
from drivers.sim.context import SimContext


class KobukiTwinOdometry(GyroTwinOdometry):
    """Odometry of a simulated Kobuki: commands are rounded to whole millimetres, as on the wire."""

    def __init__(self, gyro_noise: float = 0.0) -> None:
        super().__init__(gyro_noise, WHEEL_SEPARATION)

    def send(self, velocity: Velocity, now: float) -> Velocity:
        """Return the velocity that the base receives: speed in whole mm/s and radius in whole millimetres."""
        super().send(velocity, now)
        return Velocity(*BaseControl.of(velocity.linear, velocity.angular).velocity)


def make(keys: KobukiKeys, context: SimContext) -> BaseTwin:
    """Return the twin of a Kobuki for its section of a robot file."""
    return make_twin(keys, context, KobukiTwinOdometry(context.physics.gyro_noise))
