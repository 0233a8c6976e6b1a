"""The lines between a driver and a keeper, both ways. Pure.

A keeper has two actuators: two wheels (thousandths of full power, backwards negative), or two servos (whole degrees).
``?`` asks it how they are; ``g BOOT FIRST SECOND`` sends them somewhere; it says ``r BOOT FIRST SECOND`` when it is
asked: where they are now, ``-1`` for a servo that has got no pulse yet. ``BOOT`` is another number after each start,
and what is sent for another one is not obeyed: so nothing of before moves a keeper that has begun anew.

Behind ``*`` stands the CRC-16 of what is before it (CCITT, from 0xFFFF), as four hexadecimal digits.
"""

from binascii import crc_hqx
from dataclasses import dataclass

BAUD = 57_600

WATCHDOG_TIMEOUT = 0.3
"""Seconds without a line after which a keeper lets its actuators rest."""

FULL_POWER = 1000
"""What stands for full power of a wheel."""

UNKNOWN_ANGLE = -1
"""Where a servo is that has got no pulse yet."""

MAX_LINE_LENGTH = 40
"""Bytes of a line at most, but for the last words."""

VALUE_RANGE = range(-9999, 32768)


@dataclass(frozen=True, slots=True)
class GuardianCommand:
    """Send both to somewhere."""

    boot: int
    first: int
    second: int


@dataclass(frozen=True, slots=True)
class GuardianReport:
    """Where both are."""

    boot: int
    first: int
    second: int


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """How are they?"""


def _make_line(body: str) -> bytes:
    data = body.encode()
    return data + b"*%04X\n" % crc_hqx(data, 0xFFFF)


REPORT_REQUEST = _make_line("?")


def pack_command(boot: int, first: int, second: int) -> bytes:
    """Return the line that sends both."""
    return _make_line(f"g {boot} {first} {second}")


def pack_report(boot: int, first: int, second: int) -> bytes:
    """Return the line that says where both are."""
    return _make_line(f"r {boot} {first} {second}")


def parse_line(line: bytes) -> GuardianCommand | GuardianReport | ReportRequest:
    """Return what a line says. Raises ValueError for one that says nothing, or was damaged."""
    body, star, told = line.rpartition(b"*")
    if not star or len(line) > MAX_LINE_LENGTH or told != b"%04X" % crc_hqx(body, 0xFFFF):
        raise ValueError("no line of a keeper")
    if body == b"?":
        return ReportRequest()
    word, *figures = body.split(b" ")
    if word not in (b"g", b"r") or len(figures) != 3:
        raise ValueError("no line of a keeper")
    boot, first, second = map(int, figures)
    if not all(figure in VALUE_RANGE for figure in (boot, first, second)):
        raise ValueError("no figures of a keeper")
    return (GuardianCommand if word == b"g" else GuardianReport)(boot, first, second)
