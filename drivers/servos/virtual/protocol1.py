"""Virtual servos of protocol 1.0: execution of requests, modelled after the e-Manual.

The e-Manual leaves some points open. Here a write to a read-only or locked register is refused with the range bit. A
sync write, which is not acknowledged, clamps the goal to the angle limits. An AX also executes a factory reset, which
the e-Manual lists for all of protocol 1.0, though a user reports an AX-12 that refused it.
"""

from collections.abc import Iterable, Sequence

from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.virtual.settings import NO_FAULT
from drivers.servos.virtual.slots import Slot
from drivers.servos.wire import BROADCAST, Packet, Protocol1Instruction, ServoFault, status

_MIN_RETURN_LEVELS: dict[int, int] = {
    Protocol1Instruction.PING: 0,
    Protocol1Instruction.READ: 1,
    Protocol1Instruction.BULK_READ: 1,
}
"""Lowest status return level at which a servo answers an instruction; for all other instructions it is 2."""


def handle_packet(packet: Packet, servos: Sequence[VirtualServo], now: float) -> list[Slot]:
    """Let all ``servos`` receive ``packet`` at time ``now``; return their replies in the order of sending.

    Each item of the result is the reply of one servo, or the simultaneous replies of several with one ID.
    """
    if packet.id == BROADCAST and packet.intact and packet.code == Protocol1Instruction.SYNC_WRITE:
        sync_write(packet.parameters, servos, now)
        return []
    if packet.id == BROADCAST and packet.intact and packet.code == Protocol1Instruction.BULK_READ:
        return _bulk_read(packet.parameters, servos, now)
    slot: Slot = []
    for servo in servos:
        if packet.id in (servo.number, BROADCAST):
            servo.advance(now)
            number = servo.number
            error, data = _execute(servo, packet)
            if packet.id != BROADCAST and _may_answer(servo, packet):
                slot.append((servo, _status(servo, number, error, data)))
    return [slot] if slot else []


def _execute(servo: VirtualServo, packet: Packet) -> tuple[ServoFault, bytes]:
    """Execute a request on one servo; return its error bits and the reply data."""
    if not packet.intact:
        return ServoFault.CHECKSUM, b""
    match packet.code:
        case Protocol1Instruction.PING:
            return NO_FAULT, b""
        case Protocol1Instruction.READ:
            return _read(servo, packet.parameters)
        case Protocol1Instruction.WRITE if packet.parameters:
            return servo.write(packet.parameters[0], packet.parameters[1:]), b""
        case Protocol1Instruction.REG_WRITE if packet.parameters:
            return servo.register_write(packet.parameters[0], packet.parameters[1:]), b""
        case Protocol1Instruction.ACTION if servo.registered_write is not None:
            return servo.run_registered_write(), b""
        case Protocol1Instruction.FACTORY_RESET:
            servo.factory_reset()
            return NO_FAULT, b""
    return ServoFault.INSTRUCTION, b""


def _status(servo: VirtualServo, number: int, error: ServoFault, data: bytes) -> bytes:
    """Return the reply of ``servo`` under the ID ``number``: the faults ``error`` and its own faults, then ``data``."""
    return status(number, int(error) | int(servo.faults), data)


def _read(servo: VirtualServo, parameters: bytes) -> tuple[ServoFault, bytes]:
    data = servo.read(*parameters) if len(parameters) == 2 else b""
    return (NO_FAULT, data) if data else (ServoFault.RANGE, b"")


def _bulk_read(parameters: bytes, servos: Iterable[VirtualServo], now: float) -> list[Slot]:
    """Return the replies to a bulk read, in order.

    Each servo waits for the reply of the servo before it, so all servos after a missing one do not answer.
    """
    slots: list[Slot] = []
    for start in range(1, len(parameters) - 2, 3):
        count, number, address = parameters[start : start + 3]
        slot: Slot = []
        for servo in servos:
            if servo.number == number and servo.model.read_mode == "bulk" and servo.get("status_return_level"):
                servo.advance(now)
                error, data = _read(servo, bytes((address, count)))
                slot.append((servo, _status(servo, number, error, data)))
        if not slot:
            break
        slots.append(slot)
    return slots


def sync_write(parameters: bytes, servos: Iterable[VirtualServo], now: float) -> None:
    """Execute a sync write, which is not acknowledged."""
    if len(parameters) < 2:
        return
    (address, size), blocks = parameters[:2], parameters[2:]
    for start in range(0, len(blocks) - size, size + 1):
        for servo in servos:
            if servo.number == blocks[start]:
                servo.catch_up(now)
                servo.write(address, blocks[start + 1 : start + 1 + size], clamp=True)


def _may_answer(servo: VirtualServo, packet: Packet) -> bool:
    """True if the status return level allows a reply; a ping is always answered."""
    return servo.get("status_return_level") >= (_MIN_RETURN_LEVELS.get(packet.code, 2) if packet.intact else 2)
