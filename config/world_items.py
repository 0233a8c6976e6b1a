"""Items of a world file: inner walls, furniture, edges, coloured objects, dock, other robots and people."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import atan2, cos, dist, hypot, sin
from typing import TYPE_CHECKING, Annotated, Literal

from config.colours import COLOURS
from config.units import quantity_text
from drivers.api.keys import KeyDiagnostic, inside, key, keys

if TYPE_CHECKING:
    from config.world import WorldConfig


FloorPoint = tuple[float, float]
"""Point (x, y) on the floor in metres."""

Vector3D = tuple[float, float, float]
"""Point with its height above the floor, or length, width and height of a box, in metres."""

PLACE_ERROR = "'{}' needs a place, such as [1.5 m, 0.2 m]"
"""Error message for an invalid point on the floor."""

SIZE_ERROR = "'{}' needs three lengths, such as [1.2 m, 0.8 m, 0.75 m]"
"""Error message for an invalid size of a box."""

WALL_THICKNESS = 0.1
"""Thickness of an inner wall in metres."""

MARKER_COUNT = 50
"""Number of different markers on robots: those of ArUco's dictionary DICT_4X4_50."""

DOCK_SIZE = (0.1, 0.25)
"""Floor size of a dock in metres: along its direction, and across."""

SHAPES = ("ball", "box")
"""Shapes of coloured objects in a world."""

_MARKER_SPACE = 0.21  # metres that the side of a robot must have for its marker


class PlacedItem:
    """Base class of items with a position ``at``, whose first two numbers are metres along x and y."""

    at: tuple[float, ...]

    @property
    def x(self) -> float:
        """Position along x in metres."""
        return self.at[0]

    @property
    def y(self) -> float:
        """Position along y in metres."""
        return self.at[1]


@keys
class FloorItem(PlacedItem):
    """Base class of items with a position on the floor."""

    at: FloorPoint = key("length", wrong=PLACE_ERROR, help="Position of its middle: [x, y].")


@keys
class StandingItem(PlacedItem):
    """Base class of items that stand on the floor or on another item."""

    name: str = key(help="Name.")
    at: FloorPoint | Vector3D = key(
        "length",
        wrong=PLACE_ERROR,
        help="Position of its middle: [x, y], or [x, y, z] with the height z above the floor.",
    )

    @property
    def bottom(self) -> float:
        """Height of the item's bottom above the floor in metres."""
        return sum(self.at[2:])

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for an item whose bottom is below the floor."""
        if self.bottom < 0.0:
            yield KeyDiagnostic("'at' must be at least 0 m", ("at", 2), about=(("at",),))


@keys
class WallConfig:
    """Inner wall; as high as the room if ``height`` is None."""

    start: FloorPoint = key("length", word="from", wrong=PLACE_ERROR, help="One end: [x, y].")
    end: FloorPoint = key("length", word="to", wrong=PLACE_ERROR, help="Other end: [x, y].")
    height: float | None = key("length", default=None, low=0.1, help="Height; by default that of the room.")


@keys
class BoxConfig(StandingItem):
    """Piece of furniture: a box whose ``size`` is its length along ``heading``, its width and its height."""

    size: Vector3D = key("length", low=0.01, high=20.0, wrong=SIZE_ERROR, help="Length, width and height.")
    heading: float = key("angle", default=0.0, help="Direction of its length.")
    colour: str = key(default="brown", among=COLOURS, help="Colour.")


@keys
class ThingConfig(StandingItem):
    """Coloured object: a ball with the diameter ``size``, or a box."""

    shape: str = key(among=SHAPES, help="Shape.")
    size: (
        Annotated[float, inside("length", low=0.02, high=2.0)]
        | Annotated[Vector3D, inside("length", low=0.01, high=20.0, wrong=SIZE_ERROR)]
    ) = key(help="Diameter of a ball; length, width and height of a box.")
    turned: float | None = key("angle", default=None, word="heading", help="Direction of the length of a box.")
    colour: str = key(among=COLOURS, help="Colour.")

    @property
    def heading(self) -> float:
        """Direction of the object's length in radians."""
        return self.turned or 0.0

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for a size or a heading that does not fit the shape."""
        yield from super().diagnostics()
        about = (("shape",), ("size",))
        if self.shape == "box" and isinstance(self.size, float):
            yield KeyDiagnostic(SIZE_ERROR.replace("{}", "size"), ("size",), about=about)
        elif self.shape == "ball" and not isinstance(self.size, float):
            yield KeyDiagnostic("'size' of a ball needs one length, such as '20 cm'", ("size",), about=about)
        if self.shape == "ball" and self.turned is not None:
            yield KeyDiagnostic("a ball has no 'heading'", ("heading",), marks_key=True, about=(("shape",),))


@keys
class EdgeConfig(FloorItem):
    """Edge of the floor: a rectangular hole with its ``size`` along x and along y."""

    size: FloorPoint = key(
        "length",
        low=0.05,
        high=50.0,
        wrong="'{}' needs a length and a width, such as [1 m, 0.8 m]",
        help="Length along x, and width along y.",
    )

    @property
    def length(self) -> float:
        """Size of the hole along x in metres."""
        return self.size[0]

    @property
    def width(self) -> float:
        """Size of the hole along y in metres."""
        return self.size[1]


@keys
class DockConfig(FloorItem):
    """Charging dock of the base."""

    heading: float = key("angle", help="Direction that it faces.")


@keys
class WalkerConfig(FloorItem):
    """Base class of people and robots that may move along a path."""

    name: str = key(help="Name.")
    path: tuple[Annotated[FloorPoint, inside("length", wrong=PLACE_ERROR)], ...] = key(
        default=(), word="walk", help="Path: places to go to, in order."
    )
    speed: float = key("speed", default=0.5, low=0.01, high=5.0, help="Speed.")
    start: float = key("duration", default=0.0, low=0.0, word="after", help="Time before they start.")
    loop: bool = key(default=True, help="Return to the first place and repeat.")


@keys
class RoverConfig(WalkerConfig):
    """Other robot with a marker on its sides, which stands or drives along a path."""

    marker: int = key(low=0, high=MARKER_COUNT - 1, help="Number of the marker on its sides.")
    heading: float = key("angle", default=0.0, help="Initial heading.")
    size: Vector3D = key(
        "length",
        default=(0.35, 0.35, 0.42),
        low=0.01,
        high=20.0,
        wrong=SIZE_ERROR,
        help="Length, width and height.",
    )
    colour: str = key(default="grey", among=COLOURS, help="Colour.")
    speed: float = key("speed", default=0.2, low=0.01, high=5.0, help="Speed.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for a robot whose size is too small for the marker."""
        if min(self.size) < _MARKER_SPACE:
            least = quantity_text(_MARKER_SPACE, "length")
            message = f"'size': no side has room for its marker, which needs {least}"
            yield KeyDiagnostic(message, ("size",), about=(("size",),))


# The people of a world file: who they are, where they stand and walk, what they do and answer.

LOOKS = ("anna", "ben", "chidi", "dora", "emil", "farah")
"""Appearances of simulated people, by name."""

PERSON_RADIUS = 0.25
"""Distance in metres from a person's middle at which a robot touches them."""

ANY_PHRASE = "anything"
"""Value of ``hears`` that matches any phrase of the robot."""

REACTION_TIME = 0.6
"""Default time in seconds from a phrase of the robot to a person's reaction."""

EARSHOT = 4.0
"""Default distance in metres within which people hear the robot."""

Facing = float | Literal["camera", "away"]
"""Direction in which a person faces: an angle (rad) about z, or "camera" (towards the robot), or "away"."""


@keys
class ActConfig:
    """Act of a simulated person at a time, or ``after`` seconds from a phrase of the robot that contains ``hears``."""

    at: float | None = key("duration", default=None, low=0.0, help="Time from the beginning.")
    phrase: str | None = key(
        default=None, word="hears", help=f"What of the robot's words sets it off; `{ANY_PHRASE}` is whatever it says."
    )
    delay: float | None = key(
        "duration",
        default=None,
        word="after",
        low=0.0,
        high=60.0,
        help=f"How long after it: {REACTION_TIME} s if not given.",
    )
    say: str = key(default="", help="Text that they say.")
    nod: bool = key(default=False, help="Nod.")
    turn: Facing | None = key("angle", default=None, help="Direction to turn to.")
    leave: bool = key(default=False, help="Leave the room.")
    often: int | None = key(default=None, word="times", low=1, help="Maximum number of times; no limit by default.")

    @property
    def hears(self) -> str | None:
        """Text in the robot's speech that triggers the act (empty for any speech), or None."""
        return "" if self.phrase == ANY_PHRASE else self.phrase

    @property
    def after(self) -> float:
        """Delay in seconds after the phrase."""
        return REACTION_TIME if self.delay is None else self.delay

    @property
    def times(self) -> int:
        """Maximum number of times that the act is done; 0 for no limit."""
        return self.often or 0

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for an act with no trigger or two, or without an action."""
        if (self.at is None) == (self.phrase is None):
            hint = "such as {at: 5 s, ...} or {hears: hello, ...}"
            yield KeyDiagnostic("an act needs either 'at' or 'hears'", hint=hint)
        elif self.at is not None and self.delay is not None:
            yield KeyDiagnostic("'after' needs 'hears': 'at' sets the time already")
        elif self.at is not None and self.often is not None:
            yield KeyDiagnostic("'times' needs 'hears': an act with 'at' is done once")
        if not (self.say or self.nod or self.leave or self.turn is not None):
            yield KeyDiagnostic("the act does nothing", hint="an act needs one of: say, nod, turn, leave")


@keys
class PersonConfig(WalkerConfig):
    """Person at (x, y) who, after ``start`` seconds, walks along ``path`` at ``speed`` m/s."""

    look: str = key(default="anna", among=LOOKS, help="Appearance.")
    height: float = key("length", default=1.6, low=0.8, high=2.1, help="Height of the eyes.")
    facing: Facing = key("angle", default="camera", help="Direction: an angle, to the robot, or away.")
    acts: tuple[ActConfig, ...] = key(default=(), each="an act", help="Acts and answers.")
    known: bool = key(default=True, help="The robot knows their face.")
    hears_within: float = key(
        "length", default=EARSHOT, low=0.0, high=50.0, help="Distance within which they hear the robot."
    )


# Where things stand in a world file, and whether they can stand there: in the room, and not in each other's way.

ROBOT_RADIUS = 0.18
"""Radius of the robot in metres: that of a TurtleBot 2."""

ItemPath = tuple[str | int, ...]
"""Path of an item in the world file: keys, and indices of lists."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Rectangle on the floor: its middle (x, y), its ``length`` along ``heading``, and its ``width``."""

    x: float
    y: float
    length: float
    width: float
    heading: float = 0.0

    def corners(self) -> list[FloorPoint]:
        """Return the corners (x, y) of the rectangle."""
        c, s = cos(self.heading), sin(self.heading)
        halves = [(u * self.length / 2, v * self.width / 2) for u, v in ((1, -1), (1, 1), (-1, 1), (-1, -1))]
        return [(self.x + u * c - v * s, self.y + u * s + v * c) for u, v in halves]

    def gap(self, x: float, y: float) -> float:
        """Return the distance in metres from (x, y) to the rectangle; 0 inside."""
        dx, dy, c, s = x - self.x, y - self.y, cos(self.heading), sin(self.heading)
        u, v = abs(dx * c + dy * s), abs(dy * c - dx * s)
        return hypot(max(0.0, u - self.length / 2), max(0.0, v - self.width / 2))


@dataclass(frozen=True, slots=True)
class FloorSubject:
    """Item to place on the floor, with its ``label`` in messages.

    ``mark`` is the path in the world file at which its errors are shown, ``subject_path`` the path of the item itself.
    """

    label: str
    mark: ItemPath
    subject_path: ItemPath


@dataclass(slots=True)
class FloorPlan:
    """Floor of a world's room with the items placed so far; yields errors for items that do not fit."""

    world: "WorldConfig"
    occupied: list[tuple[FloorSubject, Rectangle]] = field(default_factory=list)

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each item of the world file that cannot be at its position."""
        world = self.world
        start = FloorSubject("the robot", ("start", "at"), ("start",))
        if not self._inside(world.start.at, ROBOT_RADIUS):
            message = f"there is no room for the robot at {_point_text(world.start.at)}, where it starts"
            yield self._outside(start, message, otherwise=("room",))
        for place, wall in enumerate(world.walls):
            yield from self._wall(wall, ("walls", place))
        for place, piece in enumerate(world.furniture):
            yield from self._box(piece, ("furniture", place))
        for place, edge in enumerate(world.edges):
            at: ItemPath = ("edges", place)
            ground = Rectangle(edge.x, edge.y, edge.length, edge.width)
            yield from self._put(FloorSubject("the edge", at, at), ground, solid=False)
        for place, thing in enumerate(world.objects):
            yield from self._box(thing, ("objects", place))
        yield from self._dock()
        for place, rover in enumerate(world.robots):
            yield from self._walk(rover, "a robot", ("robots", place), rover.size[0] / 2)
        for place, person in enumerate(world.people):
            yield from self._walk(person, "a person", ("people", place), PERSON_RADIUS)

    def _wall(self, wall: WallConfig, at: ItemPath) -> Iterator[KeyDiagnostic]:
        thing, length = FloorSubject("the wall", at, at), dist(wall.start, wall.end)
        if (wall.height or 0.0) > self.world.height:
            highest = quantity_text(self.world.height, "length")
            yield KeyDiagnostic(
                f"'height' must be at most {highest}", (*at, "height"), about=(("room",), (*at, "height"))
            )
        elif length < WALL_THICKNESS:
            least = quantity_text(WALL_THICKNESS, "length")
            message = f"the wall is only {quantity_text(length, 'length')} long: at least {least} are needed"
            yield KeyDiagnostic(message, at, about=(at,))
        else:
            outside = list(self._contains(thing, (wall.start, wall.end)))
            (x0, y0), (x1, y1) = wall.start, wall.end
            ground = Rectangle((x0 + x1) / 2, (y0 + y1) / 2, length, WALL_THICKNESS, atan2(y1 - y0, x1 - x0))
            yield from outside or self._put(thing, ground)

    def _box(self, box: BoxConfig | ThingConfig, at: ItemPath) -> Iterator[KeyDiagnostic]:
        length, width, height = (box.size,) * 3 if isinstance(box.size, float) else box.size
        thing = FloorSubject(f"'{box.name}'", (*at, "name"), at)
        if box.bottom + height > self.world.height:
            top, room = (quantity_text(end, "length") for end in (box.bottom + height, self.world.height))
            yield self._mistake(thing, f"'{box.name}' reaches up to {top}", f"the room is {room} high")
        ground = Rectangle(box.x, box.y, length, width, box.heading)
        if box.bottom == 0.0:
            yield from self._put(thing, ground)
        else:
            yield from self._contains(thing, ground.corners())

    def _dock(self) -> Iterator[KeyDiagnostic]:
        """Place the dock, with room for the robot in front of it."""
        dock = self.world.dock
        if dock is None:
            return
        thing, before = FloorSubject("the dock", ("dock", "at"), ("dock",)), DOCK_SIZE[0] / 2 + ROBOT_RADIUS
        spot = (dock.x + before * cos(dock.heading), dock.y + before * sin(dock.heading))
        in_way = next((other for other, ground in self.occupied if ground.gap(*spot) < ROBOT_RADIUS), None)
        message = f"there is no room for the robot before the dock, at {_point_text(spot)}"
        if not self._inside(spot, ROBOT_RADIUS):
            yield self._outside(thing, message)
        elif in_way is not None:
            yield self._mistake(thing, f"{message}: {in_way.label} is there", about=in_way.subject_path)
        else:
            yield from self._put(thing, Rectangle(dock.x, dock.y, *DOCK_SIZE, dock.heading))

    def _walk(self, walker: WalkerConfig, kind: str, at: ItemPath, radius: float) -> Iterator[KeyDiagnostic]:
        """Yield an error for each stop of a person's or robot's path that is outside the room or occupied."""
        stops: list[tuple[ItemPath, FloorPoint]] = [((*at, "at"), walker.at)]
        stops += [((*at, "walk", number), stop) for number, stop in enumerate(walker.path)]
        for number, (mark, point) in enumerate(stops):
            thing = FloorSubject(walker.name or kind, mark, mark)
            in_way = next((other for other, ground in self.occupied if ground.gap(*point) == 0.0), None)
            if outside := list(self._contains(thing, [point])):
                yield from outside
            elif in_way is not None:
                message = f"{thing.label} cannot be at {_point_text(point)}: {in_way.label} is there"
                yield self._mistake(thing, message, about=in_way.subject_path)
            elif number == 0 and dist(point, self.world.start.at) < ROBOT_RADIUS + radius:
                yield self._at_start(thing)

    def _put(self, thing: FloorSubject, ground: Rectangle, *, solid: bool = True) -> Iterator[KeyDiagnostic]:
        """Place an item on the floor, ``solid`` or a hole: inside the room, and not at the robot's start."""
        outside = list(self._contains(thing, ground.corners()))
        if outside:
            yield from outside
            return
        if ground.gap(*self.world.start.at) < ROBOT_RADIUS:
            yield self._at_start(thing)
        if solid:
            self.occupied.append((thing, ground))

    def _contains(self, thing: FloorSubject, points: Iterable[FloorPoint]) -> Iterator[KeyDiagnostic]:
        """Yield an error for the first point outside the room."""
        for point in points:
            if not self._inside(point):
                yield self._outside(thing, f"{thing.label} is outside the room at {_point_text(point)}")
                return

    def _inside(self, point: FloorPoint, margin: float = 0.0) -> bool:
        world = self.world
        x, y = abs(point[0] - world.centre[0]), abs(point[1] - world.centre[1])
        slack = 1e-9  # half of a length that was written may be a hair off
        return x <= world.length / 2 - margin + slack and y <= world.width / 2 - margin + slack

    def _at_start(self, thing: FloorSubject) -> KeyDiagnostic:
        where = f"{thing.label} is where the robot starts, at {_point_text(self.world.start.at)}"
        return self._mistake(thing, where, "move it, or give 'start' another place", about=("start",))

    def _outside(self, thing: FloorSubject, message: str, *, otherwise: ItemPath = ()) -> KeyDiagnostic:
        world = self.world
        sides = (
            f"{name} {quantity_text(middle - side / 2, 'length')} to {quantity_text(middle + side / 2, 'length')}"
            for name, middle, side in zip("xy", world.centre, (world.length, world.width), strict=True)
        )
        return self._mistake(thing, message, f"the room is {', '.join(sides)}", otherwise=otherwise)

    def _mistake(
        self,
        thing: FloorSubject,
        message: str,
        hint: str = "",
        *,
        about: ItemPath = ("room",),
        otherwise: ItemPath = (),
    ) -> KeyDiagnostic:
        """Return an error about an item in the room, such as two items at one place.

        ``about`` is the path of the other item that is involved. ``otherwise`` is the path that is marked in the file
        if the item's own path is not there.
        """
        return KeyDiagnostic(message, thing.mark, otherwise, hint=hint, about=(("room",), thing.subject_path, about))


def _point_text(point: FloorPoint) -> str:
    return f"[{quantity_text(point[0], 'length')}, {quantity_text(point[1], 'length')}]"
