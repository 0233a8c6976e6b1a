"""Values of a robot that can be tuned in a run and saved to its robot file: trims, limits, speeds.

A value has a name such as ``head.pan.trim``, ``base.max_speed`` or ``arm.joints.elbow.upper``, in SI units.
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
"""Last words of the names of a joint's limits, such as ``arm.joints.elbow.upper``, in the order of the file."""

TOLERANCE = radians(0.001)
"""Maximum difference of two values that count as equal."""


def file_values(robot: RobotConfig) -> dict[str, tuple[float, str]]:
    """Return the tunable values in a robot file by name, each with its dimension."""
    return {
        f"{part}.{name}": (value, dimension)
        for part, section in robot.sections.items()
        for name, value, dimension in _tunable_values(section.keys)
    }


def _tunable_values(keys: Any) -> Iterator[tuple[str, float, str]]:
    """Yield name, value and dimension of each tunable value in the keys of a part."""
    match keys:
        case BaseKeys():
            yield "max_speed", keys.max_speed, "speed"
            yield "max_turn", keys.max_turn, "turn rate"
        case HeadKeys():
            yield "speed", keys.speed, "turn rate"
            for axis in ("pan", "tilt"):
                axis_keys = getattr(keys, axis, None)
                if isinstance(axis_keys, AxisKeys):
                    yield f"{axis}.trim", axis_keys.trim, "angle"
        case ArmKeys():
            for joint, limits in keys.limits.items():
                for end in LIMIT_ENDS:
                    yield f"joints.{joint}.{end}", getattr(limits, end), "angle"
                yield f"joints.{joint}.speed", limits.speed, "turn rate"
        case _:
            return


def check_editable(path: Path, copy_command: str) -> None:
    """Raise NotEditableError for a file that must not be changed; ``copy_command`` is the hint for a copy."""
    require_own(path, copy_command)


def save_values(path: Path, values: Mapping[str, float], copy_command: str) -> list[str]:
    """Write ``values`` by name into a robot file; return the changes, such as "head: pan: trim: 3 deg".

    Nothing else in the file is changed. ``copy_command`` is the hint for a file that must not be changed. Raises
    NotEditableError if a value cannot be written, InvalidFileError for a file that is not a robot file, OSError.
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
        parse_robot(type(source)(source.name, text))  # the result must be valid too
        rewrite(path, text)
    return [": ".join((*keys, text)) for keys, text in changes.items()]


def _file_entry(
    name: str, values: Mapping[str, float], old: Mapping[str, tuple[float, str]]
) -> tuple[tuple[str, ...], str]:
    """Return the keys under which the value ``name`` stands in the robot file, and its text there.

    The limits of a joint are one list in the file, so its other end comes from ``values`` or ``old``.
    """
    keys, dimension = tuple(name.split(".")), old[name][1]
    if keys[-1] not in LIMIT_ENDS:
        return keys, quantity_text(values[name], dimension)
    ends = [".".join((*keys[:-1], end)) for end in LIMIT_ENDS]
    texts = [quantity_text(values.get(end, old[end][0]), dimension) for end in ends]
    return (*keys[:-1], "limits"), f"[{', '.join(texts)}]"
