"""Range finder on a ROS 2 topic of type LaserScan."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, isfinite, isinf, isnan, remainder, tau
from typing import Any

import numpy as np

from drivers.api import Health, Quality, RangeScan, Reading, StatusCallback, ignore, wrap_angles
from drivers.api.measures import Ranges
from drivers.base.scan_mounting import Place, Sector
from drivers.clock import Clock
from drivers.ros2 import wire
from drivers.ros2.node import TopicFaults, topic_hint
from drivers.ros2.topic_port import TopicChannel, absent_error
from drivers.ros2.types import MalformedMessage, types
from drivers.transport.link import SerialLink
from drivers.transport.loop import guard_callback

LASER_SCAN = "sensor_msgs/msg/LaserScan"

STALE_AFTER = 0.5
"""Seconds without a new scan after which the newest is stale."""

OFFLINE_TIMEOUT = 1.0
"""Seconds without a scan after which the range finder is offline."""

MAX_BEAMS = 10_000

MAX_SCAN_ANGLE = 1.05 * tau
"""Maximum angle of a scan in radians, a little more than a turn: some drivers add a few rays of the next turn."""

END_TOLERANCE = 0.02
"""Tolerance of the last angle of a scan, as a share of the number of its rays, since the motor speed varies."""

MAX_RANGE = 1000.0
"""Maximum range in metres of a range finder that states none."""


class Ros2Ranger:
    """Range finder on a ROS 2 topic: a ``drivers.api.Ranger`` over a link to ``channel``.

    ``place`` is its mounting pose on the base, ``blind`` are the sectors that the robot itself blocks.
    """

    name = "range"

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        channel: TopicChannel,
        *,
        place: Place = (0.0, 0.0, 0.0),
        blind: Sequence[Sector] = (),
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self.place = place
        self._blind = tuple(blind)
        self._link, self._clock, self._channel = link, clock, channel
        self._changed = guard_callback(changed)
        self._finder = wire.TopicFrameFinder()
        self._kind = ""
        self._latest: Reading[RangeScan] = Reading(None, -inf, Quality.NONE)
        self._faults = TopicFaults(self.name, [channel.topic], clock, report)
        self._number = 0

    def scan(self) -> Reading[RangeScan]:
        """Return the newest scan; stale after ``STALE_AFTER`` seconds without a new one."""
        latest, now = self._latest, self._clock.now()
        if latest.value is None:
            return replace(latest, stamp=now)
        return latest if now - latest.stamp <= STALE_AFTER else replace(latest, quality=Quality.STALE)

    def open(self) -> None:
        """Start connecting to the topic of the scans; returns at once."""
        self._link.open(self)

    def rest(self) -> None:
        """Do nothing: a range finder has no actuator."""

    def close(self) -> None:
        """Disconnect. Safe from any state, more than once."""
        self._link.close()

    def health(self) -> Health:
        """Return online if scans arrive."""
        link = self._link.health()
        counters = {**link.counters, "scans": self._number, "malformed": self._faults.count}
        if not link.online:
            return Health(False, link.detail, link.hint, counters)
        if self._clock.now() - self._latest.stamp <= OFFLINE_TIMEOUT:
            return Health(True, counters=counters)
        if not self._kind:
            error = absent_error(self.name, self._channel, self._faults.fault(0))
            return Health(False, str(error), error.hint, counters)
        if why := self._faults.fault(0):
            return Health(False, f"{self.name}: {why}", topic_hint(self._channel.topic), counters)
        what = f"{self.name}: {self._channel.topic}: no scan received"
        return Health(False, what, "does it turn? check its node: `mission ros2 graph`", counters)

    # What follows is drivers.transport.link.LinkHandler, called from the link's thread.

    def on_connected(self) -> None:
        """Reset the connection state."""
        self._finder, self._kind = wire.TopicFrameFinder(), ""
        self._link.write(wire.DISCOVERY_REQUEST)

    def on_data(self, data: bytes) -> None:
        """Handle received frames."""
        for channel, payload in self._finder.feed(data):
            try:
                if channel == wire.ABOUT_CHANNEL:
                    self._kind = LASER_SCAN if LASER_SCAN in wire.parse_about(payload)[1] else ""
                elif channel == wire.MISMATCH_CHANNEL:
                    self._faults.mismatch(payload)
                else:
                    self._handle_scan(types().decode(LASER_SCAN, payload))
            except (MalformedMessage, ValueError) as error:
                self._faults.add(channel, error)

    def on_poll(self) -> None:
        """Do nothing: ``scan`` and ``health`` detect late scans when they are called."""

    def on_closing(self) -> None:
        """Do nothing: there is nothing to stop."""

    def _handle_scan(self, message: Any) -> None:
        """Convert a LaserScan message to the base's frame, and store it. Raises ValueError for implausible values."""
        now = self._clock.now()
        start, step = scan_angles(message)
        least, most = range_limits(message)
        ranges = measured_ranges(message, least, most)
        start += self.place[2]
        if step < 0:  # clockwise
            start, step, ranges = start + step * (len(ranges) - 1), -step, ranges[::-1].copy()
        bearings = start + step * np.arange(len(ranges))
        for first, second in self._blind:
            past = np.remainder(bearings - first + 1e-9, 2 * np.pi)
            ranges[past <= np.remainder(second - first, 2 * np.pi) + 2e-9] = np.nan
        turn = float(message.scan_time) if isfinite(message.scan_time) else 0.0
        stamp = now - max(min(turn / 2, STALE_AFTER / 2), 0.0)
        first_bearing = float(wrap_angles(np.array([start]))[0])
        # They are float32.
        found = RangeScan(ranges, first_bearing, step, stamp, self._number, round(least, 4), round(most, 4))
        self._number += 1
        self._latest = Reading(found, now, Quality.GOOD)
        self._changed()


def scan_angles(message: Any) -> tuple[float, float]:
    """Return the direction of the first ray of a scan, and the angle between two rays, in radians.

    Raises ValueError with a message that names the values. It also does so if increment, end angles and number of
    ranges contradict each other, since obstacles would be seen in a wrong direction.
    """
    count, first, last, step = len(message.ranges), message.angle_min, message.angle_max, message.angle_increment
    if count == 0:
        given = f", but {len(message.intensities)} intensities" if len(message.intensities) else ""
        raise ValueError(f"it has no ranges{given}, in {LASER_SCAN}")
    if count > MAX_BEAMS:
        raise ValueError(f"it has {count} ranges, and {MAX_BEAMS} are the most, in {LASER_SCAN}")
    if not isfinite(first):
        raise ValueError(f"its angle_min is {first:g}, in {LASER_SCAN}")
    ends = isfinite(last) and last != first  # else angle_max was excluded
    if not isfinite(step) or step == 0:
        raise ValueError(f"its angle_increment is {step:g}, in {LASER_SCAN}")
    if abs(step) * count > MAX_SCAN_ANGLE:
        what = f"its angle_increment is {step:g} rad for {count} ranges, which is more than a turn"
        raise ValueError(f"{what}: is it in degrees? In {LASER_SCAN}")
    if ends and count > 1 and not _angles_agree(first, last, step, count):
        what = f"its angles go from {first:g} to {last:g} rad, which is not {count} ranges by {step:g} rad"
        raise ValueError(f"{what}, in {LASER_SCAN}")
    return float(first), float(step)


def _angles_agree(first: float, last: float, step: float, count: int) -> bool:
    """Return True if the last angle of a scan agrees with its increment ``step`` and its number of rays ``count``.

    Drivers may count one or two rays too many or too few, or continue beyond a full turn.
    """
    off = remainder(first + step * (count - 1) - last, tau)
    return abs(off) <= abs(step) * max(2.5, END_TOLERANCE * count)


def range_limits(message: Any) -> tuple[float, float]:
    """Return the minimum and maximum distance of a scan, in metres. Raises ValueError.

    A range_max of 0 or NaN is missing, and infinity means no limit: both become ``MAX_RANGE``.
    """
    least, most = float(message.range_min), float(message.range_max)
    least = 0.0 if isnan(least) else least
    if most == 0 or isnan(most):
        most = MAX_RANGE
    if not least < most or isinf(least):
        raise ValueError(
            f"its range_min is {message.range_min:g} and its range_max {message.range_max:g} m, in {LASER_SCAN}"
        )
    return least, min(most, MAX_RANGE)


def measured_ranges(message: Any, least: float, most: float) -> Ranges:
    """Return the ranges of a scan, NaN without an echo. Raises ValueError if no ray is plausible.

    Drivers mark rays without an echo by infinity, NaN, 0 or one value beyond the limits.
    """
    ranges: Ranges = message.ranges.astype(np.float32)
    with np.errstate(invalid="ignore"):
        measured = (ranges >= least) & (ranges <= most) & (ranges > 0)
    if not measured.any():
        _check_unmeasured(ranges, least, most)
    ranges[~measured] = np.nan
    return ranges


def _check_unmeasured(ranges: Ranges, least: float, most: float) -> None:
    """Check a scan without any measured distance.

    Raises ValueError unless its rays say that there is no obstacle in the measuring range.
    """
    finite = ranges[np.isfinite(ranges)]
    far, near = finite[finite > most], finite[(finite > 0) & (finite < least)]
    if len(far) and far.min() != far.max():
        what = f"all its ranges are above its range_max of {most:g} m ({far.min():g} to {far.max():g})"
        raise ValueError(f"{what}: are they in millimetres? In {LASER_SCAN}")
    if len(far) or (ranges == np.inf).any():
        return
    if len(near) or (ranges == -np.inf).any():
        raise ValueError(f"all its {len(ranges)} ranges are below its range_min of {least:g} m, in {LASER_SCAN}")
    word = "0" if (ranges == 0).all() else "0 or not a number"
    raise ValueError(f"all its {len(ranges)} ranges are {word}: nothing was measured, in {LASER_SCAN}")
