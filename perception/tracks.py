"""Tracking: from sightings in single frames to percepts with an id, a direction and its rate.

Each angle is filtered by a Kalman filter with two states and a constant rate, for measurements at any times: the
piecewise constant acceleration model of Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and
Navigation", section 6.3. The measurement noise is learnt. A target that starts, stops or turns round is detected by its
distance from the prediction (section 11.2: adjustable process noise).
"""

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from math import cos, hypot, nan, radians, sqrt
from typing import Any, Generic, Protocol, TypeVar

from drivers.api.fast_dataclass import dataclass
from perception.api import Box, Detection, Face, Gaze, Marker, Percept, Thing, ThingSpec
from perception.geometry import Pinhole, direction_of, wrap_angle

INITIAL_NOISE = radians(0.4)
"""Initial standard deviation in radians of a measured angle of a target.

It corresponds to four pixels of a picture 640 pixels wide, at an angle of view of 60 degrees.
"""

MIN_NOISE = radians(0.1)
"""Smallest standard deviation of a measured angle."""

PRIOR_COUNT, MAX_COUNT = 3, 20
"""Number of measurements that the initial noise counts for, and largest number of measurements averaged."""

TURN_NOISE_SHARE = 0.4
"""Standard deviation of an angle that a turn of the camera adds, as a share of that turn.

The direction of a turning camera is less certain: its servos deviate from their setpoints, and the time of the picture
is only known to some ten milliseconds.
"""

MAX_STILL_TURN, TURN_DECAY = radians(0.1), 0.5
"""Radians that a camera at rest may turn; and decay of earlier turns per measurement."""

ACCELERATION = 2.0
"""Standard deviation in rad/s^2 of changes of a target's rate: at 20 degrees/s, a person turns round in 0.35 s."""

INITIAL_RATE_DEVIATION = 1.0
"""Standard deviation in rad/s of a target's rate before its second measurement, and after a manoeuvre."""

MIN_JUMP = radians(4), radians(100)
"""Deviation from the prediction, in radians and in rad/s, that restarts the filter at the new angle.

The deviation must also exceed ``JUMP_DEVIATIONS`` standard deviations. A jump has no information about the rate.
"""

JUMP_DEVIATIONS = 3.0

MANOEUVRE_DEVIATIONS = 3.0
"""Standard deviations from the prediction at which a target is assumed to have a new rate, for a camera at rest."""


class AngleFilter:
    """Kalman filter of an angle: ``angle`` in rad and ``rate`` in rad/s at the last measurement.

    ``angle`` is continuous: it does not wrap at a full turn.
    """

    def __init__(self, angle: float) -> None:
        self._noise, self._count = INITIAL_NOISE**2, PRIOR_COUNT
        self._recent_turn = 0.0
        self._restart(angle)

    def _restart(self, angle: float) -> None:
        """Set the filter to an angle with an unknown rate."""
        self.angle = angle
        self.rate = 0.0
        self._angle_variance = self._noise
        self._covariance = 0.0
        self._rate_variance = INITIAL_RATE_DEVIATION**2
        self._recent_angles = [(angle, 0.0)]

    def update(self, angle: float, elapsed: float, camera_turn: float = 0.0, doubt: float = 0.0) -> None:
        """Process a new measurement of the angle, ``elapsed`` seconds after the last one.

        ``angle`` may differ by full turns. ``camera_turn`` is the turn of the camera in that time, in radians.
        ``doubt`` (radians, one sigma) is the uncertainty of the camera's direction, added to the noise. Raises
        ValueError for a negative time.
        """
        if elapsed < 0:
            raise ValueError(f"motion: time stamps go back by {-elapsed} s: check the clock of the camera")
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
        """Prediction step: move the angle at its rate, and increase the uncertainty."""
        jolt = (ACCELERATION * after) ** 2
        self.angle += self.rate * after
        self._angle_variance += after * (2 * self._covariance + after * self._rate_variance) + jolt * after**2 / 4
        self._covariance += after * self._rate_variance + jolt * after / 2
        self._rate_variance += jolt

    def _add_rate_variance(self, after: float, more: float) -> None:
        """Add ``more`` to the variance of the rate, as if it had changed ``after`` seconds ago."""
        self._angle_variance += after**2 * more
        self._covariance += after * more
        self._rate_variance += more

    def _learn_noise(self, angle: float, after: float, turned: float) -> None:
        """Update the measurement noise by the distance of the middle one of three angles from a straight line.

        ``after`` are the seconds since the last angle, ``turned`` is the turn of the camera since then, in radians.
        """
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
"""Seconds without a sighting after which a track ends."""

MIN_DETECTIONS = 2
"""Number of detections that confirm a track, since a false detection is seldom repeated in the same place."""

CONFIRM_TIMEOUT = 0.5
"""Seconds within which the detections that confirm a track must come."""

GATE_ANGLE = radians(8)
GATE_GROWTH = radians(30)  # per second: as fast as someone close by walks past
COAST_TIME = 0.3  # seconds for which someone out of sight is taken to go on as before


class TrackableSighting(Protocol[P_co]):
    """Sighting of an object in one frame."""

    @property
    def box(self) -> Box:
        """Place of the object in the frame."""
        ...

    @property
    def found(self) -> bool:
        """True if the detector found the object in this frame.

        False if its place was only computed, such as by optical flow; such a sighting does not confirm a track.
        """
        ...

    @property
    def kind(self) -> str:
        """Kind of the track, which only sightings of the same kind can continue."""
        ...

    def distance(self, camera: Pinhole) -> float:
        """Return the distance of the object in metres, NaN if unknown."""
        ...

    def percept(self, base: Percept) -> P_co:
        """Return the percept of the track; ``base`` has the common fields."""
        ...


def common_fields(percept: Percept) -> dict[str, Any]:
    """Return the fields common to all percepts, by name, as arguments of their classes."""
    return {field.name: getattr(percept, field.name) for field in fields(Percept)}


@dataclass(frozen=True, slots=True)
class _Measurement(Generic[P]):
    """A sighting with its directions in radians: from the optical axis, and in the odometry frame.

    ``doubt`` is the uncertainty of the camera's direction.
    """

    sighting: TrackableSighting[P]
    bearing: float
    elevation: float
    yaw: float
    pitch: float
    distance: float
    doubt: float


class _Track(Generic[P]):
    """Track of an object; its ``id`` is None until it is confirmed."""

    def __init__(self, measured: _Measurement[P], stamp: float) -> None:
        self.id: int | None = None
        self.detection_count = 1
        self.stamp = stamp
        self.last_measurement = measured
        self._yaw = AngleFilter(measured.yaw)
        self._pitch = AngleFilter(measured.pitch)

    def deviation(self, measured: _Measurement[P], stamp: float) -> float:
        """Return the distance of a measurement from the track's prediction for ``stamp``, in radians."""
        ahead = min(max(stamp - self.stamp, 0.0), COAST_TIME)
        return hypot(
            wrap_angle(measured.yaw - self._yaw.angle - self._yaw.rate * ahead),
            measured.pitch - self._pitch.angle - self._pitch.rate * ahead,
        )

    def accepts(self, measured: _Measurement[P], deviation: float, stamp: float) -> bool:
        """Return whether a measurement may belong to the track.

        ``deviation`` is its distance from the track's prediction in radians.
        """
        gate = GATE_ANGLE + GATE_GROWTH * max(0.0, stamp - self.stamp)
        return deviation <= gate and measured.sighting.kind == self.last_measurement.sighting.kind

    def update(self, measured: _Measurement[P], stamp: float) -> None:
        """Process a new measurement of the object."""
        after = max(0.0, stamp - self.stamp)
        before = self.last_measurement
        across = wrap_angle(measured.yaw - measured.bearing - before.yaw + before.bearing)
        down = measured.pitch - measured.elevation - before.pitch + before.elevation
        self._yaw.update(measured.yaw, after, abs(across), measured.doubt)
        self._pitch.update(measured.pitch, after, abs(down))
        self.detection_count += measured.sighting.found
        self.stamp, self.last_measurement = stamp, measured

    def is_alive(self, stamp: float) -> bool:
        """Return whether the track has not timed out."""
        return stamp - self.stamp <= (CONFIRM_TIMEOUT if self.id is None else TRACK_TIMEOUT)

    def percept(self, number: int) -> P:
        """Return the percept of the track, with the id ``number``."""
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
    """Tracks objects of one sort: data association by nearest neighbour within a gate, with filtered angles.

    Ids count from 1 and are never reused. A track starts with a detection, and is returned from its second detection
    on. This costs one frame, but avoids reactions to most false detections. A track ends ``TRACK_TIMEOUT`` seconds
    after the last sighting. For one thread at a time.
    """

    def __init__(self) -> None:
        self._tracks: list[_Track[P]] = []
        self._last_id = 0

    def update(
        self, sightings: Sequence[TrackableSighting[P]], *, camera: Pinhole, gaze: Gaze | None, stamp: float
    ) -> tuple[P, ...]:
        """Process the sightings of one frame and return all confirmed tracks, largest first.

        ``gaze`` is the direction of the camera at ``stamp``, the time of the frame; None counts as straight ahead. A
        frame that is not newer than the last one prolongs the tracks, but does not change their directions.
        """
        if not (sightings or self._tracks):
            return ()
        at = gaze or Gaze(0.0, 0.0)
        self._tracks = [track for track in self._tracks if track.is_alive(stamp)]
        unmatched = self._match([_measure(sighting, camera, at) for sighting in sightings], stamp)
        self._tracks += [_Track(measured, stamp) for measured in unmatched if measured.sighting.found]
        return self._percepts()

    def _match(self, measured: list[_Measurement[P]], stamp: float) -> list[_Measurement[P]]:
        """Associate each track with its nearest measurement; return the measurements that belong to no track.

        Greedy, not the Hungarian method: pairs of track and measurement are taken in the order of their deviation.
        """
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
        """Number the newly confirmed tracks, and return the percepts of all confirmed ones."""
        found: list[P] = []
        for track in self._tracks:
            if track.id is None and track.detection_count >= MIN_DETECTIONS:
                self._last_id += 1
                track.id = self._last_id
            if track.id is not None:
                found.append(track.percept(track.id))
        return tuple(sorted(found, key=lambda percept: -percept.box.width * percept.box.height))


def _measure(sighting: TrackableSighting[P], camera: Pinhole, gaze: Gaze) -> _Measurement[P]:
    """Convert the box of a sighting to directions."""
    bearing, elevation = camera.pixel_to_angles(*sighting.box.centre)
    yaw, pitch = direction_of(gaze, bearing, elevation)
    return _Measurement(sighting, bearing, elevation, yaw, pitch, sighting.distance(camera), gaze.doubt)


# What finders tell of one frame: faces, spots and things of one colour, markers. Plain values, without arrays.

SEARCH_WIDTH = 320
"""Width in pixels to which a picture is shrunk before the search for things.

This takes a quarter of the work, and halves the noise.
"""

MIN_SPOT_PIXELS = 8
"""Smallest width and height of a thing in the shrunk picture, in pixels, for its shape to be visible."""

BOX_WIDENING = 1.2
"""Assumed ratio of the visible width of a box to the width of its front.

It is 1 for a square box that faces the camera, and 1.41 for one that is turned by 45 degrees.
"""

MARKER_FAMILIES = (
    "4x4_50",
    "4x4_100",
    "5x5_100",
    "6x6_250",
    "apriltag_16h5",
    "apriltag_25h9",
    "apriltag_36h11",
)
"""Marker families as named in robot files; each stands for a dictionary of OpenCV."""


@dataclass(frozen=True, slots=True)
class FaceSighting:
    """A face in one frame: ``found`` by the detector, or else tracked to this frame by optical flow.

    If not ``is_believed``, it is a candidate that no independent search has confirmed. ``person`` is the true name,
    known only to simulated eyes.
    """

    detection: Detection
    found: bool
    person: str = ""
    is_believed: bool = True

    @property
    def box(self) -> Box:
        return self.detection.box

    @property
    def kind(self) -> str:
        return "face"

    def distance(self, camera: Pinhole) -> float:
        return camera.face_distance(self.box)

    def percept(self, base: Percept) -> Face:
        return Face(**common_fields(base))


@dataclass(frozen=True, slots=True)
class ColourSpot:
    """A spot of one colour in a picture: its box in pixels, colour, shape, and width as in ``SpotOutline``.

    ``width`` is in pixels of the picture.
    """

    box: Box
    colour: str
    shape: str
    width: float


@dataclass(frozen=True, slots=True)
class ThingSighting:
    """A spot in one frame that matches the specification of a thing."""

    spot: ColourSpot
    spec: ThingSpec
    found: bool = True

    @property
    def box(self) -> Box:
        return self.spot.box

    @property
    def kind(self) -> str:
        return self.spec.name

    def distance(self, camera: Pinhole) -> float:
        """Return the distance of the thing in metres by its specified size; NaN if the size is unknown.

        It is wrong by 3 % for a ball, and by 20 % for a box, as boxes look wider when turned.
        """
        if self.spec.size is None:
            return nan
        bearing, elevation = camera.pixel_to_angles(*self.box.centre)
        return self.spec.size * camera.focal / self.spot.width / (cos(bearing) * cos(elevation))

    def percept(self, base: Percept) -> Thing:
        wanted = self.spec
        return Thing(
            **common_fields(base), name=wanted.name, colour=wanted.colour, shape=self.spot.shape, size=wanted.size
        )


@dataclass(frozen=True, slots=True)
class MarkerSet:
    """Markers of the robots: their family, the side of their black frame in metres, and robot names by number.

    Raises ValueError for an unknown family and a side of 0 or less.
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
    """A marker in one frame: its ``range`` in metres from the lens, and its ``heading`` as in ``Marker``."""

    number: int
    name: str
    box: Box
    range: float
    heading: float
    found: bool = True

    @property
    def kind(self) -> str:
        return str(self.number)

    def distance(self, camera: Pinhole) -> float:
        del camera  # the range was found with all four corners
        return self.range

    def percept(self, base: Percept) -> Marker:
        return Marker(**common_fields(base), number=self.number, name=self.name, heading=self.heading)
