"""Protocol between a driver and an actuator guardian, both directions. Pure.

A guardian has two actuators: two wheels (thousandths of full power, backwards negative), or two servos (whole degrees).
``?`` requests a report; ``g BOOT FIRST SECOND`` sets both; the guardian replies ``r BOOT FIRST SECOND``: the current
values, ``-1`` for a servo without a pulse so far. ``BOOT`` is a new number at each start, and commands with another
number are ignored, so that commands from before a restart move nothing.

``*`` precedes the CRC-16 of the text before it (CCITT, from 0xFFFF), as four hexadecimal digits.
"""

from binascii import crc_hqx
from dataclasses import dataclass

BAUD = 57_600

WATCHDOG_TIMEOUT = 0.3
"""Seconds without a line after which a guardian stops its actuators."""

FULL_POWER = 1000
"""Value for full power of a wheel."""

UNKNOWN_ANGLE = -1
"""Angle of a servo without a pulse so far."""

MAX_LINE_LENGTH = 40
"""Maximum bytes of a line, except for the last error message."""

VALUE_RANGE = range(-9999, 32768)


@dataclass(frozen=True, slots=True)
class GuardianCommand:
    """Command to a guardian: setpoints of both actuators."""

    boot: int
    first: int
    second: int


@dataclass(frozen=True, slots=True)
class GuardianReport:
    """Report of a guardian: current values of both actuators."""

    boot: int
    first: int
    second: int


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """Request for a report of a guardian."""


def _make_line(body: str) -> bytes:
    data = body.encode()
    return data + b"*%04X\n" % crc_hqx(data, 0xFFFF)


REPORT_REQUEST = _make_line("?")


def pack_command(boot: int, first: int, second: int) -> bytes:
    """Return the line that sets both actuators of a guardian."""
    return _make_line(f"g {boot} {first} {second}")


def pack_report(boot: int, first: int, second: int) -> bytes:
    """Return the line that reports both actuators of a guardian."""
    return _make_line(f"r {boot} {first} {second}")


def parse_line(line: bytes) -> GuardianCommand | GuardianReport | ReportRequest:
    """Return the message of a line. Raises ValueError for an invalid or damaged line."""
    body, separator, checksum = line.rpartition(b"*")
    if not separator or len(line) > MAX_LINE_LENGTH or checksum != b"%04X" % crc_hqx(body, 0xFFFF):
        raise ValueError("no line of a keeper")
    if body == b"?":
        return ReportRequest()
    word, *values = body.split(b" ")
    if word not in (b"g", b"r") or len(values) != 3:
        raise ValueError("no line of a keeper")
    boot, first, second = map(int, values)
    if not all(value in VALUE_RANGE for value in (boot, first, second)):
        raise ValueError("no figures of a keeper")
    return (GuardianCommand if word == b"g" else GuardianReport)(boot, first, second)
