"""Search recorded pictures again with the installed version of perception, and compare with the recorded results.

Single pictures cannot be compared: they are JPEGs, and the record lacks some that the run searched. So tracks are
compared. A track counts as found if, in most of its pictures, the other search has it at the same position.
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
"""Minimum intersection over union at which the boxes of two searches show the same object."""

MIN_FOUND_SHARE = 0.5
"""Minimum share of the pictures of a track, found by one search, in which the other search must find it too.

With less, the track counts as missed by the other search.
"""


@dataclass(slots=True)
class ComparedTrack:
    """A tracked percept of one search of the pictures, either the recorded search or the new one.

    It is compared with the other search: ``picture_count`` is the number of pictures with it, ``found_count`` the
    number of those in which the other search finds it too. ``start`` is the time (s) of the first picture with it.
    """

    label: str
    start: float
    picture_count: int = 0
    found_count: int = 0

    @property
    def is_confirmed(self) -> bool:
        """Whether the track is in more pictures than the tracker needs for a confirmation."""
        return self.picture_count > MIN_DETECTIONS

    @property
    def is_missed(self) -> bool:
        """Whether the track is confirmed, and the other search finds it in too few of its pictures."""
        return self.is_confirmed and self.found_count < MIN_FOUND_SHARE * (self.picture_count - MIN_DETECTIONS + 1)


@dataclass(frozen=True, slots=True)
class PerceptionComparison:
    """Result of a perception rerun: number of compared pictures, and the tracks of both searches.

    ``recorded`` are the tracks of the recorded search, ``current`` those of the new search with the installed version.
    """

    picture_count: int
    recorded: tuple[ComparedTrack, ...]
    current: tuple[ComparedTrack, ...]

    @property
    def lost_tracks(self) -> tuple[ComparedTrack, ...]:
        """Confirmed tracks of the recorded run that the new search finds in too few pictures."""
        return tuple(track for track in self.recorded if track.is_missed)

    @property
    def new_tracks(self) -> tuple[ComparedTrack, ...]:
        """Confirmed tracks of the new search that the recorded run has in too few pictures."""
        return tuple(track for track in self.current if track.is_missed)


def rerun_perception(record: RunRecord, camera: CameraKeys, interests: Interests) -> PerceptionComparison:
    """Search the pictures of ``record`` for ``interests``, with the lens and detector of ``camera``.

    Raises the exceptions of the detector, such as FileNotFoundError for its model.
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
    """Collects the tracks of one search of the pictures: either the recorded search, or the new one."""

    def __init__(self) -> None:
        self._tracks: dict[tuple[str, int], ComparedTrack] = {}

    def __iter__(self) -> Iterator[ComparedTrack]:
        return iter(self._tracks.values())

    def add(self, view: View, other: View) -> None:
        """Add the percepts of one view, compared with the view of the same picture by the ``other`` search."""
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
    """A recorded picture as a ``perception.api.Frame``."""

    image: Image
    stamp: float


def _current_views(record: RunRecord, camera: CameraKeys, interests: Interests) -> Iterator[View]:
    """Yield the percepts that the installed version of perception finds in each recorded picture."""
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
            raise vision.last_error  # such as a missing model file
        yield found.pop()


class _GazeHistory:
    """Direction of the camera over time, from the recorded heading of the base and the recorded angles of the head."""

    def __init__(self, record: RunRecord) -> None:
        names = ("base.heading", "head.pan", "head.tilt")
        self._series: Mapping[str, tuple[Sequence[float], Sequence[float]]] = {
            name: record.series(name) for name in names
        }

    def at(self, stamp: float) -> Gaze:
        heading, pan, tilt = (_interpolate(*series, stamp) for series in self._series.values())
        return Gaze(heading + pan, tilt)


def _interpolate(times: Sequence[float], values: Sequence[float], time: float) -> float:
    """Return the value of a time series at ``time``, linearly interpolated; 0 without values."""
    place = bisect_left(times, time)
    if not 0 < place < len(times):
        return values[min(place, len(values) - 1)] if values else 0.0
    begin, end = times[place - 1], times[place]
    share = (time - begin) / (end - begin) if end > begin else 1.0
    return values[place - 1] + share * (values[place] - values[place - 1])


def _matching_stamp(stamps: Sequence[float], stamp: float) -> float | None:
    """Return the element of rising ``stamps`` within ``STAMP_TOLERANCE`` of ``stamp``."""
    place = bisect_left(stamps, stamp - STAMP_TOLERANCE)
    return stamps[place] if place < len(stamps) and stamps[place] <= stamp + STAMP_TOLERANCE else None


def _visible_percepts(view: View) -> Iterable[Percept]:
    """Return the percepts in a view, without those that are remembered but no longer visible."""
    return (each for each in (*view.faces, *view.things, *view.markers) if each.stamp == view.looked)


def _percept_label(percept: Percept) -> str:
    match percept:
        case Thing():
            return percept.name
        case Marker():
            return f"marker {percept.number}"
        case _:
            return "face"
