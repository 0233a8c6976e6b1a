"""The frame of the Kobuki protocol, the same in both directions: ``AA 55 LEN payload CHK``.

A payload is a row of parts (sub-payloads) ``ID SIZE data``. LEN counts the bytes of the payload, CHK is the XOR of LEN
and the payload, and all numbers are little-endian. What the parts mean is in ``commands.py`` and ``feedback.py``.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache, reduce
from operator import xor
from struct import Struct, error
from typing import ClassVar, Self

BAUD = 115200
"""The one rate of the base, 8N1."""

HEADER = b"\xaa\x55"
MIN_PAYLOAD, MAX_PAYLOAD = 3, 255
"""How many bytes a payload may have."""


@dataclass(frozen=True, slots=True)
class Part:
    """One sub-payload: its fields, in order, are what ``LAYOUT`` describes, as raw integers of the wire."""

    ID: ClassVar[int]
    LAYOUT: ClassVar[Struct]

    def pack(self) -> bytes:
        """Return the data of the part, without ID and SIZE. Raises struct.error for a value out of range."""
        return self.LAYOUT.pack(*(getattr(self, field.name) for field in fields(self)))

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read the part from its data. Raises struct.error or ValueError when it does not fit the layout."""
        return cls(*cls.LAYOUT.unpack(data))


@dataclass(frozen=True, slots=True)
class Decoded:
    """The parts of one payload that could be read, and how many could not.

    ``unknown`` parts have an ID that is not asked for; ``malformed`` ones do not fit their layout, or are cut off by
    the end of the payload.
    """

    parts: tuple[Part, ...]
    unknown: int = 0
    malformed: int = 0


def checksum(data: bytes | bytearray) -> int:
    """Return the XOR of all bytes: CHK for LEN and payload, and zero for LEN, payload and a CHK that agrees."""
    return reduce(xor, data, 0)


def frame(payload: bytes) -> bytes:
    """Put header, length and checksum around a payload. Raises ValueError for one of an impossible length."""
    if not MIN_PAYLOAD <= len(payload) <= MAX_PAYLOAD:
        raise ValueError(f"a Kobuki payload has {MIN_PAYLOAD} to {MAX_PAYLOAD} bytes, not {len(payload)}")
    body = bytes([len(payload)]) + payload
    return HEADER + body + bytes([checksum(body)])


def encode(*parts: Part) -> bytes:
    """Return one frame with these parts. Raises struct.error or ValueError for what does not fit."""
    return frame(b"".join(subpayload(part.ID, part.pack()) for part in parts))


def subpayload(identifier: int, data: bytes) -> bytes:
    """Put ID and SIZE before the data of a part."""
    return bytes([identifier, len(data)]) + data


def decode(payload: bytes, kinds: Mapping[int, type[Part]]) -> Decoded:
    """Read the parts of a payload; ``kinds`` maps the IDs to look for to their classes.

    Unknown and malformed parts are skipped by their own SIZE, and cost none of the others.
    """
    parts: list[Part] = []
    unknown = malformed = 0
    for identifier, data in _split(payload):
        kind = kinds.get(identifier)
        if data is None:
            malformed += 1
        elif kind is None:
            unknown += 1
        else:
            try:
                parts.append(_unpacked(kind.unpack, data))
            except (error, ValueError):
                malformed += 1
    return Decoded(tuple(parts), unknown, malformed)


@lru_cache(maxsize=64)
def _unpacked(unpack: Callable[[bytes], Part], data: bytes) -> Part:
    """Read a part; most are the same as in the report before."""
    return unpack(data)


def _split(payload: bytes) -> Iterator[tuple[int, bytes | None]]:
    """Yield the ID and data of each part; None for data that the end of the payload cuts off."""
    at = 0
    while at < len(payload):
        data_at = at + 2
        end = data_at + payload[at + 1] if data_at <= len(payload) else len(payload) + 1
        yield payload[at], payload[data_at:end] if end <= len(payload) else None
        at = end


class FrameFinder:
    """Finds frames in a stream that is cut anywhere and may hold noise.

    After a failed check it searches on from the byte behind the false header, so a frame that follows noise, or sits
    inside it, is found. The price: noise that looks like a header holds frames back until as many bytes have come as
    it claims (259 at most, three reports of the base).
    """

    def __init__(self) -> None:
        self.frames = 0
        self.checksum_errors = 0
        self.skipped_bytes = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes as they come; return the payloads of the frames that are complete now, in order."""
        self._buffer += data
        payloads = []
        while self._align():
            end = len(HEADER) + 1 + self._buffer[2] + 1
            if self._buffer[2] < MIN_PAYLOAD:
                self._skip(1)
            elif len(self._buffer) < end:
                break
            elif checksum(self._buffer[2:end]) != 0:
                self.checksum_errors += 1
                self._skip(1)
            else:
                self.frames += 1
                payloads.append(bytes(self._buffer[3 : end - 1]))
                del self._buffer[:end]
        return payloads

    def clear(self) -> None:
        """Forget a frame that has half arrived; the counters stay."""
        self._buffer.clear()

    def _align(self) -> bool:
        """Drop what cannot begin a frame; True when header and length are there."""
        start = self._buffer.find(HEADER)
        if start < 0:
            start = len(self._buffer) - self._buffer.endswith(HEADER[:1])
        self._skip(start)
        return len(self._buffer) > len(HEADER)

    def _skip(self, count: int) -> None:
        self.skipped_bytes += count
        del self._buffer[:count]
