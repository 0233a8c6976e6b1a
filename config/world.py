"""World files: the room that a simulated robot stands in, what is in it, and who. SI units and radians."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from config.faults import InvalidFileError, Source
from config.fields import Fields, fields_of
from config.layout import Layout, Place, place
from config.marked import Listing, Mapping, Scalar, read_source
from config.people import PersonConfig, read_person
from config.things import (
    BallConfig,
    BoxConfig,
    DockConfig,
    EdgeConfig,
    RoverConfig,
    WallConfig,
    read_dock,
    read_edge,
    read_furniture,
    read_object,
    read_rover,
    read_wall,
)

MOST_LOST = 0.9
"""The greatest share of reports or pictures that a world may lose: with all of them nothing would ever end."""

MOST_DRAIN = 1000.0
"""The greatest pace at which a battery empties: a full one in twenty seconds."""

NOISE = 3.0
"""The camera's noise in grey levels where a file does not say."""


@dataclass(frozen=True, slots=True)
class LightConfig:
    """From ``at`` seconds on the light goes to ``light`` (1 is daylight), evenly within ``over`` seconds."""

    at: float
    light: float
    over: float


@dataclass(frozen=True, slots=True)
class StartConfig:
    """Where the robot stands at first, and which way it looks."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True, slots=True)
class BatteryConfig:
    """What is left in the base's battery at the start (0..1), and how many times as fast as a real one it empties."""

    level: float = 1.0
    drain: float = 1.0


@dataclass(frozen=True, slots=True)
class PhysicsConfig:
    """How the base errs: the share of its wheels' travel that slips, the seconds from a command to its effect.

    ``gyro_noise`` in rad/s is a standard deviation; ``dropouts`` is the share 0..1 of its reports that are lost.
    Where ``battery`` is None it is full, and stays so. ``mishearing`` is the share of phrases that the robot takes for
    another one, or for nothing.
    """

    slip: float = 0.0
    lag: float = 0.0
    gyro_noise: float = 0.0
    dropouts: float = 0.0
    battery: BatteryConfig | None = None
    mishearing: float = 0.0


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """A room of ``length`` (x) by ``width`` (y) by ``height`` metres around ``centre``, and all that is in it.

    ``light`` is 1 in daylight, until the first of the ``light_changes``. ``noise`` is the standard deviation of the
    camera's noise in grey levels of 255, ``dropouts`` the share 0..1 of its pictures that are lost.
    """

    name: str
    summary: str
    length: float
    width: float
    centre: Place
    light: float
    noise: float
    people: tuple[PersonConfig, ...]
    file: str = ""
    height: float = 2.6
    start: StartConfig = StartConfig()
    light_changes: tuple[LightConfig, ...] = ()
    walls: tuple[WallConfig, ...] = ()
    furniture: tuple[BoxConfig, ...] = ()
    edges: tuple[EdgeConfig, ...] = ()
    objects: tuple[BoxConfig | BallConfig, ...] = ()
    robots: tuple[RoverConfig, ...] = ()
    dock: DockConfig | None = None
    physics: PhysicsConfig = PhysicsConfig()
    dropouts: float = 0.0


def load_world(path: Path) -> WorldConfig:
    """Read a world file. Raises InvalidFileError with every mistake in it."""
    return read_world(read_source(path))


def read_world(source: Source) -> WorldConfig:
    """Read the text of a world file. Raises InvalidFileError with every mistake in it."""
    fields = fields_of(source, what="a world file")
    room, layout = _room(fields)
    start = _start(fields, layout)
    physics = _physics(fields.section("physics"))
    noise, dropouts = _camera(fields, physics)
    light, changes = _light(fields)
    world = WorldConfig(
        name=fields.text("world"),
        summary=fields.text("summary", ""),
        length=room.length,
        width=room.width,
        height=room.height,
        centre=room.centre,
        start=start,
        light=light,
        light_changes=changes,
        noise=noise,
        dropouts=dropouts,
        physics=physics,
        walls=tuple(read_wall(fields, node, layout, room.height) for node in fields.items("walls")),
        furniture=tuple(read_furniture(fields, node, layout) for node in fields.items("furniture")),
        edges=tuple(read_edge(fields, node, layout) for node in fields.items("edges")),
        objects=tuple(read_object(fields, node, layout) for node in fields.items("objects")),
        dock=read_dock(fields, layout),
        robots=tuple(read_rover(fields, node, layout) for node in fields.items("robots")),
        people=tuple(read_person(fields, node, layout) for node in fields.items("people")),
        file=fields.source.name,
    )
    for key, named in (("objects", world.objects), ("robots", world.robots), ("people", world.people)):
        _check_names(fields, key, named)
    fields.done()
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return world


def _room(world: Fields) -> tuple[Layout, Layout | None]:
    """Read the room, and return its floor a second time to put things on, or None where the room is not known."""
    before = len(world.faults)
    length, width, height, centre = 8.0, 6.0, 2.6, (1.0, 0.0)
    fields = world.section("room")
    if fields is not None:
        length = fields.quantity("length", "length", length, low=2.0, high=50.0)
        width = fields.quantity("width", "length", width, low=2.0, high=50.0)
        height = fields.quantity("height", "length", height, low=2.2, high=20.0)
        middle = fields.node_of("centre")
        centre = place(fields, middle, "centre") if middle is not None else centre
        fields.done()
    room = Layout(length, width, height, centre)
    return room, None if len(world.faults) > before else room


def _start(world: Fields, layout: Layout | None) -> StartConfig:
    before = len(world.faults)
    fields = world.section("start")
    x = y = heading = 0.0
    room = world.node_of("room")
    mark = world.node.mark if room is None else room.mark
    if fields is not None:
        at = fields.node_of("at")
        x, y = place(fields, at, "at")
        mark = mark if at is None else at.mark
        heading = fields.quantity("heading", "angle", 0.0)
        fields.done()
    if layout is not None and len(world.faults) == before:
        layout.place_robot(world, mark, (x, y))
    return StartConfig(x, y, heading)


def _physics(fields: Fields | None) -> PhysicsConfig:
    if fields is None:
        return PhysicsConfig()
    physics = PhysicsConfig(
        slip=fields.quantity("slip", "share", 0.0, low=0.0, high=0.9),
        lag=fields.quantity("lag", "duration", 0.0, low=0.0, high=2.0),
        gyro_noise=fields.quantity("gyro_noise", "turn rate", 0.0, low=0.0, high=1.0),
        dropouts=fields.quantity("dropouts", "share", 0.0, low=0.0, high=MOST_LOST),
        battery=_battery(fields.section("battery")),
        mishearing=fields.quantity("mishearing", "share", 0.0, low=0.0, high=MOST_LOST),
    )
    fields.done()
    return physics


def _battery(fields: Fields | None) -> BatteryConfig | None:
    if fields is None:
        return None
    battery = BatteryConfig(
        level=fields.quantity("level", "share", 1.0, low=0.0, high=1.0),
        drain=fields.number("drain", 1.0, low=0.0, high=MOST_DRAIN),
    )
    fields.done()
    return battery


def _camera(world: Fields, physics: PhysicsConfig) -> tuple[float, float]:
    """Read noise and dropouts of the camera; what physics loses of reports, it loses of pictures, unless told else."""
    noise = world.number("noise", NOISE, low=0.0, high=80.0)
    fields = world.section("camera")
    if fields is None:
        return noise, physics.dropouts
    inner = fields.node_of("noise")
    if inner is not None and world.node_of("noise") is not None:
        fields.fault(inner.mark, "'noise' stands twice: here and at the top of the file")
    noise = fields.number("noise", noise, low=0.0, high=80.0)
    dropouts = fields.quantity("dropouts", "share", physics.dropouts, low=0.0, high=MOST_LOST)
    fields.done()
    return noise, dropouts


def _light(world: Fields) -> tuple[float, tuple[LightConfig, ...]]:
    """Read one light, or a list of changes in the order of time; before the first of them there is daylight."""
    node = world.node_of("light")
    if not isinstance(node, Listing):
        return world.quantity("light", "share", 1.0, low=0.0, high=2.0), ()
    changes: list[LightConfig] = []
    for item in node.items:
        fields = Fields(world.source, item, world.faults, what="a change of light")
        change = LightConfig(
            at=fields.quantity("at", "duration", low=0.0),
            light=fields.quantity("light", "share", low=0.0, high=2.0),
            over=fields.quantity("over", "duration", 0.0, low=0.0),
        )
        fields.done()
        at = fields.node_of("at")
        if at is not None and changes and change.at < changes[-1].at:
            fields.fault(at.mark, "'at': changes of light stand in the order of time")
        changes.append(change)
    return 1.0, tuple(changes)


class _Named(Protocol):
    @property
    def name(self) -> str: ...


def _check_names(world: Fields, key: str, named: Sequence[_Named]) -> None:
    """Note a fault for every name that stands in a list for the second time."""
    seen: Counter[str] = Counter()
    for node, each in zip(world.items(key), named, strict=True):
        seen[each.name] += 1
        name = node.get("name") if isinstance(node, Mapping) else None
        if seen[each.name] > 1 and isinstance(name, Scalar):
            world.fault(name.mark, f"'{each.name}' is the name of another of the {key} already")
