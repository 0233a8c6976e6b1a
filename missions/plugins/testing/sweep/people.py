"""What can be varied of a person in a world file: where they stand, how tall they are, how they walk."""

from collections.abc import Callable
from math import atan2, cos, hypot, radians, sin
from typing import Any

from config.units import in_dimension
from missions.plugins.testing.sweep.variation import Drawn

Plain = dict[str, Any]
"""A mapping of a world file as plain lists, mappings and values."""

STRIDE = 0.8
"""Metres that somebody walks to each side of their place, across the robot's view."""

STANDING = 0.01
"""Metres a second: whoever is slower stands."""


def place(thing: Plain, key: str = "at") -> tuple[float, float]:
    """Return where something stands, (x, y) in metres."""
    x, y = (in_dimension(value, "length") for value in thing[key])
    return x, y


def start_of(world: Plain) -> tuple[float, float, float]:
    """Return where the robot starts: x, y in metres, and its heading in radians."""
    start = world.get("start", {})
    heading = in_dimension(start.get("heading", "0 deg"), "angle")
    return (*(place(start) if "at" in start else (0.0, 0.0)), heading)


def distance(world: Plain, person: Plain, value: Drawn) -> None:
    """Put them so far from the robot, in the direction in which they are; their walk comes along."""
    (x, y), (x0, y0, heading) = place(person), start_of(world)
    angle = atan2(y - y0, x - x0) if (x, y) != (x0, y0) else heading
    right, up = x0 + float(value) * cos(angle) - x, y0 + float(value) * sin(angle) - y
    _carry(person, lambda px, py: (px + right, py + up))


def bearing(world: Plain, person: Plain, value: Drawn) -> None:
    """Put them in that direction of the robot (degrees, to its left), as far away as they are; with their walk."""
    (x, y), (x0, y0, heading) = place(person), start_of(world)
    turn = heading + radians(float(value)) - atan2(y - y0, x - x0)

    def turned(px: float, py: float) -> tuple[float, float]:
        far, angle = hypot(px - x0, py - y0), atan2(py - y0, px - x0) + turn
        return x0 + far * cos(angle), y0 + far * sin(angle)

    _carry(person, turned)


def height(world: Plain, person: Plain, value: Drawn) -> None:
    """Make them so tall that their eyes are at that height."""
    del world
    person["height"] = f"{value} m"


def look(world: Plain, person: Plain, value: Drawn) -> None:
    """Give them another look."""
    del world
    person["look"] = value


def facing(world: Plain, person: Plain, value: Drawn) -> None:
    """Turn them so far (degrees) from the place where the robot starts; at 0 they look at it."""
    (x, y), (x0, y0, _) = place(person), start_of(world)
    person["facing"] = f"{atan2(y0 - y, x0 - x) + radians(float(value)):.9f} rad"


def speed(world: Plain, person: Plain, value: Drawn) -> None:
    """Have them walk so fast: as the world says, else to and fro across the robot's view. At 0 they stand."""
    if float(value) < STANDING:
        person.pop("walk", None)
        return
    person["speed"] = f"{value} m/s"
    if not person.get("walk"):
        (x, y), (x0, y0, _) = place(person), start_of(world)
        across = atan2(y - y0, x - x0)
        right, up = STRIDE * sin(across), -STRIDE * cos(across)
        person["walk"] = [_at(x + right, y + up), _at(x - right, y - up)]


PEOPLE: dict[str, tuple[str, Callable[[Plain, Plain, Drawn], None], str]] = {
    "distance": ("length", distance, "how far from the robot they stand"),
    "bearing": ("angle", bearing, "in which direction of the robot, to its left"),
    "height": ("length", height, "how high their eyes are"),
    "look": ("text", look, "who they look like"),
    "facing": ("angle", facing, "how far they are turned away from the robot"),
    "speed": ("speed", speed, "how fast they walk, to and fro across the view unless the world says where; 0 stands"),
}
"""What can be varied of a person: its kind, what does it, and what it is. In the order in which it must be done."""


def _carry(person: Plain, to: Callable[[float, float], tuple[float, float]]) -> None:
    """Move somebody, and the way that they walk."""
    person["at"] = _at(*to(*place(person)))
    if person.get("walk"):
        points = [tuple(in_dimension(value, "length") for value in point) for point in person["walk"]]
        person["walk"] = [_at(*to(x, y)) for x, y in points]


def _at(x: float, y: float) -> list[str]:
    """Write a place to a tenth of a millimetre, with no minus before a zero."""
    return [f"{round(value, 4) + 0.0:g} m" for value in (x, y)]
