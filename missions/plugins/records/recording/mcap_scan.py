"""Find the records of an MCAP file: by its index if that is valid, else from record to record.

A file that was never closed has no index. After a damaged range the scan continues at the next valid chunk, which is
found by the compression field that all our chunks have.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Chunk, ChunkIndex, MetadataIndex

from missions.plugins.records.recording.container import (
    MAX_RECORD_SIZE,
    RECORD_HEADER,
    DamagedError,
    McapContainer,
    RecordSpan,
    decompress_chunk,
    parse_record,
    read_body,
    split_records,
)

MCAP_MAGIC = b"\x89MCAP0\r\n"
"""First bytes of every MCAP file, and last bytes of a closed one."""

FIRST_PRIVATE_OPCODE = 0x80
"""First opcode for private use; readers skip unknown ones."""

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary start, summary offset start, CRC
_COMPRESSION_FIELD = b"\x04\x00\x00\x00zstd"
_COMPRESSION_OFFSET = RECORD_HEADER.size + 28  # after two times, size and CRC of a chunk
_DATA_END = (Opcode.DATA_END, 4)
_READ_BYTES = 1024 * 1024

MAX_SEARCHED_BYTES = 4 * 1024**3
"""Maximum number of bytes searched for valid chunks after damage; data behind them are lost."""

MAX_SPANS = 5_000_000
"""Maximum number of MCAP records read from a file: three times as many as the record of a week's run has."""


def scan_file(path: Path) -> McapContainer | None:
    """Return the container at ``path``; None if it does not begin like an MCAP file. Raises OSError."""
    if path.exists() and not path.is_file() and not path.is_dir():
        return None  # opening a pipe would block
    with path.open("rb") as file:
        if file.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
            return None
        size = path.stat().st_size
        return _read_by_index(path, file, size) or _read_by_walking(path, file, size)


def _read_by_index(path: Path, file: BinaryIO, size: int) -> McapContainer | None:
    """Return the container by the index at the end; None if there is no valid index."""
    footer_at = size - _FOOTER.size - len(MCAP_MAGIC)
    if footer_at < len(MCAP_MAGIC):
        return None
    file.seek(footer_at)
    footer = file.read(_FOOTER.size)
    opcode, _, start, _, checksum = _FOOTER.unpack(footer)
    if (
        opcode != Opcode.FOOTER
        or file.read() != MCAP_MAGIC
        or not len(MCAP_MAGIC) < start < footer_at <= start + MAX_RECORD_SIZE
    ):
        return None
    file.seek(start)
    index = file.read(footer_at - start)
    if checksum not in (0, zlib.crc32(index + footer[:-4])):
        return None
    header = next(_walk(file, start), None)
    found = McapContainer(path, True, start, [] if header is None else [header])
    try:
        spans = [*found.spans, *_spans_in_index(found, index)]
    except DamagedError:
        return None
    spans.sort(key=lambda span: span.start)
    ends = [len(MCAP_MAGIC), *(span.end for span in spans)]
    if not all(end <= span.start < span.end <= start for end, span in zip(ends, spans, strict=False)):
        return None  # malicious index, such as one chunk a million times
    return replace(found, spans=spans)


def _spans_in_index(found: McapContainer, index: bytes) -> Iterator[RecordSpan]:
    """Yield the positions of the MCAP records that the ``index`` of an MCAP file lists.

    Channels, schemas and chunk times in the index are stored in ``found``.
    """
    for opcode, start, end in split_records(index):
        data = index[start:end]
        match opcode:
            case Opcode.CHUNK_INDEX:
                chunk = parse_record(ChunkIndex.read, data)
                found.chunk_times[chunk.chunk_start_offset] = chunk.message_start_time, chunk.message_end_time
                yield RecordSpan(Opcode.CHUNK, chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length)
            case Opcode.ATTACHMENT_INDEX:
                file = parse_record(AttachmentIndex.read, data)
                yield RecordSpan(Opcode.ATTACHMENT, file.offset, file.offset + file.length)
            case Opcode.METADATA_INDEX:
                table = parse_record(MetadataIndex.read, data)
                yield RecordSpan(Opcode.METADATA, table.offset, table.offset + table.length)
            case _:
                found.register(opcode, data)


def _read_by_walking(path: Path, file: BinaryIO, size: int) -> McapContainer:
    """Return the container of a file without a valid index: walk from record to record, and skip damaged ranges."""
    spans: list[RecordSpan] = []
    spoilt: list[RecordSpan] = []
    at, search = len(MCAP_MAGIC), _ChunkSearch(file, size)
    while True:
        spans += islice(_walk(file, size, at), MAX_SPANS - len(spans))
        at = spans[-1].end if spans else at
        if spans and spans[-1].opcode == Opcode.DATA_END:
            at = spans.pop().start
            break
        following = search.next_chunk(at)
        if following is None or len(spans) >= MAX_SPANS:
            break
        spoilt.append(RecordSpan(FIRST_PRIVATE_OPCODE, at, following))
        at = following
    return McapContainer(path, False, at, spans, spoilt)


def _walk(file: BinaryIO, size: int, at: int = len(MCAP_MAGIC)) -> Iterator[RecordSpan]:
    """Yield the positions of MCAP records from ``at`` on, up to the end of the data or the first invalid record."""
    opcode = 0
    while opcode != Opcode.DATA_END and at + RECORD_HEADER.size <= size:
        file.seek(at)
        opcode, length = RECORD_HEADER.unpack(file.read(RECORD_HEADER.size))
        start, at = at, at + RECORD_HEADER.size + length
        known = (
            Opcode.HEADER <= opcode < Opcode.DATA_END or opcode >= FIRST_PRIVATE_OPCODE or (opcode, length) == _DATA_END
        )
        if not known or length == 0 or length > MAX_RECORD_SIZE or at > size:
            return
        yield RecordSpan(opcode, start, at)


class _ChunkSearch:
    """Search for valid chunks behind damaged ranges of an MCAP file.

    All searches together read at most ``MAX_SEARCHED_BYTES``, since bytes that only look like a chunk may cost 64 MB to
    check.
    """

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._size = file, size
        self._left = MAX_SEARCHED_BYTES

    def next_chunk(self, at: int) -> int | None:
        """Return the start of the next valid chunk after ``at``; None without one."""
        place = at + RECORD_HEADER.size + _COMPRESSION_OFFSET
        while place < self._size and self._left > 0:
            self._file.seek(place)
            block = self._file.read(_READ_BYTES)
            found = block.find(_COMPRESSION_FIELD)
            if found < 0:
                self._left -= len(block)
                place += max(len(block) - len(_COMPRESSION_FIELD) + 1, 1)
                continue
            start = place + found - _COMPRESSION_OFFSET
            if self._is_sound(start):
                return start
            self._left -= found + len(_COMPRESSION_FIELD)
            place += found + 1
        return None

    def _is_sound(self, start: int) -> bool:
        span = next(_walk(self._file, self._size, start), None)
        if span is None or span.opcode != Opcode.CHUNK:
            return False
        self._left -= span.end - span.start
        try:
            decompress_chunk(parse_record(Chunk.read, read_body(self._file, span)))
        except DamagedError:
            return False
        return True
