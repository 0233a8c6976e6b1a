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
from drivers.api.senses import CameraKeys
from drivers.clock import ManualClock
from drivers.pictures.decode import decoded
from missions.assembly.eyes import vision as make_vision
from missions.assembly.models import face_detector
from missions.library.interests import Interests
from missions.plugins.records.recording.read import Record
from missions.plugins.records.replay.frames import SAME
from perception.api import Gaze, Image, Marker, Percept, Thing, View
from perception.tracks import CONFIRMED

OVERLAP = 0.5
"""Intersection over union from which on two boxes are of one thing."""

ENOUGH = 0.5
"""The share of its pictures in which what was followed must be found."""


@dataclass(slots=True)
class Track:
    """Something that was followed: what it is, in how many pictures, and in how many of them it is in both searches.

    ``begun`` is when it was seen first, in seconds of the run.
    """

    what: str
    begun: float
    pictures: int = 0
    found: int = 0

    @property
    def long(self) -> bool:
        """Whether it is in more pictures than it takes until anything is believed."""
        return self.pictures > CONFIRMED

    @property
    def missed(self) -> bool:
        """Whether the other search lacks it."""
        return self.long and self.found < ENOUGH * (self.pictures - CONFIRMED + 1)


@dataclass(frozen=True, slots=True)
class Seen:
    """What became of a record's pictures: how many there were, what was followed then, and what is followed now."""

    pictures: int
    then: tuple[Track, ...]
    now: tuple[Track, ...]

    @property
    def lost(self) -> tuple[Track, ...]:
        """What was followed then and is not found now."""
        return tuple(track for track in self.then if track.missed)

    @property
    def new(self) -> tuple[Track, ...]:
        """What is followed now and was not found then."""
        return tuple(track for track in self.now if track.missed)


def see(record: Record, camera: CameraKeys, interests: Interests) -> Seen:
    """Search the pictures of ``record`` for ``interests``, with the lens and the detector of ``camera``.

    Raises what the detector raises, such as FileNotFoundError for its model.
    """
    then, now = _Tracks(), _Tracks()
    before = {view.looked: view for _, view in record.views() if view.looked is not None}
    stamps = sorted(before)
    pictures = 0
    for view in _views(record, camera, interests):
        stamp = _near(stamps, view.looked or 0.0)
        if stamp is not None:
            pictures += 1
            then.add(before[stamp], view)
            now.add(view, before[stamp])
    return Seen(pictures, tuple(then), tuple(now))


class _Tracks:
    """The tracks of one search, as its views come."""

    def __init__(self) -> None:
        self._tracks: dict[tuple[str, int], Track] = {}

    def __iter__(self) -> Iterator[Track]:
        return iter(self._tracks.values())

    def add(self, view: View, other: View) -> None:
        """Take in what one picture shows, and what the ``other`` search found in it."""
        others = list(_shown(other))
        for percept in _shown(view):
            what = _what(percept)
            track = self._tracks.setdefault((what, percept.id), Track(what, percept.stamp))
            track.pictures += 1
            track.found += any(_what(each) == what and each.box.overlap(percept.box) >= OVERLAP for each in others)


@dataclass(frozen=True, slots=True)
class _Frame:
    """A picture of the record: a ``perception.api.Frame``."""

    image: Image
    stamp: float


def _views(record: Record, camera: CameraKeys, interests: Interests) -> Iterator[View]:
    """Yield what today's eyes make of each picture."""
    clock, found, gaze = ManualClock(), list[View](), _Gazes(record)
    vision = make_vision(
        gaze.at,
        clock,
        interests=interests,
        detector=face_detector(camera),
        field_of_view=partial(camera.turn.view, camera.field_of_view),
        lens=None if record.head.simulate else camera.upright(),
        report=ignore,
        seen=found.append,
    )
    for stamp, data in record.frames():
        image = decoded(data)
        if image is None:
            continue
        if not vision.see(_Frame(image, stamp)) and vision.trouble is not None:
            raise vision.trouble  # such as a model that is not there
        yield found.pop()


class _Gazes:
    """Which way the camera looked at any time of a record."""

    def __init__(self, record: Record) -> None:
        names = ("base.heading", "head.pan", "head.tilt")
        self._series: Mapping[str, tuple[Sequence[float], Sequence[float]]] = {
            name: record.series(name) for name in names
        }

    def at(self, stamp: float) -> Gaze:
        heading, pan, tilt = (_interpolated(*series, stamp) for series in self._series.values())
        return Gaze(heading + pan, tilt)


def _interpolated(times: Sequence[float], values: Sequence[float], time: float) -> float:
    """Return the value at a time between two; 0 where there is none at all."""
    place = bisect_left(times, time)
    if not 0 < place < len(times):
        return values[min(place, len(values) - 1)] if values else 0.0
    begin, end = times[place - 1], times[place]
    share = (time - begin) / (end - begin) if end > begin else 1.0
    return values[place - 1] + share * (values[place] - values[place - 1])


def _near(stamps: Sequence[float], stamp: float) -> float | None:
    """Return the one of rising ``stamps`` that is this one, as far as a file keeps it."""
    place = bisect_left(stamps, stamp - SAME)
    return stamps[place] if place < len(stamps) and stamps[place] <= stamp + SAME else None


def _shown(view: View) -> Iterable[Percept]:
    """Return what the picture of a view shows, without what is only remembered."""
    return (each for each in (*view.faces, *view.things, *view.markers) if each.stamp == view.looked)


def _what(percept: Percept) -> str:
    match percept:
        case Thing():
            return percept.name
        case Marker():
            return f"marker {percept.number}"
        case _:
            return "face"
