"""Frames and checksum of the Kobuki protocol, the same in both directions: ``AA 55 LEN payload CHK``.

The header is 0xAA 0x55. A payload is a sequence of parts (sub-payloads) ``ID SIZE data``. LEN counts the bytes of the
payload, CHK is the XOR of LEN and the payload, and all numbers are little-endian. The parts are in ``commands.py`` and
``feedback.py``.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import lru_cache, reduce
from operator import xor
from struct import Struct, error
from typing import ClassVar, Self

from drivers.api.fast_dataclass import dataclass

BAUD = 115200
"""Baud rate of the base, 8N1; it is fixed."""

HEADER = b"\xaa\x55"
MIN_PAYLOAD, MAX_PAYLOAD = 3, 255
"""Sizes of a payload in bytes."""


@dataclass(frozen=True, slots=True)
class KobukiSubpayload:
    """A sub-payload: its fields are the raw integers of the wire, in the order of ``LAYOUT``."""

    ID: ClassVar[int]
    LAYOUT: ClassVar[Struct]

    def pack(self) -> bytes:
        """Encode the data of the part, without ID and SIZE. Raises struct.error for a value out of range."""
        return self.LAYOUT.pack(*(getattr(self, field.name) for field in fields(self)))

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the data of a part. Raises struct.error or ValueError if it does not fit the layout."""
        return cls(*cls.LAYOUT.unpack(data))


@dataclass(frozen=True, slots=True)
class DecodedPayload:
    """Valid parts of a payload, and the numbers of ``unknown`` and ``malformed`` parts.

    An unknown part has an ID that the caller did not ask for. A malformed part does not fit its layout, or exceeds the
    payload.
    """

    parts: tuple[KobukiSubpayload, ...]
    unknown: int = 0
    malformed: int = 0


def checksum(data: bytes | bytearray) -> int:
    """Return the XOR of all bytes: CHK for LEN and payload, zero for LEN, payload and the correct CHK."""
    return reduce(xor, data, 0)


def frame(payload: bytes) -> bytes:
    """Return the frame of a payload. Raises ValueError for an invalid length."""
    if not MIN_PAYLOAD <= len(payload) <= MAX_PAYLOAD:
        raise ValueError(f"a Kobuki payload has {MIN_PAYLOAD} to {MAX_PAYLOAD} bytes, not {len(payload)}")
    body = bytes([len(payload)]) + payload
    return HEADER + body + bytes([checksum(body)])


def encode(*parts: KobukiSubpayload) -> bytes:
    """Return one frame with these parts. Raises struct.error or ValueError for values or lengths out of range."""
    return frame(b"".join(subpayload(part.ID, part.pack()) for part in parts))


def subpayload(identifier: int, data: bytes) -> bytes:
    """Return a part with ID and SIZE before its data."""
    return bytes([identifier, len(data)]) + data


def decode(payload: bytes, kinds: Mapping[int, type[KobukiSubpayload]]) -> DecodedPayload:
    """Decode the parts of a payload; ``kinds`` are the classes of the wanted parts by ID.

    Parts that are not in ``kinds`` or are malformed are only counted.
    """
    parts: list[KobukiSubpayload] = []
    unknown = malformed = 0
    for identifier, data in _split(payload):
        kind = kinds.get(identifier)
        if data is None:
            malformed += 1
        elif kind is None:
            unknown += 1
        else:
            try:
                parts.append(_try_unpack(kind.unpack, data))
            except (error, ValueError):
                malformed += 1
    return DecodedPayload(tuple(parts), unknown, malformed)


@lru_cache(maxsize=64)
def _try_unpack(unpack: Callable[[bytes], KobukiSubpayload], data: bytes) -> KobukiSubpayload:
    """Decode a part with ``unpack``. Results are cached, since most parts do not change between reports."""
    return unpack(data)


def _split(payload: bytes) -> Iterator[tuple[int, bytes | None]]:
    """Yield the ID and data of each part; the data is None if it exceeds the payload."""
    at = 0
    while at < len(payload):
        data_at = at + 2
        end = data_at + payload[at + 1] if data_at <= len(payload) else len(payload) + 1
        yield payload[at], payload[data_at:end] if end <= len(payload) else None
        at = end


class KobukiFrameFinder:
    """Finds frames in a stream of bytes, which may arrive in chunks of any size and contain noise.

    After a wrong checksum the search continues one byte after the false header, so that frames after or inside noise
    are found. Noise that looks like a header delays the frames after it until the claimed number of bytes has arrived:
    259 at most, three reports of the base.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.checksum_errors = 0
        self.skipped_bytes = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Add received bytes; return the payloads of the frames that are now complete, in order."""
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
        """Drop a partial frame; the counters stay."""
        self._buffer.clear()

    def _align(self) -> bool:
        """Drop bytes that cannot start a frame; return whether a header and the length after it have arrived."""
        start = self._buffer.find(HEADER)
        if start < 0:
            start = len(self._buffer) - self._buffer.endswith(HEADER[:1])
        self._skip(start)
        return len(self._buffer) > len(HEADER)

    def _skip(self, count: int) -> None:
        self.skipped_bytes += count
        del self._buffer[:count]
