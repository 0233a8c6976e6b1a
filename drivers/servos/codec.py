"""What a bus says and hears, in each protocol: requests by their meaning, and what a reply comes to.

The protocols share most instructions; they differ in their frames, in the width of an address, and in how a servo
complains. Feetech's has the frames of protocol 1.0, and reads many servos at once as 2.0 does.
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

# What each error byte says, made ready: every reply has one, and flags are slow to make.
_FAULTS_1 = tuple(ServoFault(error & wire.ERROR_BYTE) for error in range(256))
_FAULTS_2 = tuple(wire2.decode_error(error) for error in range(256))
_FAULTS_STS = tuple(wire.decode_sts_faults(error) for error in range(256))

KeptSettings = Literal["nothing", "id", "id and baud"]
"""What a factory reset leaves as it is."""


class ServoReply(NamedTuple):
    """What a servo has answered: its complaints, and the data asked for."""

    id: int
    faults: ServoFault
    data: bytes


@dataclass(frozen=True, slots=True)
class Codec:
    """One protocol. ``frame`` makes bytes of servo, instruction and parameters, ``parser`` makes packets of bytes.

    ``overhead`` is the bytes of a reply beside its data, ``address_size`` those of an address, ``max_parameters`` what the
    parameters of a request may come to for every servo to have room for it.
    """

    protocol: Protocol
    last_id: int
    overhead: int
    address_size: Literal[1, 2]
    max_parameters: int
    frame: Callable[[int, int, bytes], bytes]
    parser: Callable[[], PacketParser]

    def reply(self, packet: Packet) -> ServoReply | None:
        """Return what an intact packet says; None when it is no reply."""
        if self.protocol == 1:
            return ServoReply(packet.id, _FAULTS_1[packet.code], packet.parameters)
        if self.protocol == "STS":
            return ServoReply(packet.id, _FAULTS_STS[packet.code], packet.parameters)
        if packet.code != wire2.STATUS or not packet.parameters:
            return None
        return ServoReply(packet.id, _FAULTS_2[packet.parameters[0]], packet.parameters[1:])

    def ping(self, servo: int) -> Packet:
        """Ask whether ``servo`` is there; BROADCAST asks all, in protocol 2.0."""
        return Packet(servo, Protocol2Instruction.PING)

    def read(self, servo: int, block: RegisterBlock) -> Packet:
        """Ask for a block of the table."""
        return Packet(servo, Protocol2Instruction.READ, self._encode_block(block))

    def write(self, servo: int, address: int, data: bytes) -> Packet:
        """Write ``data`` from ``address`` on."""
        return Packet(servo, Protocol2Instruction.WRITE, self._encode_number(address) + data)

    def max_sync_servos(self, size: int) -> int:
        """Return how many servos one sync write of ``size`` bytes for each can serve."""
        return (self.max_parameters - 2 * self.address_size) // (size + 1)

    def sync_write(self, address: int, size: int, blocks: Mapping[int, bytes]) -> Packet:
        """Write blocks of ``size`` bytes to many servos, of which none answers."""
        data = b"".join(bytes((servo,)) + block for servo, block in blocks.items())
        return Packet(
            BROADCAST, Protocol2Instruction.SYNC_WRITE, self._encode_block(RegisterBlock(address, size)) + data
        )

    def sync_read(self, servos: Collection[int], block: RegisterBlock) -> Packet:
        """Ask many servos for the same block. Raises BadRequest in protocol 1.0."""
        if self.protocol == 1:
            raise self._unsupported_error("sync read", "read them one by one")
        return Packet(BROADCAST, Protocol2Instruction.SYNC_READ, self._encode_block(block) + bytes(servos))

    def bulk_read(self, blocks: Mapping[int, RegisterBlock]) -> Packet:
        """Ask many servos for a block each. In protocol 1.0 only the MX know it, and no STS does. Raises BadRequest."""
        if self.protocol == "STS":
            raise self._unsupported_error("bulk read", "read the same of all, by a sync read")
        if self.protocol == 1:
            rows = [bytes((0,)), *(bytes((block.size, servo, block.address)) for servo, block in blocks.items())]
        else:
            rows = [bytes((servo,)) + self._encode_block(block) for servo, block in blocks.items()]
        return Packet(BROADCAST, Protocol2Instruction.BULK_READ, b"".join(rows))

    def reboot(self, servo: int) -> Packet:
        """Start the servo anew. Raises BadRequest but in protocol 2.0."""
        if self.protocol != 2:
            raise self._unsupported_error("reboot", "write its torque limit and switch its torque on, or cut its power")
        return Packet(servo, Protocol2Instruction.REBOOT)

    def reset(self, servo: int, keep: KeptSettings) -> Packet:
        """Set the servo back to what it was delivered as. Raises BadRequest for what protocol 1.0 cannot keep."""
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
"""The protocols."""


def codecs_for(framing: Framing) -> Mapping[Protocol, Codec]:
    """Return the protocols, framed by our code or by the vendor's."""
    if framing == "own":
        return CODECS
    from drivers.servos.sdk import SDK_CODECS  # noqa: PLC0415 - few ask for it

    return SDK_CODECS


# Replies that did not come in time. They may still come, and must not be taken for the answer to something else.
#
# A reply says who sends it, but not what it answers: all replies of a servo with the same number of bytes look alike.
# So what a servo still owes is remembered by size, and nothing else of that size is asked of it meanwhile: a read is
# widened to another size, a write, whose reply has no data, has to wait.

MAX_REPLY_LATENESS = 0.05
"""Seconds by which a reply can be late, and be overtaken by another. No adapter holds bytes back for longer."""

MAX_SIZE_ERROR = 2
"""Bytes by which a reply can look longer than it is: where its length is wrong by so much, in protocol 1.0, the header
of the next packet makes its checksum right."""

LATE_REPLY_TIMEOUT = 1.0
"""Seconds after which a reply will not come any more, from a servo that has not answered anything else either."""


class ExpectedReply(NamedTuple):
    """What a servo is asked for: a reply with ``size`` bytes of data.

    Replies to equal questions are as good as each other: those to the tries of one read, which ``requested_at`` at one time,
    and those to equal writes.
    """

    request: object
    size: int
    requested_at: float


class _LateReply(NamedTuple):
    expected: ExpectedReply
    since: float


class LateReplies:
    """What the servos of a bus owe, by ID. Times are those of the bus's clock."""

    def __init__(self) -> None:
        self._late: dict[int, list[_LateReply]] = {}

    def add(self, servo: int, expected: ExpectedReply, now: float) -> None:
        """Remember that ``servo`` has not answered."""
        kept = [owed for owed in self._late.get(servo, ()) if now - owed.since < LATE_REPLY_TIMEOUT]
        self._late[servo] = [*kept, _LateReply(expected, now)]

    def pop(self, servo: int, size: int) -> bool:
        """Strike off a reply that has come after all; return whether one of that size was owed."""
        for owed in self._late.get(servo, ()):
            if owed.expected.size == size:
                self._late[servo].remove(owed)
                return True
        return False

    def on_reply(self, servo: int, expected: ExpectedReply) -> None:
        """Strike off what will not come any more, for the servo has answered what it was asked long after that."""
        if owed := self._late.get(servo):
            self._late[servo] = [o for o in owed if o.since > expected.requested_at - MAX_REPLY_LATENESS]

    def blocked_until(self, servo: int, expected: ExpectedReply, seconds: float = MAX_REPLY_LATENESS) -> float:
        """Return when the last reply that could be mistaken for the one ``expected`` is ``seconds`` overdue."""
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
        """Return whether nothing that is owed could be mistaken for the reply that is ``expected``."""
        return now >= self.blocked_until(servo, expected, LATE_REPLY_TIMEOUT)

    def widen(self, servo: int, block: RegisterBlock, request: object, now: float) -> RegisterBlock:
        """Return the smallest block that contains ``block`` and whose reply cannot be mistaken for one that is owed."""
        wide = block
        while self._late.get(servo) and not self.is_clear(servo, ExpectedReply(request, wide.size, now), now):
            wide = RegisterBlock(max(0, wide.address - 1), wide.size + 1)
        return wide

    def reset(self) -> None:
        """Forget everything: nothing of what was asked can be answered any more."""
        self._late.clear()


class Exchange:
    """Takes packets as they arrive, and sorts them.

    ``replies`` holds what has been answered or refused, by ID; ``damaged`` the servos whose reply, or whose request,
    was damaged on its way; ``missing`` those that may still answer. ``has_damaged_packet`` is True once something came that may
    have been a reply of theirs. ``duplicates`` holds the IDs of replies beyond the one that was requested. ``stray`` is
    told every sound reply that nobody waits for, and says whether it was
    owed from before; what equals one of ``sent`` is the adapter's echo of our own request.
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
        """Take one packet; a reply counts only if it is whole, from a servo that is asked, and of the right size."""
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
        elif not size and reply.faults & ServoFault.CHECKSUM:  # what the servo has heard was damaged
            self._mark_damaged(reply.id)
        elif size == wanted.size or (not size and reply.faults & REFUSAL_FAULTS and not self._on_stray(reply)):
            self.replies[reply.id] = reply
            del self.missing[reply.id]
        elif size and not self._on_stray(reply):
            self.has_damaged_packet = True

    def _mark_damaged(self, servo: int) -> None:
        self.damaged.add(servo)
        del self.missing[servo]
