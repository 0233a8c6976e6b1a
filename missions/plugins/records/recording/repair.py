"""Close a record that its writer could not close, so that every program can open it.

The repair works in place and may be killed or lose power at any time: all readable data stay readable, and the next
``repair_record`` continues. It only

1. overwrites the first bytes of unreadable ranges, which become records that every reader skips (a range keeps its
   length; of a chunk only the opcode changes),
2. truncates the file after the last complete record,
3. and then appends the index of everything before it.
"""

import fcntl
import os
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Statistics,
)

from config.file_io import regular_opener
from missions.plugins.records.recording.container import (
    MESSAGE_HEADER,
    RECORD_HEADER,
    McapContainer,
    RecordSpan,
    split_records,
)
from missions.plugins.records.recording.mcap_scan import FIRST_PRIVATE_OPCODE, MCAP_MAGIC, scan_file
from missions.plugins.records.recording.validation import InvalidRecordError


class RepairError(InvalidRecordError):
    """A record that cannot be repaired, or is being written now; the message has the reason."""


@dataclass(frozen=True, slots=True)
class RepairResult:
    """Result of a repair: bytes cut off the end, number of ranges marked to be skipped, and number of remaining chunks.

    ``already_closed`` is True if the record needed no repair.
    """

    bytes_cut: int
    skipped_spans: int
    chunks: int
    already_closed: bool = False


def repair_record(path: Path) -> RepairResult:
    """Close the record at ``path``. Raises RepairError, OSError."""
    with open(path, "r+b", opener=regular_opener) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RepairError(f"{path}: is being written: wait until the run ends") from error
        container = scan_file(path)
        if container is None:
            raise RepairError(f"{path}: not an MCAP file")
        if container.is_complete:
            return RepairResult(0, 0, sum(span.opcode == Opcode.CHUNK for span in container.spans), already_closed=True)
        size = os.fstat(file.fileno()).st_size
        index = _IndexBuilder(container)
        index.scan(file)
        if not index.chunks:
            raise RepairError(f"{path}: no readable data")
        _mark_damaged(file, container.damaged_spans, index.damaged)
        os.fsync(file.fileno())
        file.truncate(index.end)
        file.seek(index.end)
        file.write(index.encode())
        file.flush()
        os.fsync(file.fileno())
    return RepairResult(size - index.end, len(index.damaged) + len(container.damaged_spans), len(index.chunks))


def _mark_damaged(file: BinaryIO, gaps: Sequence[RecordSpan], damaged: Sequence[RecordSpan]) -> None:
    """Overwrite damaged parts of an MCAP file with an opcode that readers skip.

    ``gaps`` are ranges between valid records, which get a new record header; ``damaged`` are records, which get only
    the opcode.
    """
    for span in gaps:
        file.seek(span.start)
        file.write(RECORD_HEADER.pack(FIRST_PRIVATE_OPCODE, span.end - span.start - RECORD_HEADER.size))
    for span in damaged:
        file.seek(span.start)
        file.write(bytes([FIRST_PRIVATE_OPCODE]))
    file.flush()


class _IndexBuilder:
    """Builder of the index of an MCAP file; ``end`` is the position of the index in the file."""

    def __init__(self, container: McapContainer) -> None:
        self.end = container.end
        self.chunks: list[ChunkIndex] = []
        self.damaged: list[RecordSpan] = []
        self._container = container
        self._last_message_index = b""
        self._counts: Counter[int] = Counter()
        self._attachments: list[AttachmentIndex] = []
        self._tables: list[MetadataIndex] = []

    def scan(self, file: BinaryIO) -> None:
        """Read the MCAP file, and collect the entries of its index."""
        container, damaged = self._container, self.damaged.append
        self._attachments = [
            _attachment_index(*it) for it in container.read(Opcode.ATTACHMENT, Attachment.read, damaged)
        ]
        self._tables = [_metadata_index(*it) for it in container.read(Opcode.METADATA, Metadata.read, damaged)]
        last = [span for span in container.spans if span.opcode != Opcode.MESSAGE_INDEX][-1:]
        for span, chunk, data in container.chunks(damaged):
            for opcode, start, end in split_records(data):
                container.register(opcode, data[start:end])
            places = _message_offsets(data)
            if not places.keys() <= container.channels.keys():  # the definition of a channel is lost
                damaged(span)
                continue
            offsets, written = _encode_message_indexes(places, span.end)
            file.seek(span.end)
            if [span] == last:  # the index of the last chunk may be torn: write it again
                self.end, self._last_message_index = span.end, written
            elif file.read(len(written)) != written:
                offsets, written = {}, b""
            self._counts.update({channel: len(place) for channel, place in places.items()})
            self.chunks.append(_chunk_index(span, chunk, places, offsets, len(written)))

    def encode(self) -> bytes:
        """Return the index as bytes, to be written at ``end`` of the MCAP file."""
        before = self._last_message_index + _encode_records([DataEnd(data_section_crc=0)])
        index = _encode_records(self._records())
        start = self.end + len(before)
        footer = _encode_records([Footer(summary_start=start, summary_offset_start=0, summary_crc=0)])[:-4]
        checksum = zlib.crc32(index + footer).to_bytes(4, "little")
        return before + index + footer + checksum + MCAP_MAGIC

    def _records(self) -> Iterator[McapRecord]:
        container = self._container
        yield from container.schemas.values()
        yield from container.channels.values()
        yield Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(container.channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self.chunks),
            message_count=self._counts.total(),
            message_start_time=min((chunk.message_start_time for chunk in self.chunks), default=0),
            message_end_time=max((chunk.message_end_time for chunk in self.chunks), default=0),
            metadata_count=len(self._tables),
            schema_count=len(container.schemas),
        )
        yield from self.chunks
        yield from self._attachments
        yield from self._tables


MessageOffsets = Mapping[int, list[tuple[int, int]]]
"""Messages of a chunk by channel ID: log time (ns) of each, and its position in bytes from the start of the chunk."""


def _message_offsets(data: bytes) -> MessageOffsets:
    places: dict[int, list[tuple[int, int]]] = {}
    for opcode, start, _ in split_records(data):
        if opcode == Opcode.MESSAGE:
            channel, _, time, _ = MESSAGE_HEADER.unpack_from(data, start)
            places.setdefault(channel, []).append((time, start - RECORD_HEADER.size))
    return places


def _encode_message_indexes(places: MessageOffsets, start: int) -> tuple[dict[int, int], bytes]:
    """Return the message indexes of a chunk as bytes, and the position in the file of the index of each channel.

    ``start`` is the position in the file at which the bytes will be written.
    """
    offsets, written = {}, b""
    for channel, place in places.items():
        offsets[channel] = start + len(written)
        written += _encode_records([MessageIndex(channel, place)])
    return offsets, written


def _chunk_index(
    span: RecordSpan, chunk: Chunk, places: MessageOffsets, offsets: dict[int, int], length: int
) -> ChunkIndex:
    times = [time for place in places.values() for time, _ in place]
    return ChunkIndex(
        chunk_start_offset=span.start,
        chunk_length=span.end - span.start,
        message_start_time=min(times, default=0),
        message_end_time=max(times, default=0),
        message_index_offsets=offsets,
        message_index_length=length,
        compression=chunk.compression,
        compressed_size=len(chunk.data),
        uncompressed_size=chunk.uncompressed_size,
    )


def _attachment_index(span: RecordSpan, file: Attachment) -> AttachmentIndex:
    return AttachmentIndex(
        offset=span.start,
        length=span.end - span.start,
        log_time=file.log_time,
        create_time=file.create_time,
        data_size=len(file.data),
        name=file.name,
        media_type=file.media_type,
    )


def _metadata_index(span: RecordSpan, table: Metadata) -> MetadataIndex:
    return MetadataIndex(offset=span.start, length=span.end - span.start, name=table.name)


def _encode_records(records: Iterable[McapRecord]) -> bytes:
    builder: Any = RecordBuilder()  # Any: the mcap builder is only partly typed
    for record in records:
        record.write(builder)
    return bytes(builder.end())
