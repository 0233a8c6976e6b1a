"""Dynamixel protocol 2.0 as bytes: packets encoded and parsed, in both directions.

Request: ``FF FF FD 00 ID LENL LENH INST P1..PN CRCL CRCH``; reply (status): the same with INST = 55 and an error byte
as first parameter. LEN = N + 3 counts the bytes on the wire, after stuffing: inside INST..PN each ``FF FF FD`` is sent
as ``FF FF FD FD``, so that no header can begin there. Source: ROBOTIS e-Manual, protocol 2.0.
"""

from enum import IntEnum
from functools import lru_cache
from typing import ClassVar, Final

from drivers.servos import wire
from drivers.servos.wire import BROADCAST, Packet, ServoFault

HEADER = b"\xff\xff\xfd\x00"
LAST_ID = 0xFC

STATUS = 0x55
"""Instruction in a reply of protocol 2.0."""

ALERT = 0x80
"""Bit of the error byte that reports a hardware fault; register 70 has the fault itself."""

MAX_PARAMETERS = 1000
"""Maximum parameters of our packets, in bytes before stuffing: no control table is longer."""

_OVERHEAD = len(HEADER) + 3  # the bytes not counted by LEN
_MAX_LEN = (MAX_PARAMETERS + 2) * 4 // 3 + 3  # the largest LEN, with maximum stuffing

_FORBIDDEN, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"


class Protocol2Instruction(IntEnum):
    """Instructions of requests in protocol 2.0. Addresses and sizes are two bytes."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04  # a write that is held until ACTION
    ACTION = 0x05
    FACTORY_RESET = 0x06  # FF: everything, 01: all but the ID, 02: all but ID and baud rate
    REBOOT = 0x08
    CLEAR = 0x10  # 01 44 58 4C 22: the turns counted so far
    SYNC_READ = 0x82  # to BROADCAST: address, size, then the IDs
    SYNC_WRITE = 0x83  # to BROADCAST: address, size, then (id, data) for each servo
    BULK_READ = 0x92  # to BROADCAST: (id, address, size) for each servo
    BULK_WRITE = 0x93


class Protocol2Error(IntEnum):
    """Reason of a refusal: the low seven bits of the error byte."""

    NONE = 0
    FAILED = 1
    INSTRUCTION = 2
    CRC = 3
    RANGE = 4  # beyond the register's range
    LENGTH = 5
    LIMIT = 6  # beyond a limit set in the servo
    ACCESS = 7


_FAULTS: Final = {
    Protocol2Error.NONE: ServoFault(0),
    Protocol2Error.INSTRUCTION: ServoFault.INSTRUCTION,
    Protocol2Error.CRC: ServoFault.CHECKSUM,
    Protocol2Error.RANGE: ServoFault.RANGE,
    Protocol2Error.LENGTH: ServoFault.LENGTH,
    Protocol2Error.LIMIT: ServoFault.LIMIT,
    Protocol2Error.ACCESS: ServoFault.ACCESS,
}


def decode_error(error: int) -> ServoFault:
    """Return the faults of a status error byte; unknown numbers count as FAILED."""
    fault = _FAULTS.get(
        Protocol2Error(error & 7) if error & 0x7F <= Protocol2Error.ACCESS else Protocol2Error.FAILED, ServoFault.FAILED
    )
    return fault | ServoFault.ALERT if error & ALERT else fault


def decode_hardware_error(value: int) -> ServoFault:
    """Return the faults of register 70, hardware_error_status."""
    bits = {
        0: ServoFault.VOLTAGE,
        2: ServoFault.OVERHEATING,
        3: ServoFault.ENCODER,
        4: ServoFault.SHOCK,
        5: ServoFault.OVERLOAD,
    }
    found = ServoFault(0)
    for bit, fault in bits.items():
        if value >> bit & 1:
            found |= fault
    return found


def _row(index: int) -> int:
    remainder = index << 8
    for _ in range(8):
        remainder = remainder << 1 ^ (0x8005 if remainder & 0x8000 else 0)
    return remainder & 0xFFFF


_TABLE: Final = tuple(_row(index) for index in range(256))


def crc(data: bytes) -> int:
    """Return the CRC-16 (CRC16) of ``data``.

    Polynomial 8005, initial value 0, highest bit first, not reflected or inverted.
    """
    value = 0
    for byte in data:
        value = (value << 8 & 0xFF00) ^ _TABLE[value >> 8 ^ byte]
    return value


def stuff(body: bytes) -> bytes:
    """Return ``body`` (INST to the last parameter) with byte stuffing."""
    return body.replace(_FORBIDDEN, _STUFFED)


def unstuff(body: bytes) -> bytes:
    """Return ``body`` without byte stuffing."""
    return body.replace(_STUFFED, _FORBIDDEN)


@lru_cache(maxsize=512)  # an arm sends the same requests in every round
def request(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return a request to ``servo`` (0..252, or BROADCAST). Raises ValueError if it does not fit a packet."""
    return _frame(servo, instruction, parameters)


def status(servo: int, error: int = 0, parameters: bytes = b"") -> bytes:
    """Return the reply of ``servo`` with its error byte. Raises ValueError if it does not fit a packet."""
    return _frame(servo, STATUS, bytes((error,)) + parameters)


def _frame(servo: int, instruction: int, parameters: bytes) -> bytes:
    if not (0 <= servo <= LAST_ID or servo == BROADCAST):
        raise ValueError(f"a servo's ID is 0..{LAST_ID} or {BROADCAST} for all, not {servo}")
    if len(parameters) > MAX_PARAMETERS:
        raise ValueError(f"a packet holds {MAX_PARAMETERS} parameters, not {len(parameters)}")
    body = stuff(bytes((instruction,)) + parameters)
    frame = HEADER + bytes((servo,)) + (len(body) + 2).to_bytes(2, "little") + body
    return frame + crc(frame).to_bytes(2, "little")


class PacketParser2(wire.PacketParser):
    """Finds packets of protocol 2.0 in a stream of chunks, and resynchronises after noise."""

    header: ClassVar[bytes] = HEADER
    preamble: ClassVar[int] = _OVERHEAD

    def _size(self) -> int | None:
        servo, length = self._buffer[4], self._buffer[5] | self._buffer[6] << 8
        named = servo <= LAST_ID or servo == BROADCAST
        return length + _OVERHEAD if named and 3 <= length <= _MAX_LEN else None

    def _packet(self, frame: bytes) -> Packet:
        body = unstuff(frame[_OVERHEAD:-2])
        return Packet(frame[4], body[0], body[1:], crc(frame[:-2]) == int.from_bytes(frame[-2:], "little"))
