"""Requests and replies of the RPLIDAR protocol; the measurements of a scan are in ``nodes.py``.

A request is ``A5 CMD``; for commands from 0x80 on ``A5 CMD SIZE payload CHK``, where CHK is the XOR of all bytes before
it. A reply begins with a descriptor, ``A5 5A`` and five bytes: the length of the data in 30 bits, two bits that tell
whether it is repeated, and its type. Numbers are little-endian. Replies have no checksum of their own.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from operator import xor
from struct import Struct
from typing import Self

BAUD = 115200
"""Baud rate of the A1 and A2, 8N1."""

START_BYTE = 0xA5
"""First byte of a request and of a descriptor."""


class RPLidarCommand(IntEnum):
    """Commands; STOP, RESET and PWM have no reply."""

    SCAN = 0x20
    FORCE_SCAN = 0x21
    STOP = 0x25
    RESET = 0x40
    INFO = 0x50
    HEALTH = 0x52
    SAMPLE_RATES = 0x59
    EXPRESS = 0x82
    SETTING = 0x84
    PWM = 0xF0
    BOARD = 0xFF


_WITH_PAYLOAD = 0x80
_DESCRIPTOR = Struct("<BBIB")
_REPEATED = 1 << 30
_PWM = Struct("<H")


def request(command: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a request. Raises ValueError for a payload that is too long or not taken by ``command``."""
    if command < _WITH_PAYLOAD:
        if payload:
            raise ValueError(f"RPLIDAR command {command:#x} takes no payload")
        return bytes([START_BYTE, command])
    if len(payload) > 255:
        raise ValueError(f"an RPLIDAR payload has 255 bytes at most, not {len(payload)}")
    body = bytes([START_BYTE, command, len(payload)]) + payload
    return body + bytes([reduce(xor, body)])


def motor_request(pwm: int) -> bytes:
    """Return the request that sets the motor to the duty cycle ``pwm`` of 1023; 0 stops it."""
    return request(RPLidarCommand.PWM, _PWM.pack(pwm))


def unpack_pwm(payload: bytes) -> int:
    """Return the duty cycle of a PWM request. Raises struct.error for another payload."""
    (pwm,) = _PWM.unpack(payload)
    return int(pwm)


BOARD_REQUEST = request(RPLidarCommand.BOARD, bytes(4))
"""Asks the adapter board of an A2 whether it can set the motor's duty cycle: bit 0 of the reply."""


def descriptor(length: int, kind: int, *, repeated: bool = False) -> bytes:
    """Return the descriptor that begins a reply of the type ``kind`` with ``length`` bytes of data.

    ``repeated`` marks a series of replies, such as a scan.
    """
    return _DESCRIPTOR.pack(START_BYTE, 0x5A, length | (_REPEATED if repeated else 0), kind)


INFO_REPLY = descriptor(20, 0x04)
HEALTH_REPLY = descriptor(3, 0x06)
BOARD_REPLY = descriptor(4, 0xFF)
SCAN_REPLY = descriptor(5, 0x81, repeated=True)
EXPRESS_REPLY = descriptor(84, 0x82, repeated=True)
RATES_REPLY = descriptor(4, 0x15)

EXPRESS_REQUEST = request(RPLidarCommand.EXPRESS, bytes(5))
"""Request for an express scan in the first scan mode, which all devices with express scans have."""


def setting_reply(payload: bytes) -> bytes:
    """Return the reply to ``RPLidarCommand.SETTING`` with its descriptor."""
    return descriptor(len(payload), 0x20) + payload


@dataclass(frozen=True, slots=True)
class RPLidarInfo:
    """Model and firmware of a device, as in the info reply.

    ``model >> 4`` is the series in its name, such as 1 for an A1. ``serial`` has 16 bytes.
    """

    LAYOUT = Struct("<4B16s")

    model: int
    firmware_minor: int
    firmware_major: int
    hardware: int
    serial: bytes

    @property
    def firmware(self) -> tuple[int, int]:
        """Firmware version, major and minor."""
        return self.firmware_major, self.firmware_minor

    @property
    def series(self) -> int:
        """Series of the model: 1 for an A1, 2 for an A2."""
        return self.model >> 4

    def pack(self) -> bytes:
        """Return the 20 bytes of the info reply. Raises struct.error for a value out of range."""
        return self.LAYOUT.pack(self.model, self.firmware_minor, self.firmware_major, self.hardware, self.serial)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the 20 bytes of an info reply. Raises struct.error for another number of bytes."""
        return cls(*cls.LAYOUT.unpack(data))


class RPLidarStatus(IntEnum):
    """Health status of a device."""

    GOOD = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True, slots=True)
class RPLidarHealth:
    """Health report: an ``RPLidarStatus`` as a number, and the vendor's error ``code``."""

    LAYOUT = Struct("<BH")

    status: int
    code: int = 0

    def pack(self) -> bytes:
        """Return the three bytes of the health reply. Raises struct.error for a value out of range."""
        return self.LAYOUT.pack(self.status, self.code)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the three bytes of a health reply. Raises struct.error for another number of bytes."""
        return cls(*cls.LAYOUT.unpack(data))


class RequestFinder:
    """Finds requests in the stream of bytes that a virtual RPLIDAR receives."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Add received bytes; return the complete commands, each with its payload."""
        self._buffer += data
        requests: list[tuple[int, bytes]] = []
        while True:
            start = self._buffer.find(START_BYTE)
            del self._buffer[: start if start >= 0 else len(self._buffer)]
            size = self._size()
            if size is None or len(self._buffer) < size:
                return requests
            whole = bytes(self._buffer[:size])
            if size > 2 and reduce(xor, whole) != 0:
                del self._buffer[0]
                continue
            requests.append((whole[1], whole[3:-1]))
            del self._buffer[:size]

    def _size(self) -> int | None:
        """Return the size in bytes of the request that begins the buffer; None if not known yet."""
        if len(self._buffer) < 2 or (self._buffer[1] >= _WITH_PAYLOAD and len(self._buffer) < 3):
            return None
        return 2 if self._buffer[1] < _WITH_PAYLOAD else 4 + self._buffer[2]
