"""A range finder whose scans come by ROS 2, as LaserScan."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, isfinite
from typing import Any

import numpy as np

from drivers.api import Health, Quality, RangeScan, Reading, ignore, wrapped
from drivers.clock import Clock
from drivers.guard import guarded
from drivers.link import Link
from drivers.ros2 import wire
from drivers.ros2.line import Channel, absent
from drivers.ros2.types import Malformed, types
from drivers.rplidar.mounting import Place, Sector

SCAN = "sensor_msgs/msg/LaserScan"

STALE_AFTER = 0.5
"""Seconds without another scan after which the newest is stale."""

SILENT_AFTER = 1.0
"""Seconds without a scan after which it counts as offline."""

MOST_BEAMS = 10_000

FARTHEST = 1000.0
"""Metres that a range finder measures at most, where it says that there is no end to it."""


class Ros2Ranger:
    """A ``drivers.api.Ranger`` over a link to a topic. ``place`` and ``blind`` as of every range finder."""

    name = "range"

    def __init__(
        self,
        link: Link,
        clock: Clock,
        channel: Channel,
        *,
        place: Place = (0.0, 0.0, 0.0),
        blind: Sequence[Sector] = (),
        changed: Callable[[], None] = ignore,
    ) -> None:
        self.place = place
        self._blind = tuple(blind)
        self._link, self._clock, self._channel = link, clock, channel
        self._changed = guarded(changed)
        self._finder = wire.FrameFinder()
        self._kind = ""
        self._latest: Reading[RangeScan] = Reading(None, -inf, Quality.NONE)
        self._number = self._malformed = 0

    def scan(self) -> Reading[RangeScan]:
        """Return the newest scan; stale once ``STALE_AFTER`` has passed without another."""
        latest, now = self._latest, self._clock.now()
        if latest.value is None:
            return replace(latest, stamp=now)
        return latest if now - latest.stamp <= STALE_AFTER else replace(latest, quality=Quality.STALE)

    def open(self) -> None:
        """Start looking for its topic; returns at once."""
        self._link.open(self)

    def rest(self) -> None:
        """Do nothing: it moves nothing of the robot."""

    def close(self) -> None:
        """Listen no more. Safe from any state, more than once."""
        self._link.close()

    def health(self) -> Health:
        """Say whether scans come."""
        link = self._link.health()
        counters = {**link.counters, "scans": self._number, "malformed": self._malformed}
        if not link.online:
            return Health(False, link.detail, link.hint, counters)
        if self._clock.now() - self._latest.stamp <= SILENT_AFTER:
            return Health(True, counters=counters)
        if not self._kind:
            error = absent(self.name, self._channel)
            return Health(False, str(error), error.hint, counters)
        what = f"{self.name}: {self._channel.topic}: no scan comes"
        return Health(False, what, "does it turn? look at its node: `mission ros2 graph`", counters)

    # What follows is drivers.link.Talker, called from the link's thread.

    def connected(self) -> None:
        """Begin anew: nothing of before counts."""
        self._finder, self._kind = wire.FrameFinder(), ""
        self._link.write(wire.ASK)

    def received(self, data: bytes) -> None:
        """Take what has come."""
        for channel, payload in self._finder.feed(data):
            try:
                if channel == wire.ABOUT:
                    self._kind = SCAN if SCAN in wire.told(payload)[1] else ""
                else:
                    self._take(types().decode(SCAN, payload))
            except (Malformed, ValueError):
                self._malformed += 1

    def pulse(self) -> None:
        """Do nothing: what is late is found when it is asked for."""

    def ending(self) -> None:
        """Do nothing: there is nothing to be stopped."""

    def _take(self, told: Any) -> None:
        """Take a scan. Raises ValueError for one whose figures make no sense."""
        figures = (told.angle_min, told.angle_increment, told.range_min, told.scan_time)
        sound = all(map(isfinite, figures)) and told.range_max > 0 and told.angle_increment != 0
        if not (sound and 0 < len(told.ranges) <= MOST_BEAMS):
            raise ValueError("a scan whose figures make no sense")
        now, most = self._clock.now(), min(told.range_max, FARTHEST)
        ranges = told.ranges.astype(np.float32)
        with np.errstate(invalid="ignore"):
            ranges[~((ranges >= told.range_min) & (ranges <= most) & (ranges > 0))] = np.nan
        start, step = float(told.angle_min) + self.place[2], float(told.angle_increment)
        if step < 0:  # clockwise
            start, step, ranges = start + step * (len(ranges) - 1), -step, ranges[::-1].copy()
        bearings = start + step * np.arange(len(ranges))
        for first, second in self._blind:
            past = np.remainder(bearings - first + 1e-9, 2 * np.pi)
            ranges[past <= np.remainder(second - first, 2 * np.pi) + 2e-9] = np.nan
        stamp = now - max(min(float(told.scan_time) / 2, STALE_AFTER / 2), 0.0)
        least, most = round(float(told.range_min), 4), round(float(most), 4)  # they come as float32
        first_bearing = float(wrapped(np.array([start]))[0])
        found = RangeScan(ranges, first_bearing, step, stamp, self._number, least, most)
        self._number += 1
        self._latest = Reading(found, now, Quality.GOOD)
        self._changed()
