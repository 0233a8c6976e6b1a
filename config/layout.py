"""Where things stand in a world file, and whether they can stand there: in the room, and not in each other's way."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import cos, dist, hypot, sin

from config.faults import Mark
from config.fields import Fields
from config.marked import Listing, Node
from config.units import written

Place = tuple[float, float]
"""A place (x, y) on the floor, in metres."""

ROBOT = 0.18
"""Metres from the middle of the robot to its rim: that of a TurtleBot 2."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """What something takes of the floor: its middle, its ``length`` along ``heading``, its ``width``."""

    x: float
    y: float
    length: float
    width: float
    heading: float = 0.0

    def corners(self) -> list[Place]:
        """Return its corners (x, y)."""
        c, s = cos(self.heading), sin(self.heading)
        halves = [(u * self.length / 2, v * self.width / 2) for u, v in ((1, -1), (1, 1), (-1, 1), (-1, -1))]
        return [(self.x + u * c - v * s, self.y + u * s + v * c) for u, v in halves]

    def gap(self, x: float, y: float) -> float:
        """Return the metres from (x, y) to it; 0 within."""
        dx, dy, c, s = x - self.x, y - self.y, cos(self.heading), sin(self.heading)
        u, v = abs(dx * c + dy * s), abs(dy * c - dx * s)
        return hypot(max(0.0, u - self.length / 2), max(0.0, v - self.width / 2))


@dataclass(slots=True)
class Layout:
    """The floor of a room, and what has been put on it so far; each thing is noted as a fault where it cannot be."""

    length: float
    width: float
    height: float
    centre: Place
    start: Place = (0.0, 0.0)
    taken: list[tuple[str, Rectangle]] = field(default_factory=list)

    def place_robot(self, fields: Fields, mark: Mark, at: Place) -> None:
        """Note where the robot starts, and a fault where there is no room for it."""
        self.start = at
        if not self._inside(at, ROBOT):
            self._outside(fields, mark, f"there is no room for the robot at {_shown(at)}, where it starts")

    def room_for_robot(self, fields: Fields, mark: Mark, where: str, at: Place) -> None:
        """Note a fault where the robot cannot stand at ``at``, which is ``where``."""
        inside = next((what for what, ground in self.taken if ground.gap(*at) < ROBOT), None)
        if not self._inside(at, ROBOT):
            self._outside(fields, mark, f"there is no room for the robot {where}, at {_shown(at)}")
        elif inside is not None:
            fields.fault(mark, f"there is no room for the robot {where}, at {_shown(at)}: {inside} is there")

    def contains(self, fields: Fields, mark: Mark, what: str, points: Iterable[Place]) -> bool:
        """Say whether all ``points`` are in the room, and note a fault where one is not."""
        for point in points:
            if not self._inside(point):
                self._outside(fields, mark, f"{what} is outside the room at {_shown(point)}")
                return False
        return True

    def put(self, fields: Fields, mark: Mark, what: str, ground: Rectangle, *, solid: bool = True) -> None:
        """Put something on the floor, ``solid`` or a hole in it: in the room, and not where the robot starts."""
        if not self.contains(fields, mark, what, ground.corners()):
            return
        if ground.gap(*self.start) < ROBOT:
            self._at_start(fields, mark, what)
        if solid:
            self.taken.append((what, ground))

    def stand(self, fields: Fields, mark: Mark, who: str, point: Place, radius: float | None = None) -> None:
        """Note a fault where nobody can stand at ``point``; with a ``radius``, nor that near to the robot's start."""
        if not self.contains(fields, mark, who, [point]):
            return
        inside = next((what for what, ground in self.taken if ground.gap(*point) == 0.0), None)
        if inside is not None:
            fields.fault(mark, f"{who} cannot be at {_shown(point)}: {inside} is there")
        elif radius is not None and dist(point, self.start) < ROBOT + radius:
            self._at_start(fields, mark, who)

    def _inside(self, point: Place, margin: float = 0.0) -> bool:
        x, y = abs(point[0] - self.centre[0]), abs(point[1] - self.centre[1])
        slack = 1e-9  # half of a length that was written may be a hair off
        return x <= self.length / 2 - margin + slack and y <= self.width / 2 - margin + slack

    def _at_start(self, fields: Fields, mark: Mark, what: str) -> None:
        where = f"{what} is where the robot starts, at {_shown(self.start)}"
        fields.fault(mark, where, "move it, or give 'start' another place")

    def _outside(self, fields: Fields, mark: Mark, message: str) -> None:
        sides = (
            f"{name} {written(middle - side / 2, 'length')} to {written(middle + side / 2, 'length')}"
            for name, middle, side in zip("xy", self.centre, (self.length, self.width), strict=True)
        )
        fields.fault(mark, message, f"the room is {', '.join(sides)}")


def place(fields: Fields, node: Node | None, key: str) -> Place:
    """Read [x, y]."""
    if node is None:
        return 0.0, 0.0
    x, y = lengths(fields, node, key, 2, "a place, such as [1.5 m, 0.2 m]")
    return x, y


def sides(fields: Fields, node: Node | None, key: str) -> tuple[float, float, float]:
    """Read the size of a box: [length, width, height]."""
    if node is None:
        return 1.0, 1.0, 1.0
    example = "three lengths, such as [1.2 m, 0.8 m, 0.75 m]"
    length, width, height = lengths(fields, node, key, 3, example, low=0.01, high=20.0)
    return length, width, height


def lengths(
    fields: Fields,
    node: Node,
    key: str,
    count: int,
    example: str,
    *,
    low: float | None = None,
    high: float | None = None,
) -> list[float]:
    """Read a list of ``count`` lengths between ``low`` and ``high`` metres; zeros, and a fault, for anything else."""
    if not isinstance(node, Listing) or len(node.items) != count:
        fields.fault(node.mark, f"'{key}' needs {example}")
        return [0.0] * count
    return [fields.measure(item, key, "length", low=low, high=high) for item in node.items]


def _shown(point: Place) -> str:
    return f"[{written(point[0], 'length')}, {written(point[1], 'length')}]"
