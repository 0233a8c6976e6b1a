"""Dynamixel protocol 1.0 as bytes: packets encoded and parsed, in both directions.

Request: ``FF FF ID LEN INST P1..PN CHK``; reply (status): ``FF FF ID LEN ERR P1..PN CHK``, with LEN = N + 2 and CHK the
inverted low byte of the sum of all bytes between header and checksum. Source: ROBOTIS e-Manual, protocol 1.0. ``wire2``
is protocol 2.0 with the same interface; the common parts are here.

Feetech's STS and SMS servos share the frames of protocol 1.0. They acknowledge every intact request, also one that they
do not execute. They do not answer a damaged request. Replies to a broadcast ping collide. Source: the maker's protocol
manual and memory table.
"""

from enum import IntEnum, IntFlag
from functools import lru_cache
from typing import ClassVar, Final

from drivers.api.fast_dataclass import dataclass

HEADER = b"\xff\xff"
BROADCAST = 0xFE
"""ID that every servo obeys and no servo acknowledges."""

LAST_ID = 0xFD

PACKET_TIMEOUT = 0.1
"""Seconds of silence inside a packet after which a servo discards the bytes received so far."""

MAX_PARAMETERS = 0xFF - 2
"""Maximum parameters of a packet, in bytes."""

MAX_PACKET_BYTES = 143
"""Packet size in bytes that every servo can buffer. Source: e-Manual, sync write of the RX-64."""


class Protocol1Instruction(IntEnum):
    """Instructions of requests in protocol 1.0."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04  # a write that is held until ACTION
    ACTION = 0x05
    FACTORY_RESET = 0x06
    SYNC_WRITE = 0x83  # to BROADCAST: address, size, then (id, data) for each servo
    BULK_READ = 0x92  # MX only; to BROADCAST: 0, then (size, id, address) for each servo


class ServoFault(IntFlag):
    """Faults that a reply can report. The bits up to INSTRUCTION are the error byte of protocol 1.0."""

    VOLTAGE = 1
    ANGLE_LIMIT = 2
    OVERHEATING = 4
    RANGE = 8
    CHECKSUM = 16
    OVERLOAD = 32
    INSTRUCTION = 64
    # Protocol 2.0 alone:
    ENCODER = 128
    SHOCK = 256  # electrical, or too little power
    ACCESS = 512  # a register that cannot be written, or not while the torque is on
    FAILED = 1024  # the request could not be carried out
    LENGTH = 2048  # too few bytes for the register
    LIMIT = 4096  # beyond a limit set in the servo
    ALERT = 8192  # see register 70, hardware_error_status
    # STS alone:
    CURRENT = 16384

    @property
    def description(self) -> str:
        """The faults as text: ``overheating, overload``; empty if there are none."""
        return ", ".join((bit.name or hex(bit)).lower().replace("_", " ") for bit in self)


ERROR_BYTE = 0x7F
"""Bits of ``ServoFault`` that protocol 1.0 has."""

LASTING_FAULTS = (
    ServoFault.VOLTAGE
    | ServoFault.OVERHEATING
    | ServoFault.OVERLOAD
    | ServoFault.ENCODER
    | ServoFault.SHOCK
    | ServoFault.CURRENT
)
"""Faults of the servo itself, repeated in every reply (protocol 1.0, STS) while they last."""

REFUSAL_FAULTS = (
    ServoFault.ANGLE_LIMIT
    | ServoFault.RANGE
    | ServoFault.INSTRUCTION
    | ServoFault.ACCESS
    | ServoFault.FAILED
    | ServoFault.LENGTH
    | ServoFault.LIMIT
)
"""Faults of the request, which was refused."""


@dataclass(frozen=True, slots=True)
class Packet:
    """Packet of a servo protocol: ``code`` is the instruction of a request, or the error bits of a status.

    (In protocol 2.0 a status also has an instruction, and its error is the first parameter.) ``intact`` is False if the
    checksum was wrong: then no field is reliable.
    """

    id: int
    code: int
    parameters: bytes = b""
    intact: bool = True


def checksum(body: bytes) -> int:
    """Return the checksum of ``body``, the bytes from the ID to the last parameter."""
    return ~sum(body) & 0xFF


@lru_cache(maxsize=512)  # an arm sends the same requests in every round
def request(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return a request to ``servo`` (0..253, or BROADCAST). Raises ValueError if it does not fit a packet."""
    return _frame(servo, instruction, parameters)


def status(servo: int, error: int = 0, parameters: bytes = b"") -> bytes:
    """Return the reply of ``servo`` with its error bits. Raises ValueError if it does not fit a packet."""
    return _frame(servo, int(error) & ERROR_BYTE, parameters)


def _frame(servo: int, code: int, parameters: bytes) -> bytes:
    if not 0 <= servo <= BROADCAST:
        raise ValueError(f"a servo's ID is 0..{LAST_ID} or {BROADCAST} for all, not {servo}")
    if len(parameters) > MAX_PARAMETERS:
        raise ValueError(f"a packet holds {MAX_PARAMETERS} parameters, not {len(parameters)}")
    body = bytes((servo, len(parameters) + 2, code)) + parameters
    return HEADER + body + bytes((checksum(body),))


class PacketParser:
    """Finds packets in a stream of chunks, and resynchronises after noise.

    ``skipped_bytes`` counts bytes outside of intact packets, ``damaged_packets`` frames with a wrong checksum.
    """

    header: ClassVar[bytes] = HEADER
    preamble: ClassVar[int] = 4
    """Number of bytes at the front of a packet from which its size is known."""

    def __init__(self) -> None:
        self.skipped_bytes = 0
        self.damaged_packets = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Packet]:
        """Add ``data``; return the packets that it completes, in order, with damaged ones marked.

        After a damaged packet the search continues right behind its header: noise may look like a frame with a real one
        inside.
        """
        self._buffer += data
        found = []
        while self._buffer and (end := self._align()) is not None and len(self._buffer) >= end:
            packet = self._packet(bytes(self._buffer[:end]))
            found.append(packet)
            if packet.intact:
                del self._buffer[:end]
            else:
                self.damaged_packets += 1
                self._skip(1)
        return found

    def reset(self) -> None:
        """Discard the incomplete packet in the buffer."""
        if self._buffer:
            self._skip(len(self._buffer))

    def _align(self) -> int | None:
        """Move the next possible packet to the front of the buffer; return its size, None while that is unknown."""
        while (start := self._buffer.find(self.header)) >= 0:
            if start:
                self._skip(start)
            if len(self._buffer) < self.preamble:
                return None
            if (size := self._size()) is not None:
                return size
            self._skip(1)
        cut = next(n for n in range(len(self.header) - 1, -1, -1) if self._buffer.endswith(self.header[:n]))
        self._skip(len(self._buffer) - cut)
        return None

    def _size(self) -> int | None:
        """Return the size of the packet at the front; None if no packet begins like this."""
        servo, length = self._buffer[2], self._buffer[3]
        return length + 4 if servo <= BROADCAST and length >= 2 else None

    def _packet(self, frame: bytes) -> Packet:
        """Decode a frame of the right size."""
        return Packet(frame[2], frame[4], frame[5:-1], checksum(frame[2:-1]) == frame[-1])

    def _skip(self, count: int) -> None:
        self.skipped_bytes += count
        del self._buffer[:count]


_STS_BITS: Final = {
    0: ServoFault.VOLTAGE,
    1: ServoFault.ENCODER,
    2: ServoFault.OVERHEATING,
    3: ServoFault.CURRENT,
    5: ServoFault.OVERLOAD,
}


def decode_sts_faults(status: int) -> ServoFault:
    """Return the faults in ``status``: the error byte of a reply of an STS, or its register 65."""
    found = ServoFault(0)
    for bit, fault in _STS_BITS.items():
        if status >> bit & 1:
            found |= fault
    return found


def encode_sts_faults(faults: ServoFault) -> int:
    """Return the error byte for ``faults``."""
    return sum(1 << bit for bit, fault in _STS_BITS.items() if faults & fault)
