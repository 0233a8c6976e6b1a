"""Virtual Waveshare rover at wire level, which executes the commands as the vendor's firmware does."""

import json
from math import inf
from threading import RLock

from drivers.api import Pose2D, Velocity
from drivers.base.reckoning import TwoWheels
from drivers.sim.base_body import BaseBody
from drivers.sim.context import SimContext
from drivers.sim.wheels import DelayLine
from drivers.virtual.device import VirtualDevice, make_virtual_base
from drivers.waveshare import wire
from drivers.waveshare.declared import WaveshareKeys

BANNER = b"Initialize LittleFS for Flash files ctrl.\r\nWiFi init.\r\nUGV started.\r\n"
"""Some of the lines that the firmware prints at boot."""

LOOP_INTERVAL = 0.008
"""Minimum seconds of a pass of the firmware's main loop: the time to send a report at 115200 baud."""

BATTERY_VOLTAGE = 12.1


class VirtualWaveshare:
    """Virtual Waveshare rover with a simulated ``body``: a ``drivers.virtual.terminal.WireDevice``. Thread-safe.

    ``track`` is the distance of the wheels in metres, ``unit`` the setpoint for 1 m/s. ``encoders`` is False for a
    rover that does not measure its wheel speeds. ``echoes`` is False for firmware without an echo. ``report_delay``
    delays the reports. ``commanded`` are the current setpoints of the left and the right wheel.
    """

    def __init__(
        self, body: BaseBody, *, track: float, unit: float, encoders: bool, baud: int = 115_200, echoes: bool = True
    ) -> None:
        self.baud = baud
        self.body = body
        self.echoes = echoes
        self.commanded = (0.0, 0.0)
        self._wheels = TwoWheels(track, inf)
        self._unit = unit
        self._encoders = encoders
        self._lock = RLock()
        self.report_delay: DelayLine[bytes] = DelayLine()
        self._reset_settings()

    def _reset_settings(self) -> None:
        self.heartbeat = 3.0
        self._partial_line = b""
        self._echo = self._flow = False
        self._interval = 0.0
        self._due = -inf
        self._commanded_at = -inf
        self._banner = BANNER
        self.commanded = (0.0, 0.0)

    def reset(self, now: float) -> None:
        """Press the reset button: the wheels stop, and all settings are lost."""
        with self._lock:
            self._reset_settings()
            self.body.command(0.0, 0.0, now)

    def power_on(self, now: float) -> None:
        """Do nothing: the rover has its power from its battery."""

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle lines; return the echoes and replies."""
        with self._lock:
            *lines, self._partial_line = (self._partial_line + data).split(b"\n")
            return b"".join(self._handle_line(line, now) for line in lines) + self._output(now)

    def poll(self, now: float) -> bytes:
        """Return the reports that are due."""
        with self._lock:
            return self._output(now)

    def pose(self, now: float) -> Pose2D:
        """Return the true pose of the rover at time ``now``."""
        with self._lock:
            return self.body.advance(now)

    def _output(self, now: float) -> bytes:
        data, self._banner = self._banner, b""
        if now - self._commanded_at > self.heartbeat:
            self.commanded = (0.0, 0.0)
        self._drive(now)
        if self._flow and now >= self._due:
            self._due = now + max(self._interval, LOOP_INTERVAL)
            self.report_delay.put(now, self._report())
        return data + b"".join(self.report_delay.pop_due(now))

    def _drive(self, now: float) -> None:
        """Send the current setpoints to the simulated body, which would otherwise stop earlier than the rover."""
        velocity = self._wheels.velocity(*(speed / self._unit for speed in self.commanded))
        self.body.command(velocity.linear, velocity.angular, now)

    def _handle_line(self, line: bytes, now: float) -> bytes:
        try:
            command = json.loads(line)
            number = command["T"]
        except (ValueError, LookupError, TypeError):
            return b""
        echo = line + b"\n" if self._echo and self.echoes else b""
        value = command.get("cmd", 0)
        if number == wire.SPEED and all(isinstance(command.get(name), int | float) for name in "LR"):
            self._commanded_at = now
            if not self._encoders or max(abs(command["L"]), abs(command["R"])) <= wire.MAX_WHEEL_SPEED:
                self.commanded = (command["L"], command["R"])
        elif number == wire.HEARTBEAT:
            self.heartbeat = value / 1000
        elif number == wire.FLOW:
            self._flow = bool(value)
        elif number == wire.INTERVAL:
            self._interval = abs(value) / 1000
        elif number == wire.ECHO:
            self._echo = bool(value)
        elif number == wire.REPORT:
            return echo + self._report()
        return echo

    def _report(self) -> bytes:
        report = {"T": wire.FEEDBACK, **self.speeds, "r": 0.31, "p": -0.52, "y": "null", "v": BATTERY_VOLTAGE}
        return json.dumps(report, separators=(",", ":")).encode() + b"\r\n"

    @property
    def speeds(self) -> dict[str, float]:
        """Wheel speeds in m/s as the rover reports them: left ``L`` and right ``R``; zero without encoders."""
        if not self._encoders:
            return {"L": 0, "R": 0}
        left, right = self.body.wheel_encoders.speeds
        moves = Velocity((left + right) / 2, (right - left) / self.body.wheels.separation)
        return {name: round(speed, 4) for name, speed in zip("LR", self._wheels.rims(moves), strict=True)}


def make(keys: WaveshareKeys, context: SimContext) -> VirtualDevice:
    """Return the virtual Waveshare rover for its section of a robot file."""
    unit = 1.0 if keys.encoders else wire.FULL_POWER / keys.speed_at_full
    device = VirtualWaveshare(context.make_body(), track=keys.track, unit=unit, encoders=keys.encoders, baud=keys.baud)
    return make_virtual_base(device, "rover")
