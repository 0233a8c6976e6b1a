"""What the robot saw: pictures, as many as fit a page, and everything that it followed from picture to picture."""

from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import cv2

from drivers.api import Image
from drivers.pictures.decode import decoded
from missions.plugins.records.recording.read import Record
from missions.plugins.records.replay.frames import SAME, marks_of
from missions.trees.words import about_all, name_of
from perception.annotate import annotate
from perception.api import UNKNOWN, Box, Face, Percept, View

Views = Sequence[tuple[float, View]]
"""What perception found, and when it said so."""

WIDTH = 320
"""Pixels that a picture is wide on the page, at most."""

QUALITY = 80
"""Of the JPEG, out of 100."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture with marks around what was found in it: when it was taken, as JPEG, its size, and what it shows."""

    time: float
    jpeg: bytes
    width: int
    height: int
    caption: str


@dataclass(frozen=True, slots=True)
class Sighting:
    """Something that was followed: from when to when (s), in how many views, and how near it came (m, or None).

    ``times`` is how often it came into view anew; ``person`` whether it is a person whose name is known, ``face``
    whether it is a face without a name.
    """

    name: str
    first: float
    last: float
    views: int
    nearest: float | None
    times: int = 1
    person: bool = False
    face: bool = False


def pictures(record: Record, views: Views, most: int) -> list[Picture]:
    """Return at most so many pictures: those before failures, as far as they fill half of them, the others evenly."""
    stamps = [stamp for stamp, _ in record.frames()] if most else []
    wanted = chosen(stamps, most, {failure.t for failure in record.failures()})
    if not wanted:
        return []
    by_stamp = {view.looked: view for _, view in views if view.looked is not None}
    looked = sorted(by_stamp)
    found = []
    for number, (stamp, data) in enumerate(record.frames()):
        image = decoded(data) if number in wanted else None
        if image is not None:
            place = bisect_right(looked, stamp + SAME) - 1
            found.append(_picture(stamp, image, by_stamp[looked[place]] if place >= 0 else None))
    return found


def chosen(stamps: Sequence[float], most: int, failures: Collection[float]) -> set[int]:
    """Return the numbers of at most so many pictures."""
    places = sorted({bisect_right(stamps, time) - 1 for time in failures} - {-1})
    found = {places[number] for number in evenly(len(places), most // 2)}
    others = [number for number in range(len(stamps)) if number not in found]
    return found | {others[number] for number in evenly(len(others), most - len(found))}


def evenly(count: int, most: int) -> list[int]:
    """Return at most so many of the first ``count`` numbers, spread evenly, the first and the last among them."""
    if count <= most:
        return list(range(count))
    return [round(number * (count - 1) / max(1, most - 1)) for number in range(most)]


def sightings(views: Views) -> list[Sighting]:
    """Return all that was followed, in the order in which it came into view."""
    found: dict[tuple[str, int], Sighting] = {}
    called: dict[tuple[str, int], str] = {}
    for time, view in views:
        for percept in _fresh(view):
            key = type(percept).__name__, percept.id
            before = found.get(key, Sighting("", time, time, 0, None))
            near = [each for each in (before.nearest, percept.distance) if each is not None and isfinite(each)]
            if isinstance(percept, Face) and percept.name not in ("", UNKNOWN):
                called[key] = percept.name  # and so it was all the time, though it may not have been decided
            found[key] = replace(
                before,
                name=called.get(key) or name_of(percept),
                last=time,
                views=before.views + 1,
                nearest=min(near, default=None),
                person=key in called,
                face=isinstance(percept, Face) and key not in called,
            )
    return _by_name(found.values())


def _by_name(found: Iterable[Sighting]) -> list[Sighting]:
    """Return what was seen with each name once, however often it came into view."""
    named: dict[str, Sighting] = {}
    for each in found:
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
                times=before.times + 1,
            )
        )
    return list(named.values())


def _fresh(view: View | None) -> Iterator[Percept]:
    """Yield what a picture shows; what is only remembered is not in it."""
    if view is not None:
        yield from (each for each in (*view.faces, *view.things, *view.markers) if each.stamp == view.looked)


def _picture(time: float, image: Image, view: View | None) -> Picture:
    scale = min(1.0, WIDTH / image.shape[1])
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    small: Image = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype("uint8", copy=False)
    marks = [] if view is None else [(_scaled(box, scale), label) for box, label in marks_of(view)]
    _, data = cv2.imencode(".jpg", annotate(small, marks), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return Picture(time, data.tobytes(), *size, about_all(_fresh(view)))


def _scaled(box: Box, scale: float) -> Box:
    return Box(box.x * scale, box.y * scale, box.width * scale, box.height * scale)
