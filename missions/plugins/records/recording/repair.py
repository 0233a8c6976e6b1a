"""Closes a record that its writer could not close, so that every program opens it.

It works in place, and may be killed or lose power at any moment: nothing that could be read before is lost, and the
next ``repair_record`` goes on. For it changes nothing but

1. the first bytes of stretches that no reader gets over, which become records that every reader skips (a stretch keeps
   its length, a chunk all but the one byte that says what it is),
2. the end of the file: what follows the last whole record is cut off,
3. and only then appends the index, which is made of what is before it.
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
    """The file cannot be mended, or not just now; says why."""


@dataclass(frozen=True, slots=True)
class RepairResult:
    """What was done: how many bytes were cut off the end, how many stretches are skipped, and how many chunks are left.

    ``already_closed`` says that there was nothing to do.
    """

    bytes_cut: int
    skipped_spans: int
    chunks: int
    already_closed: bool = False


def repair_record(path: Path) -> RepairResult:
    """Close the record in ``path``. Raises NotMendedError, OSError."""
    with open(path, "r+b", opener=regular_opener) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RepairError(f"{path}: is being written just now: wait until the run is over") from error
        container = scan_file(path)
        if container is None:
            raise RepairError(f"{path}: not an MCAP file: it does not begin like one")
        if container.is_complete:
            return RepairResult(0, 0, sum(span.opcode == Opcode.CHUNK for span in container.spans), already_closed=True)
        size = os.fstat(file.fileno()).st_size
        index = _IndexBuilder(container)
        index.scan(file)
        if not index.chunks:
            raise RepairError(f"{path}: there is nothing in it that can be read")
        _mark_damaged(file, container.damaged_spans, index.damaged)
        os.fsync(file.fileno())
        file.truncate(index.end)
        file.seek(index.end)
        file.write(index.encode())
        file.flush()
        os.fsync(file.fileno())
    return RepairResult(size - index.end, len(index.damaged) + len(container.damaged_spans), len(index.chunks))


def _mark_damaged(file: BinaryIO, gaps: Sequence[RecordSpan], damaged: Sequence[RecordSpan]) -> None:
    """Let readers skip what they would stumble over."""
    for span in gaps:
        file.seek(span.start)
        file.write(RECORD_HEADER.pack(FIRST_PRIVATE_OPCODE, span.end - span.start - RECORD_HEADER.size))
    for span in damaged:
        file.seek(span.start)
        file.write(bytes([FIRST_PRIVATE_OPCODE]))
    file.flush()


class _IndexBuilder:
    """What the end of a file says of all that is before it. ``end`` is where that begins."""

    def __init__(self, container: McapContainer) -> None:
        self.end = container.end
        self.chunks: list[ChunkIndex] = []
        self.damaged: list[RecordSpan] = []
        self._container = container
        self._last_message_index = b""  # of the messages in the last chunk
        self._counts: Counter[int] = Counter()
        self._attachments: list[AttachmentIndex] = []
        self._tables: list[MetadataIndex] = []

    def scan(self, file: BinaryIO) -> None:
        """Go through the file."""
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
            if not places.keys() <= container.channels.keys():  # what told of them is gone
                damaged(span)
                continue
            offsets, written = _encode_message_indexes(places, span.end)
            file.seek(span.end)
            if [span] == last:  # what may be torn is made anew
                self.end, self._last_message_index = span.end, written
            elif file.read(len(written)) != written:
                offsets, written = {}, b""
            self._counts.update({channel: len(place) for channel, place in places.items()})
            self.chunks.append(_chunk_index(span, chunk, places, offsets, len(written)))

    def encode(self) -> bytes:
        """Return what is to be written at ``end``."""
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
"""Of each channel, the times of its messages, and where within the chunk they begin."""


def _message_offsets(data: bytes) -> MessageOffsets:
    places: dict[int, list[tuple[int, int]]] = {}
    for opcode, start, _ in split_records(data):
        if opcode == Opcode.MESSAGE:
            channel, _, time, _ = MESSAGE_HEADER.unpack_from(data, start)
            places.setdefault(channel, []).append((time, start - RECORD_HEADER.size))
    return places


def _encode_message_indexes(places: MessageOffsets, start: int) -> tuple[dict[int, int], bytes]:
    """Return the places as they stand in a file from ``start`` on, and where therein those of each channel begin."""
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
    builder: Any = RecordBuilder()  # Any, since only half of it is typed
    for record in records:
        record.write(builder)
    return bytes(builder.end())
