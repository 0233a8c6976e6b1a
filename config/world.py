"""World files: the room that a simulated robot stands in, and who is in it. SI units and radians."""

from dataclasses import dataclass
from pathlib import Path

from config.faults import InvalidFileError
from config.fields import Fields, read_fields
from config.marked import Listing, Node, Scalar


@dataclass(frozen=True, slots=True)
class PersonConfig:
    """Somebody who stands at (x, y) and, after ``start`` seconds, walks along ``path`` at ``speed`` m/s.

    ``facing`` is an angle about z, or None for always towards the camera; ``height`` is that of the eyes.
    """

    name: str
    look: str
    x: float
    y: float
    height: float
    facing: float | None
    path: tuple[tuple[float, float], ...]
    speed: float
    start: float
    loop: bool


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """A room of ``length`` (x) by ``width`` (y) metres around ``centre``; the robot starts at (0, 0), looking along x.

    ``light`` is 1 in daylight, ``noise`` the standard deviation of the camera's noise in grey levels of 255.
    """

    name: str
    summary: str
    length: float
    width: float
    centre: tuple[float, float]
    light: float
    noise: float
    people: tuple[PersonConfig, ...]
    file: str = ""


def load_world(path: Path) -> WorldConfig:
    """Read a world file. Raises InvalidFileError with every mistake in it."""
    fields = read_fields(path, what="a world file")
    room = fields.section("room")
    length, width, centre = 8.0, 6.0, (1.0, 0.0)
    if room is not None:
        length = room.quantity("length", "length", length, low=2.0, high=50.0)
        width = room.quantity("width", "length", width, low=2.0, high=50.0)
        middle = room.node_of("centre")
        centre = _place(room, middle, "centre") if middle is not None else centre
        room.done()
    world = WorldConfig(
        name=fields.text("world"),
        summary=fields.text("summary", ""),
        length=length,
        width=width,
        centre=centre,
        light=fields.quantity("light", "share", 1.0, low=0.0, high=2.0),
        noise=fields.number("noise", 3.0, low=0.0, high=80.0),
        people=tuple(_person(fields, node) for node in fields.items("people")),
        file=fields.source.name,
    )
    fields.done()
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return world


def _person(world: Fields, node: Node) -> PersonConfig:
    fields = Fields(world.source, node, world.faults, what="a person")
    at = fields.node_of("at", required=True)
    x, y = _place(fields, at, "at") if at is not None else (0.0, 0.0)
    facing = fields.node_of("facing")
    towards_camera = facing is None or (isinstance(facing, Scalar) and facing.value == "camera")
    person = PersonConfig(
        name=fields.text("name"),
        look=fields.text("look", "anna"),
        x=x,
        y=y,
        height=fields.quantity("height", "length", 1.6, low=0.8, high=2.1),
        facing=None if towards_camera or facing is None else fields.measure(facing, "facing", "angle"),
        path=tuple(_place(fields, point, "walk") for point in fields.items("walk")),
        speed=fields.quantity("speed", "speed", 0.5, low=0.01, high=5.0),
        start=fields.quantity("after", "duration", 0.0, low=0.0),
        loop=fields.flag("loop", True),
    )
    fields.done()
    return person


def _place(fields: Fields, node: Node, key: str) -> tuple[float, float]:
    if not isinstance(node, Listing) or len(node.items) != 2:
        fields.fault(node.mark, f"'{key}' needs a place, such as [1.5 m, 0.2 m]")
        return 0.0, 0.0
    x, y = (fields.measure(item, key, "length") for item in node.items)
    return x, y
