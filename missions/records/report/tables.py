"""The tables of a report: faults, what was logged, what was seen, and what the record says of itself."""

import shlex
from collections.abc import Iterator, Sequence
from datetime import datetime

from missions.executive.events import Logged, Notified, ReflexFired
from missions.records.recording.read import Record
from missions.records.report.percepts import Sighting
from missions.records.report.slider import Moments
from missions.records.report.summary import faults
from missions.views.pictures.page.markup import Markup, join, tag
from missions.views.words import counted, in_seconds

MOST_ROWS = 400
"""Of more the page would get slow; `mission replay` shows them all."""


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
    text = f"and {count - MOST_ROWS} more: `mission replay` and `mission record export` show them all"
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
