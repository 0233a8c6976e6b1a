"""Two runs side by side, in words for a terminal, and as JSON for programs."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from math import degrees

from missions.cli.printable import in_columns
from missions.executive.events import Ended, NodeChanged
from missions.plugins.records.comparison.runs import Comparison, Leaf, Pair, Split, T, Way, distance
from missions.plugins.records.recording.read import Record
from missions.plugins.records.report.joints import all_energy, all_rms
from missions.plugins.records.report.summary import verdict
from missions.trees.draw import one_line
from missions.trees.words import in_seconds

LEAVES = ("leaf", "line", "A goes", "B goes", "A s", "B s", "B - A s")
JOINTS = ("joint", "A rms deg", "B rms deg", "A at most", "B at most", "A motor J", "B motor J")
FIGURES = (("rms", ".2f"), ("worst", "+.1f"), ("energy", ".1f"))
"""What is told of a joint in both runs, and how."""

WAYS = ("way", "A", "B")

LEFT = frozenset({"leaf", "joint", "way", "run with"})

LONGEST = 60
"""Letters of a value that is shown."""


def lines_of(found: Comparison) -> Iterator[str]:
    """Yield the comparison as lines for a terminal."""
    for name, study in (("A", found.a), ("B", found.b)):
        yield f"{name}  {study.record.path}: {_one_line(verdict(study.record)[1])}"
    if found.settings:
        yield ""
        rows = [(_one_line(name), *(_value(each) for each in pair)) for name, pair in found.settings.items()]
        yield from in_columns(("run with", "A", "B"), rows, left=LEFT).splitlines()
    yield ""
    yield from _decisions(found)
    yield from _table(LEAVES, [_leaf_row(leaf) for leaf in found.leaves])
    yield from _joints(found)
    yield from _ways(found)


def as_json(found: Comparison) -> Mapping[str, object]:
    """Return the comparison for programs: seconds, metres, radians; errors of joints in degrees."""
    split = found.split
    return {
        "mission": found.a.record.head.mission,
        "robot": found.a.record.head.robot,
        **{
            name: _run(study.record, end) for name, study, end in zip("ab", (found.a, found.b), found.ends, strict=True)
        },
        "settings": {name: pair._asdict() for name, pair in found.settings.items()},
        "nodes": found.nodes,
        "split": None
        if split is None
        else {**asdict(split.place), **_both(split.became, lambda change: change.as_dict())},
        "leaves": [
            {**asdict(leaf.place), "goes": leaf.goes._asdict(), "seconds": leaf.seconds._asdict()}
            for leaf in found.leaves
        ],
        "joints": {name: _both(pair, asdict) for name, pair in found.joints.items()},
        "ways": _both(found.ways, asdict),
        "apart": None if found.apart is None else {"metres": found.apart[0], "t": found.apart[1]},
    }


def _run(record: Record, end: Ended | None) -> Mapping[str, object]:
    return {"record": str(record.path), "end": None if end is None else end.as_dict()}


def _both(pair: Pair[T], told: Callable[[T], object]) -> Mapping[str, object]:
    return {name: None if each is None else told(each) for name, each in pair._asdict().items()}


def _decisions(found: Comparison) -> Iterator[str]:
    if found.split is None:
        yield f"The trees decide alike: {found.nodes} nodes compared, no difference."
    else:
        yield from _split(found.split)
    yield ""


def _split(split: Split) -> Iterator[str]:
    place = split.place
    yield f"They first decide differently at {_one_line(str(place))}, {_one_line(place.file)}, line {place.line}:"
    for name, change in zip("AB", split.became, strict=True):
        yield f"  {name}  {_became(change)}"


def _became(change: NodeChanged | None) -> str:
    if change is None:
        return "did not get there"
    why = f" ({_one_line(change.reason)})" if change.reason else ""
    return f"{in_seconds(change.t)}  {change.status}{why}"


def _leaf_row(leaf: Leaf) -> tuple[str, ...]:
    a, b = leaf.seconds
    more = None if a is None or b is None else b - a
    name = _one_line(leaf.place.name or leaf.place.kind)
    goes = (_value(each) for each in leaf.goes)
    return (name, str(leaf.place.line or ""), *goes, _number(a, ".2f"), _number(b, ".2f"), _number(more, "+.2f"))


def _joints(found: Comparison) -> Iterator[str]:
    rows = [
        (
            name,
            *(_number(getattr(each, word, None), form) for word, form in FIGURES for each in pair),
        )
        for name, pair in found.joints.items()
    ]
    if rows:
        studies = found.a, found.b
        rms = [_number(all_rms(each.joints), ".2f") for each in studies]
        energy = [_number(all_energy(each.joints), ".1f") for each in studies]
        rows.append(("all", *rms, "", "", *energy))
    yield from _table(JOINTS, rows)


def _ways(found: Comparison) -> Iterator[str]:
    a, b = found.ways
    if a is None and b is None:
        return
    rows: list[tuple[str, Callable[[Way], str]]] = [
        ("drove", lambda way: f"{way.length:.2f} m"),
        ("turned", lambda way: f"{degrees(way.turned):.0f} deg"),
        ("ended at", lambda way: f"{way.end[0]:.2f}, {way.end[1]:.2f} m, {degrees(way.end[2]):.0f} deg"),
    ]
    told = [(name, *("-" if way is None else text(way) for way in (a, b))) for name, text in rows]
    yield from in_columns(WAYS, told, left=LEFT).splitlines()
    if a is not None and b is not None:
        yield f"They ended {distance(a, b):.2f} m apart."
    if found.apart is not None:
        metres, when = found.apart
        yield f"From where each began, they were {metres:.2f} m apart at most, {in_seconds(when)} after the first tick."


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield a table and an empty line; nothing without rows."""
    if rows:
        yield from in_columns(headings, rows, left=LEFT).splitlines()
        yield ""


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else f"{round(value, 6) + 0.0:{form}}"


def _value(value: object) -> str:
    return "-" if value is None else _one_line(str(value))


def _one_line(text: str) -> str:
    """Return a text of a record on one line, cut where it is long."""
    line = one_line(text)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 1]}…"
