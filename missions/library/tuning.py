"""Values of a robot to be changed while it runs, by its place in the robot file, and kept there: trims, limits, speeds.

A value goes by a name such as ``head.pan.trim``, ``base.max_speed`` or ``arm.joints.elbow.upper``, in SI units.
"""

from collections.abc import Iterator, Mapping
from math import isclose, radians
from pathlib import Path
from typing import Any

from config.robot import RobotConfig
from config.units import quantity_text
from config.yaml_edit import NotEditableError, require_own, rewrite, with_values
from config.yaml_nodes import read_source
from drivers.api.sections import ArmKeys, AxisKeys, BaseKeys, HeadKeys
from missions.library.drivers import parse_robot

LIMIT_ENDS = ("lower", "upper")
"""The ends of ``limits``."""

TOLERANCE = radians(0.001)
"""Values that differ by less are the same."""


def file_values(robot: RobotConfig) -> dict[str, tuple[float, str]]:
    """Return what a robot file says of each, and in which dimension."""
    return {
        f"{part}.{name}": (value, dimension)
        for part, section in robot.sections.items()
        for name, value, dimension in _tunable_values(section.keys)
    }


def _tunable_values(keys: Any) -> Iterator[tuple[str, float, str]]:
    """Yield what may be changed of a part."""
    match keys:
        case BaseKeys():
            yield "max_speed", keys.max_speed, "speed"
            yield "max_turn", keys.max_turn, "turn rate"
        case HeadKeys():
            yield "speed", keys.speed, "turn rate"
            for axis in ("pan", "tilt"):
                its = getattr(keys, axis, None)
                if isinstance(its, AxisKeys):
                    yield f"{axis}.trim", its.trim, "angle"
        case ArmKeys():
            for joint, limits in keys.limits.items():
                for end in LIMIT_ENDS:
                    yield f"joints.{joint}.{end}", getattr(limits, end), "angle"
                yield f"joints.{joint}.speed", limits.speed, "turn rate"
        case _:
            return


def check_editable(path: Path, copy_command: str) -> None:
    """Raise NotEditableError for a file in which nothing will be kept; ``again`` is what to type with a copy."""
    require_own(path, copy_command)


def save_values(path: Path, values: Mapping[str, float], copy_command: str) -> list[str]:
    """Write values into a robot file, and nothing else; return what was changed, as "head: pan: trim: 3 deg".

    Raises NotEditableError where that cannot be, InvalidFileError for a file that is no robot's, OSError.
    """
    check_editable(path, copy_command)
    source = read_source(path)
    robot = parse_robot(source)
    old = file_values(robot)
    changes: dict[tuple[str, ...], str] = {}
    for name, value in values.items():
        if name not in old:
            raise NotEditableError(f"{robot.name} has no {name} to change")
        if not isclose(old[name][0], value, abs_tol=TOLERANCE):
            keys, text = _file_entry(name, values, old)
            changes[keys] = text
    if changes:
        text = with_values(source, changes)
        parse_robot(type(source)(source.name, text))  # which it must still be
        rewrite(path, text)
    return [": ".join((*keys, text)) for keys, text in changes.items()]


def _file_entry(
    name: str, values: Mapping[str, float], old: Mapping[str, tuple[float, str]]
) -> tuple[tuple[str, ...], str]:
    """Return the keys of a value in the file, and its text there: both ends of limits stand in one list."""
    keys, dimension = tuple(name.split(".")), old[name][1]
    if keys[-1] not in LIMIT_ENDS:
        return keys, quantity_text(values[name], dimension)
    ends = [".".join((*keys[:-1], end)) for end in LIMIT_ENDS]
    texts = [quantity_text(values.get(end, old[end][0]), dimension) for end in ends]
    return (*keys[:-1], "limits"), f"[{', '.join(texts)}]"
