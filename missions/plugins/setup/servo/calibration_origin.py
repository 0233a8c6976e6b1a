"""Identity of calibrated servos: stored beside the calibration file, and compared before that calibration is restored.

Servos report no serial number. So model, firmware and all settings that a calibration does not change are compared. The
position of each servo must lie within the restored range.
"""

import json
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from stat import S_ISREG
from typing import Any

from config.file_io import read_regular_text
from drivers.errors import BadRequest, DeviceFault
from drivers.servos.bus import ServoBus
from drivers.servos.calibration import LAST_STEP, MotorCalibration
from drivers.servos.joint import Joint
from drivers.servos.lerobot import CalibrationSettings, match_calibration

CALIBRATION_REGISTERS = ("position_offset", "min_position", "max_position")
"""Servo registers that a calibration changes."""

NOT_COMPARED = (*CALIBRATION_REGISTERS, "baud")
"""Servo registers that are not compared to recognise a servo.

A calibration changes them; the baud rate must be right anyway, or the servo would not reply.
"""

IDENTITY_REGISTERS = ("model_number", "firmware")
"""Servo registers that no setting changes."""

POSITION_TOLERANCE = 60
"""Steps (60 are 5 degrees) by which a joint may be outside its calibrated range and still count as the calibrated one.
"""

MAX_FILE_BYTES = 1_000_000
"""Maximum size in bytes of the file that identifies calibrated servos."""

RegisterValues = Mapping[str, Mapping[str, int]]
"""Register values of several servos, by joint and register name."""


def origin_file(path: Path) -> Path:
    """Return the file beside a calibration file that identifies its servos."""
    return path.with_name(f"{path.stem}.servos.json")


def read_settings(bus: ServoBus, joints: Iterable[Joint]) -> dict[str, dict[str, int]]:
    """Read the registers that identify the servos of joints. Raises NoReply, NotConnected, BadRequest."""
    found = {}
    for joint in joints:
        registers = [each for each in joint.model.table.registers.values() if each.eeprom]
        data = bus.read_block(joint.address, 0, max(each.end for each in registers))
        found[joint.name] = {each.name: each.decode(data) for each in registers if each.name not in NOT_COMPARED}
    return found


def settings_text(settings: RegisterValues) -> str:
    """Return the settings of servos as the text of the file beside the calibration file."""
    return json.dumps(settings, indent=2) + "\n"


def load_settings(path: Path) -> RegisterValues:
    """Return the servo settings stored in the file beside the calibration file ``path``; empty without such a file.

    Calibrations made by LeRobot have no such file. Raises BadRequest for an unreadable or malformed file, so that a
    damaged file does not skip the comparison.
    """
    file = origin_file(path)
    try:
        file.lstat()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise _unreadable_error(file, error) from error
    try:
        found = file.stat()
        if not S_ISREG(found.st_mode) or found.st_size > MAX_FILE_BYTES:  # reading a pipe would block
            raise ValueError(f"not a regular file of at most {MAX_FILE_BYTES} bytes")
        return _validate(json.loads(read_regular_text(file)))
    except (OSError, ValueError, RecursionError) as error:
        raise _unreadable_error(file, error) from error


def _validate(content: Any) -> RegisterValues:
    """Return the JSON content of the file that identifies servos as their settings. Raises ValueError."""
    if not isinstance(content, dict) or not content:
        raise ValueError("no servos in it")
    for name, each in content.items():
        if not isinstance(each, dict) or not all(type(value) is int for value in each.values()):
            raise ValueError(f"'{name:.40}' has no settings of a servo")
        if missing := [word for word in IDENTITY_REGISTERS if word not in each]:
            raise ValueError(f"joint '{name:.40}' lacks {', '.join(missing)}")
    return content


def _unreadable_error(file: Path, error: Exception) -> BadRequest:
    why = (error.strerror if isinstance(error, OSError) else None) or str(error)
    name, bad = shlex.quote(str(file)), shlex.quote(f"{file}.bad")
    return BadRequest(
        f"{file}: the servos of this calibration are unknown: {why}",
        hint=f"mission servo home --restore --other-servos  restores without the comparison; "
        f"before you calibrate again: mv {name} {bad}",
    )


def describe_lost_calibration(bus: ServoBus, joints: Iterable[Joint], file: Path) -> str:
    """Return a warning if writing the calibration ``file`` makes another calibration file useless; else an empty text.

    That is so if the joints' servos now have the values of another file that LeRobot has stored. Raises NoReply,
    NotConnected, BadRequest.
    """
    held = {
        joint.spec.id: CalibrationSettings(
            *(bus.read(joint.address, joint.model.table[name]) for name in CALIBRATION_REGISTERS)
        )
        for joint in joints
    }
    found = match_calibration(held)
    if found is None or Path(found[0]).expanduser().resolve() == file.expanduser().resolve():
        return ""
    return f"they are calibrated by LeRobot: {found[0]} will no longer match them"


def require_same_models(before: RegisterValues, now: RegisterValues) -> None:
    """Raise DeviceFault if the model or firmware of a servo differs from that of the servo that was calibrated.

    ``before`` are the settings of the calibrated servos, ``now`` those of the connected servos.
    """
    wrong = [
        f"{name}: {word.replace('_', ' ')} {now[name][word]}, the calibration is of {value}"
        for name, settings in before.items()
        for word, value in settings.items()
        if name in now and word in IDENTITY_REGISTERS and now[name].get(word) != value
    ]
    if wrong:
        raise DeviceFault(
            f"these are not the servos of the calibration: {'; '.join(wrong)}",
            hint="name the calibration file of these servos: --into FILE",
        )


def find_doubts(
    bus: ServoBus, calibrations: Mapping[Joint, MotorCalibration], before: RegisterValues, now: RegisterValues
) -> list[str]:
    """Return a line for each joint whose servo may be another one than the servo that was calibrated.

    ``before`` are the settings of the calibrated servos, ``now`` those of the connected servos. A position outside the
    calibrated range causes a line too. Raises NoReply, NotConnected, BadRequest.
    """
    found = []
    for joint, each in calibrations.items():
        unlike = [
            f"{word} {now[joint.name].get(word)}, was {value}"
            for word, value in before.get(joint.name, {}).items()
            if now[joint.name].get(word) != value
        ]
        if unlike:
            found.append(f"{joint.title}: other settings than when it was calibrated ({', '.join(unlike)})")
        table = joint.model.table
        shown, offset = (
            bus.read(joint.address, table["present_position"]),
            bus.read(joint.address, table["position_offset"]),
        )
        place = (shown + offset - each.homing_offset) % (LAST_STEP + 1)
        if not each.range_min - POSITION_TOLERANCE <= place <= each.range_max + POSITION_TOLERANCE:
            ends = f"{each.range_min}..{each.range_max}"
            found.append(f"{joint.title}: by this calibration it stands at step {place}, beyond its range {ends}")
    return found
