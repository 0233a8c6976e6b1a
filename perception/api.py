"""What perception deals in: frames, detections, and faces with a place and a time.

Angles in radians with the axes of REP 103: ``yaw`` about z, positive left; ``pitch`` about y, positive down.
Positions in a picture are pixels from its top left corner, x to the right, y down.
"""

from collections.abc import Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Any, Protocol

from drivers.api.fast_dataclass import dataclass

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Image = npt.NDArray[np.uint8]
else:
    Image = Any  # a check needs no numpy
"""A picture: shape (height, width, 3), dtype uint8, channels blue, green, red."""


Angle = Annotated[float, "angle"]
Length = Annotated[float, "length"]
Duration = Annotated[float, "duration"]
TurnRate = Annotated[float, "turn rate"]
# What a member measures, in SI units: a mission cannot add one to another.


class Frame(Protocol):
    """One picture and when it was taken, in seconds on the run's clock."""

    @property
    def image(self) -> Image:
        """The picture."""
        ...

    @property
    def stamp(self) -> float:
        """When it was taken."""
        ...


@dataclass(frozen=True, slots=True)
class Box:
    """An upright rectangle in a picture, in pixels: its top left corner, width and height."""

    x: float
    y: float
    width: float
    height: float

    @property
    def centre(self) -> tuple[float, float]:
        """The middle (x, y)."""
        return self.x + self.width / 2, self.y + self.height / 2

    def overlap(self, other: "Box") -> float:
        """Intersection over union, 0..1."""
        across = min(self.x + self.width, other.x + other.width) - max(self.x, other.x)
        down = min(self.y + self.height, other.y + other.height) - max(self.y, other.y)
        if across <= 0 or down <= 0:
            return 0.0
        shared = across * down
        return shared / (self.width * self.height + other.width * other.height - shared)


@dataclass(frozen=True, slots=True)
class Detection:
    """One thing found in one picture. ``score`` is the detector's own measure; higher is surer.

    ``roll`` is by how much a head leans to the right in the picture, in radians, as far as the detector tells.
    """

    box: Box
    score: float
    roll: float = 0.0


@dataclass(frozen=True, slots=True)
class Gaze:
    """Which way the camera looked when a picture was taken, in the odometry frame.

    ``doubt`` is how far off the yaw may be, one sigma, as the time of the exposure is not known exactly.
    """

    yaw: float
    pitch: float
    doubt: float = 0.0


@dataclass(frozen=True, slots=True)
class Percept:
    """Something that is followed from frame to frame.

    ``id`` stays while the track lives. ``stamp`` is the time of the frame that last showed it, ``box`` where in that
    frame. ``bearing`` and ``elevation`` are its angles from that frame's optical axis: left is positive, and so is
    *down*, as with every tilt and ``pitch`` (REP 103). ``yaw``, ``pitch`` (odometry frame) and their rates in rad/s are
    filtered over time. ``distance`` is in metres.
    """

    id: int
    stamp: Duration
    box: Box
    bearing: Angle
    elevation: Angle
    yaw: Angle
    pitch: Angle
    yaw_rate: TurnRate
    pitch_rate: TurnRate
    distance: Length

    def predict(self, time: float) -> tuple[float, float]:
        """Return (yaw, pitch) at ``time``, if it goes on as it did."""
        ahead = time - self.stamp
        return self.yaw + self.yaw_rate * ahead, self.pitch + self.pitch_rate * ahead


UNKNOWN = "unknown"
"""The name of somebody whom the robot does not know."""


@dataclass(frozen=True, slots=True)
class Face(Percept):
    """A person's face, detected or carried by optical flow; its distance is a guess from the size of the box.

    ``name`` says whose it is: ``UNKNOWN`` for a stranger, empty while that is not decided or nobody asks.
    """

    name: str = ""


BALL, BOX, ANY = "ball", "box", "thing"
"""The shapes of things: round from every side; with straight edges; whatever it has."""


@dataclass(frozen=True, slots=True)
class ThingSpec:
    """A coloured shape to look for, and the name that what is found will bear.

    ``colour`` is a name of the palette, ``shape`` one of ``BALL``, ``BOX`` and ``ANY``. ``size`` is its diameter or
    width in metres, where that is known: from it follows how far away it is.
    """

    name: str
    colour: str
    shape: str = ANY
    size: float | None = None


@dataclass(frozen=True, slots=True)
class Thing(Percept):
    """A coloured shape: ``colour`` and ``shape`` in words ("red", "box"), ``name`` as it was asked for.

    ``size`` is its width in metres, as far as that is known; else None, and the distance is not a number (NaN).
    """

    name: str
    colour: str
    shape: str
    size: Length | None = None


@dataclass(frozen=True, slots=True)
class Marker(Percept):
    """A square marker on another robot: ``number`` is its own, ``name`` that of the robot, where it is known.

    ``heading`` in radians is which way the marker's face is turned as seen from here: 0 is towards the camera,
    positive turned to its left.
    """

    number: int
    name: str
    heading: Angle


@dataclass(frozen=True, slots=True)
class Scene:
    """What one picture shows as a whole, in grey levels of 255.

    ``stamp`` is its frame's time, ``brightness`` its mean. ``contrast`` is how much neighbouring spots differ where
    they do most: about 1 where it shows nothing but a blank wall or a covered lens, some tens for a room. ``motion`` is
    the share 0..1 of it that has changed since the frame before, None where nobody asked.
    """

    stamp: float
    brightness: float
    contrast: float
    motion: float | None = None


@dataclass(frozen=True, slots=True)
class View:
    """All that the newest frame gave; one object, so that readers never see half of it. ``looked`` is its stamp.

    ``spent`` are the seconds that the search took, by the run's clock: none where time is simulated.
    """

    looked: float | None = None
    faces: tuple[Face, ...] = ()
    things: tuple[Thing, ...] = ()
    markers: tuple[Marker, ...] = ()
    scene: Scene | None = None
    spent: float = field(default=0.0, compare=False)


class Sight(Protocol):
    """What a behaviour sees of perception: the newest percepts, ready at once; how old is too old, the caller says."""

    def looked(self) -> float | None:
        """The stamp of the newest frame that was searched, None before the first."""
        ...

    def faces(self) -> Sequence[Face]:
        """The faces followed now, largest first, each with the stamp of the frame that last showed it."""
        ...

    def things(self) -> Sequence[Thing]:
        """The coloured shapes followed now, largest first."""
        ...

    def markers(self) -> Sequence[Marker]:
        """The markers of other robots followed now, largest first."""
        ...

    def scene(self) -> Scene | None:
        """What the newest frame shows as a whole, or one of the last 0.2 s; None before the first."""
        ...


@dataclass(frozen=True, slots=True)
class Words:
    """Something said that was understood: one of the ``phrase``s that the mission listens for.

    ``id`` counts them. ``start`` and ``stamp`` are when they began and ended, in seconds on the run's clock. ``score``
    says how surely it was this phrase and not other speech: above 0 is more likely than not. ``who`` said it is known
    only in simulation.
    """

    id: int
    phrase: str
    start: float
    stamp: float
    score: float
    who: str = ""


class Hearing(Protocol):
    """What a behaviour hears: phrases that were understood, ready at once."""

    def listened(self) -> float | None:
        """The time up to which it has listened, None before it could: old while the microphone is gone."""
        ...

    def words(self) -> Sequence[Words]:
        """The phrases of the last 30 s, newest first."""
        ...

    def refused(self) -> Sequence[Words]:
        """What was said in the last 30 s and taken for no phrase, newest first; each with the nearest phrase."""
        ...

    def level(self) -> Annotated[float, "unsampled"]:
        """How loud it is now, in dBFS: 0 is the loudest that can be, -90 about silence."""
        ...


def ignore(*_told: object) -> None:
    """Do nothing: a callback of which nobody wants to be told."""
