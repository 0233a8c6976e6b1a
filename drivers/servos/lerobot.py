"""LeRobot's calibration files on this computer, and the search for the one that a servo was calibrated with."""

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

MAX_FILES, MAX_FILE_BYTES = 500, 100_000
"""Maximum number of calibration files that are read, and maximum size of one in bytes."""


class CalibrationSettings(NamedTuple):
    """Settings that a calibration writes into the EEPROM of a servo, in steps."""

    offset: int
    low: int
    high: int


def calibration_folder() -> Path:
    """Return LeRobot's calibration folder, from the environment variables that it uses."""
    if own := os.environ.get("HF_LEROBOT_CALIBRATION"):
        return Path(own).expanduser()
    if home := os.environ.get("HF_LEROBOT_HOME"):
        return Path(home).expanduser() / "calibration"
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    hub = os.environ.get("HF_HOME") or f"{cache}/huggingface"
    return Path(hub).expanduser() / "lerobot" / "calibration"


def find_calibrations() -> Iterator[tuple[Path, Mapping[int, tuple[str, CalibrationSettings]]]]:
    """Yield the readable calibration files, newest first, each with name and settings of its motors by ID."""
    try:
        files = [
            path
            for path in calibration_folder().glob("*/*/*.json")
            if path.is_file() and path.stat().st_size <= MAX_FILE_BYTES
        ]
        files.sort(key=lambda path: -path.stat().st_mtime)
    except (OSError, RuntimeError):  # no home folder
        return
    for path in files[:MAX_FILES]:
        try:
            told = json.loads(path.read_text(encoding="utf-8"))
            motors = {each["id"]: (name, _settings(each)) for name, each in told.items()}
        except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
            continue  # another file, or an older format
        yield path, motors


def _settings(motor: Mapping[str, int]) -> CalibrationSettings:
    return CalibrationSettings(motor["homing_offset"], motor["range_min"], motor["range_max"])


def match_calibration(servos: Mapping[int, CalibrationSettings]) -> tuple[str, Mapping[int, str]] | None:
    """Return the file that has the settings of all ``servos``, and the motor names by ID; None if there is none."""
    for path, motors in find_calibrations():
        if servos and all(number in motors and motors[number][1] == held for number, held in servos.items()):
            return home_relative(path), {number: motors[number][0] for number in servos}
    return None


def is_wheel(motor: str) -> bool:
    """True if a motor is a wheel by its name, as those of the base of a LeKiwi are."""
    return "wheel" in motor.lower()


def home_relative(path: Path) -> str:
    """Return a path as robot files name it: with ``~`` if it is in the home folder."""
    try:
        return f"~/{path.relative_to(Path.home())}"
    except (ValueError, RuntimeError):
        return str(path)
