"""Pictures for the report, and a summary of all tracked percepts."""

from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import cv2

from drivers.api import Image
from drivers.pictures.decode import decode_picture
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.replay.frames import STAMP_TOLERANCE, labelled_boxes
from missions.trees.value_text import percept_name, percepts_text
from perception.annotate import annotate
from perception.api import UNKNOWN, Box, Face, Percept, View

Views = Sequence[tuple[float, View]]
"""Views of perception, each with the time (s) at which it was reported."""

MAX_PICTURE_WIDTH = 320
"""Maximum width in pixels of a picture in a report."""

JPEG_QUALITY = 80
"""JPEG quality in percent of the pictures in a report."""


@dataclass(frozen=True, slots=True)
class ReportPicture:
    """A picture with labelled percepts: time (s), JPEG, size in pixels, and caption."""

    time: float
    jpeg: bytes
    width: int
    height: int
    caption: str


@dataclass(frozen=True, slots=True)
class SightingSummary:
    """Summary of all views of a tracked percept in a run.

    ``first`` and ``last`` are times (s), ``views`` is the number of views with it, ``nearest`` its smallest distance
    (m), or None if unknown. ``count`` is the number of its separate appearances. ``person`` is True for a person with a
    known name, ``face`` for a face without a name.
    """

    name: str
    first: float
    last: float
    views: int
    nearest: float | None
    count: int = 1
    person: bool = False
    face: bool = False


def select_pictures(record: RunRecord, views: Views, max_count: int) -> list[ReportPicture]:
    """Return at most ``max_count`` pictures: up to half of them just before failures, the others evenly spread."""
    stamps = [stamp for stamp, _ in record.frames()] if max_count else []
    wanted = choose_frames(stamps, max_count, {failure.t for failure in record.failures()})
    if not wanted:
        return []
    by_stamp = {view.looked: view for _, view in views if view.looked is not None}
    looked = sorted(by_stamp)
    found = []
    for number, (stamp, data) in enumerate(record.frames()):
        image = decode_picture(data) if number in wanted else None
        if image is not None:
            place = bisect_right(looked, stamp + STAMP_TOLERANCE) - 1
            found.append(_make_picture(stamp, image, by_stamp[looked[place]] if place >= 0 else None))
    return found


def choose_frames(stamps: Sequence[float], max_count: int, failures: Collection[float]) -> set[int]:
    """Return the indices of at most ``max_count`` frames, of which ``stamps`` are the times (s).

    Up to half of them are the last ones before ``failures`` (times in s), the others are evenly spread.
    """
    places = sorted({bisect_right(stamps, time) - 1 for time in failures} - {-1})
    found = {places[number] for number in spread_evenly(len(places), max_count // 2)}
    others = [number for number in range(len(stamps)) if number not in found]
    return found | {others[number] for number in spread_evenly(len(others), max_count - len(found))}


def spread_evenly(count: int, max_count: int) -> list[int]:
    """Return at most ``max_count`` of the first ``count`` numbers, evenly spread, including the first and last."""
    if count <= max_count:
        return list(range(count))
    return [round(number * (count - 1) / max(1, max_count - 1)) for number in range(max_count)]


def summarise_sightings(views: Views) -> list[SightingSummary]:
    """Return a summary of each tracked percept in the views, in order of first appearance."""
    found: dict[tuple[str, int], SightingSummary] = {}
    names: dict[tuple[str, int], str] = {}
    for time, view in views:
        for percept in _visible_percepts(view):
            key = type(percept).__name__, percept.id
            before = found.get(key, SightingSummary("", time, time, 0, None))
            near = [each for each in (before.nearest, percept.distance) if each is not None and isfinite(each)]
            if isinstance(percept, Face) and percept.name not in ("", UNKNOWN):
                names[key] = percept.name  # the name holds for the whole track, though recognition came later
            found[key] = replace(
                before,
                name=names.get(key) or percept_name(percept),
                last=time,
                views=before.views + 1,
                nearest=min(near, default=None),
                person=key in names,
                face=isinstance(percept, Face) and key not in names,
            )
    return _merge_by_name(found.values())


def _merge_by_name(sightings: Iterable[SightingSummary]) -> list[SightingSummary]:
    """Return one summary for each name; its ``count`` is the number of summaries merged into it."""
    named: dict[str, SightingSummary] = {}
    for each in sightings:
        before = named.get(each.name)
        near = [near for near in (each.nearest, before.nearest if before else None) if near is not None]
        named[each.name] = (
            each
            if before is None
            else replace(
                before,
                last=max(before.last, each.last),
                views=before.views + each.views,
                nearest=min(near, default=None),
                count=before.count + 1,
            )
        )
    return list(named.values())


def _visible_percepts(view: View | None) -> Iterator[Percept]:
    """Yield the percepts in a view, without those that are remembered but no longer visible."""
    if view is not None:
        yield from (each for each in (*view.faces, *view.things, *view.markers) if each.stamp == view.looked)


def _make_picture(time: float, image: Image, view: View | None) -> ReportPicture:
    scale = min(1.0, MAX_PICTURE_WIDTH / image.shape[1])
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    small: Image = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype("uint8", copy=False)
    marks = [] if view is None else [(_scale_box(box, scale), label) for box, label in labelled_boxes(view)]
    _, data = cv2.imencode(".jpg", annotate(small, marks), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return ReportPicture(time, data.tobytes(), *size, percepts_text(_visible_percepts(view)))


def _scale_box(box: Box, scale: float) -> Box:
    return Box(box.x * scale, box.y * scale, box.width * scale, box.height * scale)
