"""World files: the room that a simulated robot stands in, what is in it, and who. SI units and radians."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from config.diagnostics import InvalidFileError, SourceText
from config.fields import fields_of
from config.section_reader import read_keys
from config.world_items import (
    PLACE_ERROR,
    BoxConfig,
    DockConfig,
    EdgeConfig,
    FloorPlan,
    FloorPoint,
    PersonConfig,
    PlacedItem,
    RoverConfig,
    ThingConfig,
    WallConfig,
)
from config.yaml_nodes import read_source
from drivers.api.keys import KeyDiagnostic, key, keys

MAX_LOSS = 0.9
"""The greatest share of reports or pictures that a world may lose: with all of them nothing would ever end."""

MAX_DRAIN = 1000.0
"""The greatest pace at which a battery empties: a full one in twenty seconds."""

DEFAULT_NOISE = 3.0
"""The camera's noise in grey levels where a file does not say."""


@keys
class RoomConfig:
    """A room around ``centre``: ``length`` along x, ``width`` along y."""

    length: float = key("length", default=8.0, low=2.0, high=50.0, help="Its length, along x.")
    width: float = key("length", default=6.0, low=2.0, high=50.0, help="Its width, along y.")
    height: float = key("length", default=2.6, low=2.2, high=20.0, help="Its height.")
    centre: FloorPoint = key("length", default=(1.0, 0.0), wrong=PLACE_ERROR, help="Where its middle is: [x, y].")


@keys
class LightConfig:
    """From ``at`` seconds on the light goes to ``light`` (1 is daylight), evenly within ``over`` seconds."""

    at: float = key("duration", low=0.0, help="When, from the beginning.")
    light: float = key("share", low=0.0, high=2.0, help="How bright it is then; `100 %` is daylight.")
    over: float = key("duration", default=0.0, low=0.0, help="How long the change takes.")


@keys
class StartConfig(PlacedItem):
    """Where the robot stands at first, and which way it looks."""

    at: FloorPoint = key("length", default=(0.0, 0.0), wrong=PLACE_ERROR, help="Where: [x, y].")
    heading: float = key("angle", default=0.0, help="Which way it looks.")


@keys
class BatteryConfig:
    """What is left in the base's battery at the start (0..1), and how many times as fast as a real one it empties."""

    level: float = key("share", default=1.0, low=0.0, high=1.0, help="What is left in it at first.")
    drain: float = key(default=1.0, low=0.0, high=MAX_DRAIN, help="How many times as fast as a real one it empties.")


@keys
class PushConfig:
    """A push at the trunk of a robot that has a body: it alone would make the robot go at ``speed``."""

    at: float = key("duration", low=0.0, help="When, from the beginning.")
    speed: float = key("speed", low=0.0, high=5.0, help="How hard: the speed that the robot gets by it.")
    towards: float = key("angle", default=0.0, help="Which way: `90 deg` is along y.")
    over: float = key("duration", default=0.1, low=0.002, high=10.0, help="How long it takes.")


@keys
class PhysicsConfig:
    """How the base errs: the share of its wheels' travel that slips, the seconds from a command to its effect.

    ``gyro_noise`` in rad/s is a standard deviation; ``dropouts`` is the share 0..1 of its reports that are lost.
    Where ``battery`` is None it is full, and stays so. ``mishearing`` is the share of phrases that the robot takes for
    another one, or for nothing. The rest is for robots in physics (`--physics`): Coulomb's ``friction``, how far the
    floor rises ahead and to the left (``slope``, rad), by which share ``masses`` are off at most, the seconds from a
    goal to its servo, and ``pushes``.
    """

    slip: float = key("share", default=0.0, low=0.0, high=0.9, help="How much of its wheels' travel slips.")
    lag: float = key("duration", default=0.0, low=0.0, high=2.0, help="From a command to its effect.")
    gyro_noise: float = key(
        "turn rate", default=0.0, low=0.0, high=1.0, help="How far its gyro errs: a standard deviation."
    )
    dropouts: float = key("share", default=0.0, low=0.0, high=MAX_LOSS, help="How many of its reports are lost.")
    battery: BatteryConfig | None = key(default=None, help="Its battery, which is full for ever where not given.")
    mishearing: float = key(
        "share", default=0.0, low=0.0, high=MAX_LOSS, help="How many phrases the robot takes for others, or for none."
    )
    friction: float = key(default=1.0, low=0.05, high=3.0, help="How much friction the floor has (Coulomb's number).")
    slope: tuple[float, float] = key(
        "angle",
        default=(0.0, 0.0),
        low=-0.35,
        high=0.35,
        wrong="'{}' needs two angles, such as [2 deg, 0 deg]",
        help="How far the floor rises: [along x, along y].",
    )
    masses: float = key("share", default=0.0, low=0.0, high=0.5, help="How far each mass of the robot is off at most.")
    servo_delay: float = key("duration", default=0.0, low=0.0, high=1.0, help="From a goal to the servo that hears it.")
    pushes: tuple[PushConfig, ...] = key(default=(), each="a push", help="Pushes at the robot.")


@keys
class CameraConfig:
    """How the robot's camera errs."""

    noise: float | None = key(
        default=None, low=0.0, high=80.0, help=f"In grey levels of 255; {DEFAULT_NOISE:g} if not given."
    )
    dropouts: float | None = key(
        "share", default=None, low=0.0, high=MAX_LOSS, help="How many pictures are lost; as the base's reports."
    )


@keys
class WorldConfig:
    """A room of ``length`` (x) by ``width`` (y) by ``height`` metres around ``centre``, and all that is in it.

    ``light`` is 1 in daylight, until the first of the ``light_changes``. ``noise`` is the standard deviation of the
    camera's noise in grey levels of 255, ``dropouts`` the share 0..1 of its pictures that are lost. ``file`` is where
    it comes from.
    """

    name: str = key(word="world", help="What it is called.")
    summary: str = key(default="", help="What it is, in a line.")
    room: RoomConfig = key(default=RoomConfig(), help="The room.")
    start: StartConfig = key(default=StartConfig(), help="Where the robot stands at first.")
    lights: float | tuple[LightConfig, ...] = key(
        "share",
        default=1.0,
        low=0.0,
        high=2.0,
        word="light",
        each="a change of light",
        wrong="'{}' needs a share such as '50 %', or a list of changes",
        help="How bright it is; or how that changes, from daylight on.",
    )
    grain: float | None = key(default=None, low=0.0, high=80.0, word="noise", help="As `camera.noise`.")
    camera: CameraConfig = key(default=CameraConfig(), help="How the robot's camera errs.")
    physics: PhysicsConfig = key(default=PhysicsConfig(), help="How the robot's base errs.")
    walls: tuple[WallConfig, ...] = key(default=(), each="a wall", help="Inner walls.")
    furniture: tuple[BoxConfig, ...] = key(default=(), each="a piece of furniture", help="What stands about.")
    edges: tuple[EdgeConfig, ...] = key(default=(), each="an edge", help="Where the floor ends.")
    objects: tuple[ThingConfig, ...] = key(default=(), each="an object", help="Coloured things, to be looked for.")
    dock: DockConfig | None = key(default=None, help="The dock of the base.")
    robots: tuple[RoverConfig, ...] = key(default=(), each="a robot", help="Other robots.")
    people: tuple[PersonConfig, ...] = key(default=(), each="a person", help="Who is there.")
    file: str = ""

    @property
    def length(self) -> float:
        """Metres of the room along x."""
        return self.room.length

    @property
    def width(self) -> float:
        """Metres of the room along y."""
        return self.room.width

    @property
    def height(self) -> float:
        """Metres from the floor to the ceiling."""
        return self.room.height

    @property
    def centre(self) -> FloorPoint:
        """The middle of the room."""
        return self.room.centre

    @property
    def light(self) -> float:
        """How bright it is at first."""
        return 1.0 if isinstance(self.lights, tuple) else self.lights

    @property
    def light_changes(self) -> tuple[LightConfig, ...]:
        """How the light changes, in the order of time."""
        return self.lights if isinstance(self.lights, tuple) else ()

    @property
    def noise(self) -> float:
        """The camera's noise in grey levels."""
        return next((each for each in (self.camera.noise, self.grain) if each is not None), DEFAULT_NOISE)

    @property
    def dropouts(self) -> float:
        """The share of the camera's pictures that are lost: as of the base's reports, unless told else."""
        return self.physics.dropouts if self.camera.dropouts is None else self.camera.dropouts

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield what cannot stand where it is, what goes by one name, and what is told twice or in no order."""
        if self.camera.noise is not None and self.grain is not None:
            yield KeyDiagnostic("'noise' stands twice: here and at the top of the file", ("camera", "noise"))
        before = 0.0
        for place, change in enumerate(self.light_changes):
            if change.at < before:
                at = ("light", place, "at")
                yield KeyDiagnostic("'at': changes of light stand in the order of time", at, about=(("light",),))
            before = change.at
        for word, names in (
            ("objects", [each.name for each in self.objects]),
            ("robots", [each.name for each in self.robots]),
            ("people", [each.name for each in self.people]),
        ):
            for place, name in enumerate(names):
                if name in names[:place]:
                    at = (word, place, "name")
                    yield KeyDiagnostic(f"'{name}' is the name of another of the {word} already", at, about=(at,))
        yield from FloorPlan(self).diagnostics()


def load_world(path: Path) -> WorldConfig:
    """Read a world file. Raises InvalidFileError with every mistake in it."""
    return parse_world(read_source(path))


def parse_world(source: SourceText) -> WorldConfig:
    """Read the text of a world file. Raises InvalidFileError with every mistake in it."""
    fields = fields_of(source, subject="a world file")
    world = read_keys(fields, WorldConfig)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return replace(world, file=fields.source.name)
