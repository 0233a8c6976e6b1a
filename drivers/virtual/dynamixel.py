"""A virtual chain of Dynamixel servos that speaks protocol 1.0: bytes and the time in, bytes out.

What the AX-12A does is modelled after its e-Manual. Where that is silent: a write to a read-only or locked register is
refused with the range bit; a request is carried out whole or not at all; two servos with one ID answer on top of each
other. Replies leave at once: neither the return delay nor the time on the wire is played.
"""

from collections import Counter
from collections.abc import Sequence
from itertools import zip_longest

from drivers.dynamixel import models as m
from drivers.dynamixel.wire import BROADCAST, GAP, Fault, Instruction, Packet, Parser, status
from drivers.virtual.ax12 import TABLE_SIZE, VirtualAX12


class VirtualServoBus:
    """The chain as its wire shows it: a ``WireDevice``."""

    def __init__(self, servos: Sequence[VirtualAX12], baud: int = 1_000_000) -> None:
        self.servos = tuple(servos)
        self._parser = Parser()
        self._heard_at = 0.0
        self._held: dict[int, tuple[int, bytes]] = {}  # registered writes, by the servo's place in the chain
        for servo in self.servos:
            servo.set(m.BAUD, m.baud_code(baud))
        self._rates = [m.baud_of(servo.get(m.BAUD)) for servo in self.servos]
        self._baud = m.baud_of(m.baud_code(baud))
        self._changed_at: float | None = None

    @property
    def baud(self) -> int:
        """The rate that most servos are set to; the others are deaf, for the chain has one wire."""
        return self._baud

    def servo(self, number: int) -> VirtualAX12:
        """Return the first servo whose ID is ``number``. Raises KeyError if there is none."""
        for servo in self.servos:
            if servo.get(m.ID) == number:
                return servo
        raise KeyError(f"no servo has the ID {number}")

    def feed(self, data: bytes, now: float) -> bytes:
        """Take requests, cut anywhere; return the replies."""
        self.poll(now)
        if now - self._heard_at > GAP:
            self._parser.reset()
        self._heard_at = now
        return b"".join(self._obey(packet, now) for packet in self._parser.feed(data))

    def poll(self, now: float) -> bytes:
        """Let time pass; servos say nothing unasked. A new rate holds once the reply to its write has left."""
        for servo in self.servos:
            servo.advance(now)
        if self._changed_at is not None and now > self._changed_at:
            self._changed_at = None
            self._rates = [m.baud_of(servo.get(m.BAUD)) for servo in self.servos]
            self._baud = Counter(self._rates).most_common(1)[0][0]
        return b""

    def _obey(self, packet: Packet, now: float) -> bytes:
        if packet.code == Instruction.SYNC_WRITE:
            return self._sync_write(packet, now) if packet.intact and packet.id == BROADCAST else b""
        replies = []
        for place, servo in enumerate(self.servos):
            heard = servo.present and self._rates[place] == self._baud
            number = servo.get(m.ID)
            if heard and packet.id in (number, BROADCAST):
                error, data = self._carry_out(place, servo, packet, now)
                if packet.id != BROADCAST and _answers(servo, packet):
                    replies.append(status(number, error | servo.faults, data))
        return _overlaid(replies)

    def _carry_out(self, place: int, servo: VirtualAX12, packet: Packet, now: float) -> tuple[Fault, bytes]:
        """Do what one servo is told; return the error bits of this request, and the data that answer it."""
        if not packet.intact:
            return Fault.CHECKSUM, b""
        match packet.code:
            case Instruction.PING:
                return Fault(0), b""
            case Instruction.READ:
                return _read(servo, packet.parameters)
            case Instruction.WRITE if packet.parameters:
                return self._write(servo, packet.parameters[0], packet.parameters[1:], now), b""
            case Instruction.REG_WRITE if packet.parameters:
                write = packet.parameters[0], packet.parameters[1:]
                if not (error := refused(servo, *write)):
                    self._held[place] = write
                    servo.set(m.REGISTERED, 1)
                return error, b""
            case Instruction.ACTION if servo.get(m.REGISTERED):
                servo.set(m.REGISTERED, 0)
                return self._write(servo, *self._held.pop(place), now), b""
        return Fault.INSTRUCTION, b""  # the AX-12A has neither factory reset nor bulk read

    def _sync_write(self, packet: Packet, now: float) -> bytes:
        if len(packet.parameters) < 2:
            return b""
        address, size = packet.parameters[:2]
        blocks = packet.parameters[2:]
        for start in range(0, len(blocks) - size, size + 1):
            for place, servo in enumerate(self.servos):
                if servo.present and self._rates[place] == self._baud and servo.get(m.ID) == blocks[start]:
                    self._write(servo, address, blocks[start + 1 : start + 1 + size], now)
        return b""

    def _write(self, servo: VirtualAX12, address: int, data: bytes, now: float) -> Fault:
        if error := refused(servo, address, data):
            return error
        touched = [r for r in servo.model.registers if r.address < address + len(data) and address < r.end]
        servo.table[address : address + len(data)] = data
        if m.GOAL_POSITION in touched:
            servo.set(m.TORQUE_ENABLE, 1)
        if m.TORQUE_LIMIT in touched and servo.get(m.TORQUE_LIMIT):
            servo.rearm()
        if m.BAUD in touched:
            self._changed_at = now
        servo.advance(now)
        return Fault(0)


def refused(servo: VirtualAX12, address: int, data: bytes) -> Fault:
    """Return why ``servo`` would not take ``data`` at ``address``; no bit when it would."""
    end = address + len(data)
    touched = [r for r in servo.model.registers if r.address < end and address < r.end]
    named = {place for register in touched for place in range(register.address, register.end)}
    if not data or end > TABLE_SIZE or not named.issuperset(range(address, end)):
        return Fault.RANGE
    after = bytearray(servo.table)
    after[address:end] = data
    for register in touched:
        locked = register.eeprom and servo.get(m.LOCK) == 1
        unlocking = register == m.LOCK and register.decode(after) < servo.get(m.LOCK)
        in_range = register.lower <= register.decode(after) <= register.upper
        if not register.writable or locked or unlocking or not in_range:
            return Fault.RANGE
    if m.GOAL_POSITION in touched and not servo.wheel:
        lowest, highest = servo.get(m.CW_ANGLE_LIMIT), servo.get(m.CCW_ANGLE_LIMIT)
        if not lowest <= m.GOAL_POSITION.decode(after) <= highest:
            return Fault.ANGLE_LIMIT
    return Fault(0)


def _read(servo: VirtualAX12, parameters: bytes) -> tuple[Fault, bytes]:
    if len(parameters) != 2 or not parameters[1] or sum(parameters) > TABLE_SIZE:
        return Fault.RANGE, b""
    address, count = parameters
    return Fault(0), bytes(servo.table[address : address + count])


def _answers(servo: VirtualAX12, packet: Packet) -> bool:
    """Whether the status return level lets it answer; a ping it always answers."""
    levels: dict[int, int] = {Instruction.PING: 0, Instruction.READ: 1}
    return servo.get(m.STATUS_RETURN_LEVEL) >= (levels.get(packet.code, 2) if packet.intact else 2)


def _overlaid(replies: Sequence[bytes]) -> bytes:
    """Return what is heard when several servos answer at once: every bit that any of them sets."""
    heard = bytearray()
    for column in zip_longest(*replies, fillvalue=0):
        byte = 0
        for value in column:
            byte |= value
        heard.append(byte)
    return bytes(heard)
