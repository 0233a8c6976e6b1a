"""An arm for tests: virtual servos, the driver over them, turned by hand, and a record of what went over the wire."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from drivers.api import DeviceStatus, JointState
from drivers.servos import wire2
from drivers.servos.bus import ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.wire import Packet, PacketParser, Protocol1Instruction
from drivers.sim.timeline import Timeline
from tests.drivers.chains import chain
from tests.drivers.cranked import PERIOD, by_hand, pass_until
from tests.drivers.lines import DirectLine

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
        self._parser, self._parser2 = PacketParser(), wire2.PacketParser2()

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

    def next_poll_time(self) -> float | None:
        return self._device.next_poll_time()

    def set_baud(self, baud: int) -> None:
        self._device.set_baud(baud)

    def writes(self, servo: int) -> list[tuple[int, bytes]]:
        """What one servo was written, in order: the address and the data."""
        found = []
        for packet in list(self.requests):
            if packet.code == Protocol1Instruction.WRITE and packet.id == servo:
                found.append((packet.parameters[0], packet.parameters[1:]))
            elif packet.code == Protocol1Instruction.SYNC_WRITE:
                address, size = packet.parameters[:2]
                blocks = packet.parameters[2:]
                each = [blocks[at : at + size + 1] for at in range(0, len(blocks), size + 1)]
                found += [(address, block[1:]) for block in each if block[0] == servo]
        return found


class Arm:
    """Virtual servos, three AX-12A unless others are given, and the driver over them, in simulated time."""

    def __init__(
        self,
        specs: Mapping[str, JointSpec] = PLAIN,
        servos: VirtualServoBus | None = None,
        baud: int = 1_000_000,
        **options: Any,
    ) -> None:
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.chain = servos or chain(3)
        self.wire = Recorder(self.chain)
        self.line = DirectLine(self.wire, self.clock)
        self.timeline.call_every(PERIOD, self.line.poll)
        self.notices: list[DeviceStatus] = []
        self.rounds = 0
        self.bus = ServoBus("/dev/servos", self.clock, baud=baud, name="arm", dial=self.line.dial)
        self.joints = self.driver(specs, report=self.notices.append, changed=self.count, **options)

    def driver(self, specs: Mapping[str, JointSpec], **options: Any) -> DynamixelJoints:
        """Return a driver over the bus."""
        return DynamixelJoints(self.bus, specs, self.clock, loop=by_hand(self.timeline), **options)

    def count(self) -> None:
        self.rounds += 1

    def start(self) -> "Arm":
        self.joints.open()
        self.until(lambda: self.joints.health().online and self.told("online"))
        return self

    def close(self) -> None:
        self.joints.close()

    def until(self, holds: Callable[[], object]) -> None:
        """Let time pass until ``holds`` is true; fail after 20 s."""
        pass_until(self.timeline, holds)

    def told(self, text: str) -> bool:
        """Whether a notice of that kind, or with these words in it, has come."""
        return any(text in (notice.kind, notice.message) or text in notice.message for notice in list(self.notices))

    def state(self, name: str) -> JointState:
        value = self.joints.states()[name].value
        assert value is not None
        return value

    def at(self, name: str, angle: float) -> bool:
        return abs(self.state(name).position - angle) <= TICK

    def fresh_of(self, name: str) -> None:
        """Wait for a reading of one joint that begins after now."""
        now = self.clock.now()
        self.until(lambda: self.joints.states()[name].stamp > now)

    def limp(self, servo: int) -> bool:
        return self.chain.servo(servo).limp

    def fresh(self) -> None:
        """Wait for a whole round of readings that begins after now."""
        now = self.clock.now()
        self.until(lambda: all(reading.stamp > now for reading in self.joints.states().values() if reading.value))


Make = Callable[..., Arm]


@contextmanager
def making() -> Iterator[Make]:
    """Give a maker of arms, all of which are closed at the end."""
    arms: list[Arm] = []

    def build(specs: Mapping[str, JointSpec] = PLAIN, **options: Any) -> Arm:
        arms.append(Arm(specs, **options))
        return arms[-1]

    try:
        yield build
    finally:
        for arm in arms:
            arm.close()
