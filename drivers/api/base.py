"""What a behaviour sees of a base that drives on two wheels."""

from collections.abc import Mapping
from enum import IntFlag, StrEnum
from typing import Protocol

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.gait import GaitKeys
from drivers.api.marks import capability, command, direct, fixed
from drivers.api.steering import Source, Steering, Velocity
from drivers.errors import BadRequest


@dataclass(frozen=True, slots=True)
class Pose2D:
    """Where the base is since the driver first heard from it.

    ``x``, ``y`` in metres; ``heading`` in radians, continuous: it does not wrap.
    """

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Sides:
    """A sensor that comes as a left, a centre and a right one."""

    left: bool = False
    centre: bool = False
    right: bool = False

    def __bool__(self) -> bool:
        return self.left or self.centre or self.right

    def __str__(self) -> str:
        """Name those that are on: "left and centre"."""
        named = (("left", self.left), ("centre", self.centre), ("right", self.right))
        return " and ".join(name for name, on in named if on)


BASE_RADIUS = 0.177
"""Metres from the middle of a Kobuki to its rim: the vendor gives 351.5 mm for the diameter."""


class Posture(StrEnum):
    """How a base with legs stands: known, where it has come to it by itself."""

    UNKNOWN = ""
    STANDING = "standing"
    SITTING = "sitting"
    MOVING = "moving"


class DockBeam(IntFlag):
    """The beams of a dock as its base hears them: near or far, in the dock's left, middle or right sector."""

    NEAR_LEFT = 1
    NEAR_CENTRE = 2
    NEAR_RIGHT = 4
    FAR_CENTRE = 8
    FAR_LEFT = 16
    FAR_RIGHT = 32


_NO_BEAMS = DockBeam(0)


@dataclass(frozen=True, slots=True)
class DockSignals:
    """What each of the base's infrared receivers hears of the dock; nothing where there is none in sight."""

    left: DockBeam = _NO_BEAMS
    centre: DockBeam = _NO_BEAMS
    right: DockBeam = _NO_BEAMS

    def __bool__(self) -> bool:
        return bool(self.left or self.centre or self.right)


class Tune(StrEnum):
    """The tunes that a base knows by heart."""

    ON = "on"
    OFF = "off"
    RECHARGE = "recharge"
    BUTTON = "button"
    ERROR = "error"
    CLEANING_START = "cleaning_start"
    CLEANING_END = "cleaning_end"


class Lamp(StrEnum):
    """The colours of a light."""

    OFF = "off"
    RED = "red"
    GREEN = "green"
    ORANGE = "orange"


@dataclass(frozen=True, slots=True)
class BaseLimits:
    """How fast a base goes (m/s) and turns (rad/s) at most, and how quickly that changes (m/s^2, rad/s^2)."""

    speed: float
    turn: float
    acceleration: float
    turn_acceleration: float

    def clamp(self, velocity: Velocity) -> Velocity:
        """Return the nearest velocity within the limits."""
        return Velocity(
            linear=min(max(velocity.linear, -self.speed), self.speed),
            angular=min(max(velocity.angular, -self.turn), self.turn),
        )


@dataclass(frozen=True, slots=True)
class Odometers:
    """Raw readings of the instruments of a base, since its driver first heard from it: nothing is corrected or fused.

    ``left`` and ``right`` are the metres that the encoders counted, ``turn`` the radians that these make; ``gyro`` is
    the heading by the gyro alone, None without one.
    """

    left: float
    right: float
    turn: float
    gyro: float | None = None


@dataclass(frozen=True, slots=True)
class BaseState:
    """One report of a base: where it is, how it moves, what it feels. Battery in volts and 0..100 percent.

    ``docked`` is True while it stands on the contacts of its dock; ``overcurrent`` names the wheels that are blocked.
    ``reckoned`` says that nothing measures how it moves: its pose and velocity are dead reckoning, what it was told
    added up. ``settling`` is True while it stands and the drift of its gyro is not known yet: to turn would err.
    ``hazards`` names all other dangers that the base reports, such as "backup limit" and "stall left"; see
    ``drivers.base.motion_fault``. A base that measures no battery tells 0 V, and 100 percent. ``lean`` is how far from
    upright it stands, in radians; None where nothing measures that. ``fallen`` is True for one that lies; ``posture``
    is that of legs. ``odometers`` are the raw readings, None where the base tells only a pose.
    """

    pose: Pose2D
    velocity: Velocity
    bumper: Sides = Sides()
    cliff: Sides = Sides()
    wheel_drop: Sides = Sides()
    buttons: frozenset[int] = frozenset()
    battery_voltage: float = 0.0
    battery_percent: float = 0.0
    charging: bool = False
    docked: bool = False
    dock: DockSignals = DockSignals()
    overcurrent: Sides = Sides()
    hazards: frozenset[str] = frozenset()
    reckoned: bool = False
    settling: bool = False
    odometers: Odometers | None = None
    lean: float | None = None
    fallen: bool = False
    posture: Posture = Posture.UNKNOWN

    def figures(self) -> Mapping[str, float]:
        """Return what is shown of it: metres and radians, m/s and rad/s, percent."""
        moved = {"x": self.pose.x, "y": self.pose.y, "heading": self.pose.heading}
        return {**moved, "speed": self.velocity.linear, "turn": self.velocity.angular, "battery": self.battery_percent}


LEG_ACTS = ("stand", "sit", "gait")
"""The acts that legs can perform."""

FALLEN_REASON = "it has fallen"
"""Why a base with legs is latched that lies."""


def _require_mission_source(source: Source) -> Source:
    """Return the source of a leaf's command. Raises BadRequest for another than the mission."""
    if source is not Source.MISSION:
        raise BadRequest(f"base: a mission's behaviour cannot drive as '{source}'", hint="leave the source out")
    return source


class Capability(Protocol):
    """An optional capability of a part, which shares the name of that part."""

    @property
    @direct
    def name(self) -> str:
        """The name of the part."""
        ...


class Sounds(Capability, Protocol):
    """Capability of a base with a sounder."""

    @command("after")
    def play(self, tune: Tune) -> None:
        """Play a tune. Raises NotConnected."""
        ...

    @command("after")
    def tone(self, frequency: float, seconds: float) -> None:
        """Play a tone of ``frequency`` Hz, for 0.255 s at most. Raises BadRequest, NotConnected."""
        ...


class Lights(Capability, Protocol):
    """Capability of a base with two lights."""

    @command("after")
    def light(self, number: int, colour: Lamp) -> None:
        """Switch light 1 or 2. Raises BadRequest for another, NotConnected."""
        ...


class Legs(Capability, Protocol):
    """Capability of a base that walks."""

    @command("never", moves=True)
    def perform(self, act: str, gait: GaitKeys | None = None) -> float:
        """Perform one of ``LEG_ACTS`` for ``COMMAND_TIMEOUT``, with a ``gait`` for that act alone.

        Return the progress: a share of 0..1, or the cycles of a gait. An act that is not renewed ends by itself, in a
        stand or on the way to it. Raises BadRequest for an act that the legs cannot perform, NotConnected, and
        DeviceFault while the base is latched.
        """
        ...


class Base(Device, Protocol):
    """A mobile base, on wheels or legs. Arbitration between sources and reflexes: see ``drivers.api.steering``.

    ``sounds``, ``lights`` and ``legs`` are None for a base without them.
    """

    @property
    @capability
    def sounds(self) -> Sounds | None:
        """The sounder."""
        ...

    @property
    @capability
    def lights(self) -> Lights | None:
        """The lights."""
        ...

    @property
    @capability
    def legs(self) -> Legs | None:
        """The legs."""
        ...

    @property
    @fixed
    def limits(self) -> BaseLimits:
        """How fast it goes, and how quickly that changes."""
        ...

    @command(
        "after",
        moves=True,
        leaf_converters={"source": _require_mission_source},
        default_reply=lambda base, velocity, source: base.limits.clamp(velocity),  # noqa: ARG005 - whoever commands
    )
    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Drive so until told otherwise, for ``COMMAND_TIMEOUT`` at most; return what is in force after limiting.

        That is standing still while a more important source has the wheels. Raises BadRequest for a value that is not
        finite or for ``Source.SAFETY``, NotConnected, and DeviceFault while it is latched.
        """
        ...

    @command("before", leaf_converters={"source": lambda _: Source.MISSION})  # a leaf does not stop the base for others
    def stop(self, *, source: Source | None = None) -> None:
        """Stand still now, without a ramp: forget what ``source`` commands, or what anybody does (None).

        Safe from any state, more than once; does not raise when offline.
        """
        ...

    @command("before")
    def latch(self, reason: str) -> None:
        """Stand still until ``enable``, whoever commands. Safe from any state, more than once."""
        ...

    @command("after", moves=True)
    def enable(self) -> None:
        """End a latched stop; nothing of before is in force then. While a person stops it, no mission may."""
        ...

    @property
    def latched(self) -> str:
        """Why it is latched; empty while it is not."""
        ...

    def state(self) -> Reading[BaseState]:
        """The newest report of the base."""
        ...

    def steering(self) -> Steering:
        """Return who commands it now, and what came of that."""
        ...

    def heading_at(self, stamp: float) -> float | None:
        """The heading in radians at a past time, interpolated; None when that is not known."""
        ...
