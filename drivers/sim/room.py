"""The room of a simulated world: four walls and their fixtures, as plain values.

The frame is the frame of the world: x forward, y left, z up, metres, the floor at z = 0. A robot that starts at
(0, 0) along x has its odometry in this frame. From the middle of the room the front wall is at +x, the left wall at
+y, the back wall at -x and the right wall at -y.
"""

from dataclasses import dataclass, replace
from math import inf
from typing import Literal

from drivers.errors import BadRequest

Colour = tuple[int, int, int]
"""Red, green and blue, each 0..255."""

WallName = Literal["front", "left", "back", "right"]
"""Names of the four walls, as seen by an observer that faces +x."""

FixtureKind = Literal["door", "window", "picture"]
"""Kinds of fixtures on a wall."""


@dataclass(frozen=True, slots=True)
class Fixture:
    """A door, a window or a picture on a wall.

    ``along`` is the position of its middle in metres from the middle of the wall, positive to the right as seen from
    inside. ``bottom`` is the height of its lower edge above the floor; ``width`` and ``height`` are its size, in
    metres.
    """

    kind: FixtureKind
    wall: WallName
    along: float = 0.0
    bottom: float = 0.0
    width: float = 0.9
    height: float = 2.0
    colour: Colour = (140, 104, 72)


DEFAULT_FIXTURES = (
    Fixture("picture", "front", along=-1.6, bottom=1.15, width=0.9, height=0.65, colour=(70, 110, 140)),
    Fixture("picture", "front", along=1.9, bottom=1.0, width=0.6, height=0.8, colour=(150, 90, 60)),
    Fixture("window", "left", along=-1.2, bottom=0.9, width=1.6, height=1.2, colour=(196, 214, 226)),
    Fixture("picture", "left", along=2.0, bottom=1.2, width=0.8, height=0.55, colour=(96, 120, 80)),
    Fixture("door", "back", along=1.2),
    Fixture("picture", "back", along=-1.4, bottom=1.1, width=1.0, height=0.6, colour=(120, 100, 130)),
    Fixture("picture", "right", along=-2.2, bottom=1.15, width=0.7, height=0.7, colour=(160, 130, 70)),
    Fixture("window", "right", along=1.4, bottom=0.9, width=1.2, height=1.2, colour=(190, 208, 222)),
)
"""Fixtures of a room that specifies none."""


@dataclass(frozen=True, slots=True)
class Room:
    """A rectangular room.

    ``length`` along x, ``width`` along y and ``height`` in metres, with its middle at ``centre`` (x, y). Raises
    BadRequest for a room without volume, and for a fixture that does not fit on its wall.
    """

    length: float = 8.0
    width: float = 6.0
    height: float = 2.6
    centre: tuple[float, float] = (1.0, 0.0)
    wall: Colour = (206, 200, 186)
    floor: Colour = (142, 116, 88)
    ceiling: Colour = (226, 224, 218)
    fixtures: tuple[Fixture, ...] = DEFAULT_FIXTURES

    def __post_init__(self) -> None:
        if min(self.length, self.width, self.height) <= 0:
            raise BadRequest(f"room: {self.length} x {self.width} x {self.height} m: every side must be above 0 m")
        for fixture in self.fixtures:
            self._check(fixture)

    @classmethod
    def with_default_fixtures(cls, length: float, width: float, height: float, centre: tuple[float, float]) -> "Room":
        """Return a room with those of ``DEFAULT_FIXTURES`` that fit on its walls."""
        bare = cls(length, width, height, centre, fixtures=())
        return replace(bare, fixtures=tuple(item for item in DEFAULT_FIXTURES if not bare.misfit(item)))

    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return ((min x, max x), (min y, max y)) in metres."""
        x, y = self.centre
        return (x - self.length / 2, x + self.length / 2), (y - self.width / 2, y + self.width / 2)

    def contains(self, x: float, y: float, margin: float = 0.0) -> bool:
        """Return whether (x, y) is in the room, at least ``margin`` metres from every wall."""
        (x_low, x_high), (y_low, y_high) = self.extent()
        return x_low + margin <= x <= x_high - margin and y_low + margin <= y <= y_high - margin

    def nearest_wall(self, x: float, y: float) -> tuple[float, float]:
        """Return the point (x, y) of the walls that is nearest to a position in the room."""
        (x_low, x_high), (y_low, y_high) = self.extent()
        spots = ((x_low, y), (x_high, y), (x, y_low), (x, y_high))
        return min(spots, key=lambda spot: abs(spot[0] - x) + abs(spot[1] - y))

    def intersect_ray(self, x: float, y: float, dx: float, dy: float) -> float:
        """Return the distance from (x, y) in the room to a wall, in multiples of (dx, dy)."""
        (x_low, x_high), (y_low, y_high) = self.extent()
        across = ((x_high if dx > 0 else x_low) - x) / dx if dx else inf
        along = ((y_high if dy > 0 else y_low) - y) / dy if dy else inf
        return max(0.0, min(across, along))

    def wall_length(self, wall: WallName) -> float:
        """Return the length of a wall in metres."""
        return self.width if wall in {"front", "back"} else self.length

    def misfit(self, fixture: Fixture) -> str:
        """Return the reason why a fixture does not fit on its wall, or an empty string."""
        half = self.wall_length(fixture.wall) / 2
        if abs(fixture.along) + fixture.width / 2 > half:
            return f"{fixture.width} m wide at {fixture.along:+} m, but the wall ends at {half} m"
        if fixture.bottom < 0 or fixture.bottom + fixture.height > self.height:
            top = fixture.bottom + fixture.height
            return f"from {fixture.bottom} to {top} m, but the wall spans 0 to {self.height} m"
        return ""

    def _check(self, fixture: Fixture) -> None:
        what = f"room: {fixture.kind} on the {fixture.wall} wall"
        if min(fixture.width, fixture.height) <= 0:
            raise BadRequest(f"{what}: {fixture.width} x {fixture.height} m: both sides must be above 0 m")
        misfit = self.misfit(fixture)
        if misfit:
            hint = "leave out `fixtures` in a small room, or move them towards the middle"
            raise BadRequest(f"{what}: {misfit}", hint=hint)
