"""From sightings in single frames to people followed over time, each with an id, a direction and its rate."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, radians

from perception.api import Face, Gaze
from perception.geometry import Pinhole, look, wrap
from perception.motion import Motion
from perception.sighting import Sighting

PATIENCE = 1.0
"""Seconds for which a face that is not seen keeps its id."""

CONFIRMED = 2
"""Detections that make a track. Haar sees a false face in some frames of a hundred, seldom twice in one place."""

DOUBT = 0.5
"""Seconds within which they must come."""

GATE = radians(8)
GATE_GROWTH = radians(30)  # per second: as fast as someone close by walks past
COAST = 0.3  # seconds for which someone out of sight is taken to go on as before


@dataclass(frozen=True, slots=True)
class _Measured:
    """A sighting with its directions in radians: from the optical axis, and in the odometry frame."""

    sighting: Sighting
    bearing: float
    drop: float
    yaw: float
    pitch: float
    distance: float


class _Track:
    """One face over time, perhaps not confirmed yet (then its ``id`` is None)."""

    def __init__(self, measured: _Measured, stamp: float) -> None:
        self.id: int | None = None
        self.times = 1
        self.stamp = stamp
        self.last = measured
        self._yaw = Motion(measured.yaw)
        self._pitch = Motion(measured.pitch)

    def off(self, measured: _Measured, stamp: float) -> float:
        """Return how far a measurement is from where this face is expected, in radians."""
        ahead = min(max(stamp - self.stamp, 0.0), COAST)
        return hypot(
            wrap(measured.yaw - self._yaw.angle - self._yaw.rate * ahead),
            measured.pitch - self._pitch.angle - self._pitch.rate * ahead,
        )

    def update(self, measured: _Measured, stamp: float) -> None:
        """The face was seen again."""
        after = max(0.0, stamp - self.stamp)
        self._yaw.update(measured.yaw, after)
        self._pitch.update(measured.pitch, after)
        self.times += measured.sighting.found
        self.stamp, self.last = stamp, measured

    def lives(self, stamp: float) -> bool:
        """Whether it may still come back."""
        return stamp - self.stamp <= (DOUBT if self.id is None else PATIENCE)

    def face(self, number: int) -> Face:
        """Return what others are told of it."""
        return Face(
            id=number,
            stamp=self.stamp,
            box=self.last.sighting.detection.box,
            bearing=self.last.bearing,
            drop=self.last.drop,
            yaw=self._yaw.angle,
            pitch=self._pitch.angle,
            yaw_rate=self._yaw.rate,
            pitch_rate=self._pitch.rate,
            distance=self.last.distance,
        )


class Tracker:
    """Follows faces through time: nearest first within a gate, each filtered, ids counted from 1 and never reused.

    A track begins with a detection and is told of from the second one on, also when no other face is known: one frame
    later at best, but a robot that searches does not greet the wallpaper. It ends ``PATIENCE`` seconds after its face
    was last found, or carried by optical flow. For one thread at a time.
    """

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._ids = 0

    def update(
        self, sightings: Sequence[Sighting], *, camera: Pinhole, gaze: Gaze | None, stamp: float
    ) -> tuple[Face, ...]:
        """Take in what one frame shows and return the faces followed now, largest first.

        ``gaze`` is where the camera looked at ``stamp``, the time of the frame; None, not known, counts as straight on.
        A frame no newer than the last one refreshes the tracks without moving them on.
        """
        at = gaze or Gaze(0.0, 0.0)
        self._tracks = [track for track in self._tracks if track.lives(stamp)]
        unmatched = self._match([_measure(sighting, camera, at) for sighting in sightings], stamp)
        self._tracks += [_Track(measured, stamp) for measured in unmatched if measured.sighting.found]
        return self._faces()

    def _match(self, measured: list[_Measured], stamp: float) -> list[_Measured]:
        """Give each track the measurement nearest to it; return those that nobody took."""
        pairs = sorted(
            ((track.off(one, stamp), i, j) for i, track in enumerate(self._tracks) for j, one in enumerate(measured)),
        )
        matched: set[int] = set()
        taken: set[int] = set()
        for off, i, j in pairs:
            track = self._tracks[i]
            gate = GATE + GATE_GROWTH * max(0.0, stamp - track.stamp)
            if i not in matched and j not in taken and off <= gate:
                matched.add(i)
                taken.add(j)
                track.update(measured[j], stamp)
        return [one for j, one in enumerate(measured) if j not in taken]

    def _faces(self) -> tuple[Face, ...]:
        """Number the tracks that are confirmed by now, and tell of them."""
        faces: list[Face] = []
        for track in self._tracks:
            if track.id is None and track.times >= CONFIRMED:
                self._ids += 1
                track.id = self._ids
            if track.id is not None:
                faces.append(track.face(track.id))
        return tuple(sorted(faces, key=lambda face: -face.box.width * face.box.height))


def _measure(sighting: Sighting, camera: Pinhole, gaze: Gaze) -> _Measured:
    """Turn a box in the picture into directions."""
    box = sighting.detection.box
    bearing, drop = camera.angles(*box.centre)
    yaw, pitch = look(gaze, bearing, drop)
    return _Measured(sighting, bearing, drop, yaw, pitch, camera.distance(box))
