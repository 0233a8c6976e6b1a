"""Simulated IMU: reports the attitude of the simulated body.

In a simulation without physics, the robot is always upright and turns with its base.
"""

from drivers.api import Attitude, Health, Quality, Reading
from drivers.api.sections import ImuKeys
from drivers.sim.context import SimContext
from drivers.sim.plug import SimulatedPlug

GRAVITY = 9.81


class ImuTwin:
    """Simulated IMU: a ``drivers.api.Imu``. ``context`` provides the clock and the attitude of the robot."""

    name = "imu"

    def __init__(self, context: SimContext) -> None:
        self._context = context
        self.plug = SimulatedPlug(self.name, context.report)
        self._latest: Reading[Attitude] = Reading(None, 0.0, Quality.NONE)

    def attitude(self) -> Reading[Attitude]:
        """Return the current attitude; while unplugged, the last one before, which is stale."""
        now = self._context.clock.now()
        if self.plug.online:
            self._latest = Reading(self._measure(now), now, Quality.GOOD)
        elif self._latest.value is not None:
            return Reading(self._latest.value, self._latest.stamp, Quality.STALE)
        return self._latest

    def open(self) -> None:
        """Connect at once, unless unplugged."""
        self.plug.open()

    def rest(self) -> None:
        """Do nothing: an IMU has no actuator."""

    def close(self) -> None:
        """End the measurements. Safe from any state, more than once."""
        self.plug.close()

    def health(self) -> Health:
        """Return whether the IMU is plugged in."""
        return self.plug.health({})

    def _measure(self, now: float) -> Attitude:
        scene = self._context.scene
        if scene is None:
            return Attitude(0.0, 0.0, self._context.pose(now).heading, (0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY))
        scene.advance(now)
        roll, pitch = scene.lean()
        return Attitude(roll, pitch, scene.pose().heading, scene.gyro_rates(), scene.proper_acceleration())


def imu(keys: ImuKeys, context: SimContext) -> ImuTwin:  # noqa: ARG001 - all makers are called with both
    """Return the twin of an IMU."""
    return ImuTwin(context)
