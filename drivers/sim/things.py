"""What stands about in a simulated world besides people: walls, furniture, coloured things, other robots, holes.

Plain values, in metres and radians in the world's frame, each with the solid shape that it has. What stands on
something else has ``bottom`` metres of air below it.
"""

from dataclasses import dataclass, field
from math import atan2, dist, isfinite

from drivers.errors import BadRequest
from drivers.sim.block import Block, Disc
from drivers.sim.room import Colour
from drivers.sim.walk import Place, Walk

THICKNESS = 0.1
"""Metres from one side of an inner wall to the other."""

MARKERS = 50
"""How many markers there are in ArUco's dictionary DICT_4X4_50."""

MARKER_SIZE = 0.15
"""Metres from one side of a marker's black frame to the other."""


@dataclass(frozen=True, slots=True)
class Wall:
    """An inner wall from ``start`` to ``end``, each (x, y). Raises BadRequest for one that leads nowhere."""

    start: Place
    end: Place
    height: float = 2.6

    def __post_init__(self) -> None:
        if not dist(self.start, self.end) > 0 or not self.height > 0:
            raise BadRequest(f"wall from {self.start} to {self.end}, {self.height} m high: has no length or height")

    def solid(self) -> Block:
        """Return its shape."""
        (x0, y0), (x1, y1) = self.start, self.end
        heading = atan2(y1 - y0, x1 - x0)
        length = dist(self.start, self.end)
        return Block((x0 + x1) / 2, (y0 + y1) / 2, length, THICKNESS, heading, 0.0, self.height)


@dataclass(frozen=True, slots=True)
class Box:
    """A piece of furniture, or a coloured box: its middle, its length along ``heading``, its width and height.

    Raises BadRequest for a side that is not above 0 m, and for a place below the floor.
    """

    name: str
    x: float
    y: float
    size: tuple[float, float, float]
    colour: Colour
    heading: float = 0.0
    bottom: float = 0.0

    def __post_init__(self) -> None:
        if not min(self.size) > 0 or self.bottom < 0:
            raise BadRequest(f"{self.name}: {self.size} m, {self.bottom} m above the floor: sides must be above 0 m")

    def solid(self) -> Block:
        """Return its shape."""
        length, width, height = self.size
        return Block(self.x, self.y, length, width, self.heading, self.bottom, self.bottom + height)


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball of the diameter ``size`` that lies at (x, y). Raises BadRequest for one without size."""

    name: str
    x: float
    y: float
    size: float
    colour: Colour
    bottom: float = 0.0

    def __post_init__(self) -> None:
        if not self.size > 0 or self.bottom < 0:
            raise BadRequest(f"{self.name}: {self.size} m, {self.bottom} m above the floor: must be above 0 m")

    def solid(self) -> Disc:
        """Return its shape, which is that of the can it would just fit into."""
        return Disc(self.x, self.y, self.size / 2, self.bottom, self.bottom + self.size)


@dataclass(frozen=True, slots=True)
class Edge:
    """A rectangle about (x, y), ``length`` along x by ``width`` along y, in which there is no floor: stairs down."""

    x: float
    y: float
    length: float
    width: float

    def __post_init__(self) -> None:
        if not min(self.length, self.width) > 0:
            raise BadRequest(f"edge at ({self.x}, {self.y}): {self.length} x {self.width} m: must be above 0 m")

    def holds(self, x: float, y: float) -> bool:
        """Say whether (x, y) is in it."""
        return abs(x - self.x) <= self.length / 2 and abs(y - self.y) <= self.width / 2


@dataclass(frozen=True, slots=True)
class Rover:
    """Another robot: a box that stands, or drives along ``path`` as people walk, with a marker on each of its sides.

    ``marker`` is the number of its markers in ArUco's dictionary DICT_4X4_50. It is turned to ``heading`` until it
    drives, then the way that it goes. Raises BadRequest for a marker that is not there or does not fit on its sides.
    """

    name: str
    marker: int
    x: float
    y: float
    heading: float = 0.0
    size: tuple[float, float, float] = (0.35, 0.35, 0.42)
    colour: Colour = (70, 74, 82)
    path: tuple[Place, ...] = ()
    speed: float = 0.2
    start: float = 0.0
    loop: bool = True
    walk: Walk = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0 <= self.marker < MARKERS:
            raise BadRequest(f"{self.name}: marker {self.marker}: must be within 0..{MARKERS - 1}")
        if not min(self.size) > MARKER_SIZE * 4 / 3:
            raise BadRequest(f"{self.name}: {self.size} m: too small for a marker of {MARKER_SIZE} m and its rim")
        if not (isfinite(self.speed) and self.speed > 0):
            raise BadRequest(f"{self.name}: drives at {self.speed} m/s: must be above 0 m/s")
        walk = Walk(((self.x, self.y), *self.path), self.speed, self.start, self.loop)
        object.__setattr__(self, "walk", walk)  # the way to fill in a field of a frozen class

    def solid(self, time: float) -> Block:
        """Return its shape at ``time`` seconds."""
        x, y = self.walk.at(time)
        way = self.walk.heading(time) if time > self.start else None
        length, width, height = self.size
        return Block(x, y, length, width, self.heading if way is None else way, 0.0, height)
