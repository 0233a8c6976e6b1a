"""rosserial's wire, both ways: frames to topics, and the few messages that the Rodney sketch uses. Pure.

A frame (protocol version 2, little-endian, the length counts the data only)::

    FF FE | u16 length | 255 - sum of the length's bytes | u16 topic | data | 255 - sum of topic and data

both sums modulo 256. Topics below 100 belong to rosserial itself; the board numbers its subscribers from 100 and its
publishers behind them. A string is its length as u32, then its UTF-8 bytes.
"""

import math
import struct
from collections.abc import Iterator
from typing import Any, Self

from drivers.api.fast_dataclass import dataclass

PUBLISHER = 0  # a TopicInfo of something the board publishes; from the computer: "which topics have you?"
SUBSCRIBER = 1  # a TopicInfo of something the board listens to
LOG = 7
TIME = 10  # empty or zero from the board: "what is the time?"; from the computer: the answer
STOP = 11  # the computer takes its leave
RESERVED_TOPICS = range(12)  # topics of rosserial itself
FIRST_USER_TOPIC = 100  # the board's first subscriber

HEADER = b"\xff\xfe"
MAX_DATA_LENGTH = 1024  # bytes of data; no board of ours has buffers of more than 512


@dataclass(frozen=True, slots=True)
class RosserialFrame:
    """What one frame carries."""

    topic: int
    data: bytes

    def pack(self) -> bytes:
        """Return the bytes of the frame. Raises struct.error when the data are longer than 65535 bytes."""
        length, body = struct.pack("<H", len(self.data)), struct.pack("<H", self.topic) + self.data
        return HEADER + length + bytes([_checksum(length)]) + body + bytes([_checksum(body)])


def _checksum(data: bytes | bytearray) -> int:
    return 255 - sum(data) % 256


REQUEST_TOPICS = RosserialFrame(PUBLISHER, b"").pack()
STOP_SENDING = RosserialFrame(STOP, b"").pack()
REQUEST_TIME = RosserialFrame(TIME, bytes(8)).pack()
NUDGE = b"\xff\x00"
"""The beginning of no frame: a board whose topics nobody has asked for since it started answers with REQUEST_TIME, one
that is in step with a computer answers nothing."""

PROBE = 3 * NUDGE + REQUEST_TOPICS
"""Asks for the topics, and by the way whether it is the first to do so."""


class RosserialFrameFinder:
    """Finds the frames in a stream of bytes that is cut anywhere and may hold noise.

    After a failed check it searches again from the byte behind the header, so that noise never eats a good frame.
    ``skipped`` counts the bytes that were in no frame, ``checksum_errors`` the headers whose checks failed.
    """

    def __init__(self, max_data_length: int = MAX_DATA_LENGTH) -> None:
        self.skipped = 0
        self.checksum_errors = 0
        self._max_data_length = max_data_length
        self._buffer = bytearray()

    @property
    def has_partial_frame(self) -> bool:
        """True while it holds the beginning of what may become a frame."""
        return bool(self._buffer)

    def feed(self, data: bytes) -> list[RosserialFrame]:
        """Take what has arrived; return the frames that are now complete."""
        self._buffer += data
        return list(self._frames())

    def drop_partial_frame(self) -> list[RosserialFrame]:
        """Stop waiting for the rest of a frame that does not come; return the frames that it had hidden."""
        self._skip(1)
        return list(self._frames())

    def _frames(self) -> Iterator[RosserialFrame]:
        while self._seek_header() and len(self._buffer) >= 5:
            length = int.from_bytes(self._buffer[2:4], "little")
            end = 7 + length
            if _checksum(self._buffer[2:4]) != self._buffer[4]:
                self.checksum_errors += 1
                self._skip(1)
            elif length > self._max_data_length:
                self._skip(1)
            elif len(self._buffer) <= end:
                return
            elif _checksum(self._buffer[5:end]) != self._buffer[end]:
                self.checksum_errors += 1
                self._skip(1)
            else:
                yield RosserialFrame(int.from_bytes(self._buffer[5:7], "little"), bytes(self._buffer[7:end]))
                del self._buffer[: end + 1]

    def _seek_header(self) -> bool:
        """Bring the next header to the front; its first byte alone may be waiting for the second."""
        at = self._buffer.find(HEADER)
        if at < 0:
            at = len(self._buffer) - self._buffer.endswith(HEADER[:1])
        self._skip(at)
        return self._buffer.startswith(HEADER)

    def _skip(self, count: int) -> None:
        self.skipped += min(count, len(self._buffer))
        del self._buffer[:count]


# --- messages: each packs to and unpacks from the data of a frame; unpack raises ValueError for data that do not fit --


@dataclass(frozen=True, slots=True)
class RosserialTopic:
    """What both ends must mean by a topic: its name, its type, and the MD5 sum of the type's definition."""

    name: str
    type: str
    md5: str


SERVO_TOPIC = RosserialTopic("servo", "servo_msgs/servo_array", "a817c864e9b57c7eb2ecd1a47fde1733")
TACHO_TOPIC = RosserialTopic("tacho", "tacho_msgs/tacho", "1027c9c7c1b5b7503692cfee33924e86")


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """The board's word that it has a topic: by which number, and with how large a buffer in bytes."""

    id: int
    topic: RosserialTopic
    buffer: int

    def pack(self) -> bytes:
        """Return the data of frame PUBLISHER or SUBSCRIBER."""
        strings = (self.topic.name, self.topic.type, self.topic.md5)
        return struct.pack("<H", self.id) + b"".join(map(_pack_string, strings)) + struct.pack("<i", self.buffer)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read the data of frame PUBLISHER or SUBSCRIBER."""
        (number,) = _unpack("<H", data, 0)
        name, at = _unpack_string(data, 2)
        kind, at = _unpack_string(data, at)
        md5, at = _unpack_string(data, at)
        (buffer,) = _unpack("<i", data, at)
        return cls(number, RosserialTopic(name, kind, md5), buffer)


@dataclass(frozen=True, slots=True)
class RosserialLog:
    """A line of the board's log. ``level``: 0 debug, 1 info, 2 warning, 3 error, 4 fatal."""

    level: int
    text: str

    def pack(self) -> bytes:
        """Return the data of frame LOG."""
        return bytes([self.level]) + _pack_string(self.text)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read the data of frame LOG."""
        (level,) = _unpack("<B", data, 0)
        return cls(level, _unpack_string(data, 1)[0])


@dataclass(frozen=True, slots=True)
class RosserialTime:
    """A time in seconds; the wire carries u32 whole seconds and u32 nanoseconds."""

    seconds: float

    def pack(self) -> bytes:
        """Return the data of frame TIME."""
        whole, part = divmod(round(self.seconds * 1e9), 10**9)
        return struct.pack("<II", whole % 2**32, part)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read the data of frame TIME."""
        whole, part = _unpack("<II", data, 0)
        return cls(whole + part / 1e9)


@dataclass(frozen=True, slots=True)
class ServoAngle:
    """servo_msgs/servo_array: servo ``index`` is to go to ``angle`` degrees, 0..180 (544 and more are microseconds)."""

    index: int
    angle: int

    def pack(self) -> bytes:
        """Return the data of a frame on the topic SERVO."""
        return struct.pack("<BH", self.index, self.angle)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read the data of a frame on the topic SERVO."""
        return cls(*_unpack("<BH", data, 0))


@dataclass(frozen=True, slots=True)
class Tacho:
    """tacho_msgs/tacho: how fast the wheels turn, in revolutions per minute, forward positive."""

    left: float
    right: float

    def pack(self) -> bytes:
        """Return the data of a frame on the topic TACHO."""
        return struct.pack("<ff", self.left, self.right)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read the data of a frame on the topic TACHO; what is not finite is no rate."""
        rates = _unpack("<ff", data, 0)
        if not all(map(math.isfinite, rates)):
            raise ValueError(f"rosserial: wheels at {rates} revolutions per minute: {data.hex(' ')}")
        return cls(*rates)


def _unpack(layout: str, data: bytes, at: int) -> tuple[Any, ...]:
    try:
        return struct.unpack_from(layout, data, at)
    except struct.error as error:
        raise ValueError(f"rosserial: a message of {len(data)} bytes ends too soon: {data.hex(' ')}") from error


def _pack_string(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _unpack_string(data: bytes, at: int) -> tuple[str, int]:
    """Return the string at offset ``at``, and the offset behind it."""
    (length,) = _unpack("<I", data, at)
    end = at + 4 + length
    if end > len(data):
        raise ValueError(f"rosserial: a string of {length} bytes in a message of {len(data)}: {data.hex(' ')}")
    return data[at + 4 : end].decode(errors="replace"), end
