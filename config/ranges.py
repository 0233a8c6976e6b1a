"""Keeping how far the joints of an arm go, found out by hand, in the robot file of its owner."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isclose, radians
from pathlib import Path

from config.arm import JointConfig, Ticks, turned
from config.editing import NotEditableError, require_own, rewrite, with_value
from config.faults import InvalidFileError, Source
from config.marked import read_source
from config.robot import RobotConfig, robot_of
from config.servo import SERVO_MODELS
from config.units import written

AGAIN = "mission servo calibrate --robot FILE"


@dataclass(frozen=True, slots=True)
class Range:
    """How far a servo was turned, in its steps; ``zero`` is where it stood with its joint at 0, None to keep that."""

    lowest: int
    highest: int
    zero: int | None = None


def ranged(joint: JointConfig, found: Range) -> JointConfig:
    """Return the joint with its 0 and its limits as they were found."""
    model = SERVO_MODELS[joint.model]
    if joint.ticks is not None:
        ends = (found.highest, found.lowest) if joint.reverse else (found.lowest, found.highest)
        ticks = Ticks(joint.ticks.init if found.zero is None else found.zero, *ends)
        zero, reverse, lower, upper = turned(model, ticks)
        return replace(joint, zero=zero, reverse=reverse, lower=lower, upper=upper, ticks=ticks)
    zero = joint.zero if found.zero is None else model.angle(found.zero)
    way = -1 if joint.reverse else 1
    lower, upper = sorted((model.angle(end) - zero) * way for end in (found.lowest, found.highest))
    return replace(joint, zero=zero, lower=lower, upper=upper)


def check_keepable(path: Path) -> None:
    """Raise NotEditableError for a file in which no range will be kept: better before the arm was turned by hand."""
    require_own(path, AGAIN)


def keep_ranges(path: Path, ranges: Mapping[str, Range]) -> Path:
    """Write what was found of joints into a robot file, and nothing else; return where the file of before is kept.

    Raises NotEditableError where that cannot be, InvalidFileError for a file that is no robot's, OSError.
    """
    check_keepable(path)
    source = read_source(path)
    old = robot_of(source)
    if old.arm is None:
        raise NotEditableError(f"{old.name} has no arm")
    joints = dict(old.arm.joints)
    text = source.text
    for name, found in ranges.items():
        new = ranged(joints[name], found)
        for keys, value in _entries(joints[name], new).items():
            text = with_value(Source(source.name, text), ("arm", "joints", name, *keys), value)
        joints[name] = new
    wanted = replace(old, arm=replace(old.arm, joints=joints))
    if not _is(Source(source.name, text), wanted):
        raise NotEditableError(
            f"{path}: it is written in a way that cannot be changed here; write the figures yourself"
        )
    kept = _free(path)
    kept.write_bytes(path.read_bytes())
    rewrite(path, text)
    return kept


def _entries(old: JointConfig, new: JointConfig) -> dict[tuple[str, ...], str]:
    """Return what is to be written at which keys of a joint."""
    if old.ticks is not None and new.ticks is not None:
        return {("ticks", key): str(value) for key, value in new.ticks._asdict().items()}
    entries: dict[tuple[str, ...], str] = {} if new.zero == old.zero else {("zero",): written(new.zero, "angle")}
    entries["limits",] = f"[{written(new.lower, 'angle')}, {written(new.upper, 'angle')}]"
    return entries


def _is(source: Source, wanted: RobotConfig) -> bool:
    """Say whether a new text means the robot that it is to mean: an anchor may stand for more than one value."""
    try:
        new = robot_of(source)
    except InvalidFileError:
        return False
    if new.arm is None or wanted.arm is None or new.arm.joints.keys() != wanted.arm.joints.keys():
        return False
    same = all(_same(new.arm.joints[name], joint) for name, joint in wanted.arm.joints.items())
    return same and replace(new, arm=replace(new.arm, joints={})) == replace(wanted, arm=replace(wanted.arm, joints={}))


def _same(one: JointConfig, other: JointConfig) -> bool:
    """Say whether two joints are alike, but for what is lost when angles are written in degrees."""
    angles = ((one.zero, other.zero), (one.lower, other.lower), (one.upper, other.upper))
    near = all(isclose(here, there, abs_tol=radians(0.001)) for here, there in angles)
    return near and replace(one, zero=other.zero, lower=other.lower, upper=other.upper) == other


def _free(path: Path) -> Path:
    """Return a name beside ``path`` that nothing has yet: FILE.bak, then FILE.bak2..."""
    number, kept = 1, path.with_name(f"{path.name}.bak")
    while kept.exists():
        number += 1
        kept = path.with_name(f"{path.name}.bak{number}")
    return kept
