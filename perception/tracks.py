"""From what single frames show to what is followed over time, each with an id, a direction and its rate."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import hypot, radians
from typing import Any, Generic, Protocol, TypeVar

from perception.api import Box, Gaze, Percept
from perception.geometry import Pinhole, look, wrap
from perception.motion import Motion

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
        """What it can be followed as: a track keeps its kind."""
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
    """A sighting with its directions in radians: from the optical axis, and in the odometry frame."""

    sighting: Sighted[P]
    bearing: float
    elevation: float
    yaw: float
    pitch: float
    distance: float


class _Track(Generic[P]):
    """One thing over time, perhaps not confirmed yet (then its ``id`` is None)."""

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
        """It was seen again."""
        after = max(0.0, stamp - self.stamp)
        before = self.last
        across = wrap(measured.yaw - measured.bearing - before.yaw + before.bearing)
        down = measured.pitch - measured.elevation - before.pitch + before.elevation
        self._yaw.update(measured.yaw, after, abs(across))
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
    return _Measured(sighting, bearing, elevation, yaw, pitch, sighting.distance(camera))
