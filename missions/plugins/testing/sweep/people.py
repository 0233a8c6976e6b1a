"""Parameters of a person in a world file that a sweep can vary: position, height, appearance, motion."""

from collections.abc import Callable
from math import atan2, cos, hypot, radians, sin
from typing import Any

from config.units import si_value
from missions.plugins.testing.sweep.variation import DrawnValue

PlainMapping = dict[str, Any]
"""A world file, or a section of it, as plain lists, mappings and values."""

WALK_HALF_LENGTH = 0.8
"""Metres that a walking person walks to each side of their position, across the robot's view."""

MIN_WALK_SPEED = 0.01
"""Speed in m/s below which a person stands still."""


def position_of(thing: PlainMapping, key: str = "at") -> tuple[float, float]:
    """Return the position of an object, (x, y) in metres."""
    x, y = (si_value(value, "length") for value in thing[key])
    return x, y


def start_pose(world: PlainMapping) -> tuple[float, float, float]:
    """Return the robot's start pose: x, y in metres, heading in radians."""
    start = world.get("start", {})
    heading = si_value(start.get("heading", "0 deg"), "angle")
    return (*(position_of(start) if "at" in start else (0.0, 0.0)), heading)


def set_distance(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Move a person to a distance of ``value`` metres from the robot, in the same direction, with their path."""
    (x, y), (x0, y0, heading) = position_of(person), start_pose(world)
    angle = atan2(y - y0, x - x0) if (x, y) != (x0, y0) else heading
    right, up = x0 + float(value) * cos(angle) - x, y0 + float(value) * sin(angle) - y
    _move_person(person, lambda px, py: (px + right, py + up))


def set_bearing(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Move a person to a bearing of ``value`` degrees left of the robot, at the same distance, with their path."""
    (x, y), (x0, y0, heading) = position_of(person), start_pose(world)
    turn = heading + radians(float(value)) - atan2(y - y0, x - x0)

    def rotate(px: float, py: float) -> tuple[float, float]:
        far, angle = hypot(px - x0, py - y0), atan2(py - y0, px - x0) + turn
        return x0 + far * cos(angle), y0 + far * sin(angle)

    _move_person(person, rotate)


def set_height(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Set a person's height so that their eyes are ``value`` metres above the floor."""
    del world
    person["height"] = f"{value} m"


def set_look(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Set a person's appearance to ``value``, a name in ``LOOKS``."""
    del world
    person["look"] = value


def set_facing(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Turn a person by ``value`` degrees from the direction of the robot's start position; at 0 they look at it."""
    (x, y), (x0, y0, _) = position_of(person), start_pose(world)
    person["facing"] = f"{atan2(y0 - y, x0 - x) + radians(float(value)):.9f} rad"


def set_speed(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Set a person's walking speed: along their path, or back and forth across the robot's view. At 0 they stand."""
    if float(value) < MIN_WALK_SPEED:
        person.pop("walk", None)
        return
    person["speed"] = f"{value} m/s"
    if not person.get("walk"):
        (x, y), (x0, y0, _) = position_of(person), start_pose(world)
        across = atan2(y - y0, x - x0)
        right, up = WALK_HALF_LENGTH * sin(across), -WALK_HALF_LENGTH * cos(across)
        person["walk"] = [_position_text(x + right, y + up), _position_text(x - right, y - up)]


PERSON_PARAMETERS: dict[str, tuple[str, Callable[[PlainMapping, PlainMapping, DrawnValue], None], str]] = {
    "distance": ("length", set_distance, "distance from the robot"),
    "bearing": ("angle", set_bearing, "bearing from the robot, to its left"),
    "height": ("length", set_height, "height of the eyes"),
    "look": ("text", set_look, "appearance"),
    "facing": ("angle", set_facing, "angle away from the robot"),
    "speed": (
        "speed",
        set_speed,
        "walking speed, to and fro across the view unless the world has a path; at 0 they stand",
    ),
}
"""Parameters of a person: kind, function, description; in the order of application."""


def _move_person(person: PlainMapping, to: Callable[[float, float], tuple[float, float]]) -> None:
    """Move a person and their path; ``to`` returns the new position of each point."""
    person["at"] = _position_text(*to(*position_of(person)))
    if person.get("walk"):
        points = [tuple(si_value(value, "length") for value in point) for point in person["walk"]]
        person["walk"] = [_position_text(*to(x, y)) for x, y in points]


def _position_text(x: float, y: float) -> list[str]:
    """Return a position as texts in metres, rounded to a tenth of a millimetre; zero has no minus sign."""
    return [f"{round(value, 4) + 0.0:g} m" for value in (x, y)]
