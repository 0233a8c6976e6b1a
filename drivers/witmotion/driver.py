"""Driver of a WitMotion IMU: sets 100 reports per second, and keeps the latest."""

from math import inf

from drivers.api import Attitude, Health, Quality, Reading
from drivers.api.driver import DriverContext
from drivers.clock import Clock
from drivers.transport.link import SerialLink
from drivers.witmotion import wire
from drivers.witmotion.declared import WitMotionKeys

STALE_AFTER = 0.1
"""Seconds without a new report after which the latest is stale: it would be too old for balancing."""


class WitMotionImu:
    """Driver of a WitMotion IMU over a link that it owns: a ``drivers.api.Imu``.

    ``level`` is the measured roll and pitch (rad) while the robot is upright.
    """

    name = "imu"

    def __init__(self, link: SerialLink, clock: Clock, *, level: tuple[float, float] = (0.0, 0.0)) -> None:
        self._link, self._clock, self._level = link, clock, level
        self._finder = wire.WitMotionReportFinder()
        # Written by the link's thread alone, and replaced, never altered: any thread may read it.
        self._latest: Reading[Attitude] = Reading(None, -inf, Quality.NONE)
        self._reports = 0

    def attitude(self) -> Reading[Attitude]:
        """Return the latest attitude; stale once ``STALE_AFTER`` has passed without another."""
        latest, now = self._latest, self._clock.now()
        if latest.value is None:
            return Reading(None, now, Quality.NONE)
        fresh = self._link.online and now - latest.stamp <= STALE_AFTER
        return latest if fresh else Reading(latest.value, latest.stamp, Quality.STALE)

    def open(self) -> None:
        """Start the search for the IMU; returns at once, with or without hardware."""
        self._link.open(self)

    def rest(self) -> None:
        """Do nothing: an IMU has no actuator."""

    def close(self) -> None:
        """End the thread and release the port. Safe from any state, more than once."""
        self._link.close()

    def health(self) -> Health:
        """Return whether reports arrive, and the counters of the wire."""
        link = self._link.health()
        counters = {**link.counters, "reports": self._reports, "malformed": self._finder.malformed}
        if not link.online:
            return Health(False, link.detail, link.hint, counters)
        if not self.attitude().good:
            detail = f"{self.name}: {self._link.port}: no report from an IMU at {self._link.baud} baud"
            return Health(False, detail, "set it to 115200 baud with WitMotion's program, or set 'baud'", counters)
        return Health(True, counters=counters)

    # What follows is drivers.transport.link.LinkHandler, called from the link's thread.

    def on_connected(self) -> None:
        """Set the report rate on a port that was just opened."""
        self._finder = wire.WitMotionReportFinder()
        self._link.write(wire.UNLOCK)
        self._link.write(wire.HUNDRED_HERTZ)

    def on_data(self, data: bytes) -> None:
        for report in self._finder.feed(data):
            roll, pitch, yaw = report.angles
            level = self._level
            attitude = Attitude(roll - level[0], pitch - level[1], yaw, report.rates, report.forces)
            self._latest = Reading(attitude, self._clock.now(), Quality.GOOD)
            self._reports += 1

    def on_poll(self) -> None:
        """Do nothing: the IMU reports by itself."""

    def on_closing(self) -> None:
        """Do nothing: the IMU may continue to report."""


def make(keys: WitMotionKeys, context: DriverContext) -> WitMotionImu:
    """Return the driver of a WitMotion IMU."""
    return WitMotionImu(
        SerialLink("imu", context.port, keys.baud, report=context.report), context.clock, level=keys.level
    )
