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

from drivers.api.fast_dataclass import dataclass
from perception.api import Box, Detection, Face, Gaze, Marker, Percept, Thing, ThingSpec
from perception.geometry import Pinhole, direction_of, wrap_angle

INITIAL_NOISE = radians(0.4)
"""Standard deviation of a measured angle, until it is learnt: two or three pixels of 640 over 60 degrees."""

MIN_NOISE = radians(0.1)
"""The least that it is taken for."""

PRIOR_COUNT, MAX_COUNT = 3, 20
"""For how many measurements that counts which is believed before any, and how many are remembered."""

TURN_NOISE_SHARE = 0.4
"""Standard deviation of an angle as a share of what the camera has turned since the measurement before: servos stand
beside the way that they are sent, and when a picture was taken is known to some ten milliseconds."""

MAX_STILL_TURN, TURN_DECAY = radians(0.1), 0.5
"""Radians: a camera that has turned less stands; by and by, as the second number says."""

ACCELERATION = 2.0
"""Standard deviation in rad/s^2 of how the rate changes: someone who walks at 20 degrees/s turns about in 0.35 s."""

INITIAL_RATE_DEVIATION = 1.0
"""Standard deviation in rad/s of the rate before a second measurement, and of one that has become another."""

MIN_JUMP = radians(4), radians(100)
"""An angle farther than so many radians, and rad/s, from where it was expected has jumped, unless it was known so badly
that this is within ``JUMP_DEVIATIONS`` standard deviations. It begins anew there: a jump tells no rate."""

JUMP_DEVIATIONS = 3.0

MANOEUVRE_DEVIATIONS = 3.0
"""Standard deviations: who is farther from where he was expected, before a camera that stands, has another rate now."""


class AngleFilter:
    """The filtered ``angle`` in radians and ``rate`` in rad/s at the last measurement. The angle does not wrap."""

    def __init__(self, angle: float) -> None:
        self._noise, self._count = INITIAL_NOISE**2, PRIOR_COUNT
        self._recent_turn = 0.0
        self._restart(angle)

    def _restart(self, angle: float) -> None:
        """Know where it is, and nothing of its rate."""
        self.angle = angle
        self.rate = 0.0
        self._angle_variance = self._noise
        self._covariance = 0.0
        self._rate_variance = INITIAL_RATE_DEVIATION**2
        self._recent_angles = [(angle, 0.0)]

    def update(self, angle: float, elapsed: float, camera_turn: float = 0.0, doubt: float = 0.0) -> None:
        """Take in an angle measured ``after`` seconds, whole turns aside; the camera ``turned`` (radians) meanwhile.

        ``doubt`` (radians, one sigma) is what the direction of the camera adds to the noise.
        Raises ValueError for a negative time.
        """
        if elapsed < 0:
            raise ValueError(f"motion: a measurement cannot come {-elapsed} s before the last one")
        self._predict(elapsed)
        surprise = wrap_angle(angle - self.angle)
        camera_turn = self._recent_turn = max(camera_turn, TURN_DECAY * self._recent_turn)
        noise = self._noise + (TURN_NOISE_SHARE * camera_turn) ** 2 + doubt**2
        expected = sqrt(self._angle_variance + noise)
        if abs(surprise) > max(MIN_JUMP[0], MIN_JUMP[1] * elapsed, JUMP_DEVIATIONS * expected):
            self._restart(self.angle + surprise)
            return
        self._learn_noise(self.angle + surprise, elapsed, camera_turn)
        if camera_turn < MAX_STILL_TURN and abs(surprise) > MANOEUVRE_DEVIATIONS * expected:
            self._add_rate_variance(elapsed, INITIAL_RATE_DEVIATION**2)
        variance = self._angle_variance + noise
        gain, rate_gain = self._angle_variance / variance, self._covariance / variance
        self.angle += gain * surprise
        self.rate += rate_gain * surprise
        self._rate_variance -= rate_gain * self._covariance
        self._covariance *= 1 - gain
        self._angle_variance *= 1 - gain

    def _predict(self, after: float) -> None:
        """Predict: the angle moves on at its rate, and both become less certain."""
        jolt = (ACCELERATION * after) ** 2
        self.angle += self.rate * after
        self._angle_variance += after * (2 * self._covariance + after * self._rate_variance) + jolt * after**2 / 4
        self._covariance += after * self._rate_variance + jolt * after / 2
        self._rate_variance += jolt

    def _add_rate_variance(self, after: float, more: float) -> None:
        """The rate became less certain ``after`` seconds ago, by a variance of so much ``more``."""
        self._angle_variance += after**2 * more
        self._covariance += after * more
        self._rate_variance += more

    def _learn_noise(self, angle: float, after: float, turned: float) -> None:
        """Learn how exactly angles are measured: by how far the middle one of three is off the line of the others."""
        if after <= 0.0 or turned > MAX_STILL_TURN:
            self._recent_angles = [(angle, after)]
            return
        if len(self._recent_angles) == 2:
            (first, _), (middle, time) = self._recent_angles
            share = time / (time + after)
            off = (middle - first - share * (angle - first)) ** 2 / (1 + share**2 + (1 - share) ** 2)
            self._count = min(self._count + 1, MAX_COUNT)
            self._noise = max(MIN_NOISE**2, self._noise + (min(off, 9 * self._noise) - self._noise) / self._count)
        self._recent_angles = [self._recent_angles[-1], (angle, after)]


P = TypeVar("P", bound=Percept)
P_co = TypeVar("P_co", bound=Percept, covariant=True)

TRACK_TIMEOUT = 1.0
"""Seconds for which what is not seen keeps its id."""

MIN_DETECTIONS = 2
"""Detections that make a track. A detector errs in some frames of a hundred, seldom twice in one place."""

CONFIRM_TIMEOUT = 0.5
"""Seconds within which they must come."""

GATE_ANGLE = radians(8)
GATE_GROWTH = radians(30)  # per second: as fast as someone close by walks past
COAST_TIME = 0.3  # seconds for which someone out of sight is taken to go on as before


class TrackableSighting(Protocol[P_co]):
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

    def percept(self, base: Percept) -> P_co:
        """Return what others are told of it, ``followed`` being what all percepts have in common."""
        ...


def common_fields(percept: Percept) -> dict[str, Any]:
    """Return what all percepts have in common, by name: the arguments of each of them."""
    return {field.name: getattr(percept, field.name) for field in fields(Percept)}


@dataclass(frozen=True, slots=True)
class _Measurement(Generic[P]):
    """A sighting with its directions in radians: from the optical axis, and in the odometry frame.

    ``doubt`` is that about the direction of the camera.
    """

    sighting: TrackableSighting[P]
    bearing: float
    elevation: float
    yaw: float
    pitch: float
    distance: float
    doubt: float


class _Track(Generic[P]):
    """A thing over time, perhaps not confirmed yet (then its ``id`` is None)."""

    def __init__(self, measured: _Measurement[P], stamp: float) -> None:
        self.id: int | None = None
        self.detection_count = 1
        self.stamp = stamp
        self.last_measurement = measured
        self._yaw = AngleFilter(measured.yaw)
        self._pitch = AngleFilter(measured.pitch)

    def deviation(self, measured: _Measurement[P], stamp: float) -> float:
        """Return how far a measurement is from where this is expected, in radians."""
        ahead = min(max(stamp - self.stamp, 0.0), COAST_TIME)
        return hypot(
            wrap_angle(measured.yaw - self._yaw.angle - self._yaw.rate * ahead),
            measured.pitch - self._pitch.angle - self._pitch.rate * ahead,
        )

    def accepts(self, measured: _Measurement[P], deviation: float, stamp: float) -> bool:
        """Say whether a measurement that is ``deviation`` by so many radians may be of this."""
        gate = GATE_ANGLE + GATE_GROWTH * max(0.0, stamp - self.stamp)
        return deviation <= gate and measured.sighting.kind == self.last_measurement.sighting.kind

    def update(self, measured: _Measurement[P], stamp: float) -> None:
        """Take in that it was seen again."""
        after = max(0.0, stamp - self.stamp)
        before = self.last_measurement
        across = wrap_angle(measured.yaw - measured.bearing - before.yaw + before.bearing)
        down = measured.pitch - measured.elevation - before.pitch + before.elevation
        self._yaw.update(measured.yaw, after, abs(across), measured.doubt)
        self._pitch.update(measured.pitch, after, abs(down))
        self.detection_count += measured.sighting.found
        self.stamp, self.last_measurement = stamp, measured

    def is_alive(self, stamp: float) -> bool:
        """Whether it may still come back."""
        return stamp - self.stamp <= (CONFIRM_TIMEOUT if self.id is None else TRACK_TIMEOUT)

    def percept(self, number: int) -> P:
        """Return what others are told of it."""
        followed = Percept(
            id=number,
            stamp=self.stamp,
            box=self.last_measurement.sighting.box,
            bearing=self.last_measurement.bearing,
            elevation=self.last_measurement.elevation,
            yaw=self._yaw.angle,
            pitch=self._pitch.angle,
            yaw_rate=self._yaw.rate,
            pitch_rate=self._pitch.rate,
            distance=self.last_measurement.distance,
        )
        return self.last_measurement.sighting.percept(followed)


class Tracker(Generic[P]):
    """Follows things of one sort through time: nearest first within a gate, each filtered, ids never reused.

    Ids count from 1. A track begins with a detection and is told of from the second one on, also when nothing else is
    known: one frame later at best, but a robot that searches does not greet the wallpaper. It ends ``TRACK_TIMEOUT``
    seconds after it was last seen. For one thread at a time.
    """

    def __init__(self) -> None:
        self._tracks: list[_Track[P]] = []
        self._last_id = 0

    def update(
        self, sightings: Sequence[TrackableSighting[P]], *, camera: Pinhole, gaze: Gaze | None, stamp: float
    ) -> tuple[P, ...]:
        """Take in what one frame shows and return all that is followed now, largest first.

        ``gaze`` is where the camera looked at ``stamp``, the time of the frame; None, not known, counts as straight on.
        A frame no newer than the last one refreshes the tracks without moving them on.
        """
        if not (sightings or self._tracks):
            return ()
        at = gaze or Gaze(0.0, 0.0)
        self._tracks = [track for track in self._tracks if track.is_alive(stamp)]
        unmatched = self._match([_measure(sighting, camera, at) for sighting in sightings], stamp)
        self._tracks += [_Track(measured, stamp) for measured in unmatched if measured.sighting.found]
        return self._percepts()

    def _match(self, measured: list[_Measurement[P]], stamp: float) -> list[_Measurement[P]]:
        """Give each track the measurement nearest to it; return those that nobody took."""
        pairs = sorted(
            (
                (track.deviation(one, stamp), i, j)
                for i, track in enumerate(self._tracks)
                for j, one in enumerate(measured)
            ),
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
            if track.id is None and track.detection_count >= MIN_DETECTIONS:
                self._last_id += 1
                track.id = self._last_id
            if track.id is not None:
                found.append(track.percept(track.id))
        return tuple(sorted(found, key=lambda percept: -percept.box.width * percept.box.height))


def _measure(sighting: TrackableSighting[P], camera: Pinhole, gaze: Gaze) -> _Measurement[P]:
    """Turn a box in the picture into directions."""
    bearing, elevation = camera.pixel_to_angles(*sighting.box.centre)
    yaw, pitch = direction_of(gaze, bearing, elevation)
    return _Measurement(sighting, bearing, elevation, yaw, pitch, sighting.distance(camera), gaze.doubt)


# What finders tell of one frame: faces, spots and things of one colour, markers. Plain values, without arrays.

SEARCH_WIDTH = 320
"""Pixels of the width to which a picture is shrunk before it is searched: a quarter of the work, half of the noise."""

MIN_SPOT_PIXELS = 8
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
class FaceSighting:
    """Where a face is in one frame: ``found`` there by the detector, or else carried there by optical flow.

    One that is not ``is_believed`` is a candidate: so far only the search that found it takes it for a face. ``person`` is
    whose it truly is, which only simulated eyes know.
    """

    detection: Detection
    found: bool
    person: str = ""
    is_believed: bool = True

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
        return camera.face_distance(self.box)

    def percept(self, base: Percept) -> Face:
        """Return what others are told of it."""
        return Face(**common_fields(base))


@dataclass(frozen=True, slots=True)
class ColourSpot:
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

    spot: ColourSpot
    spec: ThingSpec
    found: bool = True

    @property
    def box(self) -> Box:
        """Where in the frame."""
        return self.spot.box

    @property
    def kind(self) -> str:
        """What it can be followed as."""
        return self.spec.name

    def distance(self, camera: Pinhole) -> float:
        """Return how far away it is in metres, by its size; NaN where that is not known.

        A ball's is off by 3 %, a box's by 20 %, as boxes look wider when they are turned.
        """
        if self.spec.size is None:
            return nan
        bearing, elevation = camera.pixel_to_angles(*self.box.centre)
        return self.spec.size * camera.focal / self.spot.width / (cos(bearing) * cos(elevation))

    def percept(self, base: Percept) -> Thing:
        """Return what others are told of it."""
        wanted = self.spec
        return Thing(
            **common_fields(base), name=wanted.name, colour=wanted.colour, shape=self.spot.shape, size=wanted.size
        )


@dataclass(frozen=True, slots=True)
class MarkerSet:
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

    def percept(self, base: Percept) -> Marker:
        """Return what others are told of it."""
        return Marker(**common_fields(base), number=self.number, name=self.name, heading=self.heading)
