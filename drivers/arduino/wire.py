"""Frames and messages of rosserial, both directions; only the messages of the Rodney sketch. Pure.

A frame (protocol version 2, little-endian, the length counts the data only):

    FF FE | u16 length | 255 - sum of the length's bytes | u16 topic | data | 255 - sum of topic and data

with both sums modulo 256. Topics below 100 are reserved for rosserial; the board numbers its subscribers from 100 and
its publishers after them. A string is its length as u32, then its UTF-8 bytes.
"""

import math
import struct
from collections.abc import Iterator
from typing import Any, Self

from drivers.api.fast_dataclass import dataclass

PUBLISHER = 0  # TopicInfo of a publisher; from the computer, without data: request for the topics
SUBSCRIBER = 1  # TopicInfo of a subscriber
LOG = 7
TIME = 10  # empty or zero from the board: time request; from the computer: the reply
STOP = 11  # the computer ends the session
RESERVED_TOPICS = range(12)  # reserved for rosserial
FIRST_USER_TOPIC = 100  # the board's first subscriber

HEADER = b"\xff\xfe"
MAX_DATA_LENGTH = 1024  # bytes of data; known boards have buffers of at most 512


@dataclass(frozen=True, slots=True)
class RosserialFrame:
    """Content of a rosserial frame: topic number and data."""

    topic: int
    data: bytes

    def pack(self) -> bytes:
        """Return the bytes of the frame. Raises struct.error if the data are longer than 65535 bytes."""
        length, body = struct.pack("<H", len(self.data)), struct.pack("<H", self.topic) + self.data
        return HEADER + length + bytes([_checksum(length)]) + body + bytes([_checksum(body)])


def _checksum(data: bytes | bytearray) -> int:
    return 255 - sum(data) % 256


REQUEST_TOPICS = RosserialFrame(PUBLISHER, b"").pack()
STOP_SENDING = RosserialFrame(STOP, b"").pack()
REQUEST_TIME = RosserialFrame(TIME, bytes(8)).pack()
NUDGE = b"\xff\x00"
"""Invalid header, to which a board without a session replies with REQUEST_TIME, and any other board not at all."""

PROBE = 3 * NUDGE + REQUEST_TOPICS
"""Requests the topics; the reply also shows whether the board was in a session."""


class RosserialFrameFinder:
    """Finds frames in a stream of chunks with noise.

    After a failed checksum the search continues at the byte behind the header, so that noise never hides a valid frame.
    ``skipped`` counts the bytes outside of frames, ``checksum_errors`` the headers with failed checksums.
    """

    def __init__(self, max_data_length: int = MAX_DATA_LENGTH) -> None:
        self.skipped = 0
        self.checksum_errors = 0
        self._max_data_length = max_data_length
        self._buffer = bytearray()

    @property
    def has_partial_frame(self) -> bool:
        """True if the buffer holds the start of a possible frame."""
        return bool(self._buffer)

    def feed(self, data: bytes) -> list[RosserialFrame]:
        """Add received bytes; return the complete frames."""
        self._buffer += data
        return list(self._frames())

    def drop_partial_frame(self) -> list[RosserialFrame]:
        """Drop the incomplete frame; return the complete frames behind it."""
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
        """Move the next header to the front of the buffer; return False if none is complete.

        If the buffer ends with the first byte of a header, this byte is kept.
        """
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
    """Definition of a topic: its name, its type, and the MD5 sum of the type's definition."""

    name: str
    type: str
    md5: str


SERVO_TOPIC = RosserialTopic("servo", "servo_msgs/servo_array", "a817c864e9b57c7eb2ecd1a47fde1733")
TACHO_TOPIC = RosserialTopic("tacho", "tacho_msgs/tacho", "1027c9c7c1b5b7503692cfee33924e86")


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """Announcement of a topic by the board: its number, and the size of the board's buffer in bytes."""

    id: int
    topic: RosserialTopic
    buffer: int

    def pack(self) -> bytes:
        """Return the data of frame PUBLISHER or SUBSCRIBER."""
        strings = (self.topic.name, self.topic.type, self.topic.md5)
        return struct.pack("<H", self.id) + b"".join(map(_pack_string, strings)) + struct.pack("<i", self.buffer)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the data of a frame PUBLISHER or SUBSCRIBER."""
        (number,) = _unpack("<H", data, 0)
        name, at = _unpack_string(data, 2)
        kind, at = _unpack_string(data, at)
        md5, at = _unpack_string(data, at)
        (buffer,) = _unpack("<i", data, at)
        return cls(number, RosserialTopic(name, kind, md5), buffer)


@dataclass(frozen=True, slots=True)
class RosserialLog:
    """Log line of the board. ``level``: 0 debug, 1 info, 2 warning, 3 error, 4 fatal."""

    level: int
    text: str

    def pack(self) -> bytes:
        """Return the data of frame LOG."""
        return bytes([self.level]) + _pack_string(self.text)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the data of a frame LOG."""
        (level,) = _unpack("<B", data, 0)
        return cls(level, _unpack_string(data, 1)[0])


@dataclass(frozen=True, slots=True)
class RosserialTime:
    """Time in seconds; the wire has u32 whole seconds and u32 nanoseconds."""

    seconds: float

    def pack(self) -> bytes:
        """Return the data of frame TIME."""
        whole, part = divmod(round(self.seconds * 1e9), 10**9)
        return struct.pack("<II", whole % 2**32, part)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the data of a frame TIME."""
        whole, part = _unpack("<II", data, 0)
        return cls(whole + part / 1e9)


@dataclass(frozen=True, slots=True)
class ServoAngle:
    """Message servo_msgs/servo_array: setpoint of servo ``index`` in degrees, 0..180.

    The sketch's Servo library takes values from 544 on as the length of a pulse in microseconds.
    """

    index: int
    angle: int

    def pack(self) -> bytes:
        """Return the data of a frame on SERVO_TOPIC."""
        return struct.pack("<BH", self.index, self.angle)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the data of a frame on SERVO_TOPIC."""
        return cls(*_unpack("<BH", data, 0))


@dataclass(frozen=True, slots=True)
class Tacho:
    """Message tacho_msgs/tacho: turn rates of the wheels in revolutions per minute, forward positive."""

    left: float
    right: float

    def pack(self) -> bytes:
        """Return the data of a frame on TACHO_TOPIC."""
        return struct.pack("<ff", self.left, self.right)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the data of a frame on TACHO_TOPIC. Raises ValueError for rates that are not finite."""
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
