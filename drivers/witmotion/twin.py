"""The twin of an IMU: in physics it feels the body, else a robot that stands upright and turns as its base does."""

from drivers.api import Attitude, Health, Quality, Reading
from drivers.api.sections import ImuKeys
from drivers.sim.context import SimContext
from drivers.sim.plug import SimulatedPlug

GRAVITY = 9.81


class ImuTwin:
    """A ``drivers.api.Imu`` on a ``stage``."""

    name = "imu"

    def __init__(self, stage: SimContext) -> None:
        self._stage = stage
        self.plug = SimulatedPlug(self.name, stage.report)
        self._latest: Reading[Attitude] = Reading(None, 0.0, Quality.NONE)

    def attitude(self) -> Reading[Attitude]:
        """Return how the robot leans now; as felt last, and stale, while it is unplugged."""
        now = self._stage.clock.now()
        if self.plug.online:
            self._latest = Reading(self._measure(now), now, Quality.GOOD)
        elif self._latest.value is not None:
            return Reading(self._latest.value, self._latest.stamp, Quality.STALE)
        return self._latest

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        self.plug.open()

    def rest(self) -> None:
        """Do nothing: it moves nothing."""

    def close(self) -> None:
        """Feel no more. Safe from any state, more than once."""
        self.plug.close()

    def health(self) -> Health:
        """Say whether it is there."""
        return self.plug.health({})

    def _measure(self, now: float) -> Attitude:
        scene = self._stage.scene
        if scene is None:
            return Attitude(0.0, 0.0, self._stage.pose(now).heading, (0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY))
        scene.advance(now)
        roll, pitch = scene.lean()
        return Attitude(roll, pitch, scene.pose().heading, scene.gyro_rates(), scene.proper_acceleration())


def imu(keys: ImuKeys, stage: SimContext) -> ImuTwin:  # noqa: ARG001 - all makers are called with both
    """Return the twin of an IMU."""
    return ImuTwin(stage)
