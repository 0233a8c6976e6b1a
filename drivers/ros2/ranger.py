"""A range finder whose scans come by ROS 2, as LaserScan."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, isfinite, isinf, isnan, remainder, tau
from typing import Any

import numpy as np

from drivers.api import Health, Quality, RangeScan, Reading, Report, ignore, wrapped
from drivers.api.measures import Ranges
from drivers.base.scan_mounting import Place, Sector
from drivers.clock import Clock
from drivers.ros2 import wire
from drivers.ros2.line import Channel, absent
from drivers.ros2.node import TopicFaults, hint_for
from drivers.ros2.types import Malformed, types
from drivers.transport.link import Link
from drivers.transport.loop import guarded

SCAN = "sensor_msgs/msg/LaserScan"

STALE_AFTER = 0.5
"""Seconds without another scan after which the newest is stale."""

SILENT_AFTER = 1.0
"""Seconds without a scan after which it counts as offline."""

MAX_BEAMS = 10_000

MAX_TURN = 1.05 * tau
"""Radians that the rays of a scan cover at most: a few of the next turn come along."""

SPARE_SHARE = 0.02
"""The share of its rays by which a scan may end elsewhere than it says: the speed of its motor varies."""

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
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self.place = place
        self._blind = tuple(blind)
        self._link, self._clock, self._channel = link, clock, channel
        self._changed = guarded(changed)
        self._finder = wire.FrameFinder()
        self._kind = ""
        self._latest: Reading[RangeScan] = Reading(None, -inf, Quality.NONE)
        self._faults = TopicFaults(self.name, [channel.topic], clock, report)
        self._number = 0

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
        counters = {**link.counters, "scans": self._number, "malformed": self._faults.count}
        if not link.online:
            return Health(False, link.detail, link.hint, counters)
        if self._clock.now() - self._latest.stamp <= SILENT_AFTER:
            return Health(True, counters=counters)
        if not self._kind:
            error = absent(self.name, self._channel, self._faults.why(0))
            return Health(False, str(error), error.hint, counters)
        if why := self._faults.why(0):
            return Health(False, f"{self.name}: {why}", hint_for(self._channel.topic), counters)
        what = f"{self.name}: {self._channel.topic}: no scan comes"
        return Health(False, what, "does it turn? look at its node: `mission ros2 graph`", counters)

    # What follows is drivers.transport.link.Talker, called from the link's thread.

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
                elif channel == wire.MISMATCH:
                    self._faults.mismatch(payload)
                else:
                    self._take(types().decode(SCAN, payload))
            except (Malformed, ValueError) as error:
                self._faults.add(channel, error)

    def pulse(self) -> None:
        """Do nothing: what is late is found when it is asked for."""

    def ending(self) -> None:
        """Do nothing: there is nothing to be stopped."""

    def _take(self, told: Any) -> None:
        """Take a scan. Raises ValueError for one whose figures make no sense."""
        now = self._clock.now()
        start, step = beams_of(told)
        least, most = limits_of(told)
        ranges = measured_ranges(told, least, most)
        start += self.place[2]
        if step < 0:  # clockwise
            start, step, ranges = start + step * (len(ranges) - 1), -step, ranges[::-1].copy()
        bearings = start + step * np.arange(len(ranges))
        for first, second in self._blind:
            past = np.remainder(bearings - first + 1e-9, 2 * np.pi)
            ranges[past <= np.remainder(second - first, 2 * np.pi) + 2e-9] = np.nan
        turn = float(told.scan_time) if isfinite(told.scan_time) else 0.0
        stamp = now - max(min(turn / 2, STALE_AFTER / 2), 0.0)
        first_bearing = float(wrapped(np.array([start]))[0])
        # They come as float32.
        found = RangeScan(ranges, first_bearing, step, stamp, self._number, round(least, 4), round(most, 4))
        self._number += 1
        self._latest = Reading(found, now, Quality.GOOD)
        self._changed()


def beams_of(told: Any) -> tuple[float, float]:
    """Return the direction of the first ray of a scan and the angle from one to the next, in radians.

    Raises ValueError, naming the figures, also where the increment, the ends and the number of ranges contradict each
    other: left could be right, or a quarter turn half of one.
    """
    count, first, last, step = len(told.ranges), told.angle_min, told.angle_max, told.angle_increment
    if count == 0:
        given = f", but {len(told.intensities)} intensities" if len(told.intensities) else ""
        raise ValueError(f"it has no ranges{given}, in {SCAN}")
    if count > MAX_BEAMS:
        raise ValueError(f"it has {count} ranges, and {MAX_BEAMS} are the most, in {SCAN}")
    if not isfinite(first):
        raise ValueError(f"its angle_min is {first:g}, in {SCAN}")
    ends = isfinite(last) and last != first  # else angle_max was left out
    if not isfinite(step) or step == 0:
        raise ValueError(f"its angle_increment is {step:g}, in {SCAN}")
    if abs(step) * count > MAX_TURN:
        what = f"its angle_increment is {step:g} rad for {count} ranges, which is more than a turn"
        raise ValueError(f"{what}: is it in degrees? In {SCAN}")
    if ends and count > 1 and not _agree(first, last, step, count):
        what = f"its angles go from {first:g} to {last:g} rad, which is not {count} ranges by {step:g} rad"
        raise ValueError(f"{what}, in {SCAN}")
    return float(first), float(step)


def _agree(first: float, last: float, step: float, count: int) -> bool:
    """Return whether a scan ends where its increment says; drivers count a ray too many or too few, or past a turn."""
    off = remainder(first + step * (count - 1) - last, tau)
    return abs(off) <= abs(step) * max(2.5, SPARE_SHARE * count)


def limits_of(told: Any) -> tuple[float, float]:
    """Return the least and the largest distance that a scan measures, in metres. Raises ValueError.

    A range_max of 0 or NaN was left out, and infinity means no end: ``FARTHEST`` counts then.
    """
    least, most = float(told.range_min), float(told.range_max)
    least = 0.0 if isnan(least) else least
    if most == 0 or isnan(most):
        most = FARTHEST
    if not least < most or isinf(least):
        raise ValueError(f"its range_min is {told.range_min:g} and its range_max {told.range_max:g} m, in {SCAN}")
    return least, min(most, FARTHEST)


def measured_ranges(told: Any, least: float, most: float) -> Ranges:
    """Return the ranges of a scan, NaN where nothing was measured. Raises ValueError where no ray can be meant.

    Rays without an echo are infinite, NaN, 0 or one figure beyond the limits, as the driver likes it.
    """
    ranges: Ranges = told.ranges.astype(np.float32)
    with np.errstate(invalid="ignore"):
        measured = (ranges >= least) & (ranges <= most) & (ranges > 0)
    if not measured.any():
        _check_blank(ranges, least, most)
    ranges[~measured] = np.nan
    return ranges


def _check_blank(ranges: Ranges, least: float, most: float) -> None:
    """Raise ValueError for a scan that measures nothing, unless its rays say that nothing is near."""
    finite = ranges[np.isfinite(ranges)]
    far, near = finite[finite > most], finite[(finite > 0) & (finite < least)]
    if len(far) and far.min() != far.max():
        what = f"all its ranges are above its range_max of {most:g} m ({far.min():g} to {far.max():g})"
        raise ValueError(f"{what}: are they in millimetres? In {SCAN}")
    if len(far) or (ranges == np.inf).any():
        return
    if len(near) or (ranges == -np.inf).any():
        raise ValueError(f"all its {len(ranges)} ranges are below its range_min of {least:g} m, in {SCAN}")
    word = "0" if (ranges == 0).all() else "0 or not a number"
    raise ValueError(f"all its {len(ranges)} ranges are {word}: nothing was measured, in {SCAN}")
