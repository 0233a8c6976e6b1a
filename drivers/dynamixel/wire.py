"""Dynamixel protocol 1.0 as bytes: packets built and found again, in both directions.

Request: ``FF FF ID LEN INST P1..PN CHK``; reply (status): ``FF FF ID LEN ERR P1..PN CHK``, with LEN = N + 2 and CHK the
inverted low byte of the sum of everything between header and checksum. Source: ROBOTIS e-Manual, protocol 1.0.
Protocol 2.0 frames, stuffs and checks differently: it belongs in a module of its own beside this one.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag

HEADER = b"\xff\xff"
BROADCAST = 0xFE
"""The ID that every servo obeys and none answers."""

GAP = 0.1
"""Seconds of silence inside a packet after which a servo forgets what it has heard of it."""

LONGEST = 0xFF - 2
"""Parameters that one packet can hold, in bytes."""


class Instruction(IntEnum):
    """What a request asks for."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04  # a write that is held until ACTION
    ACTION = 0x05
    FACTORY_RESET = 0x06
    SYNC_WRITE = 0x83  # to BROADCAST: address, size, then (id, data) for each servo
    BULK_READ = 0x92  # MX only


class Fault(IntFlag):
    """The error bits of a status packet."""

    VOLTAGE = 1
    ANGLE_LIMIT = 2
    OVERHEATING = 4
    RANGE = 8
    CHECKSUM = 16
    OVERLOAD = 32
    INSTRUCTION = 64

    @property
    def words(self) -> str:
        """The bits as words: ``overheating, overload``; empty when none is set."""
        return ", ".join((bit.name or hex(bit)).lower().replace("_", " ") for bit in self)


LASTING = Fault.VOLTAGE | Fault.OVERHEATING | Fault.OVERLOAD
"""Bits that describe the state of the servo, repeated in every reply while it lasts."""

REFUSAL = Fault.ANGLE_LIMIT | Fault.RANGE | Fault.INSTRUCTION
"""Bits that refuse the request itself."""


@dataclass(frozen=True, slots=True)
class Packet:
    """One frame: ``code`` is the instruction of a request, or the error bits of a status.

    ``intact`` is False when the checksum was wrong: then no field can be relied on.
    """

    id: int
    code: int
    parameters: bytes = b""
    intact: bool = True


def checksum(body: bytes) -> int:
    """Return the checksum of ``body``, everything from the ID to the last parameter."""
    return ~sum(body) & 0xFF


def request(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return a request to ``servo`` (0..253, or BROADCAST). Raises ValueError for what no packet can hold."""
    return _frame(servo, instruction, parameters)


def status(servo: int, error: int = 0, parameters: bytes = b"") -> bytes:
    """Return the reply of ``servo`` with its error bits. Raises ValueError for what no packet can hold."""
    return _frame(servo, error, parameters)


def _frame(servo: int, code: int, parameters: bytes) -> bytes:
    if not 0 <= servo <= BROADCAST:
        raise ValueError(f"a servo's ID is 0..253 or {BROADCAST} for all, not {servo}")
    if len(parameters) > LONGEST:
        raise ValueError(f"a packet holds {LONGEST} parameters, not {len(parameters)}")
    body = bytes((servo, len(parameters) + 2, code)) + parameters
    return HEADER + body + bytes((checksum(body),))


class Parser:
    """Finds packets in a stream cut anywhere, and finds its way back after noise.

    ``skipped`` counts bytes that belong to no intact packet, ``broken`` frames whose checksum was wrong.
    """

    def __init__(self) -> None:
        self.skipped = 0
        self.broken = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Packet]:
        """Take ``data``; return the packets that it completes, in order, broken ones marked as such.

        After a broken one the search goes on right behind its header: what looked like a frame may have been noise
        with a real one inside.
        """
        self._buffer += data
        found = []
        while self._align():
            end = self._buffer[3] + 4
            if len(self._buffer) < end:
                break
            body = bytes(self._buffer[2 : end - 1])
            intact = checksum(body) == self._buffer[end - 1]
            found.append(Packet(body[0], body[2], body[3:], intact))
            if intact:
                del self._buffer[:end]
            else:
                self.broken += 1
                self._skip(1)
        return found

    def reset(self) -> None:
        """Forget a packet that was never finished."""
        self._skip(len(self._buffer))

    def _align(self) -> bool:
        """Bring a possible packet to the front; False when there is none, or too little of it to know its length."""
        while (start := self._buffer.find(HEADER)) >= 0:
            self._skip(start)
            if len(self._buffer) < 4:
                return False
            if self._buffer[2] <= BROADCAST and self._buffer[3] >= 2:
                return True
            self._skip(1)
        self._skip(len(self._buffer) - self._buffer.endswith(HEADER[:1]))
        return False

    def _skip(self, count: int) -> None:
        self.skipped += count
        del self._buffer[:count]
