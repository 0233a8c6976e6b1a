"""Servo calibration files in LeRobot's format: ID, offset and range of each motor, as JSON.

::

    {"elbow_flex": {"id": 3, "drive_mode": 0, "homing_offset": -1024, "range_min": 885, "range_max": 3091}}

A servo reports its position minus ``homing_offset`` (steps, register ``position_offset``), so that the middle of its
joint is near step 2047. The range is in reported steps. ``drive_mode`` is 1 if the joint turns the other way.
"""

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from stat import S_ISREG
from types import MappingProxyType

from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest
from drivers.servos.models import MODELS
from drivers.servos.register import Register

_TABLE = MODELS["STS3215"].table
LAST_STEP = MODELS["STS3215"].last_tick
"""Highest position step in one turn of an STS3215."""

HALF_TURN = 2047
"""Step that LeRobot maps to the middle of a joint."""


@dataclass(frozen=True, slots=True)
class MotorCalibration:
    """Calibration of one motor, in the fields of the file."""

    id: int
    drive_mode: int
    homing_offset: int
    range_min: int
    range_max: int


_OFFSET: Register = _TABLE["position_offset"]
_BOUNDS: Mapping[str, tuple[int, int]] = MappingProxyType(
    {
        "id": (0, 253),
        "drive_mode": (0, 1),
        "homing_offset": (_OFFSET.lower, _OFFSET.upper),
        "range_min": (0, LAST_STEP),
        "range_max": (0, LAST_STEP),
    }
)


OLD_KEYS = frozenset({"motor_names", "homing_offset", "drive_mode", "start_pos", "end_pos"})
"""Keys of LeRobot's calibration files until June 2025, in which each key had a list with one value for each motor."""

OLD_FORMAT_MESSAGE = "LeRobot's format from before June 2025, whose offsets are not stored in the servos: not supported"

MAX_FILE_BYTES = 1_000_000
"""Largest calibration file that is read."""


def load_calibration(path: str) -> Mapping[str, MotorCalibration]:
    """Read a calibration file. Raises BadRequest that lists all errors by motor and field."""
    file = Path(path).expanduser()
    try:
        found = file.stat()
        if not S_ISREG(found.st_mode) or found.st_size > MAX_FILE_BYTES:  # a pipe would block
            raise OSError(f"not a regular file of at most {MAX_FILE_BYTES} bytes")
        return _load_cached(str(file), found.st_mtime_ns, found.st_size)
    except OSError as error:
        hint = "name the file as `ls` shows it; LeRobot's are in ~/.cache/huggingface/lerobot/calibration"
        raise BadRequest(f"calibration {path}: {error.strerror or error}", hint=hint) from error


@lru_cache(maxsize=8)
def _load_cached(path: str, *_: int) -> Mapping[str, MotorCalibration]:
    try:
        told = json.loads(Path(path).read_text(encoding="utf-8"), object_pairs_hook=_reject_duplicates)
    except (ValueError, RecursionError) as error:  # a number of 5000 digits, deep nesting
        raise BadRequest(f"calibration {path}: invalid JSON: {error}") from error
    if not isinstance(told, dict) or not told:
        raise BadRequest(f"calibration {path}: no motors", hint='{"elbow_flex": {"id": 3, ...}}')
    if told.keys() >= OLD_KEYS:
        raise BadRequest(
            f"calibration {path}: {OLD_FORMAT_MESSAGE}",
            hint="calibrate the arm with a current lerobot-calibrate, and name its file",
        )
    faults = [fault for motor, each in told.items() for fault in _entry_errors(motor, each)]
    if faults:
        raise BadRequest(
            f"calibration {path}: {'; '.join(faults)}",
            hint="copy the file again from where the arm was calibrated, or remove `calibration`",
        )
    return MappingProxyType({motor: MotorCalibration(**{f: each[f] for f in _BOUNDS}) for motor, each in told.items()})


def _reject_duplicates(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Return the entries of a JSON object. Raises ValueError for duplicate keys."""
    twice = [name for name, count in Counter(name for name, _ in pairs).items() if count > 1]
    if twice:
        raise ValueError(f"duplicate key {' and '.join(repr(name) for name in twice)}")
    return dict(pairs)


def _entry_errors(motor: str, entry: object) -> Iterable[str]:
    """Yield the errors in the entry of one motor."""
    if not isinstance(entry, dict):
        yield f"motor '{motor}' needs {', '.join(_BOUNDS)}, not {entry!r}"
        return
    wrong = False
    for field, (low, high) in _BOUNDS.items():
        value = entry.get(field)
        if field not in entry:
            yield f"motor '{motor}' lacks '{field}'"
        elif isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            yield f"motor '{motor}': '{field}' must be a whole number from {low} to {high}, not {value!r}"
        else:
            continue
        wrong = True
    if not wrong and entry["range_min"] >= entry["range_max"]:
        yield f"motor '{motor}': 'range_min' {entry['range_min']} must be below 'range_max' {entry['range_max']}"


def format_calibration(motors: Mapping[str, MotorCalibration]) -> str:
    """Return the text of a calibration file."""
    fields = {motor: {field: getattr(each, field) for field in _BOUNDS} for motor, each in motors.items()}
    return json.dumps(fields, indent=4) + "\n"
