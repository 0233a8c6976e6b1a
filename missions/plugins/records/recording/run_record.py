"""Reader of records."""

import base64
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any, TypeVar

from config.library import kinds_of, wrong_kind_error
from missions.executive import events
from missions.executive.events import Ended, Event, Logged, NodeChanged, Ticked
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.items import EVENT_TOPICS, FeedbackItem
from missions.plugins.records.recording.record_header import (
    FORMAT_VERSION,
    LIMIT_METADATA,
    TREE_ATTACHMENT,
    VERSIONS_METADATA,
    RecordHeader,
)
from missions.plugins.records.recording.tagged_values import decode_view, from_json
from missions.plugins.records.recording.tick_codec import TickDecoder
from missions.plugins.records.recording.validation import (
    MAX_SECONDS,
    InvalidRecordError,
    check_time,
    parse_message,
    parse_strict_json,
    reject_malformed,
)
from missions.trees.drawing import ACTIVE, TreeDrawing
from missions.trees.drawing import from_json as drawing_from_json
from missions.trees.states import TIME_TOLERANCE
from perception.api import View

if TYPE_CHECKING:
    from missions.plugins.records.recording.container import McapContainer


# Identification of record files.

MCAP_PROFILE = "missiontree"
"""MCAP profile in the header of records of runs."""

FIRST_YEAR, LAST_YEAR = 1970, 2200
"""Latest plausible start year of a run, as ``FIRST_YEAR`` is the earliest."""

OTHER_FORMAT_MESSAGE = f"record format {{}}; this version reads only format {FORMAT_VERSION}"


def not_mcap_error(path: Path) -> InvalidRecordError:
    """Return the error for a file that does not begin like an MCAP file. Raises OSError."""
    if not path.is_file():
        made = path if path.suffix == ".mcap" else "run.mcap"
        hint = f"mission run MISSION --record {made}"
        return InvalidRecordError(f"{path}: no such record file\n  try: {hint}")
    if path.stat().st_size == 0:
        return InvalidRecordError(f"{path}: empty file: its run ended before anything was written")
    if "missions" in kinds_of(path):
        return InvalidRecordError(
            f"{path}: a mission, not a record\n  try: mission run {path} --record {path.stem}.mcap"
        )
    if other := wrong_kind_error("records", path):
        return InvalidRecordError(other)
    return InvalidRecordError(f"{path}: not a record: not an MCAP file")


def read_header(container: "McapContainer", tables: Mapping[str, Mapping[str, str]]) -> RecordHeader:
    """Return the header of a record. Raises InvalidRecordError for other MCAP files and other format versions."""
    path, header = container.path, container.header()
    if VERSIONS_METADATA not in tables and (header is None or header.profile != MCAP_PROFILE):
        raise _foreign_file_error(container)
    data = next((message.data for message in container.messages(frozenset({"/mission"}))), None)
    with reject_malformed(path):
        written = (
            {"format": int(tables.get(VERSIONS_METADATA, {}).get("format", FORMAT_VERSION))}
            if data is None
            else parse_strict_json(data)
        )
        if (found := int(written["format"])) != FORMAT_VERSION:
            again = "pip install --upgrade missiontree" if found > FORMAT_VERSION else "record the mission again"
            raise InvalidRecordError(f"{path}: {OTHER_FORMAT_MESSAGE.format(found)}\n  try: {again}")
        if data is None:
            raise InvalidRecordError(f"{path}: its beginning is missing or damaged, so the record is unreadable")
        return _validate_header(from_json(written, RecordHeader))


def _validate_header(header: RecordHeader) -> RecordHeader:
    """Return a header whose numbers are plausible. Raises ValueError otherwise."""
    if not FIRST_YEAR <= datetime.fromisoformat(header.started).year <= LAST_YEAR:
        raise ValueError(f"implausible start time {header.started:.40}")
    for figure in (header.rate, 0.0 if header.lag is None else header.lag, *header.eye):
        check_time(figure)
    if header.rate <= 0:
        raise ValueError(f"a rate of {header.rate:g} Hz")
    return header


def _foreign_file_error(container: "McapContainer") -> InvalidRecordError:
    path, header = container.path, container.header()
    if header is None or not container.chunk_spans:
        return InvalidRecordError(f"{path}: truncated or damaged before its header, so the record is unreadable")
    by = " and ".join(filter(None, (header.profile, header.library)))
    origin = f" (written by {by})" if by else ""
    return InvalidRecordError(
        f"{path}: an MCAP file, but not a record of MissionTree{origin}\n  try: Foxglove, which opens it"
    )


__all__ = ["SERIES", "InvalidRecordError", "RunRecord", "open_record"]

CUT_METADATA = "cut"
"""Name of the metadata with the time range of a cut record."""

SERIES: Mapping[str, tuple[str, str]] = {
    **{
        f"base.{name}": ("/state/base", name)
        for name in ("x", "y", "heading", "speed", "turn", "requested_speed", "requested_turn")
    },
    **{f"head.{name}": ("/state/head", name) for name in ("pan", "tilt", "requested_pan", "requested_tilt")},
    "battery.percent": ("/state/base", "battery_percent"),
}
"""Time series of a record for charts, by name: topic and field of each.

Values are in SI units, the battery in percent.
"""

MAX_MESSAGES, MAX_MESSAGE_BYTES = 3_000_000, 400_000_000
"""Maximum number and bytes of messages that one query keeps in memory: two days of a run."""

MAX_FILE_BYTES, MAX_NODES = 300_000_000, 20_000
"""Maximum bytes of all files, and nodes of the tree; a mission has at most half as many steps."""

ROOT_KEY = "1"
"""Key of the tree's root."""

_EVENT_CLASSES: Mapping[str, type[Event]] = {topic: getattr(events, name) for name, topic in EVENT_TOPICS.items()}

_COUNTS: Any = Mapping[str, int]

T = TypeVar("T")


def open_record(path: Path) -> "RunRecord":
    """Return the record at ``path``; reads only its beginning and end. Raises InvalidRecordError."""
    try:
        from missions.plugins.records.recording.mcap_scan import scan_file  # noqa: PLC0415 - see above
    except ImportError as error:
        raise InvalidRecordError(
            f"reading records needs mcap ({error})\n  try: pip install 'missiontree[records]'"
        ) from error
    try:
        container = scan_file(path)
        if container is None:
            raise not_mcap_error(path)
        tables = container.metadata()
        head = read_header(container, tables)
        files = _read_attachments(container)
        last = container.last_time()
    except OSError as error:
        raise InvalidRecordError(f"{path}: cannot be read: {error.strerror or error}") from error
    with reject_malformed(path):
        began = start_time_ns(head)
    until = 0.0 if last is None else (last - began) / 1e9
    return RunRecord(
        container, head, files, until, _cut_start(tables.get(CUT_METADATA)), limit_reached=LIMIT_METADATA in tables
    )


def _read_attachments(container: "McapContainer") -> dict[str, bytes]:
    found, left = dict[str, bytes](), MAX_FILE_BYTES
    for each in container.attachments():
        left -= len(each.data)
        if left < 0:
            raise InvalidRecordError(f"{container.path}: has attached files of more than {MAX_FILE_BYTES / 1e6:.0f} MB")
        found[each.name] = each.data
    return found


def start_time_ns(header: RecordHeader) -> int:
    """Return the time of day at time 0 of the run's clock, in ns since 1970 as in message times."""
    return round(datetime.fromisoformat(header.started).timestamp() * 1e6) * 1000


def _cut_start(table: Mapping[str, str] | None) -> float | None:
    try:
        start = 0.0 if table is None else float(table["from"])
    except (KeyError, ValueError):  # damaged: the start is unknown
        return float("nan")
    return start if start > 0 else None


class RunRecord:
    """A recorded run, opened by ``open_record``; keeps no file open. Times are in seconds of the run.

    ``files`` are the files of the run, by their names in the record. ``is_complete`` tells whether it was closed.
    ``cut_start`` is the beginning of a cut record, and None for a whole one. ``limit_reached`` tells whether it ended
    at its size limit before the run did. ``container`` is the file itself.

    Data are read on first access and cached, except pictures and percepts. InvalidRecordError is raised for malformed
    messages; messages in damaged ranges are missing.
    """

    def __init__(
        self,
        container: "McapContainer",
        header: RecordHeader,
        files: Mapping[str, bytes],
        last_message_time: float,
        cut_start: float | None,
        *,
        limit_reached: bool = False,
    ) -> None:
        self.container = container
        self.path: Path = container.path
        self.header = header
        self.files = files
        self.is_complete = container.is_complete
        self._last_message_time = last_message_time
        self.cut_start = cut_start
        self.limit_reached = limit_reached
        self._series_messages: dict[str, list[tuple[float, dict[str, float]]]] = {}

    @cached_property
    def events(self) -> Sequence[Event]:
        """All events of the run in order of time: status changes, commands, faults, ticks, and the end.

        A cut record begins with the last changes before its start.
        """
        found = [
            event for event in self.read(self.decode_event, *EVENT_TOPICS.values(), "/moments") if event is not None
        ]
        found.sort(key=_sort_key)
        status = "running"
        for event in found:  # the result of a tick is the status of the root
            if isinstance(event, NodeChanged) and event.node == ROOT_KEY:
                status = event.status
            elif isinstance(event, Ticked):
                event.status = status
                if event.late is not None and event.late * self.header.rate <= 1:
                    event.late = None  # delays under one tick do not count
        return found

    @cached_property
    def end_time(self) -> float:
        """Time (s) of the last message or event in the record.

        Both are compared, since messages are stamped in whole nanoseconds and events exactly.
        """
        return max([self._last_message_time, *(event.t for event in self.events[-1:])])

    @cached_property
    def tick_records(self) -> Sequence[TickRecord]:
        """All tick records, with the replies of the robot's parts."""
        restored = TickDecoder()
        return list(self.read(lambda _, data: restored.decode(data), "/moments"))

    def views(self) -> Iterator[tuple[float, View]]:
        """Yield the percepts, with the time of their report (s)."""
        return self.read(lambda _, data: (data["t"], decode_view(data)), "/percepts")

    def frames(self) -> Iterator[tuple[float, bytes]]:
        """Yield the time (s) of each picture, and the picture as JPEG."""
        return self.read(lambda _, data: (data["t"], base64.b64decode(data["data"])), "/camera")

    def series(self, name: str) -> tuple[list[float], list[float]]:
        """Return the times (s) and the values of the time series ``name`` of ``SERIES``; unknown values are left out.

        Raises KeyError for another name.
        """
        topic, field = SERIES[name]
        if topic not in self._series_messages:  # read all series of a topic at once
            fields = [other for other_topic, other in SERIES.values() if other_topic == topic]
            self._series_messages[topic] = list(self.read(lambda _, data: _known_values(data, fields), topic))
        found = [(time, known[field]) for time, known in self._series_messages[topic] if field in known]
        return [time for time, _ in found], [value for _, value in found]

    def statuses(self, time: float) -> Mapping[str, NodeChanged]:
        """Return the last status change of each node up to ``time`` (s), by node key.

        ``TIME_TOLERANCE`` is added to the time, since messages are stamped in whole nanoseconds.
        """
        states = self.status_history
        place = bisect_right(states, time + TIME_TOLERANCE, key=lambda state: state[0])
        return {change.node: change for _, change in states[:place]}

    @cached_property
    def status_history(self) -> Sequence[tuple[float, NodeChanged]]:
        """Status changes of all nodes, and new reasons of running nodes, each with its time (s), in order."""
        news: list[NodeChanged | FeedbackItem] = [*self._changes, *self.read(_decode_feedback, "/feedback")]
        found: list[tuple[float, NodeChanged]] = []
        newest: dict[str, NodeChanged] = {}
        for new in sorted(news, key=lambda new: (new.t, isinstance(new, FeedbackItem))):
            if isinstance(new, NodeChanged):
                newest[new.node] = new
            elif new.node not in newest or newest[new.node].status not in ACTIVE:
                continue
            else:
                newest[new.node] = replace(newest[new.node], reason=new.reason)
            found.append((new.t, newest[new.node]))
        return found

    def failures(self) -> Sequence[NodeChanged]:
        """Return every change of a node to failure, in order."""
        return [change for change in self._changes if change.status == "failure"]

    def search(self, text: str) -> Sequence[Event]:
        """Return the events that contain ``text``, ignoring case; ticks have no text."""
        wanted = text.casefold()
        return [event for event in self.events if not isinstance(event, Ticked) and wanted in _search_text(event)]

    def drawing(self) -> TreeDrawing:
        """Return the mission's tree at the start of the run. Raises InvalidRecordError if it is missing."""
        if TREE_ATTACHMENT not in self.files:
            raise InvalidRecordError(f"{self.path}: the drawing of the mission's tree is missing or damaged")
        with reject_malformed(self.path):
            found = drawing_from_json(parse_strict_json(self.files[TREE_ATTACHMENT]))
            if sum(1 for _ in found.root.walk()) > MAX_NODES:
                raise ValueError(f"a tree of more than {MAX_NODES} nodes")
            return found

    def lost_counts(self) -> Mapping[str, int]:
        """Return the number of messages lost while the run was recorded, by topic."""
        counts: Counter[str] = Counter()
        for found in self.read(lambda _, data: from_json(data["counts"], _COUNTS), "/lost"):
            counts.update(found)
        return counts

    def run_end(self) -> Ended | None:
        """Return the final event of the run, with its result; None if the record lacks it."""
        return next((event for event in reversed(self.events) if isinstance(event, Ended)), None)

    @cached_property
    def _changes(self) -> list[NodeChanged]:
        return [event for event in self.events if isinstance(event, NodeChanged)]

    def decode_event(self, topic: str, data: Any) -> Event | None:
        """Return the event that a message on ``topic`` holds; None for a tick record without an event.

        The status of a tick event is left empty.
        """
        if topic == "/moments":
            # A tick event has the end of the tick; in real time a tick has a duration.
            spent = 0.0 if self.header.simulate == "fast" else check_time(data["spent"])
            late = check_time(data["late"])
            if data["kind"] != "tick":
                return None
            return Ticked(data["t"] + spent, from_json(data["tick"], int), "", late)
        if topic == EVENT_TOPICS["Logged"]:
            return Logged(data["t"], from_json(data["kind"], str), from_json(data["message"], str))
        return from_json(data, _EVENT_CLASSES[topic])

    def read(self, decode: Callable[[str, Any], T], *topics: str) -> Iterator[T]:
        """Yield ``decode(topic, data)`` for each message on ``topics``.

        Raises InvalidRecordError for a malformed message, and if the messages are too many to keep in memory.
        """
        kept = not {"/camera"}.issuperset(topics)  # pictures are not kept in memory
        messages = size = 0
        for topic, _, data in self.container.messages(frozenset(topics)):
            messages, size = messages + 1, size + len(data)
            if kept and (messages > MAX_MESSAGES or size > MAX_MESSAGE_BYTES):
                raise InvalidRecordError(
                    f"{self.path}: too large to read at once ({messages} messages, {size / 1e6:.0f} MB)"
                    f"\n  try: mission record cut {quote(str(self.path))} 0s 60s -o piece.mcap"
                )
            with reject_malformed(self.path):
                found = decode(topic, parse_message(data))
            yield found


def _decode_feedback(_: str, data: Any) -> FeedbackItem:
    return FeedbackItem(data["t"], int(data["tick"]), str(data["node"]), str(data["reason"]))


def _known_values(data: Any, fields: Sequence[str]) -> tuple[float, dict[str, float]]:
    """Return the time of a state message, and the known values of ``fields``."""
    good = data["quality"] == "good"
    values = {name: float(data[name]) for name in fields if good and data[name] is not None}
    return data["t"], {name: value for name, value in values.items() if abs(value) < MAX_SECONDS}


def _sort_key(event: Event) -> tuple[float, int]:
    """Return the sort key of an event: by time; at one time, ticks come after other events, the end of the run last."""
    return event.t, isinstance(event, Ticked) + 2 * isinstance(event, Ended)


def _search_text(event: Event) -> str:
    return " ".join(map(str, event.as_dict().values())).casefold()
