"""A run in words: how it went and why, what took long, what failed, and what is not in the record."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees

from missions.executive.events import FaultRaised, NodeChanged, Ticked
from missions.plugins.records.recording.read import Record
from missions.plugins.records.report.joints import JointFigures, figures_of, joint_charts, tracks_of
from missions.plugins.records.report.joints import sentences as about_joints
from missions.plugins.records.report.percepts import Picture, Sighting, Views, pictures, sightings
from missions.plugins.records.report.slider import Moments, moments_of
from missions.plugins.records.report.timeline import Lane, lanes_of
from missions.plugins.records.report.traces import Chart, Miss, Route, charts_of, rms, route_of, tracking
from missions.trees.draw import CONDITION
from missions.trees.drawing import Drawing
from missions.trees.words import Named, counted, in_seconds, names_in

# All that a report tells of a record, found once: for its words, its page and its pictures for papers.

MOST_PICTURES = 60
"""Pictures of the camera in a report, where nobody says how many."""


@dataclass(frozen=True, slots=True)
class Study:
    """What was found in a ``record``; see the modules that these values come from."""

    record: Record
    drawing: Drawing
    moments: Moments
    lanes: Sequence[Lane]
    misses: Sequence[Miss]
    charts: Sequence[Chart]
    route: Route
    views: Views
    pictures: Sequence[Picture]
    sightings: Sequence[Sighting]
    joints: Sequence[JointFigures]
    joint_charts: Sequence[Chart]


def study(record: Record, *, most_pictures: int = 0) -> Study:
    """Read a record through. Raises InvalidRecordError for one that is damaged or has no drawing of its tree."""
    drawing, moments, views = record.drawing(), moments_of(record), list(record.views())
    changes = [event for event in record.events if isinstance(event, NodeChanged)]
    lanes = lanes_of(drawing, changes, record.statuses(moments.end), moments.end)
    misses, tracks = tracking(record, views, lanes), tracks_of(record)
    return Study(
        record,
        drawing,
        moments,
        lanes,
        misses,
        charts_of(record, misses, moments.begin),
        route_of(record),
        views,
        pictures(record, views, most_pictures),
        sightings(views),
        figures_of(record, tracks),
        joint_charts(tracks),
    )


STILL = 0.01
"""Metres and radians together that are no movement: reports tremble."""

SOON = 2.0
"""Seconds that a robot may take to get ready before that is worth a sentence."""

ENDS = {
    "success": "It succeeded",
    "failure": "It failed",
    "interrupted": "It was stopped",
    "error": "It was ended by an error",
}
"""How results are put into sentences."""

MOST_NAMES = 4
"""As many things that were seen are named."""


def verdict(record: Record) -> tuple[str, str]:
    """Return the result in a word, empty where it is not recorded, and all of it in a sentence."""
    end = record.end()
    if end is None:
        piece = f"This is a piece of a record, from {in_seconds(record.cut_from)} on" if record.cut_from else ""
        cut_off = f"The record ends at {in_seconds(record.until)}, before the mission did"
        full = ", since it had reached its limit (--record-limit)" if record.full else ""
        return "", f"{piece or cut_off}{full}: how the mission ended is not in it."
    why = f": {end.reason}" if end.reason else ""
    did = ENDS.get(end.result, f"It ended ({end.result})")
    return end.result, f"{did} after {in_seconds(end.seconds)} and {counted(end.ticks, 'tick')}{why}."


def sentences(found: Study) -> Iterator[str]:
    """Yield what there is to say of a record, the most important first."""
    record = found.record
    yield verdict(record)[1]
    if record.cut_from is None and found.moments.begin > SOON:
        yield f"Its first tick was at {in_seconds(found.moments.begin)}: so long the robot took to get ready."
    yield from _failures(record, found.drawing)
    yield from _busiest(found.lanes, found.drawing)
    yield _faults(record)
    yield from _lateness(record)
    yield from _moved(found)
    yield from about_joints(found.joints)
    yield from _battery(record)
    yield from _seen(found)
    yield from _missing(record)


def faults(record: Record) -> list[FaultRaised]:
    """Return what parts of the robot had to say of themselves, without their coming up when all began."""
    told = [event for event in record.events if isinstance(event, FaultRaised)]
    gone: set[str] = set()
    kept = []
    for event in told:
        if event.what != "online" or event.part in gone:
            kept.append(event)
        if event.what == "offline":
            gone.add(event.part)
    return kept


def _failures(record: Record, drawing: Drawing) -> Iterator[str]:
    """Say which node the run failed by, and which actions failed besides: conditions that say no are none of them."""
    names, found, cause = names_in(drawing), record.failures(), _cause(record)
    if cause is not None:
        node = names.get(cause.node, Named(cause.name, f"line {cause.line}"))
        yield f"What it failed by was {node.title} ({node.place}), at {in_seconds(cause.t)}."
    actions = {box.key for box in drawing.root.walk() if not box.children and box.symbol != CONDITION}
    others = [change for change in found if change.node in actions and change is not cause]
    besides = " besides" if cause is not None else ""
    if not others:
        yield f"No action failed{besides}."
        return
    first = others[0]
    node, why = names[first.node], f": {first.reason}" if first.reason else ""
    began = f"first {node.title} ({node.place}), at {in_seconds(first.t)}{why}"
    yield f"Actions failed{besides} {_times(len(others))}, {began}."


def _cause(record: Record) -> NodeChanged | None:
    """Return the change that the mission failed by: the deepest of those that handed its reason up in the end."""
    end, cause = record.end(), None
    if end is None or end.result != "failure":
        return None
    for change in reversed(record.failures()):
        if change.reason != end.reason:
            break
        cause = change
    return cause


def _times(number: int) -> str:
    return {1: "once", 2: "twice"}.get(number, f"{number} times")


def _busiest(lanes: Sequence[Lane], drawing: Drawing) -> Iterator[str]:
    lane = max(lanes, key=lambda each: each.busy, default=None)
    if lane is not None and lane.busy > 0:
        node = names_in(drawing)[lane.box.key]
        times = f" in {len(lane.bars)} goes" if len(lane.bars) > 1 else ""
        yield f"Most of the time went into {node.title}: {in_seconds(lane.busy)}{times} ({node.place})."


def _faults(record: Record) -> str:
    found = [fault for fault in faults(record) if fault.what != "online"]
    if not found:
        return "No part of the robot reported a fault."
    first = found[0]
    detail = f": {first.plain}" if first.detail else ""
    return f"{counted(len(found), 'fault report')}, first at {in_seconds(first.t)}: {first.part} {first.what}{detail}."


def _lateness(record: Record) -> Iterator[str]:
    ticks = [event for event in record.events if isinstance(event, Ticked)]
    late = [(event.late, event.t) for event in ticks if event.late]
    if late:
        worst, time = max(late)
        yield (
            f"{len(late)} of {counted(len(ticks), 'tick')} came more than a tick late, "
            f"worst by {1000 * worst:.0f} ms at {in_seconds(time)}."
        )
    elif ticks:
        yield f"No tick was late: all {len(ticks)} came in time."


def _moved(found: Study) -> Iterator[str]:
    if found.route.length + found.route.turned > STILL:
        yield f"The base drove {found.route.length:.1f} m and turned {degrees(found.route.turned):.0f}° in all."
    if found.misses:
        worst = max(found.misses, key=lambda miss: miss.most)
        yield (
            f"What it followed was {rms(found.misses):.1f}° from the middle of the picture (root mean square), "
            f"and {worst.most:.1f}° at most, at {in_seconds(worst.time)}."
        )


def _battery(record: Record) -> Iterator[str]:
    _, levels = record.series("battery.percent")
    if levels:
        first, last = (f"{level:.0f} %" for level in (levels[0], levels[-1]))
        yield f"The battery stayed at {first}." if first == last else f"The battery went from {first} to {last}."


def _seen(found: Study) -> Iterator[str]:
    if found.sightings:
        people = [each for each in found.sightings if each.person]
        faces = [each for each in found.sightings if each.face]
        others = [each for each in found.sightings if not (each.person or each.face)]
        known = f"{_people(len(people))}, {_named(people)}" if people else ""
        strange = f"{len(faces)} faces without a name" if len(faces) > 1 else _named(faces)
        said = "; ".join(filter(None, (known, strange, _named(others))))
        first = found.sightings[0]
        whom = f" {first.name}" if len(found.sightings) > 1 else ""
        yield f"It saw {said}: first{whom} at {in_seconds(first.first)}."
    elif found.views:
        yield "It saw nobody and nothing that it knows."
    else:
        eyes = found.record.head.eyes
        yield "What it saw is not in this record." if eyes else "There is no camera in this record."


def _people(number: int) -> str:
    return f"{number} {'person' if number == 1 else 'people'} whom it knows"


def _named(seen: Sequence[Sighting]) -> str:
    """Return names with how often each came into view, the most frequent first where they are too many."""
    chosen = seen if len(seen) <= MOST_NAMES else sorted(seen, key=lambda each: -each.times)[:MOST_NAMES]
    names = [each.name + (f" ({_times(each.times)})" if each.times > 1 else "") for each in chosen]
    return ", ".join(names) + (f", {len(seen) - len(chosen)} more" if len(seen) > len(chosen) else "")


def _missing(record: Record) -> Iterator[str]:
    lost = record.lost()
    if lost:
        told = ", ".join(f"{count} on {topic}" for topic, count in sorted(lost.items()))
        yield f"Not all of it was recorded: {counted(sum(lost.values()), 'message')} lost ({told})."
    if not record.whole:
        yield "The record was not closed properly: what came after its last message is lost."
