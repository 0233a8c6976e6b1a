"""World files: the room of a simulated robot, with its items and people. SI units and radians."""

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
"""Maximum share of sensor reports or pictures that a world may lose; with all lost, no mission would end."""

MAX_DRAIN = 1000.0
"""Maximum factor by which a world speeds up the battery's discharge: full to empty in twenty seconds."""

DEFAULT_NOISE = 3.0
"""Default camera noise in grey levels."""


@keys
class RoomConfig:
    """Room around ``centre``: ``length`` along x, ``width`` along y."""

    length: float = key("length", default=8.0, low=2.0, high=50.0, help="Length along x.")
    width: float = key("length", default=6.0, low=2.0, high=50.0, help="Width along y.")
    height: float = key("length", default=2.6, low=2.2, high=20.0, help="Height.")
    centre: FloorPoint = key("length", default=(1.0, 0.0), wrong=PLACE_ERROR, help="Position of its middle: [x, y].")


@keys
class LightConfig:
    """Change of light: from ``at`` seconds to ``light`` (1 is daylight), linearly within ``over`` seconds."""

    at: float = key("duration", low=0.0, help="Time from the beginning.")
    light: float = key("share", low=0.0, high=2.0, help="New brightness; `100 %` is daylight.")
    over: float = key("duration", default=0.0, low=0.0, help="Duration of the change.")


@keys
class StartConfig(PlacedItem):
    """Start pose of the robot."""

    at: FloorPoint = key("length", default=(0.0, 0.0), wrong=PLACE_ERROR, help="Position: [x, y].")
    heading: float = key("angle", default=0.0, help="Heading.")


@keys
class BatteryConfig:
    """Initial charge of the base's battery (0..1), and its discharge rate as a multiple of a real one's."""

    level: float = key("share", default=1.0, low=0.0, high=1.0, help="Initial charge.")
    drain: float = key(default=1.0, low=0.0, high=MAX_DRAIN, help="Discharge rate, as a multiple of a real battery's.")


@keys
class PushConfig:
    """Push at the trunk of a robot with physics; its impulse changes the robot's velocity by ``speed`` (m/s)."""

    at: float = key("duration", low=0.0, help="Time from the beginning.")
    speed: float = key("speed", low=0.0, high=5.0, help="Strength: the speed that the push gives the robot.")
    towards: float = key("angle", default=0.0, help="Direction: `90 deg` is along y.")
    over: float = key("duration", default=0.1, low=0.002, high=10.0, help="Duration.")


@keys
class PhysicsConfig:
    """Errors of the base and disturbances: wheel slip, command lag, noise, lost reports, pushes."""

    slip: float = key("share", default=0.0, low=0.0, high=0.9, help="Share of the wheels' travel that slips.")
    lag: float = key("duration", default=0.0, low=0.0, high=2.0, help="Time from a command to its effect.")
    gyro_noise: float = key(
        "turn rate", default=0.0, low=0.0, high=1.0, help="Noise of the gyro, a standard deviation."
    )
    dropouts: float = key("share", default=0.0, low=0.0, high=MAX_LOSS, help="Share of its reports that are lost.")
    battery: BatteryConfig | None = key(default=None, help="Battery; by default it is always full.")
    mishearing: float = key(
        "share", default=0.0, low=0.0, high=MAX_LOSS, help="Share of phrases that the robot mishears or misses."
    )
    friction: float = key(default=1.0, low=0.05, high=3.0, help="Friction of the floor (Coulomb coefficient).")
    slope: tuple[float, float] = key(
        "angle",
        default=(0.0, 0.0),
        low=-0.35,
        high=0.35,
        wrong="'{}' needs two angles, such as [2 deg, 0 deg]",
        help="Slope of the floor: [along x, along y].",
    )
    masses: float = key("share", default=0.0, low=0.0, high=0.5, help="Maximum error of each mass of the robot.")
    servo_delay: float = key(
        "duration", default=0.0, low=0.0, high=1.0, help="Time from a goal to the servo's reaction."
    )
    pushes: tuple[PushConfig, ...] = key(default=(), each="a push", help="Pushes at the robot.")


@keys
class CameraConfig:
    """Errors of the robot's camera in a world, such as noise and lost pictures."""

    noise: float | None = key(
        default=None, low=0.0, high=80.0, help=f"In grey levels of 255; {DEFAULT_NOISE:g} if not given."
    )
    dropouts: float | None = key(
        "share",
        default=None,
        low=0.0,
        high=MAX_LOSS,
        help="Share of pictures that are lost; by default that of the base's reports.",
    )


@keys
class WorldConfig:
    """Room of ``length`` (x) by ``width`` (y) by ``height`` metres around ``centre``, with its items and people."""

    name: str = key(word="world", help="Name.")
    summary: str = key(default="", help="Description in a line.")
    room: RoomConfig = key(default=RoomConfig(), help="Room.")
    start: StartConfig = key(default=StartConfig(), help="Start pose of the robot.")
    lights: float | tuple[LightConfig, ...] = key(
        "share",
        default=1.0,
        low=0.0,
        high=2.0,
        word="light",
        each="a change of light",
        wrong="'{}' needs a share such as '50 %', or a list of changes",
        help="Brightness; or a list of changes, starting from daylight.",
    )
    grain: float | None = key(default=None, low=0.0, high=80.0, word="noise", help="Same as `camera.noise`.")
    camera: CameraConfig = key(default=CameraConfig(), help="Errors of the robot's camera.")
    physics: PhysicsConfig = key(default=PhysicsConfig(), help="Errors of the robot's base.")
    walls: tuple[WallConfig, ...] = key(default=(), each="a wall", help="Inner walls.")
    furniture: tuple[BoxConfig, ...] = key(default=(), each="a piece of furniture", help="Furniture.")
    edges: tuple[EdgeConfig, ...] = key(default=(), each="an edge", help="Edges: holes in the floor.")
    objects: tuple[ThingConfig, ...] = key(default=(), each="an object", help="Coloured objects to look for.")
    dock: DockConfig | None = key(default=None, help="Dock of the base.")
    robots: tuple[RoverConfig, ...] = key(default=(), each="a robot", help="Other robots.")
    people: tuple[PersonConfig, ...] = key(default=(), each="a person", help="People.")
    file: str = ""

    @property
    def length(self) -> float:
        """Size of the room along x in metres."""
        return self.room.length

    @property
    def width(self) -> float:
        """Size of the room along y in metres."""
        return self.room.width

    @property
    def height(self) -> float:
        """Height of the room in metres."""
        return self.room.height

    @property
    def centre(self) -> FloorPoint:
        """Middle of the room."""
        return self.room.centre

    @property
    def light(self) -> float:
        """Initial brightness of the room; 1 is daylight."""
        return 1.0 if isinstance(self.lights, tuple) else self.lights

    @property
    def light_changes(self) -> tuple[LightConfig, ...]:
        """Changes of the room's light in the order of time."""
        return self.lights if isinstance(self.lights, tuple) else ()

    @property
    def noise(self) -> float:
        """Camera noise in grey levels."""
        return next((each for each in (self.camera.noise, self.grain) if each is not None), DEFAULT_NOISE)

    @property
    def dropouts(self) -> float:
        """Share of lost pictures; by default the share of the base's reports that are lost."""
        return self.physics.dropouts if self.camera.dropouts is None else self.camera.dropouts

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each item that does not fit, for duplicate names and keys, and for unordered light.

        Changes of light must be in the order of time.
        """
        if self.camera.noise is not None and self.grain is not None:
            yield KeyDiagnostic("'noise' is given twice: here and at the top of the file", ("camera", "noise"))
        before = 0.0
        for place, change in enumerate(self.light_changes):
            if change.at < before:
                at = ("light", place, "at")
                yield KeyDiagnostic("'at': changes of light must be in the order of time", at, about=(("light",),))
            before = change.at
        for word, names in (
            ("objects", [each.name for each in self.objects]),
            ("robots", [each.name for each in self.robots]),
            ("people", [each.name for each in self.people]),
        ):
            for place, name in enumerate(names):
                if name in names[:place]:
                    at = (word, place, "name")
                    yield KeyDiagnostic(f"'{name}' is a duplicate name in '{word}'", at, about=(at,))
        yield from FloorPlan(self).diagnostics()


def load_world(path: Path) -> WorldConfig:
    """Read a world file. Raises InvalidFileError with all errors."""
    return parse_world(read_source(path))


def parse_world(source: SourceText) -> WorldConfig:
    """Return the world in a text. Raises InvalidFileError with all errors."""
    fields = fields_of(source, subject="a world file")
    world = read_keys(fields, WorldConfig)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return replace(world, file=fields.source.name)
