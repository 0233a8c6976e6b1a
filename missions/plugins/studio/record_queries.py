"""Queries about recorded runs, read in pieces. Only comparisons and reports read a whole record, of limited size."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from math import inf
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from drivers.clock import SystemClock
from missions.control.commands import BadMessage, ClientCommand
from missions.control.state_feed import UNLOGGED_EVENTS
from missions.plugins.records.comparison.output import as_json
from missions.plugins.records.comparison.runs import IncomparableError, compare_runs
from missions.plugins.records.recording.items import EVENT_TOPICS
from missions.plugins.records.recording.record_list import ChunkedRecord, list_entry, result_facts, run_facts
from missions.plugins.records.recording.run_record import RunRecord, open_record, start_time_ns
from missions.plugins.records.recording.validation import MAX_SECONDS, parse_message, reject_malformed
from missions.plugins.records.replay.frames import STAMP_TOLERANCE
from missions.plugins.records.report.page import report_page
from missions.plugins.records.report.summary import MAX_PICTURES, study_record
from missions.plugins.records.retention import list_records, studio_records_folder
from missions.plugins.studio import studio_commands
from missions.trees.drawing import ACTIVE, to_json

if TYPE_CHECKING:  # needs the extra mcap
    from missions.plugins.records.recording.container import McapMessage

Json = dict[str, object]

PIECE_TIME_BUDGET = 0.25
"""Seconds of work on one piece of a record; the rest follows in the next piece."""

PIECE_TOPICS = frozenset({*EVENT_TOPICS.values(), "/feedback", "/state/base"})
"""Topics whose messages one piece of a record contains."""

MAX_TRAIL_POINTS = 2000
"""Maximum number of points of the base's path in one piece."""

MAX_WHOLE_BYTES = 200_000_000
"""Maximum size in bytes of a record for a report or a comparison, which read it whole."""


def answer_records(command: ClientCommand) -> Json:
    """Return the answer to the command `records`: the list of stored records, and their folder."""
    del command
    return {
        "folder": str(studio_records_folder()),
        "records": [list_entry(path) for path in list_records(studio_records_folder())],
    }


def answer_record(command: ClientCommand) -> Json:
    """Return the answer to the command `record`: one piece of a record, and where the next piece begins."""
    if not isinstance(command, studio_commands.RecordQuery):
        raise TypeError(command.word)
    opened = ChunkedRecord(path_of(command.name))
    first = bisect_left(opened.chunks, command.start, key=lambda chunk: chunk[0])
    clock, last, gathered = SystemClock(), first, _RecordPieces()
    for start, *_ in opened.chunks[first:]:
        if start > max(command.start, opened.chunks[first][0]) and clock.now() >= PIECE_TIME_BUDGET:
            break  # never between chunks with equal start times: the next piece would repeat the first
        gathered.add(opened.excerpt(last, last + 1))
        last += 1
    answer = {**run_facts(opened.record), "until": opened.end_time, **gathered.as_json()}
    if first == 0:
        answer |= {**result_facts(opened.run_end()), "drawing": to_json(opened.record.drawing())}
    if last < len(opened.chunks):
        answer["more"] = opened.chunks[last][0]
    return answer


def render_report(name: str) -> str:
    """Return the report of a record as an HTML page. Raises BadMessage if the record is too large."""
    return report_page(
        study_record(_open_whole(name, f"mission record report {quote(str(path_of(name)))}"), max_pictures=MAX_PICTURES)
    )


def answer_compare(command: ClientCommand) -> Json:
    """Return the answer to the command `compare`: the differences of two records."""
    if not isinstance(command, studio_commands.CompareRecords):
        raise TypeError(command.word)
    names = command.name, command.other
    hint = f"mission record compare {' '.join(quote(str(path_of(name))) for name in names)}"
    try:
        return dict(as_json(compare_runs(*(_open_whole(name, hint) for name in names))))
    except IncomparableError as error:
        raise BadMessage("bad_record", str(error)) from error


HANDLERS: Mapping[str, Callable[[ClientCommand], Json]] = {
    "records": answer_records,
    "record": answer_record,
    "compare": answer_compare,
}
"""Handlers of the commands about records, by command word."""


def messages(piece: RunRecord, topics: frozenset[str], time: float = inf) -> "Iterator[McapMessage]":
    """Yield a record's messages on ``topics``, up to a time in seconds; messages on other topics are not read."""
    latest = start_time_ns(piece.header) + (time + STAMP_TOLERANCE) * 1e9
    return (message for message in piece.container.messages(topics) if message.time <= latest)


def _open_whole(name: str, hint: str) -> RunRecord:
    """Open a record to read all of it. Raises BadMessage, with the suggestion ``hint``, if it is too large."""
    path = path_of(name)
    if (size := path.stat().st_size) > MAX_WHOLE_BYTES:
        error_text = (
            f"{path}: {size / 1e6:.0f} MB are too much for this in the studio (limit {MAX_WHOLE_BYTES / 1e6:.0f})"
        )
        raise BadMessage("bad_record", error_text, hint)
    return open_record(path)


def path_of(name: str) -> Path:
    """Return the path of a record by name. Raises BadMessage for a name that is not listed."""
    found = next((path for path in list_records(studio_records_folder()) if path.name == name), None)
    if found is None:
        raise BadMessage("no_such_record", f"there is no record '{name[:80]}' in {studio_records_folder()}")
    return found


class _RecordPieces:
    """Content of several successive pieces of a record, gathered for one answer."""

    def __init__(self) -> None:
        self._lanes: dict[str, list[list[object]]] = {}
        self._log: list[object] = []
        self._failures: list[float] = []
        self._trail: list[list[float]] = []

    def add(self, piece: RunRecord) -> None:
        """Append the content of the next piece of the record."""
        with reject_malformed(piece.path):
            found = [(message.topic, parse_message(message.data)) for message in messages(piece, PIECE_TOPICS)]
            for topic, content in sorted(found, key=lambda each: float(each[1]["t"])):
                t = round(content["t"], 4)
                if topic == "/nodes":
                    self._lanes.setdefault(content["node"], []).append([t, content["status"], content["reason"]])
                    self._failures += [t] if content["status"] == "failure" else []
                elif topic == "/feedback":
                    lane = self._lanes.setdefault(content["node"], [])
                    if not lane or lane[-1][1] in ACTIVE:
                        lane.append([t, lane[-1][1] if lane else "running", content["reason"]])
                elif topic == "/state/base":
                    self._trail += pose_in(content)
                elif (event := piece.decode_event(topic, content)) is not None and not isinstance(
                    event, UNLOGGED_EVENTS
                ):
                    self._log.append(event.as_dict())

    def as_json(self) -> Json:
        """Return the gathered content as fields of the answer to `record`."""
        places = [place for before, place in pairwise([[], *self._trail]) if place[1:] != before[1:]]
        step = max(1, len(places) // MAX_TRAIL_POINTS)
        return {"lanes": self._lanes, "log": self._log, "failures": self._failures, "trail": places[::step]}


def pose_in(message: Mapping[str, Any]) -> list[list[float]]:
    """Return the time (s) and the pose of the base in a message as ``[[t, x, y, heading]]``; empty if unknown."""
    found = [message[name] for name in ("t", "x", "y", "heading")]
    known = message["quality"] == "good" and all(
        isinstance(each, int | float) and abs(each) < MAX_SECONDS for each in found
    )
    return [[round(each, 3) for each in found]] if known else []
