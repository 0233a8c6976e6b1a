"""Encoding of requests and decoding of replies in each servo protocol.

The protocols share most instructions. They differ in their frames, in the size of an address, and in the encoding of
errors. Feetech's protocol has the frames of protocol 1.0, and sync reads like 2.0.
"""

from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest
from drivers.servos import wire, wire2
from drivers.servos.register import RegisterBlock
from drivers.servos.units import Framing, Protocol, protocol_name
from drivers.servos.wire import BROADCAST, REFUSAL_FAULTS, Packet, PacketParser, ServoFault
from drivers.servos.wire2 import Protocol2Instruction

# The faults of each error byte, precomputed: every reply has one, and flags are slow to create.
_FAULTS_1 = tuple(ServoFault(error & wire.ERROR_BYTE) for error in range(256))
_FAULTS_2 = tuple(wire2.decode_error(error) for error in range(256))
_FAULTS_STS = tuple(wire.decode_sts_faults(error) for error in range(256))

KeptSettings = Literal["nothing", "id", "id and baud"]
"""Settings of a servo that survive its factory reset."""


class ServoReply(NamedTuple):
    """Reply of a servo: its faults, and the requested data."""

    id: int
    faults: ServoFault
    data: bytes


@dataclass(frozen=True, slots=True)
class Codec:
    """Codec of a servo protocol: encodes requests and decodes replies.

    ``frame`` returns the packet for a servo ID, an instruction and the bytes of its parameters; ``parser`` creates a
    packet parser. ``overhead`` is the size of a reply without its data, ``address_size`` that of an address,
    ``max_parameters`` the largest size of parameters that every servo can buffer, all in bytes.
    """

    protocol: Protocol
    last_id: int
    overhead: int
    address_size: Literal[1, 2]
    max_parameters: int
    frame: Callable[[int, int, bytes], bytes]
    parser: Callable[[], PacketParser]

    def reply(self, packet: Packet) -> ServoReply | None:
        """Decode an intact packet; return None if it is no reply."""
        if self.protocol == 1:
            return ServoReply(packet.id, _FAULTS_1[packet.code], packet.parameters)
        if self.protocol == "STS":
            return ServoReply(packet.id, _FAULTS_STS[packet.code], packet.parameters)
        if packet.code != wire2.STATUS or not packet.parameters:
            return None
        return ServoReply(packet.id, _FAULTS_2[packet.parameters[0]], packet.parameters[1:])

    def ping(self, servo: int) -> Packet:
        """Return a ping request to ``servo``; in protocol 2.0 BROADCAST pings all."""
        return Packet(servo, Protocol2Instruction.PING)

    def read(self, servo: int, block: RegisterBlock) -> Packet:
        """Return a request to read a block of the control table."""
        return Packet(servo, Protocol2Instruction.READ, self._encode_block(block))

    def write(self, servo: int, address: int, data: bytes) -> Packet:
        """Return a request to write ``data`` from ``address`` on."""
        return Packet(servo, Protocol2Instruction.WRITE, self._encode_number(address) + data)

    def max_sync_servos(self, size: int) -> int:
        """Return the number of servos that one sync write can address if each servo gets ``size`` bytes."""
        return (self.max_parameters - 2 * self.address_size) // (size + 1)

    def sync_write(self, address: int, size: int, blocks: Mapping[int, bytes]) -> Packet:
        """Return a request to write blocks of ``size`` bytes to many servos, without acknowledgement."""
        data = b"".join(bytes((servo,)) + block for servo, block in blocks.items())
        return Packet(
            BROADCAST, Protocol2Instruction.SYNC_WRITE, self._encode_block(RegisterBlock(address, size)) + data
        )

    def sync_read(self, servos: Collection[int], block: RegisterBlock) -> Packet:
        """Return a request to read the same block of many servos. Raises BadRequest in protocol 1.0."""
        if self.protocol == 1:
            raise self._unsupported_error("sync read", "read them one by one")
        return Packet(BROADCAST, Protocol2Instruction.SYNC_READ, self._encode_block(block) + bytes(servos))

    def bulk_read(self, blocks: Mapping[int, RegisterBlock]) -> Packet:
        """Return a request to read a block of each servo.

        Raises BadRequest for STS; in protocol 1.0 only MX support it.
        """
        if self.protocol == "STS":
            raise self._unsupported_error("bulk read", "read the same of all, by a sync read")
        if self.protocol == 1:
            rows = [bytes((0,)), *(bytes((block.size, servo, block.address)) for servo, block in blocks.items())]
        else:
            rows = [bytes((servo,)) + self._encode_block(block) for servo, block in blocks.items()]
        return Packet(BROADCAST, Protocol2Instruction.BULK_READ, b"".join(rows))

    def reboot(self, servo: int) -> Packet:
        """Return a request to reboot a servo. Raises BadRequest unless protocol 2.0."""
        if self.protocol != 2:
            raise self._unsupported_error("reboot", "write its torque limit and switch its torque on, or cut its power")
        return Packet(servo, Protocol2Instruction.REBOOT)

    def reset(self, servo: int, keep: KeptSettings) -> Packet:
        """Return a factory reset request. Raises BadRequest if the protocol cannot keep ``keep``."""
        if self.protocol == 1 and keep == "nothing":
            return Packet(servo, Protocol2Instruction.FACTORY_RESET)
        if self.protocol != 2:
            raise self._unsupported_error(
                f"factory reset that keeps the {keep}", "in protocol 1.0 keep nothing: its ID becomes 1"
            )
        return Packet(
            servo, Protocol2Instruction.FACTORY_RESET, bytes(({"nothing": 0xFF, "id": 1, "id and baud": 2}[keep],))
        )

    def _encode_number(self, value: int) -> bytes:
        try:
            return value.to_bytes(self.address_size, "little")
        except OverflowError:
            raise BadRequest(f"{protocol_name(self.protocol)} has no address or size {value}") from None

    def _encode_block(self, block: RegisterBlock) -> bytes:
        return self._encode_number(block.address) + self._encode_number(block.size)

    def _unsupported_error(self, operation: str, hint: str) -> BadRequest:
        return BadRequest(f"{protocol_name(self.protocol)} has no {operation}", hint=hint)


CODECS: Mapping[Protocol, Codec] = MappingProxyType(
    {
        1: Codec(1, wire.LAST_ID, 6, 1, wire.MAX_PACKET_BYTES - 6, wire.request, wire.PacketParser),
        2: Codec(2, wire2.LAST_ID, 11, 2, wire2.MAX_PARAMETERS, wire2.request, wire2.PacketParser2),
        "STS": Codec("STS", wire.LAST_ID, 6, 1, wire.MAX_PACKET_BYTES - 6, wire.request, wire.PacketParser),
    }
)
"""Codecs with the packet code of MissionTree, by protocol."""


def codecs_for(framing: Framing) -> Mapping[Protocol, Codec]:
    """Return the codecs by protocol, with the packet code of MissionTree (``framing`` "own") or of ROBOTIS ("sdk")."""
    if framing == "own":
        return CODECS
    from drivers.servos.sdk import SDK_CODECS  # noqa: PLC0415 - few ask for it

    return SDK_CODECS


# Overdue replies. They may still arrive, and must not be taken for the reply to another request.
#
# A reply contains its sender, but not its request: all replies of a servo with the same number of bytes look alike.
# So overdue replies are recorded by size, and no request with a reply of that size is sent meanwhile: a read is
# widened to another size; a write, whose reply has no data, has to wait.

MAX_REPLY_LATENESS = 0.05
"""Maximum seconds after its timeout at which a reply can still arrive if the servo has answered a newer request.

No USB adapter holds bytes back for longer.
"""

MAX_SIZE_ERROR = 2
"""Maximum number of bytes by which a damaged reply can seem longer than it is.

In protocol 1.0 a reply with a wrong length byte can pass the checksum, if the header of the next packet follows in
place of the missing bytes.
"""

LATE_REPLY_TIMEOUT = 1.0
"""Seconds after which a late reply is no longer expected, if the servo has not answered any newer request."""


class ExpectedReply(NamedTuple):
    """Reply that a servo is expected to send to ``request``: ``size`` bytes of data.

    Replies to equal requests are interchangeable. All attempts of one read are equal and share ``requested_at``, the
    time of the first attempt. Equal writes are equal requests, too.
    """

    request: object
    size: int
    requested_at: float


class _LateReply(NamedTuple):
    expected: ExpectedReply
    since: float


class LateReplies:
    """Replies that did not arrive in time, by servo ID. Times are those of the bus clock."""

    def __init__(self) -> None:
        self._late: dict[int, list[_LateReply]] = {}

    def add(self, servo: int, expected: ExpectedReply, now: float) -> None:
        """Record at time ``now`` that the ``expected`` reply of ``servo`` has not arrived in time."""
        kept = [owed for owed in self._late.get(servo, ()) if now - owed.since < LATE_REPLY_TIMEOUT]
        self._late[servo] = [*kept, _LateReply(expected, now)]

    def pop(self, servo: int, size: int) -> bool:
        """Remove a late reply with ``size`` bytes of data that has come from ``servo``; False if none was recorded."""
        for owed in self._late.get(servo, ()):
            if owed.expected.size == size:
                self._late[servo].remove(owed)
                return True
        return False

    def on_reply(self, servo: int, expected: ExpectedReply) -> None:
        """Remove the late replies of ``servo`` that cannot arrive any more once the ``expected`` reply has arrived."""
        if owed := self._late.get(servo):
            self._late[servo] = [o for o in owed if o.since > expected.requested_at - MAX_REPLY_LATENESS]

    def blocked_until(self, servo: int, expected: ExpectedReply, seconds: float = MAX_REPLY_LATENESS) -> float:
        """Return the time from which on no late reply of ``servo`` can be mistaken for the ``expected`` reply.

        That is ``seconds`` after the last similar late reply was recorded; 0 if there is none.
        """
        if not self._late.get(servo):
            return 0.0
        return max(
            (
                owed.since + seconds
                for owed in self._late[servo]
                if 0 <= expected.size - owed.expected.size <= MAX_SIZE_ERROR
                and owed.expected.request != expected.request
            ),
            default=0.0,
        )

    def is_clear(self, servo: int, expected: ExpectedReply, now: float) -> bool:
        """True if at time ``now`` no late reply of ``servo`` can be mistaken for the ``expected`` reply."""
        return now >= self.blocked_until(servo, expected, LATE_REPLY_TIMEOUT)

    def widen(self, servo: int, block: RegisterBlock, request: object, now: float) -> RegisterBlock:
        """Return the smallest block around ``block`` whose reply cannot be mistaken for a late reply of ``servo``.

        ``request`` identifies the read that the block is for, and ``now`` is the time at which it began.
        """
        wide = block
        while self._late.get(servo) and not self.is_clear(servo, ExpectedReply(request, wide.size, now), now):
            wide = RegisterBlock(max(0, wide.address - 1), wide.size + 1)
        return wide

    def reset(self) -> None:
        """Forget all late replies: the port was reopened, or its baud rate has changed."""
        self._late.clear()


class Exchange:
    """Replies to one request, sorted as they arrive.

    ``replies`` holds the replies with data, and refusals, by ID of the servo. ``damaged`` holds the servos that sent a
    damaged reply, or reported that the request was damaged. ``missing`` holds the servos that may still answer.
    ``has_damaged_packet`` is True after a packet that may have been a damaged reply. ``duplicates`` holds the IDs of
    surplus replies. ``on_stray`` is called with each unexpected intact reply and returns True for a late one. A packet
    equal to one of ``recent_requests`` is an echo of the adapter.
    """

    def __init__(
        self,
        codec: Codec,
        expected: Mapping[int, ExpectedReply],
        on_stray: Callable[[ServoReply], bool],
        recent_requests: Collection[Packet] = (),
    ) -> None:
        self.codec = codec
        self.replies: dict[int, ServoReply] = {}
        self.damaged: set[int] = set()
        self.duplicates: list[int] = []
        self.missing = dict(expected)
        self.has_damaged_packet = False
        self._on_stray = on_stray
        self._recent_requests = recent_requests

    def receive(self, packet: Packet) -> None:
        """Sort one packet; a reply counts only if it is intact, expected and of the right size."""
        reply = self.codec.reply(packet)
        if reply is None or (reply.faults and packet in self._recent_requests):  # as a reply, any echo has error bits
            return
        wanted = self.missing.get(reply.id)
        size = len(reply.data)
        if not packet.intact:
            self.has_damaged_packet = True
            if wanted and size == wanted.size:
                self._mark_damaged(reply.id)
        elif wanted is None:
            if not self._on_stray(reply):
                self.duplicates.append(reply.id)
        elif not size and reply.faults & ServoFault.CHECKSUM:  # the servo received a damaged request
            self._mark_damaged(reply.id)
        elif size == wanted.size or (not size and reply.faults & REFUSAL_FAULTS and not self._on_stray(reply)):
            self.replies[reply.id] = reply
            del self.missing[reply.id]
        elif size and not self._on_stray(reply):
            self.has_damaged_packet = True

    def _mark_damaged(self, servo: int) -> None:
        self.damaged.add(servo)
        del self.missing[servo]
