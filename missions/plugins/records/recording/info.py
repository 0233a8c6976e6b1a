"""What is to be said of a record, in lines: what it is of, what is in it, what is missing, and what to do with it."""

import shlex
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import ceil
from pathlib import Path

from missions.cli.printable import in_columns
from missions.plugins.records.recording.read import Record, open_record
from missions.trees.draw import at
from missions.trees.drawing import Drawing
from missions.trees.states import TIME_TOLERANCE, now_of

LABEL = 10
"""Letters that the names of the first lines take."""


@dataclass(frozen=True, slots=True)
class Stock:
    """How many messages there are by topic, and how many stretches of the file cannot be read."""

    counts: Counter[str]
    damaged: int


def stock(record: Record) -> Stock:
    """Go through a whole record."""
    damaged = list(record.container.spoilt)
    counts = Counter(message.topic for message in record.container.messages(damaged=damaged.append))
    for _ in record.container.attachments(damaged.append):
        pass
    return Stock(counts, len(damaged))


def lines_about(record: Record) -> Iterator[str]:
    """Yield the lines about a record. Raises InvalidRecordError, OSError."""
    found = stock(record)
    for name, text in _facts(record, found):
        yield f"{name:<{LABEL}}{text}".rstrip()
    yield ""
    rows = [(topic, str(count)) for topic, count in sorted(found.counts.items())]
    yield from in_columns(("topic", "messages"), rows, left=frozenset({"topic"})).splitlines()
    yield ""
    rows = [(name, f"{len(data)} bytes") for name, data in sorted(record.files.items())]
    yield from in_columns(("file", "size"), rows, left=frozenset({"file"})).splitlines()
    yield ""
    yield "To go on:"
    yield from (f"  {line}" for line in _hints(record))


def _facts(record: Record, found: Stock) -> Iterator[tuple[str, str]]:
    head = record.head
    yield "mission", f"{head.mission}" + (f" ({head.file})" if head.file else "")
    yield "robot", head.robot
    simulated = f"simulated ({head.simulate})" if head.simulate else ""
    yield "world", ", ".join(filter(None, (head.world, simulated))) or "the real one"
    if head.eyes:
        yield "eyes", head.eyes
    if head.params:
        yield "params", ", ".join(f"{name}={value}" for name, value in head.params.items())
    yield "result", _result(record)
    began = datetime.fromisoformat(head.started).astimezone()
    yield "when", f"{began:%A, %Y-%m-%d %H:%M:%S}"
    ticks = sum(event.event == "tick" for event in record.events)
    yield "length", f"{_length(record)}, {ticks} ticks"
    until = f"{began + timedelta(seconds=record.until):%H:%M:%S.%f}"[:-5]
    yield "closed", "yes" if record.whole else f"no: whole up to {until}, {record.until:.2f} s"
    lost = record.lost()
    told = ", ".join(f"{count} on {topic}" for topic, count in sorted(lost.items()))
    yield "lost", f"{sum(lost.values())} messages: {told}" if lost else "nothing"
    if found.damaged:
        stretches = "1 stretch" if found.damaged == 1 else f"{found.damaged} stretches"
        yield "damaged", f"{stretches} of the file cannot be read: what was there is missing"
    yield "size", f"{record.path.stat().st_size / 1e6:.2f} MB"
    yield "seed", str(head.seed)
    yield "made by", ", ".join(f"{name} {version}" for name, version in head.versions.items())
    yield "command", shlex.join(head.command)


def _result(record: Record) -> str:
    end = record.end()
    if end is None:
        cut = "" if record.cut_from is None else ": this is a piece of a record"
        return "not recorded" + (": it had reached its limit (--record-limit)" if record.full else cut)
    return f"{end.result} after {end.seconds:.2f} s" + (f": {end.reason}" if end.reason else "")


def _length(record: Record) -> str:
    if record.cut_from is None:
        return f"{record.until:.2f} s"
    return f"{record.until - record.cut_from:.2f} s, a piece from {record.cut_from:g} s on"


def _hints(record: Record) -> Iterator[str]:
    path = shlex.quote(str(record.path))
    if not record.whole:
        yield f"mission record repair {path}    close it, so that other programs open it too"
    failure = next(iter(record.failures()), None)
    moment = record.until if failure is None else failure.t
    time = ceil(1000 * (moment - TIME_TOLERANCE)) / 1000  # not before it
    yield f"mission record replay {path}"
    yield f"mission show {path} --at {time:.3f}s" + ("" if failure is None else "    the first failure of a node")
    yield f"mission record report {path}"
    yield f"mission record export {path} --csv FOLDER"


def drawing_of_record(path: Path, time: float | None) -> Drawing:
    """Return the tree of a record, with its statuses at ``time`` in seconds, if one is given."""
    record = open_record(path)
    drawing = record.drawing()
    if time is None:
        return drawing
    if time > record.until:
        sys.stderr.write(f"mission: {path} ends at {record.until:.2f} s, and is shown as it stood then\n")
        time = record.until
    return at(drawing, {key: now_of(change) for key, change in record.statuses(time).items()}, time)
