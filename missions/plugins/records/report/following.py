"""How well a robot kept what it followed in the middle of its picture: the tracking error.

A record does not say which percept a leaf has followed. It is found as such leaves choose it: the one that the file
names, else the first, largest one; and that as long as it is in view.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees, fsum, pi, sqrt

from missions.executive.events import VariableSet
from missions.plugins.records.recording.read import Record
from missions.plugins.records.report.percepts import Views
from missions.plugins.records.report.timeline import Lane
from missions.trees.drawing import Box
from missions.trees.words import name_of
from perception.api import Marker, Percept, Thing, View

FOLLOWERS = {"track_face": "faces", "follow_person": "faces", "track_object": "things", "track_robot": "markers"}
"""The leaves that follow something, and which percepts of a view."""

_VARIABLE = re.compile(r"\$\{\s*(\w+)\s*\}")


@dataclass(frozen=True, slots=True)
class Miss:
    """How far from the camera's axis something was that was followed, at ``time`` (s); degrees, left and down are +."""

    time: float
    aside: float
    below: float

    @property
    def most(self) -> float:
        """The larger of both."""
        return max(abs(self.aside), abs(self.below))


def tracking(record: Record, views: Views, lanes: Sequence[Lane]) -> list[Miss]:
    """Return the tracking error in each new view that shows what was followed then."""
    following = sorted(
        ((bar.start, bar.end, lane.box) for lane in lanes if lane.box.kind in FOLLOWERS for bar in lane.bars),
        key=lambda each: each[:2],
    )
    if not following:
        return []
    given = [event for event in record.events if isinstance(event, VariableSet)]
    found: list[Miss] = []
    for start, end, box in following:
        target = _begins_with(box, given, start)
        for time, view in views:
            if not start <= time <= end:
                continue
            percept = _chosen(box, view, target)
            if percept is not None and max(abs(percept.bearing), abs(percept.elevation)) <= pi:
                target = percept.id
                found.append(Miss(time, degrees(percept.bearing), degrees(percept.elevation)))
    return sorted(found, key=lambda miss: miss.time)


def rms(misses: Sequence[Miss]) -> float:
    """Return the root of the mean square of how far it was off, in degrees; 0 without any."""
    return sqrt(fsum(miss.most**2 for miss in misses) / len(misses)) if misses else 0.0


def _begins_with(box: Box, given: Sequence[VariableSet], start: float) -> int | None:
    """Return the id of what the file says it is to begin with: ``face: ${person}``."""
    for text in box.arguments.values():
        named = _VARIABLE.fullmatch(text)
        known = [
            event
            for event in given
            if named is not None
            and event.t <= start
            and event.name == named[1]
            and (not event.scope or box.key.startswith(f"{event.scope}."))
        ]
        # A mission inside the mission has variables of its own: the innermost count.
        newest = max(known, key=lambda event: (len(event.scope), event.t), default=None)
        if newest is not None and isinstance(newest.value, Percept):
            return newest.value.id
    return None


def _chosen(box: Box, view: View, target: int | None) -> Percept | None:
    """Return what is followed of that which a picture has just shown."""
    fresh = [percept for percept in _candidates(box, view) if percept.stamp == view.looked]
    same = next((percept for percept in fresh if percept.id == target), None)
    return same or (fresh[0] if fresh and target is None else None)


def _candidates(box: Box, view: View) -> Iterator[Percept]:
    wanted = next((box.arguments[name] for name in ("what", "which") if name in box.arguments), "")
    percepts: Sequence[Percept] = getattr(view, FOLLOWERS[box.kind])
    for percept in percepts:
        named = isinstance(percept, Thing | Marker) and wanted and "${" not in wanted
        if not named or wanted in (name_of(percept), str(getattr(percept, "number", ""))):
            yield percept
