"""The lines of Waveshare's rovers, both ways: one JSON object each. Pure.

Read from the vendor's own firmware: ``json_cmd.h`` (the numbers of ``T``), ``uart_ctrl.h`` (what is done with a line,
and that it is echoed), ``movtion_module.h`` (speeds, heartbeat) and ``ugv_advance.h`` (``baseInfoFeedback``) of the
repositories waveshareteam/ugv_base_general (WAVE ROVER) and waveshareteam/ugv_base_ros (UGV).

To the rover: ``1`` how fast the wheels are to turn, ``130`` asks for one report, ``131`` has it report by itself,
``142`` how many milliseconds lie between such reports, ``143`` whether it echoes each line that it understands, ``136``
after how many milliseconds without a speed it stops. From it: ``1001``, with the speeds ``L`` and ``R`` of the wheels
and the voltage ``v`` of its battery, beside figures of its IMU; echoes; and at its start lines of text.

A line has no checksum: a digit that is garbled on its way makes another number. Who reads must have several agree.
"""

import json
from dataclasses import dataclass
from typing import Any

SPEED, HEARTBEAT, REPORT, FLOW, INTERVAL, ECHO = 1, 136, 130, 131, 142, 143
FEEDBACK = 1001

FULL_POWER = 0.5
"""What stands for full power on a rover without encoders: its firmware makes PWM of it, 512 for 1, of 8 bits."""

MAX_WHEEL_SPEED = 2.0
"""m/s of a wheel that a rover with encoders takes at most; more it ignores."""

MAX_VALUE = 10_000.0
"""No figure of a report is larger."""

MAX_VOLTS = 50.0
"""A voltage above is in hundredths of a volt, as later firmware has it: no rover has so many volts."""


@dataclass(frozen=True, slots=True)
class WaveshareFeedback:
    """One report: the ``left`` and ``right`` wheel as the rover tells them, and the ``volts`` of its battery.

    The speeds are m/s where there are encoders. Without, firmware tells PWM or nothing: they mean nothing.
    """

    left: float
    right: float
    volts: float


@dataclass(frozen=True, slots=True)
class WaveshareEcho:
    """A line of ours that the rover has understood, as it gave it back."""

    line: bytes


def command(number: int, **fields: float) -> bytes:
    """Return one line to the rover; whole numbers as they are, others with three digits."""
    words = (f',"{name}":{value if isinstance(value, int) else f"{value:.3f}"}' for name, value in fields.items())
    return f'{{"T":{number}{"".join(words)}}}\n'.encode()


def speeds(left: float, right: float) -> bytes:
    """Return the line that sets both wheels."""
    return command(SPEED, L=float(left), R=float(right))


def parse_line(line: bytes) -> WaveshareFeedback | WaveshareEcho | None:
    """Return what a line of the rover says; None for one that says nothing of use. Raises ValueError for no JSON."""
    try:
        found = json.loads(line.decode("ascii"), parse_constant=_refuse)
    except (RecursionError, UnicodeDecodeError) as error:
        raise ValueError("no line of a rover") from error
    if not isinstance(found, dict) or type(found.get("T")) is not int:
        raise ValueError("no object with a T")
    if found["T"] != FEEDBACK:
        return WaveshareEcho(line)
    volts = _read_number(found, "v")
    return WaveshareFeedback(
        _read_number(found, "L"), _read_number(found, "R"), volts / 100 if volts > MAX_VOLTS else volts
    )


def _read_number(message: dict[str, Any], name: str) -> float:
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MAX_VALUE:
        raise ValueError(f"{name} is no figure")
    return float(value)


def _refuse(word: str) -> float:
    raise ValueError(f"{word} is no figure")
