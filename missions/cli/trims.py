"""Keeping the trims of the head in the robot file of its owner."""

from dataclasses import replace
from math import isclose, radians
from pathlib import Path

from config.editing import NotEditableError, require_own, rewrite, with_value
from config.faults import InvalidFileError, Source
from config.marked import read_source
from config.robot import RobotConfig
from config.units import written
from drivers.arduino.declared import ArduinoKeys
from drivers.dynamixel.declared import NeckKeys
from missions.library.drivers import robot_of

AGAIN = "mission head trim --robot FILE --keep"


def check_keepable(path: Path) -> None:
    """Raise NotEditableError for a file in which no trim will be kept: better before the head was trimmed."""
    require_own(path, AGAIN)


def keep_trims(path: Path, *, pan: float, tilt: float) -> list[str]:
    """Write the trims of the head (radians) into a robot file; return what was changed, as "pan: trim: 3 deg".

    Nothing but these values is changed. Raises NotEditableError where that cannot be, InvalidFileError for a file that
    is no robot's, OSError.
    """
    check_keepable(path)
    source = read_source(path)
    old = robot_of(source)
    text, changes = source.text, []
    for axis, trim in (("pan", pan), ("tilt", tilt)):
        if not isclose(_trim(old, axis), trim, abs_tol=radians(0.001)):
            text = with_value(Source(source.name, text), ("head", axis, "trim"), written(trim, "angle"))
            changes.append(f"{axis}: trim: {written(trim, 'angle')}")
    if changes:
        if not _is_trimmed(Source(source.name, text), old, pan, tilt):
            what = "; ".join(changes)
            raise NotEditableError(f"{path}: it is written in a way that cannot be changed here; write {what}")
        rewrite(path, text)
    return changes


def _trim(robot: RobotConfig, axis: str) -> float:
    head = robot.head
    if not isinstance(head, ArduinoKeys | NeckKeys):
        raise NotEditableError(f"{robot.name} has no head to trim")
    return (head.pan if axis == "pan" else head.tilt).trim


def _is_trimmed(source: Source, old: RobotConfig, pan: float, tilt: float) -> bool:
    """Say whether the trims are all that differs in a new text: an anchor may stand for more than one value."""
    try:
        new = robot_of(source)
    except InvalidFileError:  # the anchor was lost
        return False
    wanted = zip(("pan", "tilt"), (pan, tilt), strict=True)
    right = all(isclose(_trim(new, axis), trim, abs_tol=radians(0.001)) for axis, trim in wanted)
    return right and _untrimmed(new) == _untrimmed(old)


def _untrimmed(robot: RobotConfig) -> RobotConfig:
    """Return the robot with straight servos, to compare the rest of it."""
    match robot.head:
        case ArduinoKeys(pan=servo, tilt=other) as head:
            straight: object = replace(head, pan=replace(servo, trim=0.0), tilt=replace(other, trim=0.0))
        case NeckKeys(pan=joint, tilt=second) as neck:
            straight = replace(neck, pan=replace(joint, trim=0.0), tilt=replace(second, trim=0.0))
        case _:
            return robot
    return robot.with_keys("head", straight)
