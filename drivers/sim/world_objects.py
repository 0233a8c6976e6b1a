"""Objects in a simulated world: walls, furniture, coloured objects, other robots, edges and the dock.

Plain values in metres and radians in the world frame, each with its solid shape. An object that stands on another one
is ``bottom`` metres above the floor.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import atan2, cos, dist, hypot, isfinite, pi, radians, remainder, sin, tau
from typing import Protocol

from drivers.api import DockBeam, DockSignals, Pose2D
from drivers.errors import BadRequest
from drivers.sim.people import FloorPosition, WaypointPath
from drivers.sim.room import Colour
from drivers.sim.solids import Point3, UprightBox, UprightCylinder

WALL_THICKNESS = 0.1
"""Thickness of an inner wall in metres."""

MARKER_COUNT = 50
"""Number of markers in ArUco's dictionary DICT_4X4_50."""

MARKER_SIZE = 0.15
"""Side of a marker's black frame in metres."""


@dataclass(frozen=True, slots=True)
class Wall:
    """An inner wall from ``start`` to ``end``, each (x, y). Raises BadRequest for a wall without length or height."""

    start: FloorPosition
    end: FloorPosition
    height: float = 2.6

    def __post_init__(self) -> None:
        if not dist(self.start, self.end) > 0 or not self.height > 0:
            raise BadRequest(f"wall from {self.start} to {self.end}, {self.height} m high: has no length or height")

    def solid(self) -> UprightBox:
        """Return the solid shape of the wall."""
        (x0, y0), (x1, y1) = self.start, self.end
        heading = atan2(y1 - y0, x1 - x0)
        length = dist(self.start, self.end)
        return UprightBox((x0 + x1) / 2, (y0 + y1) / 2, length, WALL_THICKNESS, heading, 0.0, self.height)


@dataclass(frozen=True, slots=True)
class WorldBox:
    """A piece of furniture, or a coloured box: its middle, its length along ``heading``, its width and height.

    Raises BadRequest for a side of 0 m or less, and for a position below the floor.
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

    def solid(self) -> UprightBox:
        """Return the solid shape of the box."""
        length, width, height = self.size
        return UprightBox(self.x, self.y, length, width, self.heading, self.bottom, self.bottom + height)


@dataclass(frozen=True, slots=True)
class WorldBall:
    """A ball of the diameter ``size`` at (x, y). Raises BadRequest for a size of 0 or less."""

    name: str
    x: float
    y: float
    size: float
    colour: Colour
    bottom: float = 0.0

    def __post_init__(self) -> None:
        if not self.size > 0 or self.bottom < 0:
            raise BadRequest(f"{self.name}: {self.size} m, {self.bottom} m above the floor: must be above 0 m")

    def solid(self) -> UprightCylinder:
        """Return the solid shape: the cylinder around the ball."""
        return UprightCylinder(self.x, self.y, self.size / 2, self.bottom, self.bottom + self.size)


@dataclass(frozen=True, slots=True)
class Edge:
    """A rectangle about (x, y) without floor, such as stairs down: ``length`` along x, ``width`` along y."""

    x: float
    y: float
    length: float
    width: float

    def __post_init__(self) -> None:
        if not min(self.length, self.width) > 0:
            raise BadRequest(f"edge at ({self.x}, {self.y}): {self.length} x {self.width} m: must be above 0 m")

    def contains(self, x: float, y: float) -> bool:
        """Return whether (x, y) is in the area without floor."""
        return abs(x - self.x) <= self.length / 2 and abs(y - self.y) <= self.width / 2


@dataclass(frozen=True, slots=True)
class Rover:
    """Another robot: a box that stands, or drives along ``path``, with a marker on each side.

    ``marker`` is the number in ArUco's dictionary DICT_4X4_50. The robot faces ``heading`` until it drives, then its
    direction of travel. Raises BadRequest for an unknown marker, or one that does not fit on the sides.
    """

    name: str
    marker: int
    x: float
    y: float
    heading: float = 0.0
    size: tuple[float, float, float] = (0.35, 0.35, 0.42)
    colour: Colour = (70, 74, 82)
    path: tuple[FloorPosition, ...] = ()
    speed: float = 0.2
    start: float = 0.0
    loop: bool = True
    walk: WaypointPath = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0 <= self.marker < MARKER_COUNT:
            raise BadRequest(f"{self.name}: marker {self.marker}: must be within 0..{MARKER_COUNT - 1}")
        if not min(self.size) > MARKER_SIZE * 4 / 3:
            raise BadRequest(f"{self.name}: {self.size} m: too small for a marker of {MARKER_SIZE} m and its rim")
        if not (isfinite(self.speed) and self.speed > 0):
            raise BadRequest(f"{self.name}: drives at {self.speed} m/s: must be above 0 m/s")
        walk = WaypointPath(((self.x, self.y), *self.path), self.speed, self.start, self.loop)
        object.__setattr__(self, "walk", walk)  # the way to fill in a field of a frozen class

    def solid(self, time: float) -> UprightBox:
        """Return the solid shape of the robot at ``time`` seconds."""
        x, y = self.walk.position_at(time)
        way = self.walk.heading_at(time) if time > self.start else None
        length, width, height = self.size
        return UprightBox(x, y, length, width, self.heading if way is None else way, 0.0, height)


# The dock that charges a base: a low box with two contacts, and three infrared beams that show the way to it.
#
# Its beams are as its vendor describes them: three sectors before it that overlap, each told apart in near and far,
# and three receivers on the base. The vendor gives no figures for them: all those here are our assumption.

DOCK_SIZE = (0.1, 0.25, 0.1)
"""Size of the dock in metres: length along its heading, width and height."""

DOCK_COLOUR: Colour = (44, 46, 52)

CONTACT_REACH = 0.015
"""Metres before the front of the dock at which its spring contacts touch those of the base."""

MAX_CONTACT_OFFSET, MAX_CONTACT_ANGLE = 0.04, radians(20)
"""Largest sideways offset (metres) and angle (radians) of a base at which the contacts touch."""

NEAR_RANGE, FAR_RANGE = 0.6, 2.5
"""Metres from the middle of the dock up to which the base receives the near beams, and the far ones."""

_BEAM_SECTORS = (
    (radians(4), radians(45), DockBeam.NEAR_LEFT, DockBeam.FAR_LEFT),
    (radians(-12), radians(12), DockBeam.NEAR_CENTRE, DockBeam.FAR_CENTRE),
    (radians(-45), radians(-4), DockBeam.NEAR_RIGHT, DockBeam.FAR_RIGHT),
)
"""First and last bearing (radians) of each infrared beam of the dock, positive to the left of the dock's heading."""

_RECEIVER_SECTORS = ((radians(15), radians(95)), (radians(-15), radians(15)), (radians(-95), radians(-15)))
"""First and last direction (radians) of the left, centre and right receiver of a base, positive to its left.

The centre receiver is so narrow that a base reaches the dock if it drives in the direction of the signal that this
receiver gets, as the vendor's program does.
"""

_BEAM_HEIGHT = 0.05  # metres above the floor of beams and receivers
NO_SIGNALS = DockSignals()


@dataclass(frozen=True, slots=True)
class WorldDock:
    """Dock about (x, y) that faces ``heading``; a base approaches it from the front, facing it."""

    x: float
    y: float
    heading: float

    @property
    def box(self) -> WorldBox:
        """Box of the dock, for collisions and the camera."""
        return WorldBox("dock", self.x, self.y, DOCK_SIZE, DOCK_COLOUR, heading=self.heading)

    @property
    def approach_line(self) -> tuple[FloorPosition, FloorPosition]:
        """The line on maps that shows the approach of a base: its two ends, in metres."""
        c, s = cos(self.heading), sin(self.heading)
        return (self.x, self.y), (self.x + 2.5 * DOCK_SIZE[0] * c, self.y + 2.5 * DOCK_SIZE[0] * s)

    def has_contact(self, base: Pose2D, radius: float) -> bool:
        """Return whether the contacts of a base touch the dock; ``base`` is its pose, ``radius`` that of its body."""
        dx, dy = base.x - self.x, base.y - self.y
        if abs(dx) + abs(dy) > 1.0:
            return False
        c, s = cos(self.heading), sin(self.heading)
        ahead, aside = dx * c + dy * s, dy * c - dx * s
        askew = remainder(base.heading - self.heading - pi, tau)
        return (
            0.0 < ahead <= DOCK_SIZE[0] / 2 + radius + CONTACT_REACH
            and abs(aside) <= MAX_CONTACT_OFFSET
            and abs(askew) <= MAX_CONTACT_ANGLE
        )

    def signals(self, base: Pose2D, is_clear: Callable[[Point3, Point3], bool]) -> DockSignals:
        """Return the beams of the dock that reach the receivers of a base with the pose ``base``.

        ``is_clear`` returns whether the line of sight between two points is free.
        """
        dx, dy = base.x - self.x, base.y - self.y
        away = hypot(dx, dy)
        if away > FAR_RANGE:
            return NO_SIGNALS
        bearing = remainder(atan2(dy, dx) - self.heading, tau)
        # Added up as plain numbers: flags are slow.
        beams = sum(
            (near if away <= NEAR_RANGE else far).value
            for low, high, near, far in _BEAM_SECTORS
            if low <= bearing <= high
        )
        way = remainder(atan2(-dy, -dx) - base.heading, tau)
        heard = [low <= way <= high for low, high in _RECEIVER_SECTORS]
        if not (beams and any(heard)) or not is_clear((base.x, base.y, _BEAM_HEIGHT), (self.x, self.y, _BEAM_HEIGHT)):
            return NO_SIGNALS
        return DockSignals(*(DockBeam(beams if here else 0) for here in heard))


# What a base that drives about feels of the world: what it bumps into, where the floor ends, where its dock is.

# The backup limit of a Create 3, which has no cliff sensors at its back: it backs only over floor that it has seen.

INITIAL_BACKUP_DISTANCE = 0.12
"""Metres that the base may back before it has driven forwards: 10 cm and braking, as a TurtleBot 4 user reports."""

RELEASE_DISTANCE = 0.05
"""Metres that the base must drive forwards after it has reached its backup limit, until it can back again.

The vendor says only that it must drive "for a while", so the value is an assumption.
"""


class BackupLimit:
    """Backup limit of a Create 3: it backs ``allowance`` metres, then only as far as it has driven forwards.

    ``is_reached`` is True from the moment when the base refuses to back until it has driven ``RELEASE_DISTANCE``
    forwards.
    """

    def __init__(self, allowance: float = INITIAL_BACKUP_DISTANCE) -> None:
        self.is_reached = False
        self._remaining = allowance

    def on_travel(self, distance: float) -> None:
        """Add the travel of the wheels since the last call, in metres, backwards negative."""
        self._remaining = max(self._remaining + distance, 0.0)
        if self._remaining <= 0.0 and distance < 0.0:
            self.is_reached = True
        elif self._remaining >= RELEASE_DISTANCE:
            self.is_reached = False

    def on_lift(self) -> None:
        """Reach the limit, because the base was lifted."""
        self._remaining, self.is_reached = 0.0, True


class Ground(Protocol):
    """The floor on which a base drives. Metres and radians, in the world frame."""

    @property
    def dock(self) -> WorldDock | None:
        """The dock at which the base may charge, or None."""
        ...

    def contact_directions(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        """Return the directions (radians about z) in which a disc at (x, y) touches or overlaps a solid."""
        ...

    def has_floor(self, x: float, y: float) -> bool:
        """Return whether there is floor at (x, y), as a cliff sensor measures it."""
        ...

    def is_visible(self, eye: Point3, point: Point3, time: float) -> bool:
        """Return whether the line between two points is free; the base receives the dock only then."""
        ...


class OpenFloor:
    """An infinite ``Ground`` without objects."""

    @property
    def dock(self) -> WorldDock | None:
        return None

    def contact_directions(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        del x, y, radius, time
        return ()

    def has_floor(self, x: float, y: float) -> bool:
        del x, y
        return True

    def is_visible(self, eye: Point3, point: Point3, time: float) -> bool:
        del eye, point, time
        return True
