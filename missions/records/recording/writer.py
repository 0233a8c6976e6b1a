"""Writes a record into a file, chunk by chunk.

Each chunk is whole by itself and stands in the file as a whole, or not at all. What could not be written is counted,
and the record tells of it as soon as it can be written to again.
"""

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from mcap.writer import Writer

from missions.records.recording.head import FILES, LIMIT, METADATA, TREE, Contents
from missions.records.recording.items import Missed, topic_of
from missions.records.recording.schemas import schema
from missions.records.recording.sink import Sink
from missions.records.recording.topics import SCHEMAS, Message, Topics

CHUNK = 1_000_000
"""Bytes of messages after which a chunk is written, at the latest."""

OVERHEAD = 64
"""Bytes that a message takes beside what it says; and in the index, a chunk for each topic in it."""

LOST = "/lost"
"""The topic that tells what is missing."""


@dataclass(frozen=True, slots=True)
class Written:
    """What became of a record: the messages written and lost by topic, why they were lost, and whether it was closed.

    ``ended`` is when it reached its limit, in seconds of the run; None where it did not.
    """

    counts: Mapping[str, int] = field(default_factory=dict)
    lost: Mapping[str, int] = field(default_factory=dict)
    why: str = ""
    whole: bool = False
    ended: float | None = None


class RecordWriter:
    """Writes one record of at most ``limit`` bytes. For one thread.

    ``ended`` is when it reached that, and ``lost`` what is missing, and ``why``; it is ``failing`` while it cannot
    write. Nothing but ``begin`` raises for what is wrong with the disk. A record that the disk lost something of lacks
    its index: mend it.
    """

    def __init__(self, sink: Sink, contents: Contents, *, limit: float = float("inf")) -> None:
        self.ended: float | None = None
        self.failing = False
        self.lost: Counter[str] = Counter()
        self._sink = sink
        self._contents = contents
        self._limit = limit
        self._most = min(CHUNK, limit / 20)
        # Any, since only half of it is typed. When a chunk ends is said here.
        self._writer: Any = Writer(sink, chunk_size=64 * CHUNK)
        self._topics = Topics(contents.head)
        self._channels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        self._chunk: Counter[str] = Counter()  # messages in the chunk in progress
        self._untold: Counter[str] = Counter()  # messages lost of which the record does not tell yet
        self._reasons: dict[str, None] = {}
        self._holes = False  # of which the library does not know, so that the index that it would write is wrong
        self._size = self._index = 0
        self._t = 0.0

    @property
    def why(self) -> str:
        """Why something is missing: every reason that there was, once."""
        return "; ".join(self._reasons)

    def begin(self) -> None:
        """Write what stands at the beginning. Raises OSError where that cannot be."""
        writer, head = self._writer, self._contents.head
        writer.start(profile="missiontree", library="missiontree")
        began = self._topics.epoch.nanoseconds(0.0)
        writer.add_metadata(METADATA, {**head.versions, "seed": str(head.seed), "format": str(head.format)})
        writer.add_metadata(FILES, dict(head.paths))
        for name, data in self._contents.files.items():
            writer.add_attachment(began, began, name, "application/octet-stream", data)
        if self._contents.tree:
            writer.add_attachment(began, began, TREE, "application/json", self._contents.tree)
        # All channels stand in the first chunk, so that no chunk that may be lost has one that another needs.
        for topic, name in SCHEMAS.items():
            data = schema(name)
            number = writer.register_schema(name, "jsonschema", data)
            self._channels[topic] = writer.register_channel(topic, "json", number)
            self._index += len(data) + OVERHEAD
        self._put(self._topics.first())
        self.flush()
        if self._sink.trouble is not None:
            raise self._sink.trouble

    def add(self, item: object) -> None:
        """Write an item; once the limit is reached, none."""
        if isinstance(item, Missed):
            self._lose(Counter(item.counts), item.why)
        elif self.ended is None:
            for message in self._topics.messages(item):
                self._put(message)
            if self._size > self._most:
                self.flush()

    def refuse(self, item: object, why: str) -> None:
        """Count an item as lost that cannot be written."""
        self._lose(Counter({topic_of(item): 1}), why)

    def sync(self) -> None:
        """Wait until what was written is on the disk. What goes wrong with that, the next flush is told too."""
        with suppress(OSError):
            self._sink.sync()

    def flush(self) -> None:
        """Bring the chunk in progress to the file, or count what was in it as lost."""
        if self.ended is not None:
            return
        telling, self._untold = self._untold, Counter()
        if telling:
            self._put(self._topics.lost(self._t, telling, self.why))
        if not self._chunk:
            return
        self._topics.forget()
        self._writer.flush()
        chunk, self._chunk, self._size = self._chunk, Counter(), 0
        self._index += OVERHEAD * (2 + len(chunk))
        trouble = self._sink.trouble
        self.failing = trouble is not None
        if trouble is None:
            self._counts += chunk
        else:
            self._holes = True
            del chunk[LOST]
            self._untold = telling
            self._lose(chunk, trouble.strerror or str(trouble))
        if self._sink.good + self._index + self._most > self._limit:
            self.ended = self._t
            self._writer.add_metadata(LIMIT, {"t": f"{self._t:.3f}", "bytes": f"{self._limit:.0f}"})

    def close(self) -> Written:
        """Close the record as far as that is possible; return what became of it. Once."""
        self.flush()
        if self._untold:
            self.flush()  # for what was lost there was no room, but there may be for the news of it
        whole = not self._holes
        if whole:
            self._writer.finish()
            self._sink.flush()
            whole = self._sink.trouble is None
        return Written(dict(self._counts), dict(self.lost), self.why, whole, self.ended)

    def _put(self, message: Message) -> None:
        topic, t, data = message
        time, number = self._topics.epoch.nanoseconds(t), self._counts[topic] + self._chunk[topic]
        self._writer.add_message(self._channels[topic], time, data, time, number)
        self._chunk[topic] += 1
        self._size += len(data) + OVERHEAD
        self._t = max(self._t, t)

    def _lose(self, counts: Counter[str], why: str) -> None:
        self.lost += counts
        self._untold += counts
        self._reasons[why] = None
