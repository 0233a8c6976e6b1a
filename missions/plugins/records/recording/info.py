"""Text of ``mission record info``: facts, topics and files of a record, and commands that the user can type next."""

import shlex
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import ceil
from pathlib import Path

from missions.cli.printable import format_columns
from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.trees.drawing import TreeDrawing
from missions.trees.drawing_builder import with_states
from missions.trees.states import TIME_TOLERANCE, state_after

LABEL_WIDTH = 10
"""Width in characters of the left column of `mission record info`."""


@dataclass(frozen=True, slots=True)
class MessageCounts:
    """Number of messages in a record by topic, and number of damaged ranges in its file."""

    counts: Counter[str]
    damaged: int


def count_messages(record: RunRecord) -> MessageCounts:
    """Read a whole record and count its messages and damaged ranges."""
    damaged = list(record.container.damaged_spans)
    counts = Counter(message.topic for message in record.container.messages(on_damage=damaged.append))
    for _ in record.container.attachments(damaged.append):
        pass
    return MessageCounts(counts, len(damaged))


def record_lines(record: RunRecord) -> Iterator[str]:
    """Yield the output of ``mission record info``, line by line. Raises InvalidRecordError, OSError."""
    found = count_messages(record)
    for name, text in _facts(record, found):
        yield f"{name:<{LABEL_WIDTH}}{text}".rstrip()
    yield ""
    rows = [(topic, str(count)) for topic, count in sorted(found.counts.items())]
    yield from format_columns(("topic", "messages"), rows, left=frozenset({"topic"})).splitlines()
    yield ""
    rows = [(name, f"{len(data)} bytes") for name, data in sorted(record.files.items())]
    yield from format_columns(("file", "size"), rows, left=frozenset({"file"})).splitlines()
    yield ""
    yield "Next commands:"
    yield from (f"  {line}" for line in _next_commands(record))


def _facts(record: RunRecord, counts: MessageCounts) -> Iterator[tuple[str, str]]:
    head = record.header
    yield "mission", f"{head.mission}" + (f" ({head.file})" if head.file else "")
    yield "robot", head.robot
    simulated = f"simulated ({head.simulate})" if head.simulate else ""
    yield "world", ", ".join(filter(None, (head.world, simulated))) or "real"
    if head.eyes:
        yield "eyes", head.eyes
    if head.params:
        yield "params", ", ".join(f"{name}={value}" for name, value in head.params.items())
    yield "result", _result_text(record)
    began = datetime.fromisoformat(head.started).astimezone()
    yield "when", f"{began:%A, %Y-%m-%d %H:%M:%S}"
    ticks = sum(event.event == "tick" for event in record.events)
    yield "length", f"{_length_text(record)}, {ticks} ticks"
    until = f"{began + timedelta(seconds=record.end_time):%H:%M:%S.%f}"[:-5]
    yield "closed", "yes" if record.is_complete else f"no: complete up to {until}, {record.end_time:.2f} s"
    lost = record.lost_counts()
    topics = ", ".join(f"{count} on {topic}" for topic, count in sorted(lost.items()))
    yield "lost", f"{sum(lost.values())} messages: {topics}" if lost else "nothing"
    if counts.damaged:
        stretches = "1 range" if counts.damaged == 1 else f"{counts.damaged} ranges"
        yield "damaged", f"{stretches} of the file unreadable: messages are missing"
    yield "size", f"{record.path.stat().st_size / 1e6:.2f} MB"
    yield "seed", str(head.seed)
    yield "made by", ", ".join(f"{name} {version}" for name, version in head.versions.items())
    yield "command", shlex.join(head.command)


def _result_text(record: RunRecord) -> str:
    end = record.run_end()
    if end is None:
        cut = "" if record.cut_start is None else ": this record was cut"
        return "not recorded" + (": the size limit was reached (--record-limit)" if record.limit_reached else cut)
    return f"{end.result} after {end.seconds:.2f} s" + (f": {end.reason}" if end.reason else "")


def _length_text(record: RunRecord) -> str:
    if record.cut_start is None:
        return f"{record.end_time:.2f} s"
    return f"{record.end_time - record.cut_start:.2f} s, cut at {record.cut_start:g} s"


def _next_commands(record: RunRecord) -> Iterator[str]:
    path = shlex.quote(str(record.path))
    if not record.is_complete:
        yield f"mission record repair {path}    close it for other programs"
    failure = next(iter(record.failures()), None)
    moment = record.end_time if failure is None else failure.t
    time = ceil(1000 * (moment - TIME_TOLERANCE)) / 1000  # round up, so that it is not earlier
    yield f"mission record replay {path}"
    yield f"mission show {path} --at {time:.3f}s" + ("" if failure is None else "    the first failure of a node")
    yield f"mission record report {path}"
    yield f"mission record export {path} --csv FOLDER"


def drawing_of_record(path: Path, time: float | None) -> TreeDrawing:
    """Return the tree of a record, with its statuses at ``time`` (s) if that is not None."""
    record = open_record(path)
    drawing = record.drawing()
    if time is None:
        return drawing
    if time > record.end_time:
        sys.stderr.write(f"mission: {path} ends at {record.end_time:.2f} s; that time is shown\n")
        time = record.end_time
    return with_states(drawing, {key: state_after(change) for key, change in record.statuses(time).items()}, time)
