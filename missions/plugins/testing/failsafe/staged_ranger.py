"""Range finder for the failsafe view of the studio: it sees open floor, or one object in front of the base."""

from math import atan2, cos, hypot, radians, sin
from typing import cast

import numpy as np

from drivers.api import BASE_RADIUS, Guardable, Health, Pose2D, Quality, Ranger, RangeScan, Reading
from drivers.api.base import Base
from drivers.clock import Clock

SCAN_INTERVAL = 0.1
"""Seconds between two scans."""

BEAM_COUNT = 360


class StagedRanger:
    """A ``drivers.api.Ranger`` that guards ``base``; ``frozen`` stops new scans."""

    name = "range"
    place = (0.0, 0.0, 0.0)

    def __init__(self, base: Base, clock: Clock) -> None:
        self.frozen = False
        self._base, self._clock = base, clock
        self._thing: tuple[float, float] | None = None  # (x, y) in the odometry frame
        self._scan: RangeScan | None = None
        if isinstance(base, Guardable):
            base.guard_by(cast("Ranger", self))

    def put(self, ahead: float | None) -> None:
        """Put an object ``ahead`` metres from the rim of the base; None removes it."""
        pose = self._pose
        far = BASE_RADIUS + (ahead or 0.0)
        there = pose.x + far * cos(pose.heading), pose.y + far * sin(pose.heading)
        self._thing = None if ahead is None else there
        self._scan = None if self.frozen else self._measure()

    def scan(self) -> Reading[RangeScan]:
        """Return the latest scan."""
        now = self._clock.now()
        if self._scan is None or (not self.frozen and now - self._scan.stamp >= SCAN_INTERVAL):
            self._scan = self._measure()
        return Reading(self._scan, self._scan.stamp, Quality.GOOD)

    def health(self) -> Health:
        """Return the health: always connected."""
        return Health(online=True)

    @property
    def _pose(self) -> Pose2D:
        state = self._base.state().value
        return Pose2D(0.0, 0.0, 0.0) if state is None else state.pose

    def _measure(self) -> RangeScan:
        ranges = np.full(BEAM_COUNT, np.nan, dtype=np.float32)
        if self._thing is not None:
            pose = self._pose
            dx, dy = self._thing[0] - pose.x, self._thing[1] - pose.y
            ranges[round((atan2(dy, dx) - pose.heading) / radians(1.0)) % BEAM_COUNT] = hypot(dx, dy)
        return RangeScan(ranges, 0.0, radians(1.0), self._clock.now(), 0, 0.05, 12.0)
