"""The tables of a report: faults, what was logged, what was seen, and what the record says of itself."""

import csv
import io
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from datetime import datetime

from missions.cli.printable import in_columns
from missions.executive.events import Logged, Notified, ReflexFired
from missions.plugins.pictures.page.document import Markup, join, tag
from missions.plugins.records.recording.export import cell
from missions.plugins.records.recording.read import Record
from missions.plugins.records.report.joints import JointFigures, all_energy, all_rms, sentences
from missions.plugins.records.report.percepts import Sighting
from missions.plugins.records.report.slider import Moments
from missions.plugins.records.report.summary import faults
from missions.trees.words import counted, in_seconds

MOST_ROWS = 400
"""Of more the page would get slow; `mission record replay` shows them all."""


Row = tuple[float, str, str]
"""When, what, and the words."""


def faults_table(record: Record, moments: Moments) -> Markup:
    """Return what was wrong with parts of the robot, and what its base felt."""
    rows: list[Row] = [
        (
            event.t,
            f"{'✓' if event.what == 'online' else '!'} {event.part} {event.what}",
            "\n".join(filter(None, (event.plain, event.hint and f"try: {event.hint}"))),
        )
        for event in faults(record)
    ]
    rows += [
        (event.t, event.what.replace("_", " "), f"{event.where} {'' if event.on else '(over)'}".strip())
        for event in record.events
        if isinstance(event, ReflexFired)
    ]
    return _table(sorted(rows, key=lambda row: row[0]), moments, "No faults, and the base felt nothing.")


def log_table(record: Record, moments: Moments) -> Markup:
    """Return what was said, notified and logged."""
    rows = [(event.t, *_said(event)) for event in record.events if isinstance(event, Logged | Notified)]
    return _table(rows, moments, "Nothing was said or logged.")


def _said(event: Logged | Notified) -> tuple[str, str]:
    """Return who speaks, or what sort of line it is, and the words."""
    match event:
        case Logged(level="voice"):
            return "the robot", event.text
        case Logged(level="person"):
            who, told, words = event.text.partition(": ")
            return (who, words) if told else ("somebody", event.text)
        case Logged():
            return event.level, event.text
        case _:
            return "notice", event.text


def sightings_table(found: Sequence[Sighting], moments: Moments) -> Markup:
    """Return all that was followed from picture to picture."""
    heads = ("What", "Came", "From", "To", "Found in", "Nearest")
    rows = [
        tag(
            "tr",
            tag("th", each.name, scope="row"),
            tag("td", "once" if each.times == 1 else f"{each.times} times"),
            tag("td", go_to(each.first, moments)),
            tag("td", go_to(each.last, moments)),
            tag("td", counted(each.views, "picture")),
            tag("td", f"{each.nearest:.1f} m" if each.nearest is not None else "unknown"),
        )
        for each in found[:MOST_ROWS]
    ]
    head = tag("thead", tag("tr", *(tag("th", text, scope="col") for text in heads)))
    table = tag("div", tag("table", head, tag("tbody", *rows)), class_="sightings")
    return join(table, _more(len(found)))


def about(record: Record) -> Markup:
    """Return what was run, how, and on what."""
    terms = (join(tag("dt", name), tag("dd", text)) for name, text in _facts(record) if text)
    return tag("dl", *terms, class_="about")


def go_to(time: float, moments: Moments) -> Markup:
    """Return a time that takes the slider there."""
    return tag("button", in_seconds(time), type="button", data_place=moments.place(time), class_="link")


def began(record: Record) -> str:
    """Return when the run began, in words."""
    return f"{datetime.fromisoformat(record.head.started).astimezone():%A, %d %B %Y, %H:%M:%S}"


def _table(rows: Sequence[Row], moments: Moments, nothing: str) -> Markup:
    if not rows:
        return tag("p", nothing, class_="none")
    lines = (
        tag("tr", tag("td", go_to(time, moments)), tag("td", what), tag("td", words))
        for time, what, words in rows[:MOST_ROWS]
    )
    return join(tag("table", tag("tbody", *lines), class_="log"), _more(len(rows)))


def _more(count: int) -> Markup:
    text = f"and {count - MOST_ROWS} more: `mission record replay` and `mission record export` show them all"
    return tag("p", text, class_="none") if count > MOST_ROWS else join()


def _facts(record: Record) -> Iterator[tuple[str, str]]:
    head = record.head
    yield "record", record.path.name
    yield "began", began(record)
    yield "mission", f"{head.mission} ({head.file})"
    yield "params", ", ".join(f"{name}: {text}" for name, text in head.values.items())
    yield "robot", head.robot
    yield (
        "world",
        ", ".join(filter(None, (head.world, head.simulate and f"simulated ({head.simulate})"))) or "the real one",
    )
    yield "eyes", head.eyes
    yield "rate", f"{head.rate:g} Hz"
    yield "seed", str(head.seed)
    yield "replaced", ", ".join(head.mocks)
    yield "made by", ", ".join(f"{name} {version}" for name, version in head.versions.items())
    yield "command", shlex.join(head.command)


# How joints kept to their goals, as tables: on a page, on a terminal, and for other programs.

HEADINGS = ("joint", "rms deg", "at most deg", "at s", "motor J", "load %", "degC", "samples")
"""The columns on a terminal."""

UNKNOWN = "-"

NONE = "no joint was heard of in this record"


def joints_table(joints: Sequence[JointFigures], moments: Moments) -> Markup:
    """Return the table of a report; a click goes to when a joint was off the most."""
    heads = ("Joint", "Off its goal (rms)", "At most", "At", "Its motor did", "Load at most", "Hottest")
    rows = [
        tag(
            "tr",
            tag("th", each.name, scope="row"),
            tag("td", _told(each.rms, ".2f", "°")),
            tag("td", _told(each.worst, "+.1f", "°")),
            tag("td", UNKNOWN if each.worst_at is None else go_to(each.worst_at, moments)),
            tag("td", _told(each.energy, ".1f", " J")),
            tag("td", _told(each.load, "+.0%")),
            tag("td", _told(each.hottest, ".0f", " °C")),
        )
        for each in joints
    ]
    head = tag("thead", tag("tr", *(tag("th", text, scope="col") for text in heads)))
    return tag("div", tag("table", head, tag("tbody", *rows)), class_="sightings")


def lines_of(joints: Sequence[JointFigures]) -> Iterator[str]:
    """Yield the same as lines for a terminal."""
    if not joints:
        yield NONE
        return
    rows = [
        (
            each.name,
            _told(each.rms, ".2f"),
            _told(each.worst, "+.1f"),
            _told(each.worst_at, ".2f"),
            _told(each.energy, ".1f"),
            _told(None if each.load is None else 100 * each.load, "+.0f"),
            _told(each.hottest, ".0f"),
            str(each.samples),
        )
        for each in joints
    ]
    yield from in_columns(HEADINGS, rows, left=frozenset({"joint"})).splitlines()
    yield ""
    yield from sentences(joints)


def as_json(joints: Sequence[JointFigures]) -> Mapping[str, object]:
    """Return the same for programs: degrees, joules, loads in -1..1 of the stall torque, degC."""
    return {"rms": all_rms(joints), "energy": all_energy(joints), "joints": [asdict(each) for each in joints]}


def as_csv(joints: Sequence[JointFigures]) -> str:
    """Return the same for a spreadsheet."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([field.name for field in fields(JointFigures)])
    for each in joints:
        writer.writerow(["" if value is None else cell(value) for value in asdict(each).values()])
    return out.getvalue()


def _told(value: float | None, form: str, unit: str = "") -> str:
    return UNKNOWN if value is None else f"{value:{form}}{unit}"
