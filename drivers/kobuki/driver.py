"""Driver of the Kobuki: its protocol for ``drivers.base.diff_drive.DiffDriveBase``.

The base reports 50 times a second. Distances come from the wheel encoders, headings from the gyro.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from types import MappingProxyType
from typing import Unpack

from drivers.api import ZERO_VELOCITY, BaseState, Lamp, Tune, Velocity
from drivers.api.driver import DriverContext
from drivers.api.fast_dataclass import dataclass
from drivers.base.arbitrated import BaseSettings, settings_of
from drivers.base.diff_drive import DiffDriveBase, DiffDriveProtocol, DiffDriveTiming, ParsedReports
from drivers.base.progress_monitor import Instruments
from drivers.clock import Clock
from drivers.kobuki import commands
from drivers.kobuki.commands import (
    OUTPUTS_AT_START,
    BaseControl,
    Extra,
    KobukiOutput,
    KobukiSound,
    RequestExtra,
    SetOutputs,
    SoundSequence,
)
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.feedback import FEEDBACK, Core, DockInfrared, FirmwareVersion, HardwareVersion, Inertia, UniqueId
from drivers.kobuki.odometry import KobukiStateBuilder
from drivers.kobuki.wire import KobukiFrameFinder, decode, encode
from drivers.transport.history import DelayStatistics
from drivers.transport.link import SerialLink

STALE_AFTER = 0.1
"""Seconds after which a report is stale: five were missed."""

OFFLINE_AFTER = 0.25
"""Seconds without a report after which the base is offline and stopped. The vendor's driver takes 0.1 s, which a
loaded computer exceeds by itself."""

FRAME_TIME = 0.0075
"""Seconds from the first to the last byte of a report (87 bytes at 115200 baud).

The USB adapter adds 1 ms if its latency timer is set, else up to 16 ms. The driver cannot know which.
"""

IDLE_POLL_INTERVAL = 0.06
"""Seconds between two reads of the port while the base rests: three reports are read at once, to save CPU time.

A new command wakes the thread earlier.
"""

STOP_REPEATS = 6
"""Number of copies of each stop command that are sent at once, in case the base misses one.

If the header of a command is damaged, the base may take the next 256 bytes for its payload (see ``KobukiFrameFinder``).
Six copies are 60 bytes, 5 ms on the wire. So the base receives a stop command after five renewals at the latest.
"""

QUERY_INTERVAL = 0.5
"""Seconds between two requests for versions and ID that the base has not sent yet."""

FIRMWARE_MAJOR = 1
"""Supported major version of the firmware."""

TUNES: Mapping[Tune, commands.KobukiTune] = MappingProxyType({tune: commands.KobukiTune[tune.name] for tune in Tune})

LIGHTS: Mapping[int, tuple[KobukiOutput, KobukiOutput]] = MappingProxyType(
    {1: (KobukiOutput.LED1_RED, KobukiOutput.LED1_GREEN), 2: (KobukiOutput.LED2_RED, KobukiOutput.LED2_GREEN)}
)
"""Red and green output bit of each light; both together are orange."""


def make(keys: KobukiKeys, context: DriverContext) -> DiffDriveBase:
    """Return the driver of a Kobuki for its section of a robot file."""
    link = SerialLink("base", context.port, keys.baud, report=context.report)
    return kobuki_base(link, context.clock, **settings_of(keys, context))


def kobuki_base(link: SerialLink, clock: Clock, **settings: Unpack[BaseSettings]) -> DiffDriveBase:
    """Return the driver of a Kobuki over ``link``, which it owns."""
    return DiffDriveBase(link, clock, KobukiProtocol(), **settings)


@dataclass(frozen=True, slots=True)
class KobukiIdentity:
    """Versions and unique ID of a Kobuki; None if it has not sent them on this connection."""

    hardware: HardwareVersion | None = None
    firmware: FirmwareVersion | None = None
    unique_id: UniqueId | None = None

    @property
    def missing(self) -> Extra:
        """Flags of the versions and ID that are still to be requested."""
        known = {Extra.HARDWARE: self.hardware, Extra.FIRMWARE: self.firmware, Extra.UNIQUE_ID: self.unique_id}
        return Extra(sum(flag for flag, value in known.items() if value is None))


class KobukiProtocol(DiffDriveProtocol):
    """Protocol of the Kobuki. ``identity`` and ``counters`` may be read from any thread."""

    instruments = Instruments("encoders", "gyro")
    timing = DiffDriveTiming(
        stale_after=STALE_AFTER,
        offline_after=OFFLINE_AFTER,
        report_delay=FRAME_TIME,
        idle_poll_interval=IDLE_POLL_INTERVAL,
    )
    model = "a Kobuki"

    def __init__(self) -> None:
        self.sounds = self.lights = self
        self.identity = KobukiIdentity()
        self._outputs = OUTPUTS_AT_START
        self._finder = KobukiFrameFinder()
        self._senses = KobukiStateBuilder()
        self._unknown = self._malformed = 0
        self._report_gaps = DelayStatistics()
        self._reported_at: float | None = None
        self._queried_at = -inf

    def restart(self) -> None:
        self.identity = KobukiIdentity()  # it may be another base
        self._finder.clear()
        self._reported_at, self._queried_at = None, -inf
        self._senses.odometry.anchor()

    def greet(self) -> bytes:
        return encode(SetOutputs(self._outputs))  # a base that was off has its lights off

    def query(self, now: float) -> bytes:
        if not self.identity.missing or now - self._queried_at < QUERY_INTERVAL:
            return b""
        self._queried_at = now
        return encode(RequestExtra(self.identity.missing))

    def parse(self, data: bytes, now: float) -> ParsedReports:
        known = self.identity.firmware
        found = (self._read(payload, now) for payload in self._finder.feed(data))
        parsed = ParsedReports([state for state in found if state is not None])
        if parsed.states:
            if self._reported_at is not None:
                self._report_gaps.add(now - self._reported_at)
            self._reported_at = now
        firmware = self.identity.firmware
        if firmware is not None and firmware is not known and firmware.major != FIRMWARE_MAJOR:
            parsed.faults.append((f"firmware {firmware}, not 1.x", "update it to 1.2.0"))
        return parsed

    def drive(self, velocity: Velocity, now: float) -> bytes:
        del now
        self._senses.odometry.commanded = velocity != ZERO_VELOCITY
        return encode(BaseControl.of(velocity.linear, velocity.angular))

    def stop(self, now: float) -> bytes:
        return self.drive(ZERO_VELOCITY, now) * STOP_REPEATS

    def play(self, tune: Tune) -> bytes:
        return encode(SoundSequence(TUNES[tune]))

    def tone(self, frequency: float, seconds: float) -> bytes:
        return encode(KobukiSound.of(frequency, seconds))

    def light(self, number: int, colour: Lamp) -> bytes:
        red, green = LIGHTS[number]
        for output, colours in ((red, (Lamp.RED, Lamp.ORANGE)), (green, (Lamp.GREEN, Lamp.ORANGE))):
            self._outputs = self._outputs | output if colour in colours else self._outputs & ~output
        return encode(SetOutputs(self._outputs))

    def counters(self) -> Mapping[str, int]:
        return {
            "frames": self._finder.frames,
            "checksum_errors": self._finder.checksum_errors,
            "skipped_bytes": self._finder.skipped_bytes,
            "unknown_parts": self._unknown,
            "malformed_parts": self._malformed,
            **self._report_gaps.counters("report_gap"),
        }

    def _read(self, payload: bytes, now: float) -> BaseState | None:
        """Return the state of the base after the frame ``payload``; None if the frame contains no state."""
        decoded = decode(payload, FEEDBACK)
        self._unknown += decoded.unknown
        self._malformed += decoded.malformed
        core: Core | None = None
        inertia: Inertia | None = None
        dock: DockInfrared | None = None
        for part in decoded.parts:
            match part:
                case Core():
                    core = part
                case Inertia():
                    inertia = part
                case DockInfrared():
                    dock = part
                case HardwareVersion():
                    self.identity = replace(self.identity, hardware=part)
                case FirmwareVersion():
                    self.identity = replace(self.identity, firmware=part)
                case UniqueId():
                    self.identity = replace(self.identity, unique_id=part)
        return self._senses.update(core, inertia, now, dock)
