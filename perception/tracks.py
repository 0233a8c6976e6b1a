"""From what single frames show to what is followed over time, each with an id, a direction and its rate.

An angle's motion is a Kalman filter with a constant rate, for measurements at any times. After Bar-Shalom, Li and
Kirubarajan, "Estimation with Applications to Tracking and Navigation", section 6.3: the piecewise constant acceleration
model, with two states. How exactly angles are measured is learnt. Somebody who sets off, stops or turns about is known
by how far he is from where he was expected (section 11.2: adjustable process noise).
"""

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from math import cos, hypot, nan, radians, sqrt
from typing import Any, Generic, Protocol, TypeVar

from drivers.api.quick import dataclass
from perception.api import Box, Detection, Face, Gaze, Marker, Percept, Thing, Wanted
from perception.geometry import Pinhole, look, wrap

MEASURED = radians(0.4)
"""Standard deviation of a measured angle, until it is learnt: two or three pixels of 640 over 60 degrees."""

LEAST = radians(0.1)
"""The least that it is taken for."""

BELIEVED, REMEMBERED = 3, 20
"""For how many measurements that counts which is believed before any, and how many are remembered."""

TURNED = 0.4
"""Standard deviation of an angle as a share of what the camera has turned since the measurement before: servos stand
beside the way that they are sent, and when a picture was taken is known to some ten milliseconds."""

STANDS, FADES = radians(0.1), 0.5
"""Radians: a camera that has turned less stands; by and by, as the second number says."""

ACCELERATION = 2.0
"""Standard deviation in rad/s^2 of how the rate changes: someone who walks at 20 degrees/s turns about in 0.35 s."""

FIRST_RATE = 1.0
"""Standard deviation in rad/s of the rate before a second measurement, and of one that has become another."""

JUMP = radians(4), radians(100)
"""An angle farther than so many radians, and rad/s, from where it was expected has jumped, unless it was known so badly
that this is within ``UNSURE`` standard deviations. It begins anew there: a jump tells no rate."""

UNSURE = 3.0

SUDDEN = 3.0
"""Standard deviations: who is farther from where he was expected, before a camera that stands, has another rate now."""


class Motion:
    """The filtered ``angle`` in radians and ``rate`` in rad/s at the last measurement. The angle does not wrap."""

    def __init__(self, angle: float) -> None:
        self._noise, self._count = MEASURED**2, BELIEVED
        self._turned = 0.0
        self._begin(angle)

    def _begin(self, angle: float) -> None:
        """Know where it is, and nothing of its rate."""
        self.angle = angle
        self.rate = 0.0
        self._angle_variance = self._noise
        self._covariance = 0.0
        self._rate_variance = FIRST_RATE**2
        self._seen = [(angle, 0.0)]

    def update(self, angle: float, after: float, turned: float = 0.0, doubt: float = 0.0) -> None:
        """Take in an angle measured ``after`` seconds, whole turns aside; the camera ``turned`` (radians) meanwhile.

        ``doubt`` (radians, one sigma) is what the direction of the camera adds to the noise.
        Raises ValueError for a negative time.
        """
        if after < 0:
            raise ValueError(f"motion: a measurement cannot come {-after} s before the last one")
        self._go_on(after)
        surprise = wrap(angle - self.angle)
        turned = self._turned = max(turned, FADES * self._turned)
        noise = self._noise + (TURNED * turned) ** 2 + doubt**2
        expected = sqrt(self._angle_variance + noise)
        if abs(surprise) > max(JUMP[0], JUMP[1] * after, UNSURE * expected):
            self._begin(self.angle + surprise)
            return
        self._learn(self.angle + surprise, after, turned)
        if turned < STANDS and abs(surprise) > SUDDEN * expected:
            self._spread(after, FIRST_RATE**2)
        variance = self._angle_variance + noise
        gain, rate_gain = self._angle_variance / variance, self._covariance / variance
        self.angle += gain * surprise
        self.rate += rate_gain * surprise
        self._rate_variance -= rate_gain * self._covariance
        self._covariance *= 1 - gain
        self._angle_variance *= 1 - gain

    def _go_on(self, after: float) -> None:
        """Predict: the angle moves on at its rate, and both become less certain."""
        jolt = (ACCELERATION * after) ** 2
        self.angle += self.rate * after
        self._angle_variance += after * (2 * self._covariance + after * self._rate_variance) + jolt * after**2 / 4
        self._covariance += after * self._rate_variance + jolt * after / 2
        self._rate_variance += jolt

    def _spread(self, after: float, more: float) -> None:
        """The rate became less certain ``after`` seconds ago, by a variance of so much ``more``."""
        self._angle_variance += after**2 * more
        self._covariance += after * more
        self._rate_variance += more

    def _learn(self, angle: float, after: float, turned: float) -> None:
        """Learn how exactly angles are measured: by how far the middle one of three is off the line of the others."""
        if after <= 0.0 or turned > STANDS:
            self._seen = [(angle, after)]
            return
        if len(self._seen) == 2:
            (first, _), (middle, time) = self._seen
            share = time / (time + after)
            off = (middle - first - share * (angle - first)) ** 2 / (1 + share**2 + (1 - share) ** 2)
            self._count = min(self._count + 1, REMEMBERED)
            self._noise = max(LEAST**2, self._noise + (min(off, 9 * self._noise) - self._noise) / self._count)
        self._seen = [self._seen[-1], (angle, after)]


P = TypeVar("P", bound=Percept)
P_co = TypeVar("P_co", bound=Percept, covariant=True)

TRACK_TIMEOUT = 1.0
"""Seconds for which what is not seen keeps its id."""

CONFIRMED = 2
"""Detections that make a track. A detector errs in some frames of a hundred, seldom twice in one place."""

DOUBT = 0.5
"""Seconds within which they must come."""

GATE = radians(8)
GATE_GROWTH = radians(30)  # per second: as fast as someone close by walks past
COAST = 0.3  # seconds for which someone out of sight is taken to go on as before


class Sighted(Protocol[P_co]):
    """Something that one frame shows."""

    @property
    def box(self) -> Box:
        """Where in the frame."""
        ...

    @property
    def found(self) -> bool:
        """Whether its detector found it in this frame; else it was carried here, which confirms nothing."""
        ...

    @property
    def kind(self) -> str:
        """The kind of the track: it can only be followed as that."""
        ...

    def distance(self, camera: Pinhole) -> float:
        """Return how far away it is in metres; NaN where that is not known."""
        ...

    def percept(self, followed: Percept) -> P_co:
        """Return what others are told of it, ``followed`` being what all percepts have in common."""
        ...


def common(percept: Percept) -> dict[str, Any]:
    """Return what all percepts have in common, by name: the arguments of each of them."""
    return {field.name: getattr(percept, field.name) for field in fields(Percept)}


@dataclass(frozen=True, slots=True)
class _Measured(Generic[P]):
    """A sighting with its directions in radians: from the optical axis, and in the odometry frame.

    ``doubt`` is that about the direction of the camera.
    """

    sighting: Sighted[P]
    bearing: float
    elevation: float
    yaw: float
    pitch: float
    distance: float
    doubt: float


class _Track(Generic[P]):
    """A thing over time, perhaps not confirmed yet (then its ``id`` is None)."""

    def __init__(self, measured: _Measured[P], stamp: float) -> None:
        self.id: int | None = None
        self.times = 1
        self.stamp = stamp
        self.last = measured
        self._yaw = Motion(measured.yaw)
        self._pitch = Motion(measured.pitch)

    def off(self, measured: _Measured[P], stamp: float) -> float:
        """Return how far a measurement is from where this is expected, in radians."""
        ahead = min(max(stamp - self.stamp, 0.0), COAST)
        return hypot(
            wrap(measured.yaw - self._yaw.angle - self._yaw.rate * ahead),
            measured.pitch - self._pitch.angle - self._pitch.rate * ahead,
        )

    def accepts(self, measured: _Measured[P], off: float, stamp: float) -> bool:
        """Say whether a measurement that is ``off`` by so many radians may be of this."""
        gate = GATE + GATE_GROWTH * max(0.0, stamp - self.stamp)
        return off <= gate and measured.sighting.kind == self.last.sighting.kind

    def update(self, measured: _Measured[P], stamp: float) -> None:
        """Take in that it was seen again."""
        after = max(0.0, stamp - self.stamp)
        before = self.last
        across = wrap(measured.yaw - measured.bearing - before.yaw + before.bearing)
        down = measured.pitch - measured.elevation - before.pitch + before.elevation
        self._yaw.update(measured.yaw, after, abs(across), measured.doubt)
        self._pitch.update(measured.pitch, after, abs(down))
        self.times += measured.sighting.found
        self.stamp, self.last = stamp, measured

    def lives(self, stamp: float) -> bool:
        """Whether it may still come back."""
        return stamp - self.stamp <= (DOUBT if self.id is None else TRACK_TIMEOUT)

    def percept(self, number: int) -> P:
        """Return what others are told of it."""
        followed = Percept(
            id=number,
            stamp=self.stamp,
            box=self.last.sighting.box,
            bearing=self.last.bearing,
            elevation=self.last.elevation,
            yaw=self._yaw.angle,
            pitch=self._pitch.angle,
            yaw_rate=self._yaw.rate,
            pitch_rate=self._pitch.rate,
            distance=self.last.distance,
        )
        return self.last.sighting.percept(followed)


class Tracker(Generic[P]):
    """Follows things of one sort through time: nearest first within a gate, each filtered, ids never reused.

    Ids count from 1. A track begins with a detection and is told of from the second one on, also when nothing else is
    known: one frame later at best, but a robot that searches does not greet the wallpaper. It ends ``TRACK_TIMEOUT``
    seconds after it was last seen. For one thread at a time.
    """

    def __init__(self) -> None:
        self._tracks: list[_Track[P]] = []
        self._ids = 0

    def update(
        self, sightings: Sequence[Sighted[P]], *, camera: Pinhole, gaze: Gaze | None, stamp: float
    ) -> tuple[P, ...]:
        """Take in what one frame shows and return all that is followed now, largest first.

        ``gaze`` is where the camera looked at ``stamp``, the time of the frame; None, not known, counts as straight on.
        A frame no newer than the last one refreshes the tracks without moving them on.
        """
        if not (sightings or self._tracks):
            return ()
        at = gaze or Gaze(0.0, 0.0)
        self._tracks = [track for track in self._tracks if track.lives(stamp)]
        unmatched = self._match([_measure(sighting, camera, at) for sighting in sightings], stamp)
        self._tracks += [_Track(measured, stamp) for measured in unmatched if measured.sighting.found]
        return self._percepts()

    def _match(self, measured: list[_Measured[P]], stamp: float) -> list[_Measured[P]]:
        """Give each track the measurement nearest to it; return those that nobody took."""
        pairs = sorted(
            ((track.off(one, stamp), i, j) for i, track in enumerate(self._tracks) for j, one in enumerate(measured)),
        )
        matched: set[int] = set()
        taken: set[int] = set()
        for off, i, j in pairs:
            if i not in matched and j not in taken and self._tracks[i].accepts(measured[j], off, stamp):
                matched.add(i)
                taken.add(j)
                self._tracks[i].update(measured[j], stamp)
        return [one for j, one in enumerate(measured) if j not in taken]

    def _percepts(self) -> tuple[P, ...]:
        """Number the tracks that are confirmed by now, and tell of them."""
        found: list[P] = []
        for track in self._tracks:
            if track.id is None and track.times >= CONFIRMED:
                self._ids += 1
                track.id = self._ids
            if track.id is not None:
                found.append(track.percept(track.id))
        return tuple(sorted(found, key=lambda percept: -percept.box.width * percept.box.height))


def _measure(sighting: Sighted[P], camera: Pinhole, gaze: Gaze) -> _Measured[P]:
    """Turn a box in the picture into directions."""
    bearing, elevation = camera.angles(*sighting.box.centre)
    yaw, pitch = look(gaze, bearing, elevation)
    return _Measured(sighting, bearing, elevation, yaw, pitch, sighting.distance(camera), gaze.doubt)


# What finders tell of one frame: faces, spots and things of one colour, markers. Plain values, without arrays.

SEARCH_WIDTH = 320
"""Pixels of the width to which a picture is shrunk before it is searched: a quarter of the work, half of the noise."""

SMALLEST_SPOT = 8
"""Pixels of that by which a thing must be wide and high for its shape to be seen."""

BOX_WIDENING = 1.2
"""A box looks wider than its front when it is turned: by 1 to 1.41 times for a square one, this in the middle."""

MARKER_FAMILIES = (
    "4x4_50",
    "4x4_100",
    "5x5_100",
    "6x6_250",
    "apriltag_16h5",
    "apriltag_25h9",
    "apriltag_36h11",
)
"""The families of markers by the names that robot files give them; those of OpenCV's dictionaries."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where a face is in one frame: ``found`` there by the detector, or else carried there by optical flow.

    One that is not ``believed`` is a candidate: so far only the search that found it takes it for a face. ``who`` is
    whose it truly is, which only simulated eyes know.
    """

    detection: Detection
    found: bool
    who: str = ""
    believed: bool = True

    @property
    def box(self) -> Box:
        """Where in the frame."""
        return self.detection.box

    @property
    def kind(self) -> str:
        """What it can be followed as: any face may be that of anybody."""
        return "face"

    def distance(self, camera: Pinhole) -> float:
        """Guess how far away it is, in metres."""
        return camera.distance(self.box)

    def percept(self, followed: Percept) -> Face:
        """Return what others are told of it."""
        return Face(**common(followed))


@dataclass(frozen=True, slots=True)
class Spot:
    """What was found in one picture: where, in its pixels; its colour; its shape, and its width as ``Outline`` has it.

    ``width`` is in pixels of the picture.
    """

    box: Box
    colour: str
    shape: str
    width: float


@dataclass(frozen=True, slots=True)
class ThingSighting:
    """A spot in one frame that is what was looked for."""

    spot: Spot
    wanted: Wanted
    found: bool = True

    @property
    def box(self) -> Box:
        """Where in the frame."""
        return self.spot.box

    @property
    def kind(self) -> str:
        """What it can be followed as."""
        return self.wanted.name

    def distance(self, camera: Pinhole) -> float:
        """Return how far away it is in metres, by its size; NaN where that is not known.

        A ball's is off by 3 %, a box's by 20 %, as boxes look wider when they are turned.
        """
        if self.wanted.size is None:
            return nan
        bearing, elevation = camera.angles(*self.box.centre)
        return self.wanted.size * camera.focal / self.spot.width / (cos(bearing) * cos(elevation))

    def percept(self, followed: Percept) -> Thing:
        """Return what others are told of it."""
        wanted = self.wanted
        return Thing(
            **common(followed), name=wanted.name, colour=wanted.colour, shape=self.spot.shape, size=wanted.size
        )


@dataclass(frozen=True, slots=True)
class MarkerKind:
    """The markers that robots wear: their family, the side of their black frame in metres, and whose is which.

    ``robots`` are names by number. Raises ValueError for a family that is not known and a side that is not above 0.
    """

    family: str = "4x4_50"
    size: float = 0.15
    robots: Mapping[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.family not in MARKER_FAMILIES:
            raise ValueError(f"markers: no family '{self.family}'; known are: {', '.join(MARKER_FAMILIES)}")
        if not self.size > 0:
            raise ValueError(f"markers: a side of {self.size} m: must be above 0 m")


@dataclass(frozen=True, slots=True)
class MarkerSighting:
    """A marker in one frame: its ``range`` in metres from the lens, and its ``heading`` as ``Marker`` has it."""

    number: int
    name: str
    box: Box
    range: float
    heading: float
    found: bool = True

    @property
    def kind(self) -> str:
        """What it can be followed as."""
        return str(self.number)

    def distance(self, camera: Pinhole) -> float:
        """Return how far away it is in metres."""
        del camera  # the range was found with all four corners
        return self.range

    def percept(self, followed: Percept) -> Marker:
        """Return what others are told of it."""
        return Marker(**common(followed), number=self.number, name=self.name, heading=self.heading)
