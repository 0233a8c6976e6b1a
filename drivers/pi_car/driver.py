"""Protocol of two motors behind an actuator guardian, for ``drivers.base.diff_drive.DiffDriveBase``.

The car has no sensors, so its pose is dead reckoning.
"""

from collections.abc import Callable, Mapping
from math import inf

from drivers.api import Velocity
from drivers.base.diff_drive import DiffDriveProtocol, ParsedReports
from drivers.base.reckoning import TwoWheels, WheelOdometry
from drivers.transport import guardian_wire
from drivers.transport.lines import LineFinder

QUERY_INTERVAL = 0.02
"""Seconds between two requests for a report; the setpoint is sent again after each report."""


class GuardianProtocol(DiffDriveProtocol):
    """Protocol of two motors behind an actuator guardian; the pose is dead reckoning.

    Commands are shares of full power. ``track`` is the distance of the wheels in metres, ``speed_at_full`` the speed of
    a wheel at full power in m/s. ``offline_reason`` returns why the guardian does not reply, or an empty text if that
    is not known; ``hint`` is the hint for it.
    """

    def __init__(
        self, track: float, speed_at_full: float, *, offline_reason: Callable[[], str] = str, hint: str = ""
    ) -> None:
        self._odometry = WheelOdometry(TwoWheels(track, speed_at_full), measured=False)
        self._get_offline_reason, self._hint = offline_reason, hint
        self._malformed = self._reports = 0
        self.restart()

    def restart(self) -> None:
        self._lines = LineFinder()
        self._boot: int | None = None
        self._queried_at = -inf
        self._odometry.pause()

    def greet(self) -> bytes:
        return guardian_wire.REPORT_REQUEST

    def query(self, now: float) -> bytes:
        if now - self._queried_at < QUERY_INTERVAL:
            return b""
        self._queried_at = now
        return guardian_wire.REPORT_REQUEST

    def parse(self, data: bytes, now: float) -> ParsedReports:
        parsed = ParsedReports()
        for line in self._lines.feed(data):
            try:
                message = guardian_wire.parse_line(line)
            except ValueError:
                self._malformed += 1
                continue
            if isinstance(message, guardian_wire.GuardianReport):
                if self._boot not in (None, message.boot):
                    parsed.restarted = ("the guardian of the motors restarted", self._hint)
                self._boot = message.boot
                self._reports += 1
                parsed.states.append(self._odometry.report(now, None))
        return parsed

    def drive(self, velocity: Velocity, now: float) -> bytes:
        left, right = self._odometry.send(velocity, now)
        if self._boot is None:  # a guardian obeys only commands with its own boot number
            return b""
        full = guardian_wire.FULL_POWER / self._odometry.wheels.fastest
        return guardian_wire.pack_command(self._boot, round(left * full), round(right * full))

    def counters(self) -> Mapping[str, int]:
        return {"reports": self._reports, "malformed": self._malformed}

    def offline_reason(self, now: float, where: str, baud: int, *, silent: bool) -> tuple[str, str]:
        del now, baud, silent
        return (
            f"{where}: {self._get_offline_reason() or 'open, but no reply from the guardian of the motors'}",
            self._hint,
        )
