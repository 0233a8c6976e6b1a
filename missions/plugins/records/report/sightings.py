"""What the robot saw: pictures, as many as fit a page, and everything that it followed from picture to picture."""

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
"""What perception found, and when it said so."""

MAX_PICTURE_WIDTH = 320
"""Pixels that a picture is wide on the page, at most."""

JPEG_QUALITY = 80
"""Of the JPEG, out of 100."""


@dataclass(frozen=True, slots=True)
class ReportPicture:
    """A picture with marks around what was found in it: when it was taken, as JPEG, its size, and what it shows."""

    time: float
    jpeg: bytes
    width: int
    height: int
    caption: str


@dataclass(frozen=True, slots=True)
class SightingSummary:
    """Something that was followed: from when to when (s), in how many views, and how near it came (m, or None).

    ``count`` is how often it came into view anew; ``person`` whether it is a person whose name is known, ``face``
    whether it is a face without a name.
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
    """Return at most so many pictures: those before failures, as far as they fill half of them, the others evenly."""
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
    """Return the numbers of at most so many pictures."""
    places = sorted({bisect_right(stamps, time) - 1 for time in failures} - {-1})
    found = {places[number] for number in spread_evenly(len(places), max_count // 2)}
    others = [number for number in range(len(stamps)) if number not in found]
    return found | {others[number] for number in spread_evenly(len(others), max_count - len(found))}


def spread_evenly(count: int, max_count: int) -> list[int]:
    """Return at most so many of the first ``count`` numbers, spread evenly, the first and the last among them."""
    if count <= max_count:
        return list(range(count))
    return [round(number * (count - 1) / max(1, max_count - 1)) for number in range(max_count)]


def summarise_sightings(views: Views) -> list[SightingSummary]:
    """Return all that was followed, in the order in which it came into view."""
    found: dict[tuple[str, int], SightingSummary] = {}
    called: dict[tuple[str, int], str] = {}
    for time, view in views:
        for percept in _visible_percepts(view):
            key = type(percept).__name__, percept.id
            before = found.get(key, SightingSummary("", time, time, 0, None))
            near = [each for each in (before.nearest, percept.distance) if each is not None and isfinite(each)]
            if isinstance(percept, Face) and percept.name not in ("", UNKNOWN):
                called[key] = percept.name  # and so it was all the time, though it may not have been decided
            found[key] = replace(
                before,
                name=called.get(key) or percept_name(percept),
                last=time,
                views=before.views + 1,
                nearest=min(near, default=None),
                person=key in called,
                face=isinstance(percept, Face) and key not in called,
            )
    return _merge_by_name(found.values())


def _merge_by_name(sightings: Iterable[SightingSummary]) -> list[SightingSummary]:
    """Return what was seen with each name once, however often it came into view."""
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
    """Yield what a picture shows; what is only remembered is not in it."""
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
