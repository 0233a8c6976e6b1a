"""Copy a time range of a record into a new record.

The new record has the files and the header of the original, and all messages of the range. Before these it has the
state at the start of the range: the last change of each node and variable, and the last state of each part. Those
messages keep their original ``t``, but their log time is the start of the range, so that other programs show them from
there on.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from mcap.writer import Writer

from missions.library.private_files import new_file
from missions.plugins.records.recording.container import McapMessage
from missions.plugins.records.recording.run_record import CUT_METADATA, MCAP_PROFILE, RunRecord, start_time_ns
from missions.plugins.records.recording.tick_codec import TickDecoder, TickEncoder
from missions.plugins.records.recording.validation import parse_message, reject_malformed

STATE_KEYS = {"/mission": (), "/nodes": ("node",), "/feedback": ("node",), "/variables": ("scope", "name")}
"""Topics whose last messages before a time describe the state of a run at that time, with their key fields.

For example, the state includes the last message on ``/nodes`` for each value of the field ``node``. It also includes
the last message on each topic ``/state/...``.
"""


def cut_record(record: RunRecord, start: float, end: float, output: Path, *, force: bool = False) -> int:
    """Write the range from ``start`` to ``end`` (s of the run, inclusive); return the number of messages.

    Raises ExistsError if ``output`` exists, InvalidRecordError, OSError.
    """
    piece = _Excerpt(record, start, end)
    with new_file(output, force=force) as file:
        return piece.write(file)


class _Excerpt:
    """The time range from ``start`` to ``end`` (s) of ``record``, to be written as a new record."""

    def __init__(self, record: RunRecord, start: float, end: float) -> None:
        self._record = record
        self._start = start
        self._end = end
        self._first = start_time_ns(record.header) + round(start * 1e9)
        self._last = start_time_ns(record.header) + round(end * 1e9)
        self._decoder = TickDecoder()
        self._encoder = TickEncoder()

    def write(self, file: BinaryIO) -> int:
        """Write the excerpt to ``file`` as a record; return the number of messages."""
        container = self._record.container
        held = [message._replace(time=max(message.time, self._first)) for message in self._initial_state()]
        # Every chunk was read, so all channels are known. Any: the mcap writer is only partly typed.
        writer: Any = Writer(file, chunk_size=1 << 40)  # chunks end where those of the record do
        writer.start(profile=MCAP_PROFILE, library=MCAP_PROFILE)
        span = {"from": str(self._start), "to": str(self._end), "of": self._record.path.name}
        for name, table in ({**container.metadata(), CUT_METADATA: span}).items():
            writer.add_metadata(name, dict(table))
        for each in container.attachments():
            writer.add_attachment(each.create_time, each.log_time, each.name, each.media_type, each.data)
        schemas = {
            number: writer.register_schema(schema.name, schema.encoding, schema.data)
            for number, schema in container.schemas.items()
        }
        channels = {
            channel.topic: writer.register_channel(channel.topic, channel.message_encoding, schemas[channel.schema_id])
            for channel in container.channels.values()
        }
        count = 0
        for messages in (held, *self._chunks()):
            for topic, time, data in messages:
                writer.add_message(channels[topic], time, data, time, count)
                count += 1
            writer.flush()
        writer.finish()
        return count

    def _initial_state(self) -> list[McapMessage]:
        """Return the messages that describe the state at the start of the excerpt, the record header first."""
        held: dict[tuple[str, ...], McapMessage] = {}
        with reject_malformed(self._record.path):
            for message in self._record.container.messages():
                topic = message.topic
                if topic == "/mission" or (
                    message.time < self._first and (topic in STATE_KEYS or topic.startswith("/state/"))
                ):
                    data = parse_message(message.data) if STATE_KEYS.get(topic) else {}
                    held[(topic, *(str(data[name]) for name in STATE_KEYS.get(topic, ())))] = message
        return list(held.values())

    def _chunks(self) -> Iterator[list[McapMessage]]:
        """Yield the messages within the time range of the excerpt, chunk by chunk."""
        container = self._record.container
        for _, _, data in container.chunks():
            messages = [message for message in container.messages_in(data) if message.topic != "/mission"]
            if any(self._first <= message.time <= self._last for message in messages):
                self._encoder.reset()
                yield [kept for message in messages if (kept := self._convert(message)) is not None]

    def _convert(self, message: McapMessage) -> McapMessage | None:
        """Return a message as the excerpt contains it; None if its time is outside of the excerpt.

        A tick record is encoded again: its replies may refer to an earlier tick of its chunk.
        """
        if message.topic == "/moments":
            with reject_malformed(self._record.path):
                moment = self._decoder.decode(parse_message(message.data))
            message = message._replace(data=self._encoder.encode(moment)) if message.time >= self._first else message
        return message if self._first <= message.time <= self._last else None
