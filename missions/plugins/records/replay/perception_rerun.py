"""Today's perception on the pictures of a record: does it find what was found then?

It is not the same run over again: a picture has been through JPEG, and of those that were searched then not all were
kept. So tracks are compared, not ids and single pictures: what was followed then counts as found when the pictures that
show it have it at the same place now, most of the time.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from drivers.api import ignore
from drivers.api.sensor_sections import CameraKeys
from drivers.clock import ManualClock
from drivers.pictures.decode import decode_picture
from missions.assembly.eyes import vision as make_vision
from missions.assembly.models import face_detector
from missions.library.interests import Interests
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.replay.frames import STAMP_TOLERANCE
from perception.api import Gaze, Image, Marker, Percept, Thing, View
from perception.tracks import MIN_DETECTIONS

MIN_OVERLAP = 0.5
"""Intersection over union from which on two boxes are of one thing."""

MIN_FOUND_SHARE = 0.5
"""The share of its pictures in which what was followed must be found."""


@dataclass(slots=True)
class ComparedTrack:
    """Something that was followed: what it is, in how many pictures, and in how many of them it is in both searches.

    ``start`` is when it was seen first, in seconds of the run.
    """

    label: str
    start: float
    picture_count: int = 0
    found_count: int = 0

    @property
    def is_confirmed(self) -> bool:
        """Whether it is in more pictures than it takes until anything is believed."""
        return self.picture_count > MIN_DETECTIONS

    @property
    def is_missed(self) -> bool:
        """Whether the other search lacks it."""
        return self.is_confirmed and self.found_count < MIN_FOUND_SHARE * (self.picture_count - MIN_DETECTIONS + 1)


@dataclass(frozen=True, slots=True)
class PerceptionComparison:
    """What became of a record's pictures: how many there were, what was followed then, and what is followed now."""

    picture_count: int
    recorded: tuple[ComparedTrack, ...]
    current: tuple[ComparedTrack, ...]

    @property
    def lost_tracks(self) -> tuple[ComparedTrack, ...]:
        """What was followed then and is not found now."""
        return tuple(track for track in self.recorded if track.is_missed)

    @property
    def new_tracks(self) -> tuple[ComparedTrack, ...]:
        """What is followed now and was not found then."""
        return tuple(track for track in self.current if track.is_missed)


def rerun_perception(record: RunRecord, camera: CameraKeys, interests: Interests) -> PerceptionComparison:
    """Search the pictures of ``record`` for ``interests``, with the lens and the detector of ``camera``.

    Raises what the detector raises, such as FileNotFoundError for its model.
    """
    then, now = _TrackCollector(), _TrackCollector()
    before = {view.looked: view for _, view in record.views() if view.looked is not None}
    stamps = sorted(before)
    pictures = 0
    for view in _current_views(record, camera, interests):
        stamp = _matching_stamp(stamps, view.looked or 0.0)
        if stamp is not None:
            pictures += 1
            then.add(before[stamp], view)
            now.add(view, before[stamp])
    return PerceptionComparison(pictures, tuple(then), tuple(now))


class _TrackCollector:
    """The tracks of one search, as its views come."""

    def __init__(self) -> None:
        self._tracks: dict[tuple[str, int], ComparedTrack] = {}

    def __iter__(self) -> Iterator[ComparedTrack]:
        return iter(self._tracks.values())

    def add(self, view: View, other: View) -> None:
        """Take in what one picture shows, and what the ``other`` search found in it."""
        others = list(_visible_percepts(other))
        for percept in _visible_percepts(view):
            what = _percept_label(percept)
            track = self._tracks.setdefault((what, percept.id), ComparedTrack(what, percept.stamp))
            track.picture_count += 1
            track.found_count += any(
                _percept_label(each) == what and each.box.overlap(percept.box) >= MIN_OVERLAP for each in others
            )


@dataclass(frozen=True, slots=True)
class _Frame:
    """A picture of the record: a ``perception.api.Frame``."""

    image: Image
    stamp: float


def _current_views(record: RunRecord, camera: CameraKeys, interests: Interests) -> Iterator[View]:
    """Yield what today's eyes make of each picture."""
    clock, found, gaze = ManualClock(), list[View](), _GazeHistory(record)
    vision = make_vision(
        gaze.at,
        clock,
        interests=interests,
        detector=face_detector(camera),
        field_of_view=partial(camera.orientation.field_of_view, camera.field_of_view),
        lens=None if record.header.simulate else camera.upright(),
        report=ignore,
        seen=found.append,
    )
    for stamp, data in record.frames():
        image = decode_picture(data)
        if image is None:
            continue
        if not vision.see(_Frame(image, stamp)) and vision.last_error is not None:
            raise vision.last_error  # such as a model that is not there
        yield found.pop()


class _GazeHistory:
    """Which way the camera looked at any time of a record."""

    def __init__(self, record: RunRecord) -> None:
        names = ("base.heading", "head.pan", "head.tilt")
        self._series: Mapping[str, tuple[Sequence[float], Sequence[float]]] = {
            name: record.series(name) for name in names
        }

    def at(self, stamp: float) -> Gaze:
        heading, pan, tilt = (_interpolate(*series, stamp) for series in self._series.values())
        return Gaze(heading + pan, tilt)


def _interpolate(times: Sequence[float], values: Sequence[float], time: float) -> float:
    """Return the value at a time between two; 0 where there is none at all."""
    place = bisect_left(times, time)
    if not 0 < place < len(times):
        return values[min(place, len(values) - 1)] if values else 0.0
    begin, end = times[place - 1], times[place]
    share = (time - begin) / (end - begin) if end > begin else 1.0
    return values[place - 1] + share * (values[place] - values[place - 1])


def _matching_stamp(stamps: Sequence[float], stamp: float) -> float | None:
    """Return the one of rising ``stamps`` that is this one, as far as a file keeps it."""
    place = bisect_left(stamps, stamp - STAMP_TOLERANCE)
    return stamps[place] if place < len(stamps) and stamps[place] <= stamp + STAMP_TOLERANCE else None


def _visible_percepts(view: View) -> Iterable[Percept]:
    """Return what the picture of a view shows, without what is only remembered."""
    return (each for each in (*view.faces, *view.things, *view.markers) if each.stamp == view.looked)


def _percept_label(percept: Percept) -> str:
    match percept:
        case Thing():
            return percept.name
        case Marker():
            return f"marker {percept.number}"
        case _:
            return "face"
