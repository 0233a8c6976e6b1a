"""Records of runs, looked at piece by piece: no record is read whole, however large, to answer a command."""

import base64
import struct
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from shlex import quote
from typing import Any

from drivers.clock import SystemClock
from missions.executive.events import Ended, VariableSet
from missions.executive.telling import percept_of
from missions.records.recording.codec import from_json
from missions.records.recording.faults import InvalidRecordError, message_in, understanding
from missions.records.recording.read import Record, began_at, open_record
from missions.records.replay.frames import SAME
from missions.records.report.page import page
from missions.records.report.study import MOST_PICTURES, study
from missions.studio import wishes
from missions.studio.commands import Command
from missions.studio.form import BadMessage
from missions.studio.outlet import UNWRITTEN
from missions.studio.pictures import found_in
from missions.studio.ring import records_folder, records_in
from missions.studio.wishes import Moment
from missions.views.pictures.tree_json import to_json
from missions.views.words import in_words

Json = dict[str, object]

BUDGET = 1.0
"""Seconds of work on one piece of a record; what comes behind it is in the next."""

BEFORE = 16_000_000
"""Bytes before a moment that are looked through for what was so then."""

MOST_PLACES = 2000
"""Places of the base's way in one piece."""

LARGEST_REPORT = 200_000_000
"""Bytes of a record that is made a report of: that reads it whole."""

TAIL = 4
"""Chunks at the end of a record in which its end is looked for."""

_TIMES = struct.Struct("<QQ")
_HEAD = 9  # bytes before what a chunk holds


class Opened:
    """A record, and the pieces of it: ``chunks`` are when each begins and ends (s), in order of time."""

    def __init__(self, path: Path) -> None:
        self.record = open_record(path)
        began = began_at(self.record.head)
        self.chunks = []
        with path.open("rb") as file:
            for span in self.record.container.chunk_spans:
                file.seek(span.start + _HEAD)
                found = file.read(_TIMES.size)
                if len(found) == _TIMES.size:
                    start, end = _TIMES.unpack(found)
                    self.chunks.append(((start - began) / 1e9, (end - began) / 1e9, span))
        self.chunks.sort(key=lambda chunk: chunk[0])

    def piece(self, first: int, last: int) -> Record:
        """Return the record of these chunks alone."""
        whole = self.record
        spans = [span for _, _, span in self.chunks[first:last]]
        container = replace(whole.container, spans=spans)
        return Record(container, whole.head, whole.files, self.until, None)

    @property
    def until(self) -> float:
        """When it ends."""
        return max((end for _, end, _ in self.chunks), default=0.0)

    def end(self) -> Ended | None:
        """Return how the run ended, where the end of the record tells it."""
        return self.piece(max(0, len(self.chunks) - TAIL), len(self.chunks)).end()

    def before(self, time: float) -> Iterator[tuple[int, int]]:
        """Yield the chunks that begin up to ``time``, one by one from the last, for ``BEFORE`` bytes."""
        last, size = bisect_left(self.chunks, time + SAME, key=lambda chunk: chunk[0]), 0
        while last > 0 and size < BEFORE:
            span = self.chunks[last - 1][2]
            size += span.end - span.start
            yield last - 1, last
            last -= 1


def listed(command: Command) -> Json:
    """Answer `records`."""
    del command
    where = records_folder()
    return {"folder": str(where), "records": [entry(path) for path in records_in(where)]}


def record(command: Command) -> Json:
    """Answer `record`."""
    if not isinstance(command, wishes.Record):
        raise TypeError(command.word)
    opened = Opened(_path(command.name))
    first = bisect_left(opened.chunks, command.start, key=lambda chunk: chunk[0])
    clock, last, pieces = SystemClock(), first, list[Record]()
    while last < len(opened.chunks) and (last == first or clock.now() < BUDGET):
        pieces.append(opened.piece(last, last + 1))
        _read(pieces[-1])
        last += 1
    told = {**_about(opened.record), **_ended(opened.end()), "until": opened.until, **_gathered(pieces)}
    if first == 0:
        told["drawing"] = to_json(opened.record.drawing())
    if last < len(opened.chunks):
        told["more"] = opened.chunks[last][0]
    return told


def moment(command: Command) -> Json:
    """Answer `moment`."""
    if not isinstance(command, Moment):
        raise TypeError(command.word)
    opened, time = Opened(_path(command.name)), command.t
    spans = list(opened.before(time))
    piece = opened.piece(spans[-1][0], spans[0][1]) if spans else opened.piece(0, 0)
    changed: dict[str, list[object]] = {}
    variables: Json = {}
    for topic, told in _messages(piece, frozenset({"/nodes", "/feedback", "/variables"}), time):
        if topic == "/variables":
            event = from_json(told, VariableSet)
            variables[f"{event.scope} {event.name}".lstrip()] = None if event.value is None else in_words(event.value)
        elif topic == "/nodes":
            changed[told["node"]] = [told["status"], told["reason"], told["t"]]
        elif told["node"] in changed:
            changed[told["node"]][1] = told["reason"]
    views = [(told, view) for told, view in piece.views() if told <= time + SAME]
    places = [place for place in _trail(piece) if place[0] <= time + SAME]
    return {
        "t": time,
        "changed": changed,
        "variables": variables,
        "percept": percept_of(views[-1][1], views[-1][0]).as_dict() if views else None,
        "pose": places[-1][1:] if places else None,
        "picture": _picture(opened, time, spans),
    }


def report(name: str) -> str:
    """Return the report of a record, as a page. Raises BadMessage for one that is too large."""
    path = _path(name)
    if (size := path.stat().st_size) > LARGEST_REPORT:
        told = (
            f"{path}: {size / 1e6:.0f} MB are too much for a report in the studio (at most {LARGEST_REPORT / 1e6:.0f})"
        )
        raise BadMessage("bad_record", told, f"mission report {quote(str(path))}")
    return page(study(open_record(path), most_pictures=MOST_PICTURES))


DOES: Mapping[str, Callable[[Command], Json]] = {"records": listed, "record": record, "moment": moment}
"""What does each command."""


def _messages(piece: Record, topics: frozenset[str], time: float) -> Iterator[tuple[str, Any]]:
    """Yield what was told on topics up to a time: nothing else of the piece is read."""
    with understanding(piece.path):
        for message in piece.container.messages(topics):
            told = message_in(message.data)
            if told["t"] <= time + SAME:
                yield message.topic, told


def _path(name: str) -> Path:
    """Return the record of a name. Raises BadMessage for what is none of those that are listed."""
    found = next((path for path in records_in(records_folder()) if path.name == name), None)
    if found is None:
        raise BadMessage("no_such_record", f"there is no record '{name[:80]}' in {records_folder()}")
    return found


def entry(path: Path) -> Json:
    """Return what lists say of a record: `trouble` where it cannot be read."""
    told: Json = {"name": path.name, "bytes": path.stat().st_size}
    try:
        opened = Opened(path)
        return told | _about(opened.record) | {"seconds": opened.until} | _ended(opened.end())
    except (InvalidRecordError, OSError) as error:
        return told | {"began": path.stat().st_mtime, "trouble": str(error)[:500]}


def _about(found: Record) -> Json:
    head = found.head
    began = datetime.fromisoformat(head.started).timestamp()
    return {
        "mission": head.mission,
        "robot": head.robot,
        "simulated": head.simulate,
        "world": head.world,
        "began": began,
    }


def _ended(end: Ended | None) -> Json:
    return {"result": "", "reason": ""} if end is None else {"result": end.result, "reason": end.reason}


def _read(piece: Record) -> None:
    """Have a piece read what is asked of it below."""
    _ = piece.events, piece.states


def _gathered(pieces: Sequence[Record]) -> Json:
    """Return what pieces tell together."""
    lanes: dict[str, list[object]] = {}
    log: list[object] = []
    failures: list[float] = []
    trail: list[list[float]] = []
    pictures: list[float] = []
    for piece in pieces:
        for time, now in piece.states:
            lanes.setdefault(now.node, []).append([round(time, 4), now.status, now.reason])
        log += [event.as_dict() for event in piece.events if not isinstance(event, UNWRITTEN)]
        failures += [round(change.t, 4) for change in piece.failures()]
        trail += _trail(piece)
        pictures += [round(time, 4) for time in _times(piece, "/camera")]
    step = max(1, len(trail) // MOST_PLACES)
    return {"lanes": lanes, "log": log, "failures": failures, "trail": trail[::step], "pictures": pictures}


def _trail(piece: Record) -> list[list[float]]:
    """Return when the base was where."""
    (times, xs), (_, ys), (_, headings) = (piece.series(f"base.{name}") for name in ("x", "y", "heading"))
    places = [
        [round(t, 3), round(x, 3), round(y, 3), round(heading, 3)]
        for t, x, y, heading in zip(times, xs, ys, headings, strict=False)
    ]
    return [place for before, place in pairwise([[], *places]) if place[1:] != before[1:]]


def _times(piece: Record, topic: str) -> Iterator[float]:
    """Yield when messages on a topic were, without reading them."""
    began = began_at(piece.head)
    for message in piece.container.messages(frozenset({topic})):
        yield (message.time - began) / 1e9


def _picture(opened: Opened, time: float, spans: Sequence[tuple[int, int]]) -> Json | None:
    """Return the newest picture up to a time, with what was found in it."""
    for first, last in spans:
        piece = opened.piece(first, last)
        frames = [(stamp, jpeg) for stamp, jpeg in piece.frames() if stamp <= time + SAME]
        if frames:
            stamp, jpeg = frames[-1]
            views = (view for _, view in piece.views() if view.looked is not None)
            view = next((view for view in views if abs((view.looked or 0.0) - stamp) <= SAME), None)
            found = [] if view is None else found_in(view)
            width, height = _size(jpeg)
            coded = base64.b64encode(jpeg).decode()
            return {"t": stamp, "width": width, "height": height, "jpeg": coded, "found": found}
    return None


def _size(jpeg: bytes) -> tuple[int, int]:
    """Return the width and height of a JPEG; nothing for what is none."""
    at = 2
    while at + 9 < len(jpeg) and jpeg[at] == 0xFF:
        kind, length = jpeg[at + 1], int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(jpeg[at + 7 : at + 9], "big"), int.from_bytes(jpeg[at + 5 : at + 7], "big")
        at += 2 + length
    return 0, 0
