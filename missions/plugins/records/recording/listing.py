"""Records as lists show them: of each, its beginning and its end alone are read."""

import os
import struct
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from missions.executive.events import Ended
from missions.plugins.records.recording.faults import InvalidRecordError
from missions.plugins.records.recording.read import Record, began_at, open_record
from missions.plugins.records.replay.frames import SAME

Json = dict[str, object]

BEFORE = 16_000_000
"""Bytes before a moment that are looked through for what was so then."""

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
        container = self.record.container
        with path.open("rb") as file:
            for span in container.chunk_spans:
                times = container.times.get(span.start)
                if times is None:  # it was never closed, and has no index
                    file.seek(span.start + _HEAD)
                    found = file.read(_TIMES.size)
                    times = _TIMES.unpack(found) if len(found) == _TIMES.size else None
                if times is not None:
                    self.chunks.append(((times[0] - began) / 1e9, (times[1] - began) / 1e9, span))
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


def entry(path: Path) -> Json:
    """Return what lists say of a record: `trouble` where it cannot be read."""
    told: Json = {"name": path.name, "bytes": path.stat().st_size}
    if (name := os.fsencode(path.name).decode("utf-8", "replace")) != path.name:
        trouble = "the name of this file is not text in UTF-8, so no link leads to it: rename the file"
        return {**told, "name": name, "began": path.stat().st_mtime, "trouble": trouble}
    try:
        opened = Opened(path)
        return told | about(opened.record) | {"seconds": opened.until} | ended(opened.end())
    except (InvalidRecordError, OSError) as error:
        return told | {"began": path.stat().st_mtime, "trouble": str(error)[:500]}


def about(found: Record) -> Json:
    """Return the mission, robot and world of a record, and when it began."""
    head = found.head
    began = datetime.fromisoformat(head.started).timestamp()
    return {
        "mission": head.mission,
        "robot": head.robot,
        "simulated": head.simulate,
        "world": head.world,
        "began": began,
    }


def ended(end: Ended | None) -> Json:
    """Return how a run ended."""
    return {"result": "", "reason": ""} if end is None else {"result": end.result, "reason": end.reason}
