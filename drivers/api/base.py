"""Protocol and states of a mobile base."""

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
    """Pose of the base, relative to its first report to the driver.

    ``x``, ``y`` in metres; ``heading`` in radians, continuous: it does not wrap.
    """

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Sides:
    """State of a sensor that exists on the left, in the centre and on the right."""

    left: bool = False
    centre: bool = False
    right: bool = False

    def __bool__(self) -> bool:
        return self.left or self.centre or self.right

    def __str__(self) -> str:
        """Return the names of the active sides: "left and centre"."""
        sides = (("left", self.left), ("centre", self.centre), ("right", self.right))
        return " and ".join(name for name, on in sides if on)


BASE_RADIUS = 0.177
"""Metres from the middle of a Kobuki to its rim: the vendor gives 351.5 mm for the diameter."""


class Posture(StrEnum):
    """Posture of a base with legs.

    It is UNKNOWN until the base has reached a posture by its own motion, for example after a start or a fall.
    """

    UNKNOWN = ""
    STANDING = "standing"
    SITTING = "sitting"
    MOVING = "moving"


class DockBeam(IntFlag):
    """Infrared beams of a dock, as the base receives them: near or far, in the dock's left, centre or right sector."""

    NEAR_LEFT = 1
    NEAR_CENTRE = 2
    NEAR_RIGHT = 4
    FAR_CENTRE = 8
    FAR_LEFT = 16
    FAR_RIGHT = 32


_NO_BEAMS = DockBeam(0)


@dataclass(frozen=True, slots=True)
class DockSignals:
    """Dock beams that each infrared receiver of the base receives; empty if no dock is in sight."""

    left: DockBeam = _NO_BEAMS
    centre: DockBeam = _NO_BEAMS
    right: DockBeam = _NO_BEAMS

    def __bool__(self) -> bool:
        return bool(self.left or self.centre or self.right)


class Tune(StrEnum):
    """Built-in tunes of a base."""

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
    """Maximum speed (m/s), turn rate (rad/s) and accelerations (m/s^2, rad/s^2) of a base."""

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
    """Raw odometry of each instrument of a base since its first report, neither corrected nor fused.

    ``left`` and ``right`` are the distances of the wheels in metres by the encoders, ``turn`` the rotation in radians
    by the encoders, ``gyro`` the heading in radians by the gyro, None without a gyro.
    """

    left: float
    right: float
    turn: float
    gyro: float | None = None


@dataclass(frozen=True, slots=True)
class BaseState:
    """State of a base in one report. Battery in volts and 0..100 percent.

    ``docked``: the base is on the contacts of its dock. ``overcurrent``: the wheels that are blocked. ``reckoned``:
    nothing measures the motion, so pose and velocity are dead reckoning from the commands. ``settling``: the bias of
    the gyro is not known yet, so the base should not turn. ``hazards``: other dangers, such as "backup limit" and
    "stall left", see ``drivers.base.motion_fault``. ``lean``: angle from upright in radians, None if not measured.
    ``fallen``: the base lies on the floor. ``posture``: posture of the legs. ``odometers``: raw odometry, None if the
    base reports only a pose. A base without a battery sensor reports 0 V and 100 percent.
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
        """Return the values that displays show, by name: metres and radians, m/s and rad/s, percent."""
        pose = {"x": self.pose.x, "y": self.pose.y, "heading": self.pose.heading}
        return {**pose, "speed": self.velocity.linear, "turn": self.velocity.angular, "battery": self.battery_percent}


LEG_ACTS = ("stand", "sit", "gait")
"""Names of the acts that a base with legs can perform."""

FALLEN_REASON = "it has fallen"
"""Latch reason of a base with legs that has fallen."""


def _require_mission_source(source: Source) -> Source:
    """Return ``source``. Raises BadRequest unless it is the mission, which is the only source that a leaf may use."""
    if source is not Source.MISSION:
        raise BadRequest(f"base: a mission's behaviour cannot drive as '{source}'", hint="leave the source out")
    return source


class Capability(Protocol):
    """Optional capability of a part, with the name of that part."""

    @property
    @direct
    def name(self) -> str:
        """Name of the part."""
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
        """Set the colour of light 1 or 2. Raises BadRequest for another number, NotConnected."""
        ...


class Legs(Capability, Protocol):
    """Capability of a base with legs."""

    @command("never", moves=True)
    def perform(self, act: str, gait: GaitKeys | None = None) -> float:
        """Perform one of ``LEG_ACTS`` for ``COMMAND_TIMEOUT``; ``gait`` is only for the act "gait".

        Return the progress: a share of 0..1, or the number of cycles of a gait. An act that is not renewed ends by
        itself, in a stand or on the way to it. Raises BadRequest for an act that the legs cannot perform, NotConnected,
        and DeviceFault while the base is latched.
        """
        ...


class Base(Device, Protocol):
    """A mobile base, on wheels or legs. Arbitration between sources and reflexes: see ``drivers.api.steering``.

    ``sounds``, ``lights`` and ``legs`` are None for a base without them.
    """

    @property
    @capability
    def sounds(self) -> Sounds | None:
        """Sounder of the base."""
        ...

    @property
    @capability
    def lights(self) -> Lights | None:
        """Lights of the base."""
        ...

    @property
    @capability
    def legs(self) -> Legs | None:
        """Legs of the base."""
        ...

    @property
    @fixed
    def limits(self) -> BaseLimits:
        """Maximum speeds and accelerations of the base."""
        ...

    @command(
        "after",
        moves=True,
        leaf_converters={"source": _require_mission_source},
        default_reply=lambda base, velocity, source: base.limits.clamp(velocity),  # noqa: ARG005 - whoever commands
    )
    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Drive at ``velocity`` for ``COMMAND_TIMEOUT`` at most; return the velocity in force after limiting.

        While a source of higher priority drives, that is zero. Raises BadRequest for a value that is not finite or for
        ``Source.SAFETY``, NotConnected, and DeviceFault while the base is latched.
        """
        ...

    @command("before", leaf_converters={"source": lambda _: Source.MISSION})  # a leaf does not stop the base for others
    def stop(self, *, source: Source | None = None) -> None:
        """Stop without a ramp, and drop the pending command of ``source``, or of all sources if None.

        Safe from any state, more than once; does not raise when offline.
        """
        ...

    @command("before")
    def latch(self, reason: str) -> None:
        """Stop, and refuse all commands until ``enable``. Safe from any state, more than once."""
        ...

    @command("after", moves=True)
    def enable(self) -> None:
        """Release the latch; commands from before the latch are not resumed.

        A mission cannot release a latch that a person has set.
        """
        ...

    @property
    def latched(self) -> str:
        """Reason of the latch; empty if not latched."""
        ...

    def state(self) -> Reading[BaseState]:
        """Latest reported state of the base."""
        ...

    def steering(self) -> Steering:
        """Return the source in command, its request, and the velocity in force."""
        ...

    def heading_at(self, stamp: float) -> float | None:
        """Heading in radians at a past time, interpolated; None if unknown."""
        ...
