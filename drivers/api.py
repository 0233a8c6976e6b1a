"""What a behaviour sees of a robot: small protocols and value types, nothing of any bus.

SI units and radians throughout, with the axes of REP 103: x forward, y left, z up, anticlockwise positive.
So a positive pan looks left, and a positive tilt (about y) looks *down*.

Every device starts without its hardware: ``open`` starts looking for it, ``health`` says whether it is there, and
it reconnects by itself. Commands to a device that is offline raise ``drivers.errors.NotConnected``.
So all commands may be made in a tick: they take one exchange on the wire at most, a few milliseconds, while the
hardware answers. The exception are joints, which confirm hold, relax, and a move that first makes them stiff, one by
one: each that answers costs two or three exchanges, each that has just fallen silent up to six time-outs (6 ms each,
22 with an adapter that holds replies back). ``rest`` and ``close`` take what they need.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import sqrt
from typing import Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T")

Image = npt.NDArray[np.uint8]
"""A picture: shape (height, width, 3), dtype uint8, channels blue, green, red."""

COMMAND_LIFE = 0.3
"""Seconds for which a velocity command is valid; a base that hears no newer one stops."""


class Quality(StrEnum):
    """How far a reading can be trusted."""

    GOOD = "good"
    STALE = "stale"  # measured, but longer ago than the device's own limit
    NONE = "none"  # never measured


@dataclass(frozen=True, slots=True)
class Reading(Generic[T]):
    """A measured value, when it was measured (on the driver's clock), and how good it is.

    ``value`` is None exactly when ``quality`` is ``Quality.NONE``: a missed reply never looks like a number.
    """

    value: T | None
    stamp: float
    quality: Quality

    @property
    def good(self) -> bool:
        """True when the value is there and fresh."""
        return self.quality is Quality.GOOD


@dataclass(frozen=True, slots=True)
class Health:
    """Whether a device is there, and the figures of its wire.

    ``detail`` says in a few words what is the matter ("/dev/kobuki: no such device"), ``hint`` what to type next;
    both are empty when all is well. ``counters`` are totals since ``open``: frames, misses, checksum errors and so on.
    """

    online: bool
    detail: str = ""
    hint: str = ""
    counters: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Notice:
    """What a device tells of itself unasked: ``kind`` is ``offline``, ``online`` or ``fault``."""

    device: str
    kind: str
    what: str
    hint: str = ""


Report = Callable[[Notice], None]
"""Where a driver sends its notices; called mostly from the driver's own thread, must return at once.

What it raises is logged once and goes no further: a driver that reports must not come to harm by it.
"""


def unreported(notice: Notice) -> None:
    """Drop a notice: the report of a driver that nobody listens to."""


def unheard() -> None:
    """Do nothing: the ``changed`` callback of a driver that nobody waits for."""


class Device(Protocol):
    """What all devices have in common."""

    @property
    def name(self) -> str:
        """The part of the robot that it is: ``base``, ``head``, ``arm``, ``camera``, ``voice``."""
        ...

    def open(self) -> None:
        """Start looking for the hardware, and start the threads; returns at once, hardware or not."""
        ...

    def rest(self) -> None:
        """Bring every actuator to the rest that the robot file asks for. Safe from any state, more than once."""
        ...

    def close(self) -> None:
        """Rest, then end the threads and release the port. Safe from any state, more than once."""
        ...

    def health(self) -> Health:
        """Say whether the hardware is there."""
        ...


# --- base -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Velocity:
    """``linear`` in m/s along x, ``angular`` in rad/s about z."""

    linear: float
    angular: float


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


@dataclass(frozen=True, slots=True)
class BaseState:
    """One report of a base: where it is, how it moves, what it feels. Battery in volts and 0..100 percent."""

    pose: Pose2D
    velocity: Velocity
    bumper: Sides = Sides()
    cliff: Sides = Sides()
    wheel_drop: Sides = Sides()
    buttons: frozenset[int] = frozenset()
    battery_voltage: float = 0.0
    battery_percent: float = 0.0
    charging: bool = False


class Base(Device, Protocol):
    """A base that drives on two wheels."""

    def drive(self, velocity: Velocity) -> Velocity:
        """Drive so until told otherwise, for ``COMMAND_LIFE`` at most; return what was accepted after limiting."""
        ...

    def stop(self) -> None:
        """Stand still now. Safe from any state, more than once; does not raise when offline."""
        ...

    def state(self) -> Reading[BaseState]:
        """The newest report of the base."""
        ...

    def heading_at(self, stamp: float) -> float | None:
        """The heading in radians at a past time, interpolated; None when that is not known."""
        ...


# --- joints -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class JointLimits:
    """How far (radians) and how fast (rad/s) a joint may go."""

    lower: float
    upper: float
    speed: float


@dataclass(frozen=True, slots=True)
class JointState:
    """What one joint feels.

    ``position`` and ``goal`` in radians, ``velocity`` in rad/s, ``load`` in -1..1 of the stall torque, ``voltage`` in
    volts, ``temperature`` in degrees Celsius.
    """

    position: float
    velocity: float
    goal: float | None
    load: float
    voltage: float
    temperature: float
    moving: bool
    torque: bool


class Joints(Device, Protocol):
    """Named joints that take positions: an arm, a leg, a neck."""

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """The joints by name, in the order of the robot file."""
        ...

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians), all in one packet; return the goals after clamping.

        ``speeds`` in rad/s, by name; a joint without one goes at its limit's speed.
        Raises BadRequest for an unknown joint or a value that is not finite.
        """
        ...

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The newest state of each joint."""
        ...

    def hold(self) -> None:
        """Stand still and stiff where it is now. Safe from any state; does not raise when offline."""
        ...

    def relax(self) -> None:
        """Switch the torque off. Safe from any state; does not raise when offline."""
        ...


@dataclass(frozen=True, slots=True)
class Keyframe:
    """Where the named joints (radians) are to be at ``time`` seconds after the gesture began."""

    time: float
    positions: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Gesture:
    """A movement of the arm as keyframes in rising order of time, played with smooth interpolation between them."""

    name: str
    summary: str
    keyframes: tuple[Keyframe, ...]


# --- head -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class HeadPose:
    """Where the head looks, in radians: ``pan`` about z, positive left; ``tilt`` about y, positive down."""

    pan: float
    tilt: float


HEAD_ACCELERATION = 7.0
"""rad/s^2 (400 degrees/s^2): how hard a head speeds up and brakes unless the robot file says otherwise."""


@dataclass(frozen=True, slots=True)
class HeadLimits:
    """How far the head turns (radians), how fast (rad/s), and how hard it speeds up and brakes (rad/s^2); both axes."""

    pan: tuple[float, float]
    tilt: tuple[float, float]
    speed: float
    acceleration: float = HEAD_ACCELERATION

    def clamp(self, pose: HeadPose) -> HeadPose:
        """Return the nearest pose within the limits."""
        return HeadPose(
            pan=min(max(pose.pan, self.pan[0]), self.pan[1]), tilt=min(max(pose.tilt, self.tilt[0]), self.tilt[1])
        )

    def time_for(self, angle: float) -> float:
        """Return the seconds that an axis needs for a turn by ``angle`` (radians), from rest to rest."""
        way = abs(angle)
        if way * self.acceleration < self.speed**2:  # it brakes before it has come to its full speed
            return 2 * sqrt(way / self.acceleration)
        return way / self.speed + self.speed / self.acceleration


class Head(Device, Protocol):
    """A head that pans and tilts a camera."""

    @property
    def limits(self) -> HeadLimits:
        """How far and how fast it turns."""
        ...

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping. Raises BadRequest if not finite."""
        ...

    def pose(self) -> Reading[HeadPose]:
        """Where the head looks now: measured where the servos tell, else computed from what they were sent."""
        ...

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Where the head looked at a past time, interpolated; None when that is not known."""
        ...

    def stop(self) -> None:
        """Brake, within its acceleration, and hold. Safe from any state, more than once; never raises when offline."""
        ...


# --- camera and voice -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class CameraFrame:
    """One picture, when it was taken (driver's clock), and its number since the camera was opened, from 0."""

    image: Image
    stamp: float
    number: int


class Camera(Device, Protocol):
    """A source of pictures."""

    @property
    def field_of_view(self) -> float:
        """The horizontal angle of view in radians."""
        ...

    def read(self, timeout: float) -> CameraFrame | None:
        """Wait up to ``timeout`` seconds for a frame newer than the last one read; None when none came.

        The newest frame wins: frames that nobody read in time are dropped. For a reader's own thread, not for a tick.
        """
        ...


class Utterance(Protocol):
    """Something being said, or waiting to be."""

    def done(self) -> bool:
        """True once it was spoken to the end, or cancelled."""
        ...

    def cancel(self) -> None:
        """Fall silent now. Safe more than once."""
        ...


class Voice(Device, Protocol):
    """What the robot speaks with."""

    def say(self, text: str) -> Utterance:
        """Start to speak ``text``, after whatever is being said; returns at once."""
        ...
