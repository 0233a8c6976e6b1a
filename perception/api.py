"""Values and protocols of perception: frames, detections, and percepts with a direction and a time.

Angles in radians with the axes of REP 103: ``yaw`` about z, positive left; ``pitch`` about y, positive down. Positions
in a picture are pixels from its top left corner, x to the right, y down.
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
    """A picture and its time, in seconds on the run's clock."""

    @property
    def image(self) -> Image:
        """The picture."""
        ...

    @property
    def stamp(self) -> float:
        """Time of the exposure, in seconds."""
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
        """Centre (x, y) of the box in pixels."""
        return self.x + self.width / 2, self.y + self.height / 2

    def overlap(self, other: "Box") -> float:
        """Return intersection over union with ``other``, 0..1."""
        across = min(self.x + self.width, other.x + other.width) - max(self.x, other.x)
        down = min(self.y + self.height, other.y + other.height) - max(self.y, other.y)
        if across <= 0 or down <= 0:
            return 0.0
        shared = across * down
        return shared / (self.width * self.height + other.width * other.height - shared)


@dataclass(frozen=True, slots=True)
class Detection:
    """Detection of one object in one picture. ``score`` is the detector's own measure; higher is surer.

    ``roll`` is the angle by which a head leans to the right in the picture, in radians, if the detector measures it.
    """

    box: Box
    score: float
    roll: float = 0.0


@dataclass(frozen=True, slots=True)
class Gaze:
    """Direction of the camera when a picture was taken, in the odometry frame.

    ``doubt`` is the uncertainty of the yaw, one sigma, because the time of the exposure is not known exactly.
    """

    yaw: float
    pitch: float
    doubt: float = 0.0


@dataclass(frozen=True, slots=True)
class Percept:
    """An object that is tracked from frame to frame.

    ``id`` is constant while the track lives. ``stamp`` is the time of the frame that last showed the object, ``box``
    its place in that frame. ``bearing`` and ``elevation`` are its angles from the optical axis of that frame: left is
    positive, and so is *down*, as for every tilt and ``pitch`` (REP 103). ``yaw``, ``pitch`` (odometry frame) and their
    rates in rad/s are filtered over time. ``distance`` is in metres.
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
        """Return (yaw, pitch) at ``time``, extrapolated at constant rates."""
        ahead = time - self.stamp
        return self.yaw + self.yaw_rate * ahead, self.pitch + self.pitch_rate * ahead


UNKNOWN = "unknown"
"""Name of a face that belongs to no known person."""


@dataclass(frozen=True, slots=True)
class Face(Percept):
    """A person's face, detected or tracked by optical flow; its distance is estimated from the size of the box.

    ``name`` is the person's name: ``UNKNOWN`` for a stranger, empty while it is undecided or names are not used.
    """

    name: str = ""


BALL, BOX, ANY = "ball", "box", "thing"
"""Shapes of things: round from every side; with straight edges; any."""


@dataclass(frozen=True, slots=True)
class ThingSpec:
    """Specification of a coloured shape to look for, and the name of things that match it.

    ``colour`` is a name of the palette, ``shape`` one of ``BALL``, ``BOX`` and ``ANY``. ``size`` is the diameter or
    width in metres, if known; the distance is computed from it.
    """

    name: str
    colour: str
    shape: str = ANY
    size: float | None = None


@dataclass(frozen=True, slots=True)
class Thing(Percept):
    """A coloured shape that matches a ``ThingSpec``: ``colour`` and ``shape`` in words ("red", "box").

    ``name`` and ``size`` are those of the specification. ``size`` is the width in metres; if it is None, the distance
    is NaN.
    """

    name: str
    colour: str
    shape: str
    size: Length | None = None


@dataclass(frozen=True, slots=True)
class Marker(Percept):
    """A square marker on another robot, with its ``number``; ``name`` is that of the robot, if known.

    ``heading`` is the direction in radians that the marker faces, relative to the camera: 0 if it faces the camera,
    positive if it is turned to its own left.
    """

    number: int
    name: str
    heading: Angle


@dataclass(frozen=True, slots=True)
class Scene:
    """Properties of a whole picture, in grey levels of 0 to 255.

    ``stamp`` is the time of its frame, ``brightness`` its mean. ``contrast`` is the largest difference between
    neighbouring small areas: about 1 for a blank wall or a covered lens, some tens for a room. ``motion`` is the share
    0..1 of the picture that has changed since the frame before, None if motion is not used.
    """

    stamp: float
    brightness: float
    contrast: float
    motion: float | None = None


@dataclass(frozen=True, slots=True)
class View:
    """All results of the newest frame in one immutable value, so readers always get a consistent set.

    ``looked`` is the stamp of the frame. ``spent`` is the duration of the search in seconds of the run's clock: 0 in
    simulated time.
    """

    looked: float | None = None
    faces: tuple[Face, ...] = ()
    things: tuple[Thing, ...] = ()
    markers: tuple[Marker, ...] = ()
    scene: Scene | None = None
    spent: float = field(default=0.0, compare=False)


class Sight(Protocol):
    """Access of a behaviour to the newest percepts, without waiting; the caller decides how old they may be."""

    def looked(self) -> float | None:
        """Return the stamp of the newest frame that was searched, None before the first."""
        ...

    def faces(self) -> Sequence[Face]:
        """Return the faces tracked now, largest first, each with the stamp of the frame that last showed it."""
        ...

    def things(self) -> Sequence[Thing]:
        """Return the coloured shapes tracked now, largest first."""
        ...

    def markers(self) -> Sequence[Marker]:
        """Return the markers of other robots tracked now, largest first."""
        ...

    def scene(self) -> Scene | None:
        """Return the brightness and contrast of the newest frame; None before the first frame.

        They may be those of an earlier frame, which is at most 0.2 s old.
        """
        ...


@dataclass(frozen=True, slots=True)
class Words:
    """An utterance that was recognised as one of the phrases that the mission listens for.

    ``id`` counts the utterances. ``start`` and ``stamp`` are its begin and end, in seconds on the run's clock.
    ``score`` is the certainty: above 0 the phrase is more likely than other speech. ``who`` is the speaker, known only
    in simulation.
    """

    id: int
    phrase: str
    start: float
    stamp: float
    score: float
    who: str = ""


class Hearing(Protocol):
    """Access of a behaviour to recognised phrases, without waiting."""

    def listened(self) -> float | None:
        """Return the time up to which the sound was searched; None before the first sound.

        The time stands still while the microphone is disconnected.
        """
        ...

    def words(self) -> Sequence[Words]:
        """Return the recognised phrases of the last 30 s, newest first."""
        ...

    def refused(self) -> Sequence[Words]:
        """Return the utterances of the last 30 s that were not accepted as a phrase, newest first.

        Each has the phrase that is nearest to it, and a score that is too low.
        """
        ...

    def level(self) -> Annotated[float, "unsampled"]:
        """Return the current sound level in dBFS: 0 is the maximum, -90 about silence."""
        ...


def ignore(*_told: object) -> None:
    """Do nothing: the default of unused callbacks."""
