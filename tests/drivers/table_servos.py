"""Servos that are a table of bytes behind a wire, of models that the virtual servos do not play."""

from dataclasses import dataclass, field

from drivers.servos import wire, wire2
from drivers.servos.models import ServoModel
from drivers.servos.wire import BROADCAST, Protocol1Instruction


@dataclass
class TableServo:
    """One servo; ``table`` is what it holds, and ``written`` what was written to it: addresses and bytes."""

    model: ServoModel
    id: int
    number: bytes = b""  # the bytes of its model number, where these are not the table's own coding
    table: bytearray = field(init=False)
    written: list[tuple[int, bytes]] = field(default_factory=list)

    def __post_init__(self) -> None:
        registers = self.model.table.registers
        self.table = bytearray(self.model.table.size)
        for row in registers.values():
            self.table[row.address : row.end] = row.encode(self.model.default(row))
        at = registers["model_number"].address
        self.table[at : at + 2] = self.number or self.model.number.to_bytes(2, "little")
        self.set("id", self.id)
        self.set("present_position", self.model.centre_tick)
        self.set("present_voltage", round(self.model.nominal_voltage * 10))
        self.set("present_temperature", 30)

    def set(self, name: str, value: int) -> None:
        row = self.model.table[name]
        self.table[row.address : row.end] = row.encode(value)

    def get(self, name: str) -> int:
        return self.model.table[name].decode(self.table)

    def obey(self, code: int, at: int, rest: bytes, count: int) -> bytes | None:
        """Return the data of the answer; None where nothing is answered."""
        if code == Protocol1Instruction.READ:
            return bytes(self.table[at : at + count])
        if code == Protocol1Instruction.WRITE:
            self.table[at : at + len(rest)] = rest
            self.written.append((at, rest))
            return b""
        return None


class TableServos:
    """A chain of them, all of one family: a ``WireDevice`` that is ``TimedDevice`` and ``MultiRateDevice``."""

    def __init__(self, *servos: TableServo, baud: int = 1_000_000) -> None:
        self.servos = servos
        self.baud = baud
        self._set_to = baud
        self._new = servos[0].model.protocol == 2
        self._parser = wire2.PacketParser2() if self._new else wire.PacketParser()

    def set_baud(self, baud: int) -> None:
        self._set_to = baud

    def poll(self, now: float) -> bytes:  # noqa: ARG002
        return b""

    def next_poll_time(self) -> float | None:
        return None

    def feed(self, data: bytes, now: float) -> bytes:  # noqa: ARG002
        if self._set_to != self.baud:
            return b""
        said = b""
        for packet in self._parser.feed(data):
            for servo in self.servos:
                number = servo.get("id")
                if packet.intact and packet.id in (number, BROADCAST):
                    said += self._answered(servo, number, packet)
        return said

    def _answered(self, servo: TableServo, number: int, packet: wire.Packet) -> bytes:
        if packet.code == Protocol1Instruction.PING:
            if not self._new:
                return wire.status(number) if packet.id == number else b""
            firmware = servo.model.table["firmware"].address
            return wire2.status(number, 0, bytes([*servo.table[0:2], servo.table[firmware]]))
        if packet.id == BROADCAST:
            return b""
        if self._new:
            at, rest = int.from_bytes(packet.parameters[:2], "little"), packet.parameters[2:]
            count = int.from_bytes(rest, "little")
        else:
            at, rest = packet.parameters[0], packet.parameters[1:]
            count = rest[0] if rest else 0
        found = servo.obey(packet.code, at, rest, count)
        if found is None:
            return b""
        return wire2.status(number, 0, found) if self._new else wire.status(number, 0, found)
