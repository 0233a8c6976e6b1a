"""How large a picture is, by its header: what is compressed to nothing may take gigabytes once it is decoded."""

import re
import struct
from typing import BinaryIO

Size = tuple[int, int]
"""Width and height in pixels."""

_LONGEST_COMMENT = 65_536
"""Bytes of the header of a PPM or PGM that are looked at."""

_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""The markers of a JPEG after which its size stands."""

_ALONE = frozenset({0x01, *range(0xD0, 0xD9)})
"""Markers of a JPEG without a segment."""

_FIELDS = {256: 0, 257: 1, 322: 0, 323: 1}
"""Fields of a TIFF: its width and height, and those of a tile, which a decoder makes room for as well."""


def size_of(file: BinaryIO) -> Size | None:
    """Return the size of the PNG, JPEG, BMP, WebP, GIF, TIFF, PPM or PGM in a file that can be sought in.

    None for anything else, and where the header does not tell.
    """
    file.seek(0)
    begin = file.read(32)
    try:
        return _told(file, begin)
    except struct.error:  # it ends in its header
        return None


def _told(file: BinaryIO, begin: bytes) -> Size | None:
    if begin.startswith(b"\x89PNG\r\n\x1a\n"):
        return struct.unpack(">II", begin[16:24]) if begin[12:16] == b"IHDR" else None
    if begin.startswith(b"\xff\xd8"):
        return _jpeg(file)
    if begin.startswith((b"GIF87a", b"GIF89a")):
        return struct.unpack("<HH", begin[6:10])
    if begin.startswith(b"BM"):
        (header,) = struct.unpack("<I", begin[14:18])
        width, height = struct.unpack(*("<HH", begin[18:22]) if header == 12 else ("<ii", begin[18:26]))
        return abs(width), abs(height)
    if begin.startswith(b"RIFF") and begin[8:12] == b"WEBP":
        return _webp(begin[12:])
    if begin.startswith((b"II*\0", b"MM\0*")):
        return _tiff(file, "<" if begin[:1] == b"I" else ">", begin)
    if re.match(rb"P[1-6]\s", begin):
        return _plain(file)
    return None


def _jpeg(file: BinaryIO) -> Size | None:
    """Return what stands after the first marker of a frame; bytes between segments are passed over, as decoders do."""
    file.seek(2)
    while byte := file.read(1):
        if byte != b"\xff":
            continue
        while byte == b"\xff":
            byte = file.read(1)
        if not byte:
            return None
        marker = byte[0]
        if marker == 0 or marker in _ALONE:
            continue
        (length,) = struct.unpack(">H", file.read(2))
        if marker in _FRAMES:
            height, width = struct.unpack(">xHH", file.read(5))
            return width, height
        file.seek(max(0, length - 2), 1)
    return None


def _webp(begin: bytes) -> Size | None:
    kind, data = begin[:4], begin[8:]
    if kind == b"VP8X":
        return int.from_bytes(data[4:7], "little") + 1, int.from_bytes(data[7:10], "little") + 1
    if kind == b"VP8L":
        (bits,) = struct.unpack("<I", data[1:5])
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 " and data[3:6] == b"\x9d\x01\x2a":
        width, height = struct.unpack("<HH", data[6:10])
        return width & 0x3FFF, height & 0x3FFF
    return None


def _tiff(file: BinaryIO, order: str, begin: bytes) -> Size | None:
    """Return the larger of the first picture and its tiles, each way."""
    file.seek(*struct.unpack(f"{order}I", begin[4:8]))
    (count,) = struct.unpack(f"{order}H", file.read(2))
    found = [0, 0]
    for _ in range(count):
        tag, kind, _, value = struct.unpack(f"{order}HHI4s", file.read(12))
        if tag in _FIELDS:
            (number,) = struct.unpack(f"{order}H", value[:2]) if kind == 3 else struct.unpack(f"{order}I", value)
            found[_FIELDS[tag]] = max(found[_FIELDS[tag]], number)
    width, height = found
    return (width, height) if width and height else None


def _plain(file: BinaryIO) -> Size | None:
    """Return the first two numbers of a PPM or PGM; comments go from # to the end of their line."""
    file.seek(2)
    words = re.sub(rb"#[^\n]*(\n|$)", b"\n", file.read(_LONGEST_COMMENT)).split(None, 2)
    if len(words) < 3 or not all(re.fullmatch(rb"[0-9]{1,9}", word) for word in words[:2]):
        return None
    return int(words[0]), int(words[1])
