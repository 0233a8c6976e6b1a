"""Robot files: which parts a robot has, where they are plugged in, and how far and fast they may go.

A part that the file does not name is a part that the robot does not have. SI units and radians throughout.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from config.arm import ArmConfig, JointConfig, read_arm
from config.base import BaseConfig, ReflexConfig, read_base
from config.faults import InvalidFileError, Source
from config.fields import Fields, fields_of
from config.head import HeadConfig, NeckConfig, read_head
from config.identity import IdentityConfig, read_identity
from config.marked import read_source
from config.microphone import MicrophoneConfig, read_microphone
from config.notices import NoticeConfig, read_notices
from config.range import RangeConfig, read_range
from config.screen import ScreenConfig, read_screen
from config.voice import VoiceConfig, read_voice

__all__ = [
    "DISTORTION",
    "MARKER_FAMILIES",
    "PARTS",
    "ArmConfig",
    "BaseConfig",
    "CameraConfig",
    "IdentityConfig",
    "JointConfig",
    "MarkersConfig",
    "MicrophoneConfig",
    "RangeConfig",
    "ReflexConfig",
    "RobotConfig",
    "ScreenConfig",
    "VoiceConfig",
    "load_robot",
    "robot_of",
]

PARTS = ("base", "head", "arm", "range", "camera", "microphone", "voice", "screen")
"""The parts that a robot may have."""

DISTORTION = ("k1", "k2", "p1", "p2", "k3")
"""The coefficients by which a lens bends a picture, in the order that OpenCV has."""


MARKER_FAMILIES = ["4x4_50", "4x4_100", "5x5_100", "6x6_250", "apriltag_16h5", "apriltag_25h9", "apriltag_36h11"]
"""The families of markers, as perception knows them: a test holds the two together."""


@dataclass(frozen=True, slots=True)
class MarkersConfig:
    """The markers that other robots wear: their family, the side of the black frame in metres, and whose is which."""

    family: str
    size: float
    robots: Mapping[int, str]


@dataclass(frozen=True, slots=True)
class CameraConfig:
    """A camera: an index, a device, a file, a URL or a folder; its view and where it sits.

    ``position`` is (x, y, z) in metres from the middle of the base on the floor, with the head looking ahead.
    ``centre`` is where the optical axis meets the picture, as shares of its sides; ``distortion`` is empty, or k1, k2,
    p1, p2, k3 as calibration finds them. ``detector`` of faces is ``haar`` or ``yunet``, ``model`` the file of the
    latter, empty for where `mission models fetch` puts it. ``markers`` are what other robots wear. ``identity`` says
    how people are recognised. ``delay`` is how many seconds after its exposure a picture is stamped, as far as that is
    known; it is learnt from there on.
    """

    source: str
    field_of_view: float
    width: int
    height: int
    position: tuple[float, float, float]
    centre: tuple[float, float] = (0.5, 0.5)
    distortion: tuple[float, ...] = ()
    detector: str = "haar"
    model: str = ""
    markers: MarkersConfig | None = None
    identity: IdentityConfig = field(default_factory=IdentityConfig)
    delay: float = 0.0


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """A whole robot. ``rate`` is the ceiling of ticks per second; ``notices`` say where it is told how tasks went."""

    name: str
    summary: str
    rate: float
    base: BaseConfig | None = None
    head: HeadConfig | NeckConfig | None = None
    arm: ArmConfig | None = None
    range: RangeConfig | None = None
    camera: CameraConfig | None = None
    microphone: MicrophoneConfig | None = None
    voice: VoiceConfig | None = None
    screen: ScreenConfig | None = None
    notices: tuple[NoticeConfig, ...] = ()
    path: Path | None = field(default=None, compare=False)

    @property
    def parts(self) -> frozenset[str]:
        """The names of the parts that it has."""
        return frozenset(part for part in PARTS if getattr(self, part) is not None)


def load_robot(path: Path) -> RobotConfig:
    """Read a robot file. Raises InvalidFileError with every mistake in it."""
    return robot_of(read_source(path), path)


def robot_of(source: Source, path: Path | None = None) -> RobotConfig:
    """Read the text of a robot file. Raises InvalidFileError with every mistake in it."""
    fields = fields_of(source, what="a robot file")
    arm = read_arm(fields.section("arm"))
    robot = RobotConfig(
        name=fields.text("robot"),
        summary=fields.text("summary", ""),
        rate=fields.quantity("rate", "frequency", 20.0, low=1.0, high=200.0),
        base=read_base(fields.section("base")),
        head=read_head(fields.section("head"), {} if arm is None else arm.reaches),
        arm=arm,
        range=read_range(fields.section("range")),
        camera=_camera(fields.section("camera")),
        microphone=read_microphone(fields.section("microphone")),
        voice=read_voice(fields.section("voice")),
        screen=read_screen(fields.section("screen")),
        notices=read_notices(fields),
        path=path,
    )
    fields.done()
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return robot


def _camera(fields: Fields | None) -> CameraConfig | None:
    if fields is None:
        return None
    fields.choice("driver", ["opencv"], "opencv")
    camera = CameraConfig(
        source=fields.text("source", "0"),
        field_of_view=fields.quantity("field_of_view", "angle", 1.0471975512, low=0.2, high=2.6),
        width=fields.integer("width", 640, low=64, high=4096),
        height=fields.integer("height", 480, low=48, high=4096),
        position=fields.position("position", (0.0, 0.0, 1.0)),
        centre=(
            fields.quantity("centre_x", "share", 0.5, low=0.1, high=0.9),
            fields.quantity("centre_y", "share", 0.5, low=0.1, high=0.9),
        ),
        distortion=_distortion(fields.section("distortion")),
        detector=fields.choice("detector", ["haar", "yunet"], "haar"),
        model=fields.text("model", ""),
        markers=_markers(fields.section("markers")),
        identity=read_identity(fields.section("identity")),
        delay=fields.quantity("delay", "duration", 0.0, low=-0.1, high=0.25),
    )
    fields.done()
    return camera


def _markers(fields: Fields | None) -> MarkersConfig | None:
    if fields is None:
        return None
    robots: dict[int, str] = {}
    section = fields.section("robots")
    if section is not None:
        for key, _ in section.entries():
            if re.fullmatch("[0-9]{1,9}", key.text):
                robots[int(key.text)] = section.text(key.text)
            else:
                section.fault(key.mark, f"'{key.text}' is no marker's number", "robots: {7: R2}")
    markers = MarkersConfig(
        family=fields.choice("family", MARKER_FAMILIES, MARKER_FAMILIES[0]),
        size=fields.quantity("size", "length", 0.15, low=0.01, high=2.0),
        robots=robots,
    )
    fields.done()
    return markers


def _distortion(fields: Fields | None) -> tuple[float, ...]:
    if fields is None:
        return ()
    found = tuple(fields.number(name, 0.0, low=-20.0, high=20.0) for name in DISTORTION)
    fields.done()
    return found
