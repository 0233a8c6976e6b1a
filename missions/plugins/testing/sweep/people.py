"""What can be varied of a person in a world file: where they stand, how tall they are, how they walk."""

from collections.abc import Callable
from math import atan2, cos, hypot, radians, sin
from typing import Any

from config.units import si_value
from missions.plugins.testing.sweep.variation import DrawnValue

PlainMapping = dict[str, Any]
"""A mapping of a world file as plain lists, mappings and values."""

WALK_HALF_LENGTH = 0.8
"""Metres that somebody walks to each side of their place, across the robot's view."""

MIN_WALK_SPEED = 0.01
"""Metres a second: whoever is slower stands."""


def position_of(thing: PlainMapping, key: str = "at") -> tuple[float, float]:
    """Return where something stands, (x, y) in metres."""
    x, y = (si_value(value, "length") for value in thing[key])
    return x, y


def start_pose(world: PlainMapping) -> tuple[float, float, float]:
    """Return where the robot starts: x, y in metres, and its heading in radians."""
    start = world.get("start", {})
    heading = si_value(start.get("heading", "0 deg"), "angle")
    return (*(position_of(start) if "at" in start else (0.0, 0.0)), heading)


def set_distance(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Put them so far from the robot, in the direction in which they are; their walk comes along."""
    (x, y), (x0, y0, heading) = position_of(person), start_pose(world)
    angle = atan2(y - y0, x - x0) if (x, y) != (x0, y0) else heading
    right, up = x0 + float(value) * cos(angle) - x, y0 + float(value) * sin(angle) - y
    _move_person(person, lambda px, py: (px + right, py + up))


def set_bearing(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Put them in that direction of the robot (degrees, to its left), as far away as they are; with their walk."""
    (x, y), (x0, y0, heading) = position_of(person), start_pose(world)
    turn = heading + radians(float(value)) - atan2(y - y0, x - x0)

    def turned(px: float, py: float) -> tuple[float, float]:
        far, angle = hypot(px - x0, py - y0), atan2(py - y0, px - x0) + turn
        return x0 + far * cos(angle), y0 + far * sin(angle)

    _move_person(person, turned)


def set_height(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Make them so tall that their eyes are at that height."""
    del world
    person["height"] = f"{value} m"


def set_look(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Give them another look."""
    del world
    person["look"] = value


def set_facing(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Turn them so far (degrees) from the place where the robot starts; at 0 they look at it."""
    (x, y), (x0, y0, _) = position_of(person), start_pose(world)
    person["facing"] = f"{atan2(y0 - y, x0 - x) + radians(float(value)):.9f} rad"


def set_speed(world: PlainMapping, person: PlainMapping, value: DrawnValue) -> None:
    """Have them walk so fast: as the world says, else to and fro across the robot's view. At 0 they stand."""
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
    "distance": ("length", set_distance, "how far from the robot they stand"),
    "bearing": ("angle", set_bearing, "in which direction of the robot, to its left"),
    "height": ("length", set_height, "how high their eyes are"),
    "look": ("text", set_look, "who they look like"),
    "facing": ("angle", set_facing, "how far they are turned away from the robot"),
    "speed": (
        "speed",
        set_speed,
        "how fast they walk, to and fro across the view unless the world says where; 0 stands",
    ),
}
"""What can be varied of a person: its kind, what does it, and what it is. In the order in which it must be done."""


def _move_person(person: PlainMapping, to: Callable[[float, float], tuple[float, float]]) -> None:
    """Move somebody, and the way that they walk."""
    person["at"] = _position_text(*to(*position_of(person)))
    if person.get("walk"):
        points = [tuple(si_value(value, "length") for value in point) for point in person["walk"]]
        person["walk"] = [_position_text(*to(x, y)) for x, y in points]


def _position_text(x: float, y: float) -> list[str]:
    """Write a place to a tenth of a millimetre, with no minus before a zero."""
    return [f"{round(value, 4) + 0.0:g} m" for value in (x, y)]
