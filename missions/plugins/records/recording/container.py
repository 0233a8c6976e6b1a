"""What an MCAP file holds, read with distrust: it may end or be damaged anywhere.

The format is described at https://mcap.dev/spec. A file is a row of records: one byte that says what it is, eight that
say how long, and as much of it. Most of ours are *chunks*: compressed stretches of messages with a checksum. Where
they stand, ``survey`` finds out. No record takes more memory than ``MAX_RECORD_SIZE``, whatever a damaged length says.

It knows nothing of missions: the process that writes records mends them with it, and must start fast.
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

from missions.plugins.records.recording.faults import InvalidRecordError

MAX_RECORD_SIZE = 64 * 1024 * 1024
"""Bytes that one record, or what a chunk is unpacked to, may have."""

HEAD = struct.Struct("<BQ")
"""How a record begins: what it is, and how many bytes follow."""

MESSAGE = struct.Struct("<HIQQ")
"""How a message begins: its channel, its number, and when it was logged and published, in ns since 1970."""

T = TypeVar("T")


PACKED, ROOM = 100, 256 * 1024 * 1024
"""A file may unpack to so many times its size, and so many bytes more: records of runs unpack to seven times theirs."""


class DamagedError(ValueError):
    """A stretch of the file is not what it should be."""


class Span(NamedTuple):
    """Where a record stands: the byte that it begins at, and the one after its end; ``opcode`` says what it is."""

    opcode: int
    start: int
    end: int


class Message(NamedTuple):
    """A message: its topic, its time in nanoseconds since 1970, and what it says."""

    topic: str
    time: int
    data: bytes


Damaged = Callable[[Span], None]
"""Told of each record that cannot be read."""


def ignored(span: Span) -> None:
    """Take no notice of a damaged record."""


@dataclass(frozen=True)
class Container:
    """A file, and where its records stand. ``whole``: it was closed properly. ``end``: the byte where its data end.

    ``spoilt`` are the stretches between records that are none. ``channels`` and ``schemas`` are those that the index
    names; reading the chunks adds theirs. ``times`` are the first and the last of each chunk that the index names (ns
    since 1970), by the byte that it begins at.
    """

    path: Path
    whole: bool
    end: int
    spans: Sequence[Span]
    spoilt: Sequence[Span] = ()
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    times: dict[int, tuple[int, int]] = field(default_factory=dict)

    def header(self) -> Header | None:
        """Return which program wrote the file, for which readers; None where that is damaged."""
        return next((header for _, header in self.read(Opcode.HEADER, Header.read)), None)

    def metadata(self) -> Mapping[str, Mapping[str, str]]:
        """Return the tables of words, by name; of several with one name, the last."""
        return {table.name: table.metadata for _, table in self.read(Opcode.METADATA, Metadata.read)}

    def attachments(self, damaged: Damaged = ignored) -> Iterator[Attachment]:
        """Yield the files within this file."""
        for _, attachment in self.read(Opcode.ATTACHMENT, Attachment.read, damaged):
            yield attachment

    def chunks(self, damaged: Damaged = ignored) -> Iterator[tuple[Span, Chunk, bytes]]:
        """Yield each chunk with what it unpacks to. Raises InvalidRecordError for more than any run writes."""
        left = PACKED * self.end + ROOM
        for span, chunk in self.read(Opcode.CHUNK, Chunk.read, damaged):
            left -= chunk.uncompressed_size if chunk.uncompressed_size <= MAX_RECORD_SIZE else 0  # else: just damaged
            if left < 0:
                size = f"{self.end / 1e6:.1f} MB, and would unpack to more than {PACKED} times that"
                raise InvalidRecordError(f"{self.path}: has {size}: no run has written this, and nothing of it is read")
            try:
                data = unpacked(chunk)
            except DamagedError:
                damaged(span)
            else:
                yield span, chunk, data

    def messages(self, topics: frozenset[str] | None = None, damaged: Damaged = ignored) -> Iterator[Message]:
        """Yield the messages on ``topics`` (None: on all), in the order of the file."""
        for _, _, data in self.chunks(damaged):
            yield from self.messages_in(data, topics)

    def messages_in(self, data: bytes, topics: frozenset[str] | None = None) -> Iterator[Message]:
        """Yield those of one chunk, which is unpacked."""
        for opcode, start, end in records_in(data):
            if opcode == Opcode.MESSAGE:
                number, _, time, _ = MESSAGE.unpack_from(data, start)
                channel = self.channels.get(number)
                if channel is not None and (topics is None or channel.topic in topics):
                    yield Message(channel.topic, time, data[start + MESSAGE.size : end])
            else:
                self.learn(opcode, data[start:end])

    @property
    def chunk_spans(self) -> Sequence[Span]:
        """Where the chunks stand."""
        return [span for span in self.spans if span.opcode == Opcode.CHUNK]

    def last_time(self) -> int | None:
        """Return the latest time (ns since 1970) in the last chunk that can be read; None without any."""
        for span in reversed(self.chunk_spans):
            for _, _, data in replace(self, spans=[span]).chunks():
                times = [
                    MESSAGE.unpack_from(data, at)[2] for opcode, at, _ in records_in(data) if opcode == Opcode.MESSAGE
                ]
                if times:
                    return int(max(times))
        return None

    def learn(self, opcode: int, data: bytes) -> None:
        """Take note of a channel or a schema."""
        if opcode == Opcode.CHANNEL:
            channel = parsed(Channel.read, data)
            self.channels[channel.id] = channel
        elif opcode == Opcode.SCHEMA:
            schema = parsed(Schema.read, data)
            self.schemas[schema.id] = schema

    def read(
        self, opcode: Opcode, read: Callable[[ReadDataStream], T], damaged: Damaged = ignored
    ) -> Iterator[tuple[Span, T]]:
        """Yield the records of one kind, each with where it stands."""
        with self.path.open("rb") as file:
            for span in self.spans:
                if span.opcode != opcode:
                    continue
                try:
                    record = parsed(read, body(file, span))
                except DamagedError:
                    damaged(span)
                else:
                    yield span, record


def body(file: BinaryIO, span: Span) -> bytes:
    """Return what a record holds. Raises DamagedError."""
    file.seek(span.start)
    if span.end - span.start > MAX_RECORD_SIZE + HEAD.size:
        raise DamagedError(f"a record of {span.end - span.start} bytes")
    data = file.read(span.end - span.start)
    if len(data) < HEAD.size or HEAD.unpack_from(data) != (span.opcode, len(data) - HEAD.size):
        raise DamagedError(f"no record at byte {span.start}")
    if span.opcode == Opcode.ATTACHMENT and zlib.crc32(data[HEAD.size : -4]) != int.from_bytes(data[-4:], "little"):
        raise DamagedError(f"the attachment at byte {span.start} does not match its checksum")
    return data[HEAD.size :]


def parsed(read: Callable[[ReadDataStream], T], data: bytes) -> T:
    """Return the record that ``data`` hold. Raises DamagedError."""
    try:
        return read(_Strict(BytesIO(data)))
    except (struct.error, McapError, UnicodeDecodeError) as error:
        raise DamagedError(str(error) or "a record ends too early") from error


class _Strict(ReadDataStream):
    """A stream that has no less than what is asked for: the library's own takes what there is."""

    def read(self, length: int) -> bytes:
        data = super().read(min(length, MAX_RECORD_SIZE))
        if len(data) != length:
            raise EndOfFile
        return data


def unpacked(chunk: Chunk) -> bytes:
    """Return the records of a chunk. Raises DamagedError."""
    size = chunk.uncompressed_size
    if size > MAX_RECORD_SIZE:
        raise DamagedError(f"a chunk of {size} bytes")
    if chunk.compression == "zstd":
        data = _from_zstd(chunk.data, size)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise DamagedError(f"a chunk that is packed by '{chunk.compression}'")
    if len(data) != size or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise DamagedError("a chunk does not match its checksum")
    return data


def _from_zstd(data: bytes, size: int) -> bytes:
    """Return the ``size`` bytes of which ``data`` are made, reserving no more for them. Raises DamagedError."""
    try:
        if zstandard.get_frame_parameters(data).content_size not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise DamagedError(f"a chunk that does not unpack to {size} bytes")
        return zstandard.decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise DamagedError(str(error)) from error


def records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield what each record within ``data`` is, and where what it holds begins and ends, up to one that is none."""
    at = 0
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        start, at = at + HEAD.size, at + HEAD.size + length
        if at > len(data) or (opcode == Opcode.MESSAGE and length < MESSAGE.size):
            return
        yield opcode, start, at
