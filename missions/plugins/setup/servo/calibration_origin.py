"""Which servos a calibration was measured on: kept beside its file, and compared before it is restored.

No servo has a serial number that its bus tells. So model, firmware and all settings are kept that a calibration does
not change, and the place where the servo stands has to lie within the range that is restored.
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
"""The registers that a calibration changes."""

NOT_COMPARED = (*CALIBRATION_REGISTERS, "baud")
"""The registers that do not tell one servo from another; the wrong rate would have been silence."""

IDENTITY_REGISTERS = ("model_number", "firmware")
"""The registers that no setting changes."""

POSITION_TOLERANCE = 60
"""Steps (5 degrees) by which a joint may stand beyond the ends that were touched."""

MAX_FILE_BYTES = 1_000_000
"""Bytes that the file may have."""

RegisterValues = Mapping[str, Mapping[str, int]]
"""The settings of each servo, by joint and register."""


def origin_file(path: Path) -> Path:
    """Return the file beside a calibration file that says which servos it is of."""
    return path.with_name(f"{path.stem}.servos.json")


def read_settings(bus: ServoBus, joints: Iterable[Joint]) -> dict[str, dict[str, int]]:
    """Read what tells the servos of joints from others. Raises NoReply, NotConnected, BadRequest."""
    found = {}
    for joint in joints:
        registers = [each for each in joint.model.table.registers.values() if each.eeprom]
        data = bus.read_block(joint.address, 0, max(each.end for each in registers))
        found[joint.name] = {each.name: each.decode(data) for each in registers if each.name not in NOT_COMPARED}
    return found


def settings_text(settings: RegisterValues) -> str:
    """Return the file."""
    return json.dumps(settings, indent=2) + "\n"


def load_settings(path: Path) -> RegisterValues:
    """Read the file; return no settings if there is no file: LeRobot's calibrations have none.

    Raises BadRequest for a file that cannot be read or has not the form of ``settings_text``, so that no damage to it switches
    the comparison off.
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
        if not S_ISREG(found.st_mode) or found.st_size > MAX_FILE_BYTES:  # a pipe would be waited for
            raise ValueError(f"not a regular file of at most {MAX_FILE_BYTES} bytes")
        return _validate(json.loads(read_regular_text(file)))
    except (OSError, ValueError, RecursionError) as error:
        raise _unreadable_error(file, error) from error


def _validate(content: Any) -> RegisterValues:
    """Return the content of a file as settings. Raises ValueError."""
    if not isinstance(content, dict) or not content:
        raise ValueError("no servos in it")
    for name, each in content.items():
        if not isinstance(each, dict) or not all(type(value) is int for value in each.values()):
            raise ValueError(f"'{name:.40}' has no settings of a servo")
        if missing := [word for word in IDENTITY_REGISTERS if word not in each]:
            raise ValueError(f"'{name:.40}' has no {', '.join(missing)}")
    return content


def _unreadable_error(file: Path, error: Exception) -> BadRequest:
    why = (error.strerror if isinstance(error, OSError) else None) or str(error)
    name, bad = shlex.quote(str(file)), shlex.quote(f"{file}.bad")
    return BadRequest(
        f"{file}: it is not known of which servos the calibration is: {why}",
        hint=f"mission servo home --restore --other-servos  restores without the comparison; "
        f"before you calibrate anew: mv {name} {bad}",
    )


def describe_lost_calibration(bus: ServoBus, joints: Iterable[Joint], file: Path) -> str:
    """Say which other calibration file of LeRobot's will fit no more once these servos are set; empty for none.

    Raises NoReply, NotConnected, BadRequest.
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
    return f"they are calibrated by LeRobot: {found[0]} will not fit them any more"


def require_same_models(before: RegisterValues, now: RegisterValues) -> None:
    """Raise DeviceFault where a servo is of another model, or has another firmware, than the calibration's."""
    wrong = [
        f"{name}: {word.replace('_', ' ')} {now[name][word]}, the calibration is of {value}"
        for name, settings in before.items()
        for word, value in settings.items()
        if name in now and word in IDENTITY_REGISTERS and now[name].get(word) != value
    ]
    if wrong:
        raise DeviceFault(
            f"these are not the servos that the calibration came from: {'; '.join(wrong)}",
            hint="name the calibration file of these servos: --into FILE",
        )


def find_doubts(
    bus: ServoBus, calibrations: Mapping[Joint, MotorCalibration], before: RegisterValues, now: RegisterValues
) -> list[str]:
    """Return what speaks against these being the servos of the calibration, a line for each joint that is concerned.

    Raises NoReply, NotConnected, BadRequest.
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
