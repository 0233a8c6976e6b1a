"""Driver of Waveshare's rovers: their protocol of JSON lines for ``drivers.base.diff_drive.DiffDriveBase``."""

from collections import deque
from collections.abc import Mapping
from math import inf
from typing import Unpack

from drivers.api import Velocity
from drivers.api.driver import DriverContext
from drivers.base.arbitrated import BaseSettings, settings_of
from drivers.base.diff_drive import GREETING_INTERVAL, DiffDriveBase, DiffDriveProtocol, ParsedReports
from drivers.base.progress_monitor import Instruments
from drivers.base.reckoning import TwoWheels, WheelOdometry
from drivers.clock import Clock
from drivers.transport.lines import LineFinder
from drivers.transport.link import SerialLink
from drivers.waveshare import wire
from drivers.waveshare.declared import WaveshareKeys

REPORT_INTERVAL = 0.02
"""Seconds between two reports that the driver requests from the rover."""

HEARTBEAT_TIMEOUT = 0.4
"""Seconds without a command after which the rover stops; the driver sends this setting to the rover."""

DEFAULT_HEARTBEAT_TIMEOUT = 3.0
"""Seconds without a command after which a rover stops by default.

It is ``HEART_BEAT_DELAY`` in the vendor's ``ugv_config.h``.
"""

CONFIRMATION_TIMEOUT = 2.0
"""Seconds of reports after which the user is warned if the rover has not confirmed ``HEARTBEAT_TIMEOUT``."""

MEDIAN_LENGTH = 5
"""Number of reports whose median is used, since a line has no checksum and may have a damaged digit."""

EMPTY_VOLTAGE, FULL_VOLTAGE = 9.0, 12.6
"""Volts of three lithium cells in series at 0 and at 100 percent."""

HEARTBEAT_UNCONFIRMED = (
    (
        "the rover does not confirm its heartbeat: "
        f"after a kill or an unplug it may roll on for {DEFAULT_HEARTBEAT_TIMEOUT:g} s"
    ),
    "update its firmware (ugv_base_general, ugv_base_ros); until then stay within reach of its switch",
)


def make(keys: WaveshareKeys, context: DriverContext) -> DiffDriveBase:
    """Return the driver of a Waveshare rover for its section of a robot file."""
    return waveshare_base(
        SerialLink("base", context.port, keys.baud, report=context.report),
        context.clock,
        track=keys.track,
        encoders=keys.encoders,
        speed_at_full=keys.speed_at_full,
        **settings_of(keys, context),
    )


def waveshare_base(
    link: SerialLink,
    clock: Clock,
    *,
    track: float,
    encoders: bool,
    speed_at_full: float,
    **settings: Unpack[BaseSettings],
) -> DiffDriveBase:
    """Return the driver of a rover over ``link``, which it owns; see ``WaveshareProtocol``."""
    return DiffDriveBase(link, clock, WaveshareProtocol(track, speed_at_full, encoders=encoders), **settings)


class WaveshareProtocol(DiffDriveProtocol):
    """Protocol of a Waveshare rover with wheels ``track`` metres apart.

    ``speed_at_full`` (m/s) is the speed of a rover without ``encoders`` at full power; its pose is dead reckoning.
    """

    instruments = Instruments("encoders", "encoders")
    model = "a rover"
    noun = "rover"

    def __init__(self, track: float, speed_at_full: float, *, encoders: bool) -> None:
        wheels = TwoWheels(track, wire.MAX_WHEEL_SPEED if encoders else speed_at_full)
        self._odometry = WheelOdometry(wheels, measured=encoders)
        self._sent_per_speed = 1.0 if encoders else wire.FULL_POWER / speed_at_full
        self._heartbeat = wire.command(wire.HEARTBEAT, cmd=round(1000 * HEARTBEAT_TIMEOUT))
        self._malformed = self._reports = 0
        self._confirmed = False
        self.restart()

    def restart(self) -> None:
        self._lines = LineFinder()
        self._newest: deque[wire.WaveshareFeedback] = deque(maxlen=MEDIAN_LENGTH)
        self._warned, self._unconfirmed_since, self._greeted_at = False, inf, -inf
        self._odometry.pause()

    def greet(self) -> bytes:
        self._confirmed = False
        return (
            b"\n"  # ends an incomplete line
            + wire.command(wire.ECHO, cmd=1)
            + self._heartbeat  # before the reports: without it a disconnected rover rolls on
            + wire.command(wire.INTERVAL, cmd=round(1000 * REPORT_INTERVAL))
            + wire.command(wire.FLOW, cmd=1)
        )

    def query(self, now: float) -> bytes:
        if self._confirmed or now - self._greeted_at < GREETING_INTERVAL:
            return b""
        self._greeted_at = now
        return self.greet()

    def parse(self, data: bytes, now: float) -> ParsedReports:
        parsed = ParsedReports()
        for line in self._lines.feed(data):
            try:
                message = wire.parse_line(line)
            except ValueError:
                self._malformed += 1
                continue
            if isinstance(message, wire.WaveshareFeedback):
                self._feedback(message, now, parsed)
            elif message is not None and message.line == self._heartbeat.strip() and not self._confirmed:
                self._confirmed = True
                parsed.reply += wire.command(wire.ECHO, cmd=0)
        return parsed

    def drive(self, velocity: Velocity, now: float) -> bytes:
        left, right = self._odometry.send(velocity, now)
        return wire.speeds(left * self._sent_per_speed, right * self._sent_per_speed)

    def counters(self) -> Mapping[str, int]:
        return {"reports": self._reports, "malformed": self._malformed, "overlong": self._lines.overlong}

    def _feedback(self, message: wire.WaveshareFeedback, now: float, parsed: ParsedReports) -> None:
        """Add the state for a report, as the median of the newest reports, to ``parsed``.

        Also add a warning if the rover has not confirmed the heartbeat timeout.
        """
        self._newest.append(message)
        if len(self._newest) < MEDIAN_LENGTH:
            return
        left, right, volts = (
            sorted(getattr(each, name) for each in self._newest)[MEDIAN_LENGTH // 2]
            for name in ("left", "right", "volts")
        )
        self._reports += 1
        self._unconfirmed_since = min(self._unconfirmed_since, now)
        if not (self._confirmed or self._warned) and now - self._unconfirmed_since >= CONFIRMATION_TIMEOUT:
            self._warned = True
            parsed.faults.append(HEARTBEAT_UNCONFIRMED)
        percent = min(max(100 * (volts - EMPTY_VOLTAGE) / (FULL_VOLTAGE - EMPTY_VOLTAGE), 0.0), 100.0)
        speeds = (left, right) if self._odometry.measured else None
        parsed.states.append(self._odometry.report(now, speeds, volts=volts, percent=percent))
