"""Buses of servos drawn by chance, healthy or with one fault, and an oracle on their wire.

The oracle hears every instruction as the servos do. It knows which servos each one reaches, and whether the command
that sent it had identified them before.
"""

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import radians, sin
from pathlib import Path
from random import Random
from typing import Self

import pytest

from drivers.clock import ManualClock
from drivers.servos import wire, wire2
from drivers.servos.bus import ServoBus
from drivers.servos.models import MODELS
from drivers.servos.units import baud_code
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import BROADCAST, Packet
from drivers.virtual.terminal import baud_rates_match
from tests.drivers.fault_injection import FaultInjection
from tests.drivers.lines import DirectLine

KINDS = ("AX-12A", "MX-28", "XL430-W250", "XL330-M288", "STS3215")
OTHERS = {1: ("AX-18A", "MX-28"), 2: ("XM430-W350", "XL330-M288"), "STS": ("STS3250", "AX-12A")}
FAULTS = (
    *("twins", "twins", "clone", "plugged in meanwhile", "missing", "wrong mode", "wrong model", "unknown model"),
    *("wrong baud", "mute", "noise"),
)
WRITES = {0x03, 0x04, 0x05, 0x06, 0x08, 0x10, 0x83, 0x93}  # write, reg write, action, resets, reboot, clear, sync, bulk
RATE = 1_000_000
ENOUGH = 60.0
"""Simulated seconds within which every command has ended."""


class Oracle:
    """The wire between computer and servos: notes what was ``written`` to whom, and what should not have been."""

    def __init__(self, chain: VirtualServoBus) -> None:
        self.chain = chain
        self.wrong: list[str] = []
        self.written: list[VirtualServo] = []
        self.identified: set[int] = set()
        self.forbidden: set[VirtualServo] = set()
        self._parsers = (wire.PacketParser(), wire2.PacketParser2())

    @property
    def baud(self) -> int:
        return self.chain.baud

    def set_baud(self, baud: int) -> None:
        self.chain.set_baud(baud)

    def poll(self, now: float) -> bytes:
        return self.chain.poll(now)

    def next_poll_time(self) -> float | None:
        return self.chain.next_poll_time()

    def feed(self, data: bytes, now: float) -> bytes:
        for old, parser in ((True, self._parsers[0]), (False, self._parsers[1])):
            for packet in parser.feed(data):
                if packet.intact:
                    self._look(packet, old=old)
        return self.chain.feed(data, now)

    def _look(self, packet: Packet, *, old: bool) -> None:
        if packet.code in WRITES:
            for servos in self._reached(packet, old=old):
                self._judge(servos, packet)
        elif packet.code == 0x02 or (not old and packet.code == 0x01 and packet.id != BROADCAST):
            front = packet.code == 0x01 or packet.parameters[0] <= (3 if old else 0)
            if front and len(alone := self._meant(packet.id, old=old)) == 1:
                self.identified.add(id(alone[0]))

    def _meant(self, number: int, *, old: bool) -> list[VirtualServo]:
        """Return who hears an instruction to an ID in frames of protocol 1.0, or of 2.0."""
        rate = self.chain.baud
        able = [each for each in self.chain.servos if each.is_listening and (each.model.protocol != 2) is old]
        return [
            each for each in able if number in (each.number, BROADCAST) and baud_rates_match(each.settings.baud, rate)
        ]

    def _reached(self, packet: Packet, *, old: bool) -> Iterable[list[VirtualServo]]:
        if packet.id != BROADCAST:
            return [self._meant(packet.id, old=old)]
        data = packet.parameters
        if packet.code == 0x83:
            size, first = (data[1], 2) if old else (int.from_bytes(data[2:4], "little"), 4)
            return [self._meant(data[at], old=old) for at in range(first, len(data), size + 1)]
        return [[each] for each in self._meant(BROADCAST, old=old)]

    def _judge(self, servos: Sequence[VirtualServo], packet: Packet) -> None:
        self.written += servos
        names = ", ".join(f"{each.model.name} {each.number}" for each in servos)
        if len(servos) > 1:
            self.wrong.append(f"instruction {packet.code} reaches {len(servos)} servos: {names}")
        for servo in servos:
            if id(servo) not in self.identified:
                self.wrong.append(f"instruction {packet.code} to {names}, which was not identified")
            if servo.get("model_number") not in {model.number for model in MODELS.values()}:
                self.wrong.append(f"instruction {packet.code} to {names}, of an unknown model")
            if servo in self.forbidden:
                self.wrong.append(f"instruction {packet.code} to {names}, which is not what the file says")


@dataclass
class Case:
    """One bus, its robot file, and the servo that has the ``fault``: the ``victim`` at its joint ``j<ID>``."""

    seed: int
    fault: str = ""
    chance: Random = field(init=False)
    chain: VirtualServoBus = field(init=False)
    victim: VirtualServo = field(init=False)
    intruder: VirtualServo | None = None
    file: str = field(init=False)
    kind: str = field(init=False)
    told: int = field(init=False)

    def __post_init__(self) -> None:
        self.chance = Random(self.seed)  # noqa: S311  # it must be repeatable, and guards nothing
        self.kind = self.chance.choice(KINDS)
        count = self.chance.randint(1, 6 if self.fault else 12)
        numbers = self.chance.sample(range(1, 30), count)
        servos = [self._servo(number, self.kind) for number in numbers]
        self.victim, self.told = self.chance.choice(servos), 0
        self.told = self.victim.number
        driver = "feetech" if self.kind == "STS3215" else "dynamixel"
        lines = [f"robot: bus\narm:\n  driver: {driver}\n  port: /dev/servos\n  at_end: hold\n  joints:"]
        lines += [
            f"    j{number}: {{id: {number}, model: {self.kind}, limits: [-80 deg, 80 deg]}}" for number in numbers
        ]
        self.file = "\n".join(lines) + "\n"
        if "twins" in self.fault or self.fault in ("clone", "plugged in meanwhile"):
            self.intruder = self._second()
            servos.append(self.intruder)
        self.chance.shuffle(servos)
        noise = FaultInjection(seed=self.seed, flip=0.3) if self.fault == "noise" else None
        self.chain = VirtualServoBus(servos, RATE, paced=self.chance.random() < 0.7, injection=noise)
        if self.intruder is not None and self.fault == "twins" and self.chance.random() < 0.3:
            self.chain.contention = lambda slot: [self.chance.choice(slot)]
        self._spoil()

    def _servo(self, number: int, model: str) -> VirtualServo:
        servo = VirtualServo(number, model=model, angle=radians(self.chance.uniform(-60, 60)))
        servo.temperature = float(self.chance.randint(25, 45))
        servo.voltage = servo.model.nominal_voltage + self.chance.uniform(-0.3, 0.3)
        servo.reply_skew = self.chance.uniform(0, 10e-6)
        servo.booted_at = -self.chance.uniform(0, 60)
        servo.set("return_delay", self.chance.choice((0, 10, 250)))
        return servo

    def _second(self) -> VirtualServo:
        victim, others = self.victim, OTHERS[self.victim.model.protocol]
        other = self.fault == "twins" and self.chance.random() < 0.2
        twin = self._servo(victim.number, self.chance.choice(others) if other else self.kind)
        if self.fault == "clone":
            twin.temperature, twin.booted_at = victim.temperature, victim.booted_at
            twin.set("return_delay", victim.get("return_delay"))
            twin.turn_by_hand(victim.angle)
        twin.present = self.fault != "plugged in meanwhile"
        return twin

    def _spoil(self) -> None:
        victim, chance = self.victim, self.chance
        if self.fault == "missing":
            victim.present = False
        elif self.fault == "wrong mode":
            if victim.model.protocol == 2:
                victim.set("operating_mode", chance.choice((1, 4, 16)))
            elif victim.model.protocol == "STS":
                victim.set("mode", chance.choice((1, 2, 3)))
            else:
                for limit in victim.model.table.limit_registers:
                    victim.set(limit, 0)
        elif self.fault == "wrong model":
            known = [each for each in MODELS.values() if each.protocol == victim.model.protocol]
            wanted = chance.choice([each.name for each in known if each.number != victim.model.number])
            self.file = self.file.replace(f"id: {victim.number}, model: {self.kind}",
                                          f"id: {victim.number}, model: {wanted}")  # fmt: skip
        elif self.fault == "unknown model":
            victim.set("model_number", chance.choice((350, 999, 4711)))
        elif self.fault == "wrong baud":
            victim.set("baud", baud_code(chance.choice((57_600, 115_200)), victim.model.protocol))
            self.chain.poll(0.0)
            self.chain.poll(1e-3)
        elif self.fault == "mute":
            level = "response_level" if victim.model.protocol == "STS" else "status_return_level"
            victim.set(level, 0)

    @property
    def driven(self) -> bool:
        """Whether the victim may be driven as its joint."""
        return self.fault in ("", "noise", "plugged in meanwhile")


class Typing(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return 0


class Table:
    """A case on its line, with a person at the terminal who answers yes, holds the arm and turns what is limp."""

    def __init__(self, case: Case, patch: pytest.MonkeyPatch) -> None:
        self.case = case
        self.clock = ManualClock()
        self.oracle = Oracle(case.chain)
        self.line = DirectLine(self.oracle, self.clock)
        self.questions = 0
        self._turns = 0
        Path("bus.yaml").write_text(case.file)
        bench = "missions.plugins.setup.servo.connections"
        patch.setattr(f"{bench}.ServoBus", partial(ServoBus, dial=self.line.dial))
        patch.setattr(f"{bench}.SystemClock", lambda: self.clock)
        for module in ("connections", "joint_commands"):
            patch.setattr(f"missions.plugins.setup.servo.{module}.pause", self.pause)
        patch.setattr("missions.plugins.setup.servo.connections.KeyReader", self.keys)
        patch.setattr("sys.stdin", Typing())
        patch.setattr("click.confirm", self.confirm)

    def pause(self, seconds: float = 0.02) -> None:
        """Let time pass, and turn what is limp by hand."""
        self._turns += 1
        for servo in self.case.chain.servos:
            if servo.limp and self._turns > 3:
                servo.turn_by_hand(radians(50) * sin(self._turns / 5 + servo.number))
        self.clock.advance_to(self.clock.now() + seconds)
        self.line.poll()

    def confirm(self, *_: object, **__: object) -> bool:
        self._answered()
        return True

    def _answered(self) -> None:
        self.questions += 1
        if self.case.fault == "plugged in meanwhile" and self.case.intruder is not None:
            self.case.intruder.present = True

    def keys(self, descriptor: int) -> Self:  # noqa: ARG002 - as Keys is made
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the keys."""

    def read(self, timeout: float) -> str:  # noqa: ARG002 - as Keys has it
        self.clock.advance_to(self.clock.now() + 0.02)
        self._answered()
        return "enter"


COMMANDS = (
    *("set {told} id {free}", "set j{told} id {free}", "set {told} baud 115200", "set all baud 115200"),
    *("set {told} temperature_limit 60", "set all temperature_limit 60", "set {told} torque_enable 0"),
    *("calibrate --seconds 0.5", "calibrate j{told} --seconds 0.5", "torque on", "torque off", "torque restart {told}"),
    "home --seconds 0.5 --into bus.json",
)


def command_for(case: Case) -> str:
    """Draw a command for a case."""
    drawn = case.chance.choice(COMMANDS if case.kind == "STS3215" else COMMANDS[:-1])
    return drawn.format(told=case.told, free=free(case))


def free(case: Case) -> int:
    """Return an ID that none of the servos has."""
    taken = {servo.number for servo in case.chain.servos}
    return next(number for number in range(40, 90) if number not in taken)


def by_joint(command: str) -> bool:
    """Whether a command means servos as joints of the robot file; `torque restart` asks the servo for its model."""
    return command.split(maxsplit=1)[0] in ("calibrate", "torque", "home") and not command.startswith("torque restart")
