"""Protocol between a driver and an actuator guardian, in both directions: lines of text. No I/O.

A guardian has two actuators: two wheels (thousandths of full power, backwards negative), or two servos (whole degrees).
The line ``?`` requests a report, ``g BOOT FIRST SECOND`` sets both actuators. The guardian replies ``r BOOT FIRST
SECOND`` with the current values; ``-1`` is a servo that has had no pulse so far. The guardian chooses a new number
``BOOT`` at each start, and ignores commands with another number, so that commands from before a restart move nothing.

Each line ends with ``*`` and the CRC-16 (CCITT, initial value 0xFFFF) of the text before it, as four hexadecimal
digits.
"""

from binascii import crc_hqx
from dataclasses import dataclass

BAUD = 57_600

WATCHDOG_TIMEOUT = 0.3
"""Seconds without a line after which a guardian stops its actuators."""

FULL_POWER = 1000
"""Value in the protocol for full power of a wheel."""

UNKNOWN_ANGLE = -1
"""Angle in the protocol of a servo that has had no pulse so far."""

MAX_LINE_LENGTH = 40
"""Maximum bytes of a line of the protocol. An error message, with which a guardian may end, may be longer."""

VALUE_RANGE = range(-9999, 32768)


@dataclass(frozen=True, slots=True)
class GuardianCommand:
    """Command to a guardian: setpoints of both actuators, and the guardian's boot number."""

    boot: int
    first: int
    second: int


@dataclass(frozen=True, slots=True)
class GuardianReport:
    """Report of a guardian: current values of both actuators, and its boot number."""

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
