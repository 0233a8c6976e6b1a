"""What stands about in a world file: inner walls, furniture, edges, coloured objects, other robots."""

from dataclasses import dataclass
from math import atan2, cos, dist, sin

from config.colours import COLOURS
from config.fields import Fields
from config.layout import ROBOT, Layout, Place, Rectangle, lengths, place, sides
from config.marked import Listing, Node, Scalar
from config.people import read_path
from config.units import written

THICKNESS = 0.1
"""Metres from one side of an inner wall to the other."""

MARKERS = 50
"""How many markers there are: those of ArUco's dictionary DICT_4X4_50."""

DOCK = (0.1, 0.25)
"""Metres that a dock takes of the floor: along the way it faces, and across."""

SHAPES = ("ball", "box")
"""The shapes of coloured objects."""

_ROBOT_SIZE = (0.35, 0.35, 0.42)
_MARKER_SPACE = 0.21  # metres that the side of a robot must have for its marker


@dataclass(frozen=True, slots=True)
class WallConfig:
    """An inner wall from ``start`` to ``end``, each (x, y)."""

    start: Place
    end: Place
    height: float


@dataclass(frozen=True, slots=True)
class BoxConfig:
    """Furniture, or a coloured box: its middle, its ``size`` (length along ``heading``, width, height).

    ``bottom`` is the height above the floor of what it stands on; ``colour`` is a name in ``config.colours``.
    """

    name: str
    x: float
    y: float
    bottom: float
    size: tuple[float, float, float]
    heading: float
    colour: str


@dataclass(frozen=True, slots=True)
class BallConfig:
    """A ball of the diameter ``size``; the rest is as of a box."""

    name: str
    x: float
    y: float
    bottom: float
    size: float
    colour: str


@dataclass(frozen=True, slots=True)
class EdgeConfig:
    """Where the floor ends: a rectangle about (x, y), ``length`` along x, ``width`` along y."""

    x: float
    y: float
    length: float
    width: float


@dataclass(frozen=True, slots=True)
class DockConfig:
    """The dock of the base: its middle, and the way it faces."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class RoverConfig:
    """Another robot, with marker number ``marker`` on its sides, that stands or drives as people walk."""

    name: str
    marker: int
    x: float
    y: float
    heading: float
    size: tuple[float, float, float]
    colour: str
    path: tuple[Place, ...]
    speed: float
    start: float
    loop: bool


def read_wall(world: Fields, node: Node, layout: Layout | None, height: float) -> WallConfig:
    """Read an inner wall; as high as the room, ``height``, where it does not say."""
    fields = Fields(world.source, node, world.faults, what="a wall")
    before = len(fields.faults)
    start, end = (place(fields, fields.node_of(key, required=True), key) for key in ("from", "to"))
    wall = WallConfig(start, end, fields.quantity("height", "length", height, low=0.1, high=height))
    fields.done()
    if len(fields.faults) > before:
        return wall
    if dist(start, end) < THICKNESS:
        fields.fault(node.mark, f"the wall is only {written(dist(start, end), 'length')} long")
    elif layout is not None and layout.contains(fields, node.mark, "the wall", (start, end)):
        (x0, y0), (x1, y1) = start, end
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        ground = Rectangle(*middle, dist(start, end), THICKNESS, atan2(y1 - y0, x1 - x0))
        layout.put(fields, node.mark, "the wall", ground)
    return wall


def read_furniture(world: Fields, node: Node, layout: Layout | None) -> BoxConfig:
    """Read a piece of furniture."""
    fields = Fields(world.source, node, world.faults, what="a piece of furniture")
    before = len(fields.faults)
    found = _box(fields, "brown")
    fields.done()
    if layout is not None and len(fields.faults) == before:
        _check(fields, node, layout, found)
    return found


def read_object(world: Fields, node: Node, layout: Layout | None) -> BoxConfig | BallConfig:
    """Read a coloured object."""
    fields = Fields(world.source, node, world.faults, what="an object")
    before = len(fields.faults)
    shape = fields.choice("shape", SHAPES)
    if len(fields.faults) > before:  # what was meant shows in its size
        shape = "box" if isinstance(fields.node_of("size"), Listing) else "ball"
    found = _ball(fields) if shape == "ball" else _box(fields, None)
    fields.done()
    if layout is not None and len(fields.faults) == before:
        _check(fields, node, layout, found)
    return found


def read_edge(world: Fields, node: Node, layout: Layout | None) -> EdgeConfig:
    """Read where the floor ends."""
    fields = Fields(world.source, node, world.faults, what="an edge")
    before = len(fields.faults)
    x, y = place(fields, fields.node_of("at", required=True), "at")
    size = fields.node_of("size", required=True)
    length = width = 1.0
    if size is not None:
        example = "a length and a width, such as [1 m, 0.8 m]"
        length, width = lengths(fields, size, "size", 2, example, low=0.05, high=50.0)
    fields.done()
    if layout is not None and len(fields.faults) == before:
        layout.put(fields, node.mark, "the edge", Rectangle(x, y, length, width), solid=False)
    return EdgeConfig(x, y, length, width)


def read_dock(world: Fields, layout: Layout | None) -> DockConfig | None:
    """Read the dock of the base, before which there must be room for it; None where there is no dock."""
    fields = world.section("dock")
    if fields is None:
        return None
    before = len(fields.faults)
    at = fields.node_of("at", required=True)
    x, y = place(fields, at, "at")
    heading = fields.quantity("heading", "angle")
    fields.done()
    if at is not None and layout is not None and len(fields.faults) == before:
        length, width = DOCK
        before_it = length / 2 + ROBOT
        spot = (x + before_it * cos(heading), y + before_it * sin(heading))
        layout.room_for_robot(fields, at.mark, "before the dock", spot)
        if len(fields.faults) == before:
            layout.put(fields, at.mark, "the dock", Rectangle(x, y, length, width, heading))
    return DockConfig(x, y, heading)


def read_rover(world: Fields, node: Node, layout: Layout | None) -> RoverConfig:
    """Read another robot."""
    fields = Fields(world.source, node, world.faults, what="a robot")
    (x, y), path = read_path(fields, layout, _ROBOT_SIZE[0] / 2)
    size = fields.node_of("size")
    rover = RoverConfig(
        name=fields.text("name"),
        marker=fields.integer("marker", low=0, high=MARKERS - 1),
        x=x,
        y=y,
        heading=fields.quantity("heading", "angle", 0.0),
        size=_ROBOT_SIZE if size is None else sides(fields, size, "size"),
        colour=fields.choice("colour", list(COLOURS), "grey"),
        path=path,
        speed=fields.quantity("speed", "speed", 0.2, low=0.01, high=5.0),
        start=fields.quantity("after", "duration", 0.0, low=0.0),
        loop=fields.flag("loop", True),
    )
    fields.done()
    if size is not None and isinstance(size, Listing) and 0 < min(rover.size) < _MARKER_SPACE:
        least = written(_MARKER_SPACE, "length")
        fields.fault(size.mark, f"'size': no side has room for its marker, which needs {least}")
    return rover


def _box(fields: Fields, colour: str | None) -> BoxConfig:
    x, y, bottom = _spot(fields)
    return BoxConfig(
        name=fields.text("name"),
        x=x,
        y=y,
        bottom=bottom,
        size=sides(fields, fields.node_of("size", required=True), "size"),
        heading=fields.quantity("heading", "angle", 0.0),
        colour=fields.choice("colour", list(COLOURS), colour),
    )


def _ball(fields: Fields) -> BallConfig:
    x, y, bottom = _spot(fields)
    return BallConfig(
        name=fields.text("name"),
        x=x,
        y=y,
        bottom=bottom,
        size=fields.quantity("size", "length", low=0.02, high=2.0),
        colour=fields.choice("colour", list(COLOURS)),
    )


def _spot(fields: Fields) -> tuple[float, float, float]:
    """Read where something stands: [x, y], or [x, y, z] for z above the floor."""
    node = fields.node_of("at", required=True)
    if not isinstance(node, Listing) or len(node.items) != 3:
        return (*place(fields, node, "at"), 0.0)
    x, y = (fields.measure(item, "at", "length") for item in node.items[:2])
    return x, y, fields.measure(node.items[2], "at", "length", low=0.0)


def _check(fields: Fields, node: Node, layout: Layout, found: BoxConfig | BallConfig) -> None:
    """Note a fault where something is outside of the room, above or beside, or where the robot starts."""
    if isinstance(found, BallConfig):
        length = width = height = found.size
        heading = 0.0
    else:
        (length, width, height), heading = found.size, found.heading
    name = fields.node_of("name")
    mark = node.mark if not isinstance(name, Scalar) else name.mark
    if found.bottom + height > layout.height:
        top = written(found.bottom + height, "length")
        room = f"the room is {written(layout.height, 'length')} high"
        fields.fault(mark, f"'{found.name}' reaches up to {top}", room)
    ground = Rectangle(found.x, found.y, length, width, heading)
    if found.bottom == 0.0:
        layout.put(fields, mark, f"'{found.name}'", ground)
    else:
        layout.contains(fields, mark, f"'{found.name}'", ground.corners())
