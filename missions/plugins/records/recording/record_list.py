"""Facts about the records in a folder, as the studio lists them; only the beginning and end of each record are read."""

import os
import struct
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from missions.executive.events import Ended
from missions.plugins.records.recording.run_record import RunRecord, open_record, start_time_ns
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.plugins.records.replay.frames import STAMP_TOLERANCE

Json = dict[str, object]

MAX_SEARCH_BYTES = 16_000_000
"""Maximum number of bytes of a record that are searched back from a time for the state at that time."""

END_CHUNKS = 4
"""Number of chunks at the end of a record that are searched for its result."""

_TIMES = struct.Struct("<QQ")
_CHUNK_HEADER_BYTES = 9  # opcode and length


class ChunkedRecord:
    """A record and its chunks: first time, last time (s) and position of each, in order of time."""

    def __init__(self, path: Path) -> None:
        self.record = open_record(path)
        began = start_time_ns(self.record.header)
        self.chunks = []
        container = self.record.container
        with path.open("rb") as file:
            for span in container.chunk_spans:
                times = container.chunk_times.get(span.start)
                if times is None:  # no index: the record was not closed
                    file.seek(span.start + _CHUNK_HEADER_BYTES)
                    found = file.read(_TIMES.size)
                    times = _TIMES.unpack(found) if len(found) == _TIMES.size else None
                if times is not None:
                    self.chunks.append(((times[0] - began) / 1e9, (times[1] - began) / 1e9, span))
        self.chunks.sort(key=lambda chunk: chunk[0])

    def excerpt(self, first: int, last: int) -> RunRecord:
        """Return a record of the chunks from ``first`` up to, not including, ``last``."""
        whole = self.record
        spans = [span for _, _, span in self.chunks[first:last]]
        container = replace(whole.container, spans=spans)
        return RunRecord(container, whole.header, whole.files, self.end_time, None)

    @property
    def end_time(self) -> float:
        """End of the record, in seconds of the run."""
        return max((end for _, end, _ in self.chunks), default=0.0)

    def run_end(self) -> Ended | None:
        """Return the final event of the run, with its result; None if the end of the record lacks it."""
        return self.excerpt(max(0, len(self.chunks) - END_CHUNKS), len(self.chunks)).run_end()

    def chunks_before(self, time: float) -> Iterator[tuple[int, int]]:
        """Yield the chunks that begin up to ``time`` (s), last one first, each as an index range (first, first + 1).

        It ends once the chunks together have ``MAX_SEARCH_BYTES``.
        """
        last, size = bisect_left(self.chunks, time + STAMP_TOLERANCE, key=lambda chunk: chunk[0]), 0
        while last > 0 and size < MAX_SEARCH_BYTES:
            span = self.chunks[last - 1][2]
            size += span.end - span.start
            yield last - 1, last
            last -= 1


def list_entry(path: Path) -> Json:
    """Return the facts about one record for a list of records; `trouble` is the reason if it cannot be read."""
    entry: Json = {"name": path.name, "bytes": path.stat().st_size}
    if (name := os.fsencode(path.name).decode("utf-8", "replace")) != path.name:
        trouble = "the file name is not UTF-8, so the studio cannot link to it: rename the file"
        return {**entry, "name": name, "began": path.stat().st_mtime, "trouble": trouble}
    try:
        opened = ChunkedRecord(path)
        return entry | run_facts(opened.record) | {"seconds": opened.end_time} | result_facts(opened.run_end())
    except (InvalidRecordError, OSError) as error:
        return entry | {"began": path.stat().st_mtime, "trouble": str(error)[:500]}


def run_facts(record: RunRecord) -> Json:
    """Return mission, robot, world and start time (Unix time) of a record."""
    head = record.header
    began = datetime.fromisoformat(head.started).timestamp()
    return {
        "mission": head.mission,
        "robot": head.robot,
        "simulated": head.simulate,
        "world": head.world,
        "began": began,
    }


def result_facts(end: Ended | None) -> Json:
    """Return result and reason of a run as JSON; empty texts if the record lacks its end."""
    return {"result": "", "reason": ""} if end is None else {"result": end.result, "reason": end.reason}
