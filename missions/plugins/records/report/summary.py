"""Summary of a run in words: result, cause, durations, failures, and missing data."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees

from missions.executive.events import FaultRaised, NodeChanged, Ticked
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.report.joints import JointFigures, joint_charts, joint_figures, joint_samples
from missions.plugins.records.report.joints import joint_sentences as about_joints
from missions.plugins.records.report.sightings import (
    ReportPicture,
    SightingSummary,
    Views,
    select_pictures,
    summarise_sightings,
)
from missions.plugins.records.report.slider import SliderTimes, slider_times
from missions.plugins.records.report.timeline import Lane, leaf_lanes
from missions.plugins.records.report.traces import (
    BaseRoute,
    Chart,
    TrackingError,
    base_route,
    make_charts,
    tracking_errors,
    tracking_rms,
)
from missions.trees.drawing import TreeDrawing
from missions.trees.drawing_builder import CONDITION_SYMBOL
from missions.trees.value_text import NodeName, count_text, node_names, seconds_text

# Analysis of a record, shared by summary, page and plots.

MAX_PICTURES = 60
"""Default number of camera pictures in a report."""


@dataclass(frozen=True, slots=True)
class RecordStudy:
    """Results of the analysis of a ``record`` for all reports: charts, timeline, pictures, percepts, joints."""

    record: RunRecord
    drawing: TreeDrawing
    slider: SliderTimes
    lanes: Sequence[Lane]
    tracking_errors: Sequence[TrackingError]
    charts: Sequence[Chart]
    route: BaseRoute
    views: Views
    pictures: Sequence[ReportPicture]
    sightings: Sequence[SightingSummary]
    joints: Sequence[JointFigures]
    joint_charts: Sequence[Chart]


def study_record(record: RunRecord, *, max_pictures: int = 0) -> RecordStudy:
    """Analyse a record. Raises InvalidRecordError if it is damaged or has no tree."""
    drawing, moments, views = record.drawing(), slider_times(record), list(record.views())
    changes = [event for event in record.events if isinstance(event, NodeChanged)]
    lanes = leaf_lanes(drawing, changes, record.statuses(moments.end), moments.end)
    misses, tracks = tracking_errors(record, views, lanes), joint_samples(record)
    return RecordStudy(
        record,
        drawing,
        moments,
        lanes,
        misses,
        make_charts(record, misses, moments.start),
        base_route(record),
        views,
        select_pictures(record, views, max_pictures),
        summarise_sightings(views),
        joint_figures(record, tracks),
        joint_charts(tracks),
    )


MIN_MOTION = 0.01
"""Minimum motion of the base, as a sum of metres and radians, that the summary mentions: odometry is noisy."""

MAX_START_DELAY = 2.0
"""Delay of the first tick in seconds above which the summary mentions it."""

RESULT_PHRASES = {
    "success": "It succeeded",
    "failure": "It failed",
    "interrupted": "It was stopped",
    "error": "It ended with an error",
}
"""Beginning of the summary's sentence about a run with each result."""

MAX_NAMES = 4
"""Maximum number of names of percepts in a sentence of the summary."""


def verdict(record: RunRecord) -> tuple[str, str]:
    """Return the result of a run as a word and as a sentence; the word is empty if the record lacks the result."""
    end = record.run_end()
    if end is None:
        piece = f"This record was cut at {seconds_text(record.cut_start)}" if record.cut_start else ""
        cut_off = f"The record ends at {seconds_text(record.end_time)}, before the mission did"
        full = ", since the size limit was reached (--record-limit)" if record.limit_reached else ""
        return "", f"{piece or cut_off}{full}; the result of the mission is not recorded."
    why = f": {end.reason}" if end.reason else ""
    did = RESULT_PHRASES.get(end.result, f"It ended ({end.result})")
    return end.result, f"{did} after {seconds_text(end.seconds)} and {count_text(end.ticks, 'tick')}{why}."


def summary_sentences(study: RecordStudy) -> Iterator[str]:
    """Yield the sentences of the summary, the most important first."""
    record = study.record
    yield verdict(record)[1]
    if record.cut_start is None and study.slider.start > MAX_START_DELAY:
        yield f"The robot took {seconds_text(study.slider.start)} to get ready."
    yield from _failure_sentences(record, study.drawing)
    yield from _busiest_leaf_sentence(study.lanes, study.drawing)
    yield _fault_sentence(record)
    yield from _lateness_sentence(record)
    yield from _motion_sentences(study)
    yield from about_joints(study.joints)
    yield from _battery_sentence(record)
    yield from _sight_sentence(study)
    yield from _loss_sentences(record)


def reported_faults(record: RunRecord) -> list[FaultRaised]:
    """Return the fault events of the robot's parts, without their first connection."""
    events = [event for event in record.events if isinstance(event, FaultRaised)]
    offline_parts: set[str] = set()
    kept = []
    for event in events:
        if event.status != "online" or event.part in offline_parts:
            kept.append(event)
        if event.status == "offline":
            offline_parts.add(event.part)
    return kept


def _failure_sentences(record: RunRecord, drawing: TreeDrawing) -> Iterator[str]:
    """Yield a sentence about the node that caused the mission's failure, and one about the other failed actions.

    Failed conditions are not counted.
    """
    names, found, cause = node_names(drawing), record.failures(), _failure_cause(record)
    if cause is not None:
        node = names.get(cause.node, NodeName(cause.name, f"line {cause.line}"))
        yield f"Cause of the failure: {node.title} ({node.place}), at {seconds_text(cause.t)}."
    actions = {box.key for box in drawing.root.walk() if not box.children and box.symbol != CONDITION_SYMBOL}
    others = [change for change in found if change.node in actions and change is not cause]
    subject = "other action" if cause is not None else "action"
    if not others:
        yield f"No {subject} failed."
        return
    first = others[0]
    node, why = names[first.node], f": {first.reason}" if first.reason else ""
    details = f"first {node.title} ({node.place}), at {seconds_text(first.t)}{why}"
    yield f"{subject.capitalize()}s failed {_count_text(len(others))}, {details}."


def _failure_cause(record: RunRecord) -> NodeChanged | None:
    """Return the failure that caused the mission to fail; None if it did not fail, or the cause is unknown.

    It is the deepest node that failed with the same reason as the mission.
    """
    end, cause = record.run_end(), None
    if end is None or end.result != "failure":
        return None
    for change in reversed(record.failures()):
        if change.reason != end.reason:
            break
        cause = change
    return cause


def _count_text(number: int) -> str:
    return {1: "once", 2: "twice"}.get(number, f"{number} times")


def _busiest_leaf_sentence(lanes: Sequence[Lane], drawing: TreeDrawing) -> Iterator[str]:
    lane = max(lanes, key=lambda each: each.busy_seconds, default=None)
    if lane is not None and lane.busy_seconds > 0:
        node = node_names(drawing)[lane.box.key]
        times = f" in {len(lane.bars)} runs" if len(lane.bars) > 1 else ""
        yield f"Longest action: {node.title}, {seconds_text(lane.busy_seconds)}{times} ({node.place})."


def _fault_sentence(record: RunRecord) -> str:
    found = [fault for fault in reported_faults(record) if fault.status != "online"]
    if not found:
        return "No part of the robot reported a fault."
    first = found[0]
    detail = f": {first.detail_without_part}" if first.detail else ""
    count = count_text(len(found), "fault report")
    return f"{count}, first at {seconds_text(first.t)}: {first.part} {first.status}{detail}."


def _lateness_sentence(record: RunRecord) -> Iterator[str]:
    ticks = [event for event in record.events if isinstance(event, Ticked)]
    late = [(event.late, event.t) for event in ticks if event.late]
    if late:
        worst, time = max(late)
        yield (
            f"{len(late)} of {count_text(len(ticks), 'tick')} were more than a tick late, "
            f"at most {1000 * worst:.0f} ms at {seconds_text(time)}."
        )
    elif ticks:
        yield f"No tick was late ({count_text(len(ticks), 'tick')})."


def _motion_sentences(study: RecordStudy) -> Iterator[str]:
    if study.route.length + study.route.rotation > MIN_MOTION:
        yield f"The base drove {study.route.length:.1f} m and turned {degrees(study.route.rotation):.0f}° in total."
    if study.tracking_errors:
        worst = max(study.tracking_errors, key=lambda miss: miss.largest)
        yield (
            f"Tracking error: {tracking_rms(study.tracking_errors):.1f}° root mean square, "
            f"{worst.largest:.1f}° at most, at {seconds_text(worst.time)}."
        )


def _battery_sentence(record: RunRecord) -> Iterator[str]:
    _, levels = record.series("battery.percent")
    if levels:
        first, last = (f"{level:.0f} %" for level in (levels[0], levels[-1]))
        yield f"The battery stayed at {first}." if first == last else f"The battery went from {first} to {last}."


def _sight_sentence(study: RecordStudy) -> Iterator[str]:
    if study.sightings:
        people = [each for each in study.sightings if each.person]
        faces = [each for each in study.sightings if each.face]
        others = [each for each in study.sightings if not (each.person or each.face)]
        known = f"{_people_text(len(people))}, {_names_text(people)}" if people else ""
        strange = f"{len(faces)} faces without a name" if len(faces) > 1 else _names_text(faces)
        said = "; ".join(filter(None, (known, strange, _names_text(others))))
        first = study.sightings[0]
        whom = f" {first.name}" if len(study.sightings) > 1 else ""
        yield f"It saw {said}: first{whom} at {seconds_text(first.first)}."
    elif study.views:
        yield "It saw no face, object or marker."
    else:
        eyes = study.record.header.eyes
        yield "Its percepts are not recorded." if eyes else "It used no camera."


def _people_text(number: int) -> str:
    return f"{number} known {'person' if number == 1 else 'people'}"


def _names_text(sightings: Sequence[SightingSummary]) -> str:
    """Return the names of percepts with numbers of appearances; if they are too many, only the most frequent."""
    chosen = sightings if len(sightings) <= MAX_NAMES else sorted(sightings, key=lambda each: -each.count)[:MAX_NAMES]
    names = [each.name + (f" ({_count_text(each.count)})" if each.count > 1 else "") for each in chosen]
    return ", ".join(names) + (f", {len(sightings) - len(chosen)} more" if len(sightings) > len(chosen) else "")


def _loss_sentences(record: RunRecord) -> Iterator[str]:
    lost = record.lost_counts()
    if lost:
        counts = ", ".join(f"{count} on {topic}" for topic, count in sorted(lost.items()))
        yield f"The record is incomplete: {count_text(sum(lost.values()), 'message')} lost ({counts})."
    if not record.is_complete:
        yield "The record was not closed: everything after its last message is lost."
