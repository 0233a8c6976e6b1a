"""Tables of a report: faults, log, percepts, facts about the record, joints."""

import csv
import io
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from datetime import datetime

from missions.cli.printable import format_columns
from missions.executive.events import Logged, Notified, ReflexFired
from missions.plugins.pictures.page.document import Markup, join, tag
from missions.plugins.records.recording.export import safe_cell
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.report.joints import JointFigures, combined_rms, joint_sentences, total_energy
from missions.plugins.records.report.sightings import SightingSummary
from missions.plugins.records.report.slider import SliderTimes
from missions.plugins.records.report.summary import reported_faults
from missions.trees.value_text import count_text, seconds_text

MAX_ROWS = 400
"""Maximum number of rows of a table, so that the page stays fast; `mission record replay` shows all."""


LogRow = tuple[float, str, str]
"""Row of the fault or log table in a report: time (s), subject, and text."""


def faults_table(record: RunRecord, slider: SliderTimes) -> Markup:
    """Return the HTML table of faults and reflexes, of which each time is a button."""
    rows: list[LogRow] = [
        (
            event.t,
            f"{'✓' if event.status == 'online' else '!'} {event.part} {event.status}",
            "\n".join(filter(None, (event.detail_without_part, event.hint and f"try: {event.hint}"))),
        )
        for event in reported_faults(record)
    ]
    rows += [
        (event.t, event.condition.replace("_", " "), f"{event.where} {'' if event.on else '(ended)'}".strip())
        for event in record.events
        if isinstance(event, ReflexFired)
    ]
    return _log_markup(sorted(rows, key=lambda row: row[0]), slider, "No faults and no reflexes.")


def log_table(record: RunRecord, slider: SliderTimes) -> Markup:
    """Return the table of speech, notices and log lines."""
    rows = [(event.t, *_speaker_and_text(event)) for event in record.events if isinstance(event, Logged | Notified)]
    return _log_markup(rows, slider, "No speech and no log lines.")


def _speaker_and_text(event: Logged | Notified) -> tuple[str, str]:
    """Return the speaker of a log line, or its log level without a speaker, and its text."""
    match event:
        case Logged(level="voice"):
            return "the robot", event.text
        case Logged(level="person"):
            speaker, separator, words = event.text.partition(": ")
            return (speaker, words) if separator else ("a person", event.text)
        case Logged():
            return event.level, event.text
        case _:
            return "notice", event.text


def sightings_table(sightings: Sequence[SightingSummary], slider: SliderTimes) -> Markup:
    """Return the HTML table of tracked percepts."""
    heads = ("Percept", "Appeared", "From", "To", "Found in", "Nearest")
    rows = [
        tag(
            "tr",
            tag("th", each.name, scope="row"),
            tag("td", "once" if each.count == 1 else f"{each.count} times"),
            tag("td", time_button(each.first, slider)),
            tag("td", time_button(each.last, slider)),
            tag("td", count_text(each.views, "picture")),
            tag("td", f"{each.nearest:.1f} m" if each.nearest is not None else "unknown"),
        )
        for each in sightings[:MAX_ROWS]
    ]
    head = tag("thead", tag("tr", *(tag("th", text, scope="col") for text in heads)))
    table = tag("div", tag("table", head, tag("tbody", *rows)), class_="sightings")
    return join(table, _hidden_rows_note(len(sightings)))


def record_facts(record: RunRecord) -> Markup:
    """Return mission, robot, settings and versions of a record as an HTML list."""
    terms = (join(tag("dt", name), tag("dd", text)) for name, text in _facts(record) if text)
    return tag("dl", *terms, class_="about")


def time_button(time: float, slider: SliderTimes) -> Markup:
    """Return a time as a button that moves the slider there."""
    return tag("button", seconds_text(time), type="button", data_place=slider.position(time), class_="link")


def start_text(record: RunRecord) -> str:
    """Return the start time of the run as text."""
    return f"{datetime.fromisoformat(record.header.started).astimezone():%A, %d %B %Y, %H:%M:%S}"


def _log_markup(rows: Sequence[LogRow], slider: SliderTimes, empty_text: str) -> Markup:
    if not rows:
        return tag("p", empty_text, class_="none")
    lines = (
        tag("tr", tag("td", time_button(time, slider)), tag("td", what), tag("td", words))
        for time, what, words in rows[:MAX_ROWS]
    )
    return join(tag("table", tag("tbody", *lines), class_="log"), _hidden_rows_note(len(rows)))


def _hidden_rows_note(count: int) -> Markup:
    text = f"and {count - MAX_ROWS} more: `mission record replay` and `mission record export` show them all"
    return tag("p", text, class_="none") if count > MAX_ROWS else join()


def _facts(record: RunRecord) -> Iterator[tuple[str, str]]:
    head = record.header
    yield "record", record.path.name
    yield "started", start_text(record)
    yield "mission", f"{head.mission} ({head.file})"
    yield "params", ", ".join(f"{name}: {text}" for name, text in head.values.items())
    yield "robot", head.robot
    yield (
        "world",
        ", ".join(filter(None, (head.world, head.simulate and f"simulated ({head.simulate})"))) or "real",
    )
    yield "eyes", head.eyes
    yield "rate", f"{head.rate:g} Hz"
    yield "seed", str(head.seed)
    yield "mocks", ", ".join(head.mocks)
    yield "versions", ", ".join(f"{name} {version}" for name, version in head.versions.items())
    yield "command", shlex.join(head.command)


# Joint statistics as HTML, text, JSON and CSV.

JOINT_HEADINGS = ("joint", "rms deg", "max deg", "at s", "motor J", "load %", "degC", "samples")
"""Column headings of the joint table on a terminal."""

UNKNOWN = "-"

NO_JOINTS = "no joint states in this record"


def joints_table(joints: Sequence[JointFigures], slider: SliderTimes) -> Markup:
    """Return the joint table of a report; the time of the largest error is a button."""
    heads = ("Joint", "Error (rms)", "Largest error", "At", "Motor work", "Largest load", "Hottest")
    rows = [
        tag(
            "tr",
            tag("th", each.name, scope="row"),
            tag("td", _value_text(each.rms, ".2f", "°")),
            tag("td", _value_text(each.worst, "+.1f", "°")),
            tag("td", UNKNOWN if each.worst_at is None else time_button(each.worst_at, slider)),
            tag("td", _value_text(each.energy, ".1f", " J")),
            tag("td", _value_text(each.load, "+.0%")),
            tag("td", _value_text(each.hottest, ".0f", " °C")),
        )
        for each in joints
    ]
    head = tag("thead", tag("tr", *(tag("th", text, scope="col") for text in heads)))
    return tag("div", tag("table", head, tag("tbody", *rows)), class_="sightings")


def lines_of(joints: Sequence[JointFigures]) -> Iterator[str]:
    """Yield the joint table as lines for a terminal."""
    if not joints:
        yield NO_JOINTS
        return
    rows = [
        (
            each.name,
            _value_text(each.rms, ".2f"),
            _value_text(each.worst, "+.1f"),
            _value_text(each.worst_at, ".2f"),
            _value_text(each.energy, ".1f"),
            _value_text(None if each.load is None else 100 * each.load, "+.0f"),
            _value_text(each.hottest, ".0f"),
            str(each.samples),
        )
        for each in joints
    ]
    yield from format_columns(JOINT_HEADINGS, rows, left=frozenset({"joint"})).splitlines()
    yield ""
    yield from joint_sentences(joints)


def as_json(joints: Sequence[JointFigures]) -> Mapping[str, object]:
    """Return the joint table for JSON: degrees, joules, loads in -1..1 of the stall torque, degC."""
    return {"rms": combined_rms(joints), "energy": total_energy(joints), "joints": [asdict(each) for each in joints]}


def as_csv(joints: Sequence[JointFigures]) -> str:
    """Return the joint table as CSV."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([field.name for field in fields(JointFigures)])
    for each in joints:
        writer.writerow(["" if value is None else safe_cell(value) for value in asdict(each).values()])
    return out.getvalue()


def _value_text(value: float | None, form: str, unit: str = "") -> str:
    return UNKNOWN if value is None else f"{value:{form}}{unit}"
