"""Protocol of Waveshare's rovers, both directions: one JSON object per line. No I/O.

Source: the vendor's firmware, ``json_cmd.h`` (the values of ``T``), ``uart_ctrl.h`` (execution and echo of a line),
``movtion_module.h`` (speeds, heartbeat) and ``ugv_advance.h`` (``baseInfoFeedback``) of the repositories
waveshareteam/ugv_base_general (WAVE ROVER) and waveshareteam/ugv_base_ros (UGV).

The key ``T`` of a line is the number of the command or report. To the rover: ``1`` sets the wheel speeds, ``130``
requests one report, ``131`` switches periodic reports, ``142`` sets their interval in milliseconds, ``143`` switches
the echo of valid lines, and ``136`` sets the milliseconds without a speed after which the rover stops. From the rover:
``1001``, with the wheel speeds ``L`` and ``R`` and the battery voltage ``v``, and values of its IMU; echoes; and lines
of text at boot.

A line has no checksum: a damaged digit makes another number. So a reader must compare several reports.
"""

import json
from dataclasses import dataclass
from typing import Any

SPEED, HEARTBEAT, REPORT, FLOW, INTERVAL, ECHO = 1, 136, 130, 131, 142, 143
FEEDBACK = 1001

FULL_POWER = 0.5
"""Setpoint for full power on a rover without encoders: the firmware multiplies it by 512 for an 8-bit PWM."""

MAX_WHEEL_SPEED = 2.0
"""Maximum wheel speed in m/s of a rover with encoders; it ignores higher setpoints."""

MAX_VALUE = 10_000.0
"""Maximum absolute value of a number in a valid report."""

MAX_VOLTS = 50.0
"""Voltage in volts above which the reported number is taken for hundredths of a volt.

Later versions of the firmware report hundredths of a volt.
"""


@dataclass(frozen=True, slots=True)
class WaveshareFeedback:
    """Report of the rover: speeds of the ``left`` and ``right`` wheel, and ``volts`` of the battery.

    The speeds are m/s with encoders. Without encoders firmware reports PWM or nothing, so they are meaningless.
    """

    left: float
    right: float
    volts: float


@dataclass(frozen=True, slots=True)
class WaveshareEcho:
    """Echo of a valid line, which the rover sends."""

    line: bytes


def command(number: int, **fields: float) -> bytes:
    """Return the line of a command. Integers are written as they are, other numbers with three decimal places."""
    pairs = (f',"{name}":{value if isinstance(value, int) else f"{value:.3f}"}' for name, value in fields.items())
    return f'{{"T":{number}{"".join(pairs)}}}\n'.encode()


def speeds(left: float, right: float) -> bytes:
    """Return the line that sets the speeds of both wheels."""
    return command(SPEED, L=float(left), R=float(right))


def parse_line(line: bytes) -> WaveshareFeedback | WaveshareEcho | None:
    """Return the message of a line from the rover; None for a message that the driver does not use.

    Raises ValueError for invalid JSON.
    """
    try:
        message = json.loads(line.decode("ascii"), parse_constant=_refuse)
    except (RecursionError, UnicodeDecodeError) as error:
        raise ValueError("no line of a rover") from error
    if not isinstance(message, dict) or type(message.get("T")) is not int:
        raise ValueError("no object with a T")
    if message["T"] != FEEDBACK:
        return WaveshareEcho(line)
    volts = _read_number(message, "v")
    return WaveshareFeedback(
        _read_number(message, "L"), _read_number(message, "R"), volts / 100 if volts > MAX_VOLTS else volts
    )


def _read_number(message: dict[str, Any], name: str) -> float:
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MAX_VALUE:
        raise ValueError(f"{name} is not a valid number")
    return float(value)


def _refuse(word: str) -> float:
    raise ValueError(f"{word} is not a valid number")
