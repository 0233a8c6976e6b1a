"""Virtual STS servos: execution of requests, modelled after the maker's protocol manual and memory table.

Both leave some points open. Here a damaged or unknown request is not answered. In a sync read, the servos after a
missing one do not answer, as with Dynamixels.
"""

from collections.abc import Iterator, Sequence

from drivers.servos.virtual.protocol1 import sync_write
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.virtual.slots import Slot
from drivers.servos.wire import BROADCAST, Packet, encode_sts_faults, status
from drivers.servos.wire2 import Protocol2Instruction

_ALWAYS_ANSWERED = (Protocol2Instruction.PING, Protocol2Instruction.READ)
"""Instructions that are answered at any response level."""


def handle_packet(packet: Packet, servos: Sequence[VirtualServo], now: float) -> list[Slot]:
    """Let all ``servos`` receive ``packet`` at time ``now``; return their replies in the order of sending.

    Each item of the result is the reply of one servo, or the simultaneous replies of several with one ID.
    """
    if not packet.intact:
        return []
    if packet.id == BROADCAST and packet.code == Protocol2Instruction.SYNC_WRITE:
        sync_write(packet.parameters, servos, now)
        return []
    if packet.id == BROADCAST and packet.code == Protocol2Instruction.SYNC_READ:
        return list(_answer_in_turn(packet.parameters, servos, now))
    slot: Slot = []
    for servo in servos:
        if packet.id in (servo.number, BROADCAST):
            servo.advance(now)
            number = servo.number  # it answers with the ID of the request
            data = _execute(servo, packet)
            heard = packet.code == Protocol2Instruction.PING or packet.id != BROADCAST
            if data is not None and heard and (packet.code in _ALWAYS_ANSWERED or servo.get("response_level")):
                slot.append((servo, _status(servo, number, data)))
    return [slot] if slot else []


def _execute(servo: VirtualServo, packet: Packet) -> bytes | None:
    """Execute a request on one servo; return the reply data, None for an unknown instruction."""
    parameters = packet.parameters
    match packet.code:
        case Protocol2Instruction.PING:
            return b""
        case Protocol2Instruction.READ if len(parameters) == 2:
            return servo.read(*parameters)
        case Protocol2Instruction.WRITE if parameters:
            servo.write(parameters[0], parameters[1:])
        case Protocol2Instruction.REG_WRITE if parameters:
            servo.registered_write = (parameters[0], parameters[1:])
            servo.set("registered", 1)
        case Protocol2Instruction.ACTION:
            servo.run_registered_write()
        case Protocol2Instruction.FACTORY_RESET:
            servo.factory_reset("id")
        case _:
            return None
    return b""


def _status(servo: VirtualServo, number: int, data: bytes) -> bytes:
    return status(number, encode_sts_faults(servo.faults), data)


def _answer_in_turn(parameters: bytes, servos: Sequence[VirtualServo], now: float) -> Iterator[Slot]:
    """Yield the replies to a sync read in the order of the request, up to the first missing servo."""
    for number in parameters[2:]:
        slot: Slot = []
        for servo in servos:
            if servo.number == number:
                servo.advance(now)
                slot.append((servo, _status(servo, number, servo.read(*parameters[:2]))))
        if not slot:
            return
        yield slot
