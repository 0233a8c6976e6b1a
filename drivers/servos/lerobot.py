"""LeRobot's calibration files on this computer, and those that the settings of a servo come from."""

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

MAX_FILES, MAX_FILE_BYTES = 500, 100_000
"""How many calibration files are looked at, and the bytes of one."""


class CalibrationSettings(NamedTuple):
    """What calibrating sets in the EEPROM of a servo, in steps."""

    offset: int
    low: int
    high: int


def calibration_folder() -> Path:
    """Return where LeRobot keeps its calibrations, by the environment variables that it heeds."""
    if own := os.environ.get("HF_LEROBOT_CALIBRATION"):
        return Path(own).expanduser()
    if home := os.environ.get("HF_LEROBOT_HOME"):
        return Path(home).expanduser() / "calibration"
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    hub = os.environ.get("HF_HOME") or f"{cache}/huggingface"
    return Path(hub).expanduser() / "lerobot" / "calibration"


def find_calibrations() -> Iterator[tuple[Path, Mapping[int, tuple[str, CalibrationSettings]]]]:
    """Yield the calibration files that can be read, the newest first: names and settings of the motors by ID."""
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
            continue  # another file, or an older form
        yield path, motors


def _settings(motor: Mapping[str, int]) -> CalibrationSettings:
    return CalibrationSettings(motor["homing_offset"], motor["range_min"], motor["range_max"])


def match_calibration(servos: Mapping[int, CalibrationSettings]) -> tuple[str, Mapping[int, str]] | None:
    """Return the file whose motors have the settings of all ``servos``, by ID, and their names; None without one."""
    for path, motors in find_calibrations():
        if servos and all(number in motors and motors[number][1] == held for number, held in servos.items()):
            return home_relative(path), {number: motors[number][0] for number in servos}
    return None


def is_wheel(motor: str) -> bool:
    """Say whether a motor is a wheel by its name, as those of the base of a LeKiwi are."""
    return "wheel" in motor.lower()


def home_relative(path: Path) -> str:
    """Return a path as a robot file may name it, short where it is in the home folder."""
    try:
        return f"~/{path.relative_to(Path.home())}"
    except (ValueError, RuntimeError):
        return str(path)
