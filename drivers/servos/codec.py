"""What a bus says and hears, in each protocol: requests by their meaning, and what a reply comes to.

The protocols share most instructions; they differ in their frames, in the width of an address, and in how a servo
complains. Feetech's has the frames of protocol 1.0, and reads many servos at once as 2.0 does.
"""

from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

from drivers.api.quick import dataclass
from drivers.errors import BadRequest
from drivers.servos import wire, wire2
from drivers.servos.register import Block
from drivers.servos.units import Framing, Protocol, called
from drivers.servos.wire import BROADCAST, REFUSAL, Fault, Packet, Parser
from drivers.servos.wire2 import Instruction

# What each error byte says, made ready: every reply has one, and flags are slow to make.
_FAULTS_1 = tuple(Fault(error & wire.ERROR_BYTE) for error in range(256))
_FAULTS_2 = tuple(wire2.faults_of(error) for error in range(256))
_FAULTS_STS = tuple(wire.sts_faults(error) for error in range(256))

Keep = Literal["nothing", "id", "id and baud"]
"""What a factory reset leaves as it is."""


class Reply(NamedTuple):
    """What a servo has answered: its complaints, and the data asked for."""

    id: int
    faults: Fault
    data: bytes


@dataclass(frozen=True, slots=True)
class Codec:
    """One protocol. ``frame`` makes bytes of servo, instruction and parameters, ``parser`` makes packets of bytes.

    ``overhead`` is the bytes of a reply beside its data, ``width`` those of an address, ``longest`` what the
    parameters of a request may come to for every servo to have room for it.
    """

    protocol: Protocol
    last_id: int
    overhead: int
    width: Literal[1, 2]
    longest: int
    frame: Callable[[int, int, bytes], bytes]
    parser: Callable[[], Parser]

    def reply(self, packet: Packet) -> Reply | None:
        """Return what an intact packet says; None when it is no reply."""
        if self.protocol == 1:
            return Reply(packet.id, _FAULTS_1[packet.code], packet.parameters)
        if self.protocol == "STS":
            return Reply(packet.id, _FAULTS_STS[packet.code], packet.parameters)
        if packet.code != wire2.STATUS or not packet.parameters:
            return None
        return Reply(packet.id, _FAULTS_2[packet.parameters[0]], packet.parameters[1:])

    def ping(self, servo: int) -> Packet:
        """Ask whether ``servo`` is there; BROADCAST asks all, in protocol 2.0."""
        return Packet(servo, Instruction.PING)

    def read(self, servo: int, block: Block) -> Packet:
        """Ask for a block of the table."""
        return Packet(servo, Instruction.READ, self._place(block))

    def write(self, servo: int, address: int, data: bytes) -> Packet:
        """Write ``data`` from ``address`` on."""
        return Packet(servo, Instruction.WRITE, self._number(address) + data)

    def sync_room(self, size: int) -> int:
        """Return how many servos one sync write of ``size`` bytes for each can serve."""
        return (self.longest - 2 * self.width) // (size + 1)

    def sync_write(self, address: int, size: int, blocks: Mapping[int, bytes]) -> Packet:
        """Write blocks of ``size`` bytes to many servos, of which none answers."""
        data = b"".join(bytes((servo,)) + block for servo, block in blocks.items())
        return Packet(BROADCAST, Instruction.SYNC_WRITE, self._place(Block(address, size)) + data)

    def sync_read(self, servos: Collection[int], block: Block) -> Packet:
        """Ask many servos for the same block. Raises BadRequest in protocol 1.0."""
        if self.protocol == 1:
            raise self._lacking("sync read", "read them one by one")
        return Packet(BROADCAST, Instruction.SYNC_READ, self._place(block) + bytes(servos))

    def bulk_read(self, blocks: Mapping[int, Block]) -> Packet:
        """Ask many servos for a block each. In protocol 1.0 only the MX know it, and no STS does. Raises BadRequest."""
        if self.protocol == "STS":
            raise self._lacking("bulk read", "read the same of all, by a sync read")
        if self.protocol == 1:
            rows = [bytes((0,)), *(bytes((block.size, servo, block.address)) for servo, block in blocks.items())]
        else:
            rows = [bytes((servo,)) + self._place(block) for servo, block in blocks.items()]
        return Packet(BROADCAST, Instruction.BULK_READ, b"".join(rows))

    def reboot(self, servo: int) -> Packet:
        """Start the servo anew. Raises BadRequest but in protocol 2.0."""
        if self.protocol != 2:
            raise self._lacking("reboot", "write its torque limit and switch its torque on, or cut its power")
        return Packet(servo, Instruction.REBOOT)

    def reset(self, servo: int, keep: Keep) -> Packet:
        """Set the servo back to what it was delivered as. Raises BadRequest for what protocol 1.0 cannot keep."""
        if self.protocol == 1 and keep == "nothing":
            return Packet(servo, Instruction.FACTORY_RESET)
        if self.protocol != 2:
            raise self._lacking(
                f"factory reset that keeps the {keep}", "in protocol 1.0 keep nothing: its ID becomes 1"
            )
        return Packet(servo, Instruction.FACTORY_RESET, bytes(({"nothing": 0xFF, "id": 1, "id and baud": 2}[keep],)))

    def _number(self, value: int) -> bytes:
        try:
            return value.to_bytes(self.width, "little")
        except OverflowError:
            raise BadRequest(f"{called(self.protocol)} has no address or size {value}") from None

    def _place(self, block: Block) -> bytes:
        return self._number(block.address) + self._number(block.size)

    def _lacking(self, what: str, instead: str) -> BadRequest:
        return BadRequest(f"{called(self.protocol)} has no {what}", hint=instead)


CODECS: Mapping[Protocol, Codec] = MappingProxyType(
    {
        1: Codec(1, wire.LAST_ID, 6, 1, wire.BUFFER - 6, wire.request, wire.Parser),
        2: Codec(2, wire2.LAST_ID, 11, 2, wire2.MAX_PARAMETERS, wire2.request, wire2.Parser),
        "STS": Codec("STS", wire.LAST_ID, 6, 1, wire.BUFFER - 6, wire.request, wire.Parser),
    }
)
"""The protocols."""


def codecs(framing: Framing) -> Mapping[Protocol, Codec]:
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

LATE = 0.05
"""Seconds by which a reply can be late, and be overtaken by another. No adapter holds bytes back for longer."""

MARGIN = 2
"""Bytes by which a reply can look longer than it is: where its length is wrong by so much, in protocol 1.0, the header
of the next packet makes its checksum right."""

FORGOTTEN = 1.0
"""Seconds after which a reply will not come any more, from a servo that has not answered anything else either."""


class Wanted(NamedTuple):
    """What a servo is asked for: a reply with ``size`` bytes of data.

    Replies to equal questions are as good as each other: those to the tries of one read, which ``began`` at one time,
    and those to equal writes.
    """

    question: object
    size: int
    began: float


class _Owed(NamedTuple):
    wanted: Wanted
    since: float


class Overdue:
    """What the servos of a bus owe, by ID. Times are those of the bus's clock."""

    def __init__(self) -> None:
        self._owed: dict[int, list[_Owed]] = {}

    def add(self, servo: int, wanted: Wanted, now: float) -> None:
        """Remember that ``servo`` has not answered."""
        kept = [owed for owed in self._owed.get(servo, ()) if now - owed.since < FORGOTTEN]
        self._owed[servo] = [*kept, _Owed(wanted, now)]

    def came(self, servo: int, size: int) -> bool:
        """Strike off a reply that has come after all; return whether one of that size was owed."""
        for owed in self._owed.get(servo, ()):
            if owed.wanted.size == size:
                self._owed[servo].remove(owed)
                return True
        return False

    def answered(self, servo: int, wanted: Wanted) -> None:
        """Strike off what will not come any more, for the servo has answered what it was asked long after that."""
        if owed := self._owed.get(servo):
            self._owed[servo] = [o for o in owed if o.since > wanted.began - LATE]

    def until(self, servo: int, wanted: Wanted, seconds: float = LATE) -> float:
        """Return when the last reply that could be mistaken for the one ``wanted`` is ``seconds`` overdue."""
        if not self._owed.get(servo):
            return 0.0
        return max(
            (
                owed.since + seconds
                for owed in self._owed[servo]
                if 0 <= wanted.size - owed.wanted.size <= MARGIN and owed.wanted.question != wanted.question
            ),
            default=0.0,
        )

    def clear(self, servo: int, wanted: Wanted, now: float) -> bool:
        """Return whether nothing that is owed could be mistaken for the reply that is ``wanted``."""
        return now >= self.until(servo, wanted, FORGOTTEN)

    def widened(self, servo: int, block: Block, question: object, now: float) -> Block:
        """Return the smallest block that contains ``block`` and whose reply cannot be mistaken for one that is owed."""
        wide = block
        while self._owed.get(servo) and not self.clear(servo, Wanted(question, wide.size, now), now):
            wide = Block(max(0, wide.address - 1), wide.size + 1)
        return wide

    def forget(self) -> None:
        """Forget everything: nothing of what was asked can be answered any more."""
        self._owed.clear()


class Exchange:
    """Takes packets as they arrive, and sorts them.

    ``replies`` holds what has been answered or refused, by ID; ``spoilt`` the servos whose reply, or whose request,
    was damaged on its way; ``missing`` those that may still answer. ``garbled`` is True once something came that may
    have been a reply of theirs. ``doubles`` holds the IDs of replies beyond the one that was requested. ``stray`` is
    told every sound reply that nobody waits for, and says whether it was
    owed from before; what equals one of ``sent`` is the adapter's echo of our own request.
    """

    def __init__(
        self,
        codec: Codec,
        wanted: Mapping[int, Wanted],
        stray: Callable[[Reply], bool],
        sent: Collection[Packet] = (),
    ) -> None:
        self.codec = codec
        self.replies: dict[int, Reply] = {}
        self.spoilt: set[int] = set()
        self.doubles: list[int] = []
        self.missing = dict(wanted)
        self.garbled = False
        self._stray = stray
        self._sent = sent

    def take(self, packet: Packet) -> None:
        """Take one packet; a reply counts only if it is whole, from a servo that is asked, and of the right size."""
        reply = self.codec.reply(packet)
        if reply is None or (reply.faults and packet in self._sent):  # as a reply, any echo has error bits
            return
        wanted = self.missing.get(reply.id)
        size = len(reply.data)
        if not packet.intact:
            self.garbled = True
            if wanted and size == wanted.size:
                self._spoil(reply.id)
        elif wanted is None:
            if not self._stray(reply):
                self.doubles.append(reply.id)
        elif not size and reply.faults & Fault.CHECKSUM:  # what the servo has heard was damaged
            self._spoil(reply.id)
        elif size == wanted.size or (not size and reply.faults & REFUSAL and not self._stray(reply)):
            self.replies[reply.id] = reply
            del self.missing[reply.id]
        elif size and not self._stray(reply):
            self.garbled = True

    def _spoil(self, servo: int) -> None:
        self.spoilt.add(servo)
        del self.missing[servo]
