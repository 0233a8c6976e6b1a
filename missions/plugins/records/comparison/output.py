"""Terminal text and JSON of a comparison of two runs."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from math import degrees

from missions.cli.printable import format_columns
from missions.executive.events import Ended, NodeChanged
from missions.plugins.records.comparison.runs import (
    BasePath,
    FirstDifference,
    LeafComparison,
    RunComparison,
    RunPair,
    T,
    end_distance,
)
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.report.joints import combined_rms, total_energy
from missions.plugins.records.report.summary import verdict
from missions.trees.drawing_builder import one_line
from missions.trees.value_text import seconds_text

LEAF_COLUMNS = ("leaf", "line", "A runs", "B runs", "A s", "B s", "B - A s")
JOINT_COLUMNS = ("joint", "A rms deg", "B rms deg", "A max deg", "B max deg", "A motor J", "B motor J")
JOINT_FIGURES = (("rms", ".2f"), ("worst", "+.1f"), ("energy", ".1f"))
"""Fields of ``JointFigures`` in the table of joints, with their number formats."""

PATH_COLUMNS = ("path", "A", "B")

LEFT_ALIGNED_COLUMNS = frozenset({"leaf", "joint", "path", "run with"})

MAX_VALUE_LENGTH = 60
"""Maximum number of characters of a name, reason or setting in the printed comparison of two runs."""


def lines_of(comparison: RunComparison) -> Iterator[str]:
    """Yield the comparison as lines for a terminal."""
    for name, study in (("A", comparison.a), ("B", comparison.b)):
        yield f"{name}  {study.record.path}: {_one_line(verdict(study.record)[1])}"
    if comparison.settings:
        yield ""
        rows = [(_one_line(name), *(_value_text(each) for each in pair)) for name, pair in comparison.settings.items()]
        yield from format_columns(("run with", "A", "B"), rows, left=LEFT_ALIGNED_COLUMNS).splitlines()
    yield ""
    yield from _decision_lines(comparison)
    yield from _table(LEAF_COLUMNS, [_leaf_row(leaf) for leaf in comparison.leaves])
    yield from _joint_lines(comparison)
    yield from _path_lines(comparison)


def as_json(comparison: RunComparison) -> Mapping[str, object]:
    """Return the comparison for JSON: seconds, metres, radians; joint errors in degrees."""
    split = comparison.first_difference
    return {
        "mission": comparison.a.record.header.mission,
        "robot": comparison.a.record.header.robot,
        **{
            name: _run_as_json(study.record, end)
            for name, study, end in zip("ab", (comparison.a, comparison.b), comparison.ends, strict=True)
        },
        "settings": {name: pair._asdict() for name, pair in comparison.settings.items()},
        "nodes": comparison.nodes,
        "split": None
        if split is None
        else {**asdict(split.place), **_encode_pair(split.changes, lambda change: change.as_dict())},
        "leaves": [
            {**asdict(leaf.place), "goes": leaf.runs._asdict(), "seconds": leaf.seconds._asdict()}
            for leaf in comparison.leaves
        ],
        "joints": {name: _encode_pair(pair, asdict) for name, pair in comparison.joints.items()},
        "ways": _encode_pair(comparison.paths, asdict),
        "apart": None
        if comparison.max_distance is None
        else {"metres": comparison.max_distance[0], "t": comparison.max_distance[1]},
    }


def _run_as_json(record: RunRecord, end: Ended | None) -> Mapping[str, object]:
    return {"record": str(record.path), "end": None if end is None else end.as_dict()}


def _encode_pair(pair: RunPair[T], encode: Callable[[T], object]) -> Mapping[str, object]:
    return {name: None if each is None else encode(each) for name, each in pair._asdict().items()}


def _decision_lines(comparison: RunComparison) -> Iterator[str]:
    if comparison.first_difference is None:
        yield f"No different decision: {comparison.nodes} nodes compared."
    else:
        yield from _difference_lines(comparison.first_difference)
    yield ""


def _difference_lines(difference: FirstDifference) -> Iterator[str]:
    place = difference.place
    yield f"First different decision: {_one_line(str(place))}, {_one_line(place.file)}, line {place.line}:"
    for name, change in zip("AB", difference.changes, strict=True):
        yield f"  {name}  {_change_text(change)}"


def _change_text(change: NodeChanged | None) -> str:
    if change is None:
        return "not reached"
    why = f" ({_one_line(change.reason)})" if change.reason else ""
    return f"{seconds_text(change.t)}  {change.status}{why}"


def _leaf_row(leaf: LeafComparison) -> tuple[str, ...]:
    a, b = leaf.seconds
    more = None if a is None or b is None else b - a
    name = _one_line(leaf.place.name or leaf.place.kind)
    goes = (_value_text(each) for each in leaf.runs)
    return (
        name,
        str(leaf.place.line or ""),
        *goes,
        _number_text(a, ".2f"),
        _number_text(b, ".2f"),
        _number_text(more, "+.2f"),
    )


def _joint_lines(comparison: RunComparison) -> Iterator[str]:
    rows = [
        (
            name,
            *(_number_text(getattr(each, word, None), form) for word, form in JOINT_FIGURES for each in pair),
        )
        for name, pair in comparison.joints.items()
    ]
    if rows:
        studies = comparison.a, comparison.b
        rms = [_number_text(combined_rms(each.joints), ".2f") for each in studies]
        energy = [_number_text(total_energy(each.joints), ".1f") for each in studies]
        rows.append(("all", *rms, "", "", *energy))
    yield from _table(JOINT_COLUMNS, rows)


def _path_lines(comparison: RunComparison) -> Iterator[str]:
    a, b = comparison.paths
    if a is None and b is None:
        return
    rows: list[tuple[str, Callable[[BasePath], str]]] = [
        ("drove", lambda way: f"{way.length:.2f} m"),
        ("turned", lambda way: f"{degrees(way.turned):.0f} deg"),
        ("ended at", lambda way: f"{way.end[0]:.2f}, {way.end[1]:.2f} m, {degrees(way.end[2]):.0f} deg"),
    ]
    cells = [(name, *("-" if way is None else text(way) for way in (a, b))) for name, text in rows]
    yield from format_columns(PATH_COLUMNS, cells, left=LEFT_ALIGNED_COLUMNS).splitlines()
    if a is not None and b is not None:
        yield f"They ended {end_distance(a, b):.2f} m apart."
    if comparison.max_distance is not None:
        metres, when = comparison.max_distance
        yield f"From their starts, they were at most {metres:.2f} m apart, {seconds_text(when)} after the first tick."


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a text table and an empty line; nothing without rows."""
    if rows:
        yield from format_columns(headings, rows, left=LEFT_ALIGNED_COLUMNS).splitlines()
        yield ""


def _number_text(value: float | None, form: str) -> str:
    return "-" if value is None else f"{round(value, 6) + 0.0:{form}}"


def _value_text(value: object) -> str:
    return "-" if value is None else _one_line(str(value))


def _one_line(text: str) -> str:
    """Return a text of a record on one line, shortened to ``MAX_VALUE_LENGTH``."""
    line = one_line(text)
    return line if len(line) <= MAX_VALUE_LENGTH else f"{line[: MAX_VALUE_LENGTH - 1]}…"
