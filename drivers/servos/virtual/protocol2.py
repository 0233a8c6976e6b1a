"""Virtual servos of protocol 2.0: execution of requests, modelled after the e-Manual.

Servos that are read together answer in the order of the request, each after the one before it: all after a missing
servo are silent.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.virtual.settings import NO_FAULT
from drivers.servos.virtual.slots import Slot, overlay
from drivers.servos.wire import BROADCAST, Packet, ServoFault
from drivers.servos.wire2 import ALERT, HEADER, STATUS, Protocol2Error, Protocol2Instruction, crc, status

FAST_SYNC_READ, FAST_BULK_READ = 0x8A, 0x9A
"""Instructions that all servos answer in one common packet."""

CLEAR_TURNS = bytes.fromhex("01 44 58 4C 22")
"""Parameters of CLEAR that clear the turns of a position: the code 01, and a fixed password."""

KEPT_REGISTERS: Mapping[int, tuple[str, ...]] = MappingProxyType({0xFF: (), 0x01: ("id",), 0x02: ("id", "baud")})
"""Registers that survive a factory reset, by the parameter of the instruction FACTORY_RESET."""

_ERRORS: Mapping[ServoFault, Protocol2Error] = MappingProxyType(
    {
        NO_FAULT: Protocol2Error.NONE,
        ServoFault.RANGE: Protocol2Error.RANGE,
        ServoFault.LENGTH: Protocol2Error.LENGTH,
        ServoFault.LIMIT: Protocol2Error.LIMIT,
        ServoFault.ACCESS: Protocol2Error.ACCESS,
    }
)
_MIN_RETURN_LEVELS: dict[int, int] = {Protocol2Instruction.PING: 0, Protocol2Instruction.READ: 1}
"""Lowest status return level at which a servo answers an instruction; for all other instructions it is 2."""

ReadTarget = tuple[int, int, int]
"""Part of a read request for one servo: ID, address, and size."""


def handle_packet(packet: Packet, servos: Sequence[VirtualServo], now: float) -> list[Slot]:
    """Let all ``servos`` receive ``packet`` at time ``now``; return their replies in the order of sending.

    Each item of the result is the reply of one servo, or the simultaneous replies of several with one ID.
    """
    meant = [servo for servo in servos if packet.id in (servo.number, BROADCAST)]
    for servo in meant:
        servo.on_bus_activity(now)
        if packet.code in (Protocol2Instruction.SYNC_WRITE, Protocol2Instruction.BULK_WRITE):
            servo.catch_up(now)
        else:
            servo.advance(now)
    if packet.id == BROADCAST and packet.intact:
        if packet.code == Protocol2Instruction.PING:
            return [_ping(meant, number) for number in sorted({servo.number for servo in meant})]
        if packet.code in (Protocol2Instruction.SYNC_WRITE, Protocol2Instruction.BULK_WRITE):
            _write_many(packet, meant)
            return []
        if packet.code in (Protocol2Instruction.SYNC_READ, Protocol2Instruction.BULK_READ):
            return _answer_in_turn(_parse_read_targets(packet), meant)
        if packet.code in (FAST_SYNC_READ, FAST_BULK_READ):
            return _answer_in_one_packet(_parse_read_targets(packet), meant)
    slot: Slot = []
    for servo in meant:
        number = servo.number
        error, data = _execute(servo, packet)
        if packet.id != BROADCAST and _may_answer(servo, packet):
            slot.append((servo, status(number, error | _alert(servo), data)))
    return [slot] if slot else []


def _execute(servo: VirtualServo, packet: Packet) -> tuple[Protocol2Error, bytes]:
    """Execute a request on one servo; return the error in its reply, and the reply data."""
    if not packet.intact:
        return Protocol2Error.CRC, b""
    address, rest = int.from_bytes(packet.parameters[:2], "little"), packet.parameters[2:]
    match packet.code:
        case Protocol2Instruction.PING:
            return Protocol2Error.NONE, _identity(servo)
        case Protocol2Instruction.READ:
            return _read(servo, address, int.from_bytes(rest, "little"))
        case Protocol2Instruction.WRITE if rest:
            return _ERRORS[servo.write(address, rest)], b""
        case Protocol2Instruction.REG_WRITE if rest:
            return _ERRORS[servo.register_write(address, rest)], b""
        case Protocol2Instruction.ACTION if servo.registered_write is not None:
            return _ERRORS[servo.run_registered_write()], b""
        case Protocol2Instruction.REBOOT | Protocol2Instruction.FACTORY_RESET | Protocol2Instruction.CLEAR:
            return _restart(servo, packet), b""
    return Protocol2Error.INSTRUCTION, b""


def _restart(servo: VirtualServo, packet: Packet) -> Protocol2Error:
    """Execute REBOOT, FACTORY_RESET or CLEAR."""
    match packet.code, packet.parameters:
        case Protocol2Instruction.REBOOT, _:
            servo.brown_out()
        case Protocol2Instruction.FACTORY_RESET, bytes(option) if len(option) == 1 and option[0] in KEPT_REGISTERS:
            servo.factory_reset(*KEPT_REGISTERS[option[0]])
        case Protocol2Instruction.CLEAR, parameters if parameters == CLEAR_TURNS:
            if servo.is_moving:
                return Protocol2Error.FAILED
            servo.clear_turns()
        case _:
            return Protocol2Error.INSTRUCTION
    return Protocol2Error.NONE


def _identity(servo: VirtualServo) -> bytes:
    """Return the data of a ping reply: model number and firmware."""
    return bytes(servo.table[0:2]) + bytes((servo.get("firmware"),))


def _ping(servos: Iterable[VirtualServo], number: int) -> Slot:
    """Return the replies of the servos with ID ``number`` to a broadcast ping."""
    return [(s, status(number, _alert(s), _identity(s))) for s in servos if s.number == number]


def _alert(servo: VirtualServo) -> int:
    return ALERT if servo.get("hardware_error") else 0


def _read(servo: VirtualServo, address: int, count: int) -> tuple[Protocol2Error, bytes]:
    data = servo.read(address, count)
    return (Protocol2Error.NONE, data) if data else (Protocol2Error.RANGE, b"")


def _parse_read_targets(packet: Packet) -> list[ReadTarget]:
    """Return the servo, address and size of each part of a sync read or a bulk read, in order."""
    data = packet.parameters
    if packet.code in (Protocol2Instruction.SYNC_READ, FAST_SYNC_READ):
        return [(number, _word(data, 0), _word(data, 2)) for number in data[4:]]
    return [(data[n], _word(data, n + 1), _word(data, n + 3)) for n in range(0, len(data) - 4, 5)]


def _word(data: bytes, start: int) -> int:
    return int.from_bytes(data[start : start + 2], "little")


def _readers(servos: Iterable[VirtualServo], number: int) -> list[VirtualServo]:
    return [servo for servo in servos if servo.number == number and servo.get("status_return_level")]


def _answer_in_turn(targets: Iterable[ReadTarget], servos: Sequence[VirtualServo]) -> list[Slot]:
    """Return the replies to a sync read or a bulk read, in the order of ``targets``, up to the first missing servo."""
    slots: list[Slot] = []
    for number, address, count in targets:
        slot: Slot = []
        for servo in _readers(servos, number):
            error, data = _read(servo, address, count)
            slot.append((servo, status(number, error | _alert(servo), data)))
        if not slot:
            break
        slots.append(slot)
    return slots


def _answer_in_one_packet(targets: Sequence[ReadTarget], servos: Sequence[VirtualServo]) -> list[Slot]:
    """Return the common reply of several servos: error, ID and data of each, and a CRC of all bytes so far.

    It is sent without byte stuffing, and ends early if a servo is missing.
    """
    length = 1 + sum(count + 4 for _, _, count in targets)
    frame = HEADER + bytes((BROADCAST, *length.to_bytes(2, "little"), STATUS))
    first: VirtualServo | None = None
    for number, address, count in targets:
        readers = _readers(servos, number)
        if not readers:
            break
        first = first or readers[0]
        parts = []
        for servo in readers:
            error, data = _read(servo, address, count)
            parts.append(bytes((error | _alert(servo), number)) + data.ljust(count, b"\0"))
        frame += overlay(parts)
        frame += crc(frame).to_bytes(2, "little")
    return [[(first, frame)]] if first else []


def _write_many(packet: Packet, servos: Sequence[VirtualServo]) -> None:
    """Execute a sync write or a bulk write, which are not acknowledged."""
    data = packet.parameters
    for number, address, block in (
        _sync_blocks(data) if packet.code == Protocol2Instruction.SYNC_WRITE else _bulk_blocks(data)
    ):
        for servo in servos:
            if servo.number == number:
                servo.write(address, block)


WriteTarget = tuple[int, int, bytes]
"""Part of a write request for one servo: ID, address, and bytes."""


def _sync_blocks(data: bytes) -> Iterator[WriteTarget]:
    address, size = _word(data, 0), _word(data, 2)
    for start in range(4, len(data) - size, size + 1):
        yield data[start], address, data[start + 1 : start + 1 + size]


def _bulk_blocks(data: bytes) -> Iterator[WriteTarget]:
    while len(data) > 5:
        size = _word(data, 3)
        yield data[0], _word(data, 1), data[5 : 5 + size]
        data = data[5 + size :]


def _may_answer(servo: VirtualServo, packet: Packet) -> bool:
    """True if the status return level allows a reply; a ping is always answered."""
    return servo.get("status_return_level") >= (_MIN_RETURN_LEVELS.get(packet.code, 2) if packet.intact else 2)
