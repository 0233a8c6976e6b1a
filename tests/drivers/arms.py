"""An arm for tests: virtual servos on a terminal, the driver over them, and a record of what went over the wire."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from threading import Event
from typing import Any

import pytest

from drivers.api import JointState, Notice
from drivers.clock import SystemClock
from drivers.dynamixel import wire2
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.driver import DynamixelJoints
from drivers.dynamixel.joint import JointSpec
from drivers.dynamixel.models import MODELS
from drivers.dynamixel.wire import Instruction, Packet, Parser
from drivers.virtual.dynamixel import VirtualServoBus
from drivers.virtual.terminal import Terminal
from tests.drivers.chains import chain
from tests.waiting import wait_until

TICK = MODELS["AX-12A"].tick
PLAIN = {"shoulder": JointSpec(1), "elbow": JointSpec(2), "wrist": JointSpec(3)}


class Recorder:
    """A device that notes every request on its way to the one behind it.

    ``requests`` are those of protocol 1.0, ``requests2`` those of 2.0; ``deaf_to`` names instructions that get lost.
    """

    def __init__(self, device: VirtualServoBus) -> None:
        self.requests: list[Packet] = []
        self.requests2: list[Packet] = []
        self.deaf_to: set[int] = set()
        self._device = device
        self._parser, self._parser2 = Parser(), wire2.Parser()

    @property
    def baud(self) -> int:
        return self._device.baud

    def feed(self, data: bytes, now: float) -> bytes:
        heard, heard2 = self._parser.feed(data), self._parser2.feed(data)
        self.requests += heard
        self.requests2 += heard2
        lost = any(packet.code in self.deaf_to for packet in (*heard, *heard2))
        return b"" if lost else self._device.feed(data, now)

    def poll(self, now: float) -> bytes:
        return self._device.poll(now)

    def tune(self, baud: int) -> None:
        self._device.tune(baud)

    def writes(self, servo: int) -> list[tuple[int, bytes]]:
        """What one servo was written, in order: the address and the data."""
        found = []
        for packet in list(self.requests):
            if packet.code == Instruction.WRITE and packet.id == servo:
                found.append((packet.parameters[0], packet.parameters[1:]))
            elif packet.code == Instruction.SYNC_WRITE:
                address, size = packet.parameters[:2]
                blocks = packet.parameters[2:]
                each = [blocks[at : at + size + 1] for at in range(0, len(blocks), size + 1)]
                found += [(address, block[1:]) for block in each if block[0] == servo]
        return found


class Arm:
    """Virtual servos on a terminal, three AX-12A unless others are given, and the driver over them."""

    def __init__(
        self,
        specs: Mapping[str, JointSpec] = PLAIN,
        servos: VirtualServoBus | None = None,
        baud: int = 1_000_000,
        **options: Any,
    ) -> None:
        self.clock = SystemClock()
        self.chain = servos or chain(3)
        self.wire = Recorder(self.chain)
        self.terminal = Terminal("arm", self.wire, self.clock)
        self.terminal.open()
        self.notices: list[Notice] = []
        self.rounds = Event()
        self.bus = Bus(self.terminal.path, self.clock, baud=baud, name="arm", patience=0.04)
        self.joints = DynamixelJoints(
            self.bus, specs, self.clock, report=self.notices.append, changed=self.rounds.set, **options
        )

    def start(self) -> "Arm":
        self.joints.open()
        wait_until(lambda: self.joints.health().online and self.told("online"))
        return self

    def close(self) -> None:
        self.joints.close()
        self.terminal.close()

    def told(self, text: str) -> bool:
        """Whether a notice of that kind, or with these words in it, has come."""
        return any(text in (notice.kind, notice.what) or text in notice.what for notice in list(self.notices))

    def state(self, name: str) -> JointState:
        value = self.joints.states()[name].value
        assert value is not None
        return value

    def at(self, name: str, angle: float) -> bool:
        return abs(self.state(name).position - angle) <= TICK

    def fresh_of(self, name: str) -> None:
        """Wait for a reading of one joint that begins after now."""
        now = self.clock.now()
        wait_until(lambda: self.joints.states()[name].stamp > now)

    def limp(self, servo: int) -> bool:
        return self.chain.servo(servo).limp

    def fresh(self) -> None:
        """Wait for a whole round of readings that begins after now."""
        now = self.clock.now()
        wait_until(lambda: all(reading.stamp > now for reading in self.joints.states().values() if reading.value))


Make = Callable[..., Arm]


OFTEN = {"watch.SLOWLY": 0.2, "driver.RETRY": 0.1}
"""What the driver does about once a second, and how often (s) it does it in most tests."""


@contextmanager
def making(intervals: Mapping[str, float] = OFTEN) -> Iterator[Make]:
    """Give a maker of arms, all of which are closed at the end; their drivers work at the ``intervals``."""
    arms: list[Arm] = []

    def build(specs: Mapping[str, JointSpec] = PLAIN, **options: Any) -> Arm:
        arms.append(Arm(specs, **options))
        return arms[-1]

    with pytest.MonkeyPatch.context() as patch:
        for name, seconds in intervals.items():
            patch.setattr(f"drivers.dynamixel.{name}", seconds)
        try:
            yield build
        finally:
            for arm in arms:
                arm.close()
