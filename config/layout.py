"""Where things stand in a world file, and whether they can stand there: in the room, and not in each other's way."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import atan2, cos, dist, hypot, sin
from typing import TYPE_CHECKING

from config.people import BODY
from config.things import DOCK, THICKNESS, BoxConfig, Place, ThingConfig, Walker, WallConfig
from config.units import written
from drivers.api.keys import Mistake

if TYPE_CHECKING:
    from config.world import WorldConfig

ROBOT = 0.18
"""Metres from the middle of the robot to its rim: that of a TurtleBot 2."""

Path = tuple[str | int, ...]
"""Where something stands in the file."""


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


@dataclass(frozen=True, slots=True)
class Thing:
    """What is to stand somewhere: ``what`` messages call it, the ``mark`` where they point, and ``about`` what."""

    what: str
    mark: Path
    about: Path


@dataclass(slots=True)
class Layout:
    """The floor of a world's room, and what has been put on it so far; what cannot be there is yielded."""

    world: "WorldConfig"
    taken: list[tuple[Thing, Rectangle]] = field(default_factory=list)

    def mistakes(self) -> Iterator[Mistake]:
        """Yield everything that cannot stand where it is."""
        world = self.world
        start = Thing("the robot", ("start", "at"), ("start",))
        if not self._inside(world.start.at, ROBOT):
            message = f"there is no room for the robot at {_shown(world.start.at)}, where it starts"
            yield self._outside(start, message, otherwise=("room",))
        for place, wall in enumerate(world.walls):
            yield from self._wall(wall, ("walls", place))
        for place, piece in enumerate(world.furniture):
            yield from self._box(piece, ("furniture", place))
        for place, edge in enumerate(world.edges):
            at: Path = ("edges", place)
            ground = Rectangle(edge.x, edge.y, edge.length, edge.width)
            yield from self._put(Thing("the edge", at, at), ground, solid=False)
        for place, thing in enumerate(world.objects):
            yield from self._box(thing, ("objects", place))
        yield from self._dock()
        for place, rover in enumerate(world.robots):
            yield from self._walk(rover, "a robot", ("robots", place), rover.size[0] / 2)
        for place, person in enumerate(world.people):
            yield from self._walk(person, "a person", ("people", place), BODY)

    def _wall(self, wall: WallConfig, at: Path) -> Iterator[Mistake]:
        thing, length = Thing("the wall", at, at), dist(wall.start, wall.end)
        if (wall.height or 0.0) > self.world.height:
            highest = written(self.world.height, "length")
            yield Mistake(f"'height' must be at most {highest}", (*at, "height"), about=(("room",), (*at, "height")))
        elif length < THICKNESS:
            yield Mistake(f"the wall is only {written(length, 'length')} long", at, about=(at,))
        else:
            outside = list(self._contains(thing, (wall.start, wall.end)))
            (x0, y0), (x1, y1) = wall.start, wall.end
            ground = Rectangle((x0 + x1) / 2, (y0 + y1) / 2, length, THICKNESS, atan2(y1 - y0, x1 - x0))
            yield from outside or self._put(thing, ground)

    def _box(self, box: BoxConfig | ThingConfig, at: Path) -> Iterator[Mistake]:
        length, width, height = (box.size,) * 3 if isinstance(box.size, float) else box.size
        thing = Thing(f"'{box.name}'", (*at, "name"), at)
        if box.bottom + height > self.world.height:
            top, room = (written(end, "length") for end in (box.bottom + height, self.world.height))
            yield self._mistake(thing, f"'{box.name}' reaches up to {top}", f"the room is {room} high")
        ground = Rectangle(box.x, box.y, length, width, box.heading)
        if box.bottom == 0.0:
            yield from self._put(thing, ground)
        else:
            yield from self._contains(thing, ground.corners())

    def _dock(self) -> Iterator[Mistake]:
        """Put the dock, before which there must be room for the robot."""
        dock = self.world.dock
        if dock is None:
            return
        thing, before = Thing("the dock", ("dock", "at"), ("dock",)), DOCK[0] / 2 + ROBOT
        spot = (dock.x + before * cos(dock.heading), dock.y + before * sin(dock.heading))
        in_way = next((other for other, ground in self.taken if ground.gap(*spot) < ROBOT), None)
        message = f"there is no room for the robot before the dock, at {_shown(spot)}"
        if not self._inside(spot, ROBOT):
            yield self._outside(thing, message)
        elif in_way is not None:
            yield self._mistake(thing, f"{message}: {in_way.what} is there", about=in_way.about)
        else:
            yield from self._put(thing, Rectangle(dock.x, dock.y, *DOCK, dock.heading))

    def _walk(self, walker: Walker, kind: str, at: Path, radius: float) -> Iterator[Mistake]:
        """Yield where somebody of a ``radius`` cannot stand, or walk to."""
        stops: list[tuple[Path, Place]] = [((*at, "at"), walker.at)]
        stops += [((*at, "walk", number), stop) for number, stop in enumerate(walker.path)]
        for number, (mark, point) in enumerate(stops):
            thing = Thing(walker.name or kind, mark, mark)
            in_way = next((other for other, ground in self.taken if ground.gap(*point) == 0.0), None)
            if outside := list(self._contains(thing, [point])):
                yield from outside
            elif in_way is not None:
                message = f"{thing.what} cannot be at {_shown(point)}: {in_way.what} is there"
                yield self._mistake(thing, message, about=in_way.about)
            elif number == 0 and dist(point, self.world.start.at) < ROBOT + radius:
                yield self._at_start(thing)

    def _put(self, thing: Thing, ground: Rectangle, *, solid: bool = True) -> Iterator[Mistake]:
        """Put something on the floor, ``solid`` or a hole in it: in the room, and not where the robot starts."""
        outside = list(self._contains(thing, ground.corners()))
        if outside:
            yield from outside
            return
        if ground.gap(*self.world.start.at) < ROBOT:
            yield self._at_start(thing)
        if solid:
            self.taken.append((thing, ground))

    def _contains(self, thing: Thing, points: Iterable[Place]) -> Iterator[Mistake]:
        """Yield the first of some points that is not in the room."""
        for point in points:
            if not self._inside(point):
                yield self._outside(thing, f"{thing.what} is outside the room at {_shown(point)}")
                return

    def _inside(self, point: Place, margin: float = 0.0) -> bool:
        world = self.world
        x, y = abs(point[0] - world.centre[0]), abs(point[1] - world.centre[1])
        slack = 1e-9  # half of a length that was written may be a hair off
        return x <= world.length / 2 - margin + slack and y <= world.width / 2 - margin + slack

    def _at_start(self, thing: Thing) -> Mistake:
        where = f"{thing.what} is where the robot starts, at {_shown(self.world.start.at)}"
        return self._mistake(thing, where, "move it, or give 'start' another place", about=("start",))

    def _outside(self, thing: Thing, message: str, *, otherwise: Path = ()) -> Mistake:
        world = self.world
        sides = (
            f"{name} {written(middle - side / 2, 'length')} to {written(middle + side / 2, 'length')}"
            for name, middle, side in zip("xy", world.centre, (world.length, world.width), strict=True)
        )
        return self._mistake(thing, message, f"the room is {', '.join(sides)}", otherwise=otherwise)

    def _mistake(
        self, thing: Thing, message: str, hint: str = "", *, about: Path = ("room",), otherwise: Path = ()
    ) -> Mistake:
        """Return a mistake about a thing, the room, and more."""
        return Mistake(message, thing.mark, otherwise, hint=hint, about=(("room",), thing.about, about))


def _shown(point: Place) -> str:
    return f"[{written(point[0], 'length')}, {written(point[1], 'length')}]"
