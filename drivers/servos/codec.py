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
from drivers.servos.wire import BROADCAST, Fault, Packet, Parser
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
