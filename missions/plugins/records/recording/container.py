"""Reader of MCAP files that may be truncated or damaged anywhere.

The format is described at https://mcap.dev/spec. A file is a sequence of records: one byte for the opcode, eight for
the length, then the content. Most of our records are *chunks*: compressed groups of messages with a checksum.
``mcap_scan`` finds their positions. No record takes more memory than ``MAX_RECORD_SIZE``, whatever its length field.

This module imports nothing of missions: the writer process uses it for repairs, and must start fast.
"""

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata, Schema

from missions.plugins.records.recording.validation import InvalidRecordError

MAX_RECORD_SIZE = 64 * 1024 * 1024
"""Maximum size in bytes of a record, and of a decompressed chunk."""

RECORD_HEADER = struct.Struct("<BQ")
"""Header of an MCAP record: opcode, and number of bytes that follow."""

MESSAGE_HEADER = struct.Struct("<HIQQ")
"""Header of an MCAP message: channel, sequence number, log time and publish time in ns since 1970."""

T = TypeVar("T")


MAX_EXPANSION_RATIO, EXPANSION_ALLOWANCE = 100, 256 * 1024 * 1024
"""A file may decompress to ``MAX_EXPANSION_RATIO`` times its size, plus this many bytes; ours expand sevenfold."""


class DamagedError(ValueError):
    """A range of an MCAP file is damaged."""


class RecordSpan(NamedTuple):
    """Position of an MCAP record: opcode, first byte, and the byte after its end."""

    opcode: int
    start: int
    end: int


class McapMessage(NamedTuple):
    """An MCAP message: topic, time in ns since 1970, and content."""

    topic: str
    time: int
    data: bytes


DamageCallback = Callable[[RecordSpan], None]
"""Callback that is called with the position of each MCAP record that cannot be read."""


def ignore_damage(span: RecordSpan) -> None:
    """Do nothing about a damaged record: the default DamageCallback."""


@dataclass(frozen=True)
class McapContainer:
    """An MCAP file and the positions of its records.

    ``is_complete`` tells whether the file was closed; ``end`` is the byte at which its data end. ``damaged_spans`` are
    the ranges between valid records. ``channels`` and ``schemas`` come from the index, and from each chunk that is
    read. ``chunk_times`` are the first and last message times (ns since 1970) of the chunks in the index, by first
    byte.
    """

    path: Path
    is_complete: bool
    end: int
    spans: Sequence[RecordSpan]
    damaged_spans: Sequence[RecordSpan] = ()
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    chunk_times: dict[int, tuple[int, int]] = field(default_factory=dict)

    def header(self) -> Header | None:
        """Return the header with the profile and library of the writer; None if it is damaged."""
        return next((header for _, header in self.read(Opcode.HEADER, Header.read)), None)

    def metadata(self) -> Mapping[str, Mapping[str, str]]:
        """Return the metadata tables by name; of several tables with the same name, the last one."""
        return {table.name: table.metadata for _, table in self.read(Opcode.METADATA, Metadata.read)}

    def attachments(self, on_damage: DamageCallback = ignore_damage) -> Iterator[Attachment]:
        """Yield the files attached to the MCAP file."""
        for _, attachment in self.read(Opcode.ATTACHMENT, Attachment.read, on_damage):
            yield attachment

    def chunks(self, on_damage: DamageCallback = ignore_damage) -> Iterator[tuple[RecordSpan, Chunk, bytes]]:
        """Yield each chunk with its position and its decompressed content.

        Raises InvalidRecordError if the chunks together decompress to an implausible size, many times that of the file.
        """
        left = MAX_EXPANSION_RATIO * self.end + EXPANSION_ALLOWANCE
        for span, chunk in self.read(Opcode.CHUNK, Chunk.read, on_damage):
            left -= (
                chunk.uncompressed_size if chunk.uncompressed_size <= MAX_RECORD_SIZE else 0
            )  # larger ones are damaged
            if left < 0:
                size = f"{self.end / 1e6:.1f} MB, and would decompress to more than {MAX_EXPANSION_RATIO} times that"
                raise InvalidRecordError(f"{self.path}: has {size}: not written by MissionTree, and not read")
            try:
                data = decompress_chunk(chunk)
            except DamagedError:
                on_damage(span)
            else:
                yield span, chunk, data

    def messages(
        self, topics: frozenset[str] | None = None, on_damage: DamageCallback = ignore_damage
    ) -> Iterator[McapMessage]:
        """Yield the messages on ``topics`` (None: all topics), in the order of the file."""
        for _, _, data in self.chunks(on_damage):
            yield from self.messages_in(data, topics)

    def messages_in(self, data: bytes, topics: frozenset[str] | None = None) -> Iterator[McapMessage]:
        """Yield the messages of one decompressed chunk."""
        for opcode, start, end in split_records(data):
            if opcode == Opcode.MESSAGE:
                number, _, time, _ = MESSAGE_HEADER.unpack_from(data, start)
                channel = self.channels.get(number)
                if channel is not None and (topics is None or channel.topic in topics):
                    yield McapMessage(channel.topic, time, data[start + MESSAGE_HEADER.size : end])
            else:
                self.register(opcode, data[start:end])

    @property
    def chunk_spans(self) -> Sequence[RecordSpan]:
        """Positions of the chunks in the MCAP file."""
        return [span for span in self.spans if span.opcode == Opcode.CHUNK]

    def last_time(self) -> int | None:
        """Return the time (ns since 1970) of the latest message in the last readable chunk; None without a chunk."""
        for span in reversed(self.chunk_spans):
            for _, _, data in replace(self, spans=[span]).chunks():
                times = [
                    MESSAGE_HEADER.unpack_from(data, at)[2]
                    for opcode, at, _ in split_records(data)
                    if opcode == Opcode.MESSAGE
                ]
                if times:
                    return int(max(times))
        return None

    def register(self, opcode: int, data: bytes) -> None:
        """Store the channel or schema definition in ``data``; an MCAP record with another opcode is ignored."""
        if opcode == Opcode.CHANNEL:
            channel = parse_record(Channel.read, data)
            self.channels[channel.id] = channel
        elif opcode == Opcode.SCHEMA:
            schema = parse_record(Schema.read, data)
            self.schemas[schema.id] = schema

    def read(
        self, opcode: Opcode, parse: Callable[[ReadDataStream], T], on_damage: DamageCallback = ignore_damage
    ) -> Iterator[tuple[RecordSpan, T]]:
        """Yield the parsed MCAP records of one opcode, each with its position."""
        with self.path.open("rb") as file:
            for span in self.spans:
                if span.opcode != opcode:
                    continue
                try:
                    record = parse_record(parse, read_body(file, span))
                except DamagedError:
                    on_damage(span)
                else:
                    yield span, record


def read_body(file: BinaryIO, span: RecordSpan) -> bytes:
    """Return the content of a record. Raises DamagedError."""
    file.seek(span.start)
    if span.end - span.start > MAX_RECORD_SIZE + RECORD_HEADER.size:
        raise DamagedError(f"a record of {span.end - span.start} bytes")
    data = file.read(span.end - span.start)
    if len(data) < RECORD_HEADER.size or RECORD_HEADER.unpack_from(data) != (
        span.opcode,
        len(data) - RECORD_HEADER.size,
    ):
        raise DamagedError(f"no valid record at byte {span.start}")
    if span.opcode == Opcode.ATTACHMENT and zlib.crc32(data[RECORD_HEADER.size : -4]) != int.from_bytes(
        data[-4:], "little"
    ):
        raise DamagedError(f"the attachment at byte {span.start} does not match its checksum")
    return data[RECORD_HEADER.size :]


def parse_record(parse: Callable[[ReadDataStream], T], data: bytes) -> T:
    """Return the record that ``parse`` reads from ``data``. Raises DamagedError."""
    try:
        return parse(_StrictStream(BytesIO(data)))
    except (struct.error, McapError, UnicodeDecodeError) as error:
        raise DamagedError(str(error) or "a record ends too early") from error


class _StrictStream(ReadDataStream):
    """Stream that raises EndOfFile on a short read; the library's own stream returns fewer bytes."""

    def read(self, length: int) -> bytes:
        data = super().read(min(length, MAX_RECORD_SIZE))
        if len(data) != length:
            raise EndOfFile
        return data


def decompress_chunk(chunk: Chunk) -> bytes:
    """Return the decompressed content of a chunk, a sequence of MCAP records. Raises DamagedError."""
    size = chunk.uncompressed_size
    if size > MAX_RECORD_SIZE:
        raise DamagedError(f"a chunk of {size} bytes")
    if chunk.compression == "zstd":
        data = _decompress_zstd(chunk.data, size)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise DamagedError(f"a chunk of unknown compression '{chunk.compression}'")
    if len(data) != size or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise DamagedError("a chunk does not match its checksum")
    return data


def _decompress_zstd(data: bytes, size: int) -> bytes:
    """Decompress ``data`` to ``size`` bytes without allocating more. Raises DamagedError."""
    try:
        if zstandard.get_frame_parameters(data).content_size not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise DamagedError(f"a chunk that does not unpack to {size} bytes")
        return zstandard.decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise DamagedError(str(error)) from error


def split_records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the content of each MCAP record in ``data``, up to the first invalid one."""
    at = 0
    while at + RECORD_HEADER.size <= len(data):
        opcode, length = RECORD_HEADER.unpack_from(data, at)
        start, at = at + RECORD_HEADER.size, at + RECORD_HEADER.size + length
        if at > len(data) or (opcode == Opcode.MESSAGE and length < MESSAGE_HEADER.size):
            return
        yield opcode, start, at
