"""LeRobot's calibration files on this computer, and those that the settings of a servo come from."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from drivers.errors import BadRequest
from drivers.feetech.calibration import MotorCalibration, load

MAX_FILES = 500
"""Calibration files that are looked at."""


class Calibrated(NamedTuple):
    """What calibrating sets in the EEPROM of a servo, in steps."""

    offset: int
    low: int
    high: int


def folder() -> Path:
    """Return where LeRobot keeps its calibrations, by the environment variables that it heeds."""
    if own := os.environ.get("HF_LEROBOT_CALIBRATION"):
        return Path(own).expanduser()
    if home := os.environ.get("HF_LEROBOT_HOME"):
        return Path(home).expanduser() / "calibration"
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    hub = os.environ.get("HF_HOME") or f"{cache}/huggingface"
    return Path(hub).expanduser() / "lerobot" / "calibration"


def calibrations() -> Iterator[tuple[Path, Mapping[str, MotorCalibration]]]:
    """Yield the calibration files that can be read, the newest first."""
    try:
        found = sorted(folder().glob("*/*/*.json"), key=lambda path: -path.stat().st_mtime)[:MAX_FILES]
    except OSError:
        return
    for path in found:
        try:
            yield path, load(str(path))
        except BadRequest:
            continue


def calibration_of(servos: Mapping[int, Calibrated]) -> tuple[str, Mapping[str, MotorCalibration]] | None:
    """Return the file, and what it says, whose motors have the IDs and settings of all ``servos``; None without one."""
    for path, motors in calibrations():
        told = {each.id: Calibrated(each.homing_offset, each.range_min, each.range_max) for each in motors.values()}
        if servos and servos.items() <= told.items():
            return shown(path), motors
    return None


def shown(path: Path) -> str:
    """Return a path as a robot file may name it, short where it is in the home folder."""
    try:
        return f"~/{path.relative_to(Path.home())}"
    except (ValueError, RuntimeError):
        return str(path)
