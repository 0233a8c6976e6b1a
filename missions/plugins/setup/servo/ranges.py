"""Write the measured limits of an arm's joints into a robot file."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import isclose, radians
from pathlib import Path

from config.diagnostics import InvalidFileError, SourceText
from config.file_io import save_file
from config.robot import RobotConfig
from config.units import quantity_text
from config.yaml_edit import NotEditableError, require_own, rewrite, with_value
from config.yaml_nodes import read_source
from drivers.servos.declared import DynamixelKeys, JointKeys, Ticks
from missions.library.drivers import parse_robot

RETRY_COMMAND = "mission servo calibrate --robot FILE"


@dataclass(frozen=True, slots=True)
class ServoRange:
    """Range of a servo in steps.

    ``zero`` is the position at which the joint's angle is 0; None keeps the old one.
    """

    lowest: int
    highest: int
    zero: int | None = None


def with_range(joint: JointKeys, servo_range: ServoRange) -> JointKeys:
    """Return the keys of a joint in the robot file, with the measured limits and zero in place of the old ones."""
    model = joint.servo_model
    if joint.ticks is not None:
        low, high = (
            (servo_range.highest, servo_range.lowest) if joint.reverse else (servo_range.lowest, servo_range.highest)
        )
        init = joint.ticks.init if servo_range.zero is None else servo_range.zero
        return replace(joint, ticks=Ticks(init=init, min=low, max=high))
    zero = joint.zero if servo_range.zero is None else model.angle(servo_range.zero)
    way = -1 if joint.reverse else 1
    lower, upper = sorted((model.angle(end) - zero) * way for end in (servo_range.lowest, servo_range.highest))
    return replace(joint, written_zero=zero, limits=(lower, upper))


def check_keepable(path: Path) -> None:
    """Raise NotEditableError for a robot file that cannot be written.

    Call it before the user moves the arm, so that the measured limits are not lost.
    """
    require_own(path, RETRY_COMMAND)


def write_ranges(path: Path, ranges: Mapping[str, ServoRange], part: str = "arm") -> Path:
    """Write ranges of an arm's joints into a robot file, and nothing else; return the backup file.

    Raises NotEditableError if that is not possible, InvalidFileError for an invalid robot file, OSError.
    """
    check_keepable(path)
    source = read_source(path)
    old = parse_robot(source)
    arm = arm_keys(old, part)
    if arm is None:
        raise NotEditableError(f"{old.name} has no arm of Dynamixel servos")
    joints = dict(arm.joints)
    text = source.text
    for name, found in ranges.items():
        new = with_range(joints[name], found)
        for keys, value in _changed_entries(joints[name], new).items():
            text = with_value(SourceText(source.name, text), (part, "joints", name, *keys), value)
        joints[name] = new
    wanted = old.with_keys(part, replace(arm, joints=joints))
    if not _means(SourceText(source.name, text), wanted, part):
        raise NotEditableError(f"{path}: cannot be edited automatically; write the values yourself")
    kept = free_backup_path(path)
    save_file(kept, path.read_bytes(), path.stat().st_mode)
    rewrite(path, text)
    return kept


def _changed_entries(old: JointKeys, new: JointKeys) -> dict[tuple[str, ...], str]:
    """Return the changed values of a joint as text for a robot file, by their key paths within the joint."""
    if old.ticks is not None and new.ticks is not None:
        return {("ticks", key): str(value) for key, value in asdict(new.ticks).items()}
    entries: dict[tuple[str, ...], str] = {} if new.zero == old.zero else {("zero",): quantity_text(new.zero, "angle")}
    entries["limits",] = f"[{quantity_text(new.lower, 'angle')}, {quantity_text(new.upper, 'angle')}]"
    return entries


def arm_keys(robot: RobotConfig, part: str) -> DynamixelKeys | None:
    """Return the section of a Dynamixel or Feetech arm; None without one of that name."""
    section = robot.sections.get(part)
    return section.keys if section is not None and isinstance(section.keys, DynamixelKeys) else None


def _means(source: SourceText, expected: RobotConfig, part: str) -> bool:
    """Return whether the edited text of a robot file describes the ``expected`` robot.

    It describes another robot, for example, if the file uses a YAML anchor in the arm ``part`` elsewhere too.
    """
    try:
        new = parse_robot(source)
    except InvalidFileError:
        return False
    arm, meant = arm_keys(new, part), arm_keys(expected, part)
    if arm is None or meant is None or arm.joints.keys() != meant.joints.keys():
        return False
    same = all(_same_joint(arm.joints[name], joint) for name, joint in meant.joints.items())
    bare, other = (robot.with_keys(part, replace(keys, joints={})) for robot, keys in ((new, arm), (expected, meant)))
    return same and bare == other


def _same_joint(one: JointKeys, other: JointKeys) -> bool:
    """Return whether two joints are equal, except for the rounding of angles in the robot file."""
    angles = ((one.zero, other.zero), (one.lower, other.lower), (one.upper, other.upper))
    near = all(isclose(here, there, abs_tol=radians(0.001)) for here, there in angles)
    return near and replace(one, written_zero=other.written_zero, limits=other.limits) == other


def free_backup_path(path: Path) -> Path:
    """Return an unused backup name beside ``path``: FILE.bak, then FILE.bak2..."""
    number, kept = 1, path.with_name(f"{path.name}.bak")
    while kept.exists():
        number += 1
        kept = path.with_name(f"{path.name}.bak{number}")
    return kept
