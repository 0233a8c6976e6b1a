"""Ten thousand transactions on a wire where everything goes wrong: no wrong value, only our errors, no lasting harm."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from random import Random

import pytest

from drivers.clock import SystemClock
from drivers.errors import DriverError, NoReply
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.register import Register, RegisterBlock
from drivers.servos.units import Protocol
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.terminal import PseudoTerminal
from tests.drivers.fault_injection import FaultInjection
from tests.drivers.lines import direct_bus
from tests.tries import tries

MODELS = ("AX-12A", "AX-12A", "RX-64", "MX-28", "MX-28", "XL430-W250", "XL430-W250", "XL430-W250")
FEETECH = ("STS3215",) * 6
LOOKALIKES: Mapping[Protocol, tuple[str, ...]] = {
    1: ("moving_speed", "torque_limit", "punch", "goal_position", "present_position", "cw_angle_limit", "model_number"),
    2: ("profile_velocity", "profile_acceleration", "goal_position", "present_position", "max_position"),
    "STS": ("goal_speed", "torque_limit", "goal_position", "present_position", "max_position", "model_number", "punch"),
}
"""Registers of one size, whose replies look alike. The first two are written to; none of that moves a servo."""


def injection(rate: float, seed: int) -> FaultInjection:
    """Return every mishap at the same rate."""
    return FaultInjection(seed, drop=rate, flip=rate, split=rate, noise=rate, echo=rate, late=rate, truncate=rate)


class Campaign:
    """Asks and tells servos of all protocols at random; what each holds is looked up behind the bus's back."""

    def __init__(self, chain: VirtualServoBus, bus: ServoBus, seed: int = 1) -> None:
        self.servos = {ServoAddress(servo.get("id"), servo.model.protocol): servo for servo in chain.servos}
        self.bus = bus
        self.chance = Random(seed)  # noqa: S311 - chance, not a secret
        self.outcomes: Counter[str] = Counter()

    def run(self, transactions: int) -> None:
        for _ in range(transactions):
            at = self.chance.choice(list(self.servos))
            try:
                what = self.chance.choice(
                    (self.read, self.read, self.read, self.write, self.read_many, self.write_many)
                )
                what(at)
            except DriverError as error:
                self.outcomes[type(error).__name__] += 1
                self.recover(at)
            else:
                self.outcomes["done"] += 1

    def read(self, at: ServoAddress) -> None:
        register = self.register(at, self.chance.choice(LOOKALIKES[at.protocol]))
        assert self.bus.read(at, register) == self.servos[at].get(register), f"{register.name} of {at}"

    def write(self, at: ServoAddress) -> None:
        register = self.register(at, self.chance.choice(LOOKALIKES[at.protocol][:2]))
        value = self.chance.randint(1, 1000)
        self.bus.write(at, register, value)
        assert self.servos[at].get(register) == value, f"{register.name} of {at}"

    def read_many(self, at: ServoAddress) -> None:
        together = [other for other in self.servos if other.protocol == at.protocol and self.reads(other) != "single"]
        wanted = {other: self.servos[other].model.table.fast_block for other in together}
        for other, data in self.bus.read_many(wanted, mode="bulk" if at.protocol == 1 else "sync").items():
            assert data == self.held(other, wanted[other]), f"{wanted[other]} of {other}"
            self.outcomes["of many"] += 1

    def write_many(self, at: ServoAddress) -> None:
        register = self.register(at, LOOKALIKES[at.protocol][0])
        values = {other.id: self.chance.randint(1, 1000) for other in self.servos if other.protocol == at.protocol}
        self.bus.sync_write(at.protocol, register, values)

    def recover(self, at: ServoAddress) -> None:
        """See that the servo is there again at once: of two reads of three tries at least one is answered."""
        try:
            self.read(at)
        except NoReply:
            self.read(at)

    def register(self, at: ServoAddress, name: str) -> Register:
        return self.servos[at].model.table[name]

    def reads(self, at: ServoAddress) -> str:
        return self.servos[at].model.read_mode

    def held(self, at: ServoAddress, block: RegisterBlock) -> bytes:
        return bytes(self.servos[at].table[block.address : block.address + block.size])


def varied_chain(models: Sequence[str] = MODELS, *, paced: bool) -> VirtualServoBus:
    """Return a chain whose registers hold many different values, so that a mix-up shows."""
    servos = [VirtualServo(number, model=model, angle=number / 10) for number, model in enumerate(models, 1)]
    chain = VirtualServoBus(servos, paced=paced)
    for servo in servos:
        servo.set("return_delay", 0)
        for place, name in enumerate(LOOKALIKES[servo.model.protocol][:4]):
            servo.set(name, 100 + 50 * place + servo.get("id"))
    return chain


@pytest.mark.parametrize("models", [MODELS, FEETECH], ids=["dynamixel", "feetech"])
@pytest.mark.parametrize(("rate", "transactions"), [(0.01, tries(5000, most=10_000)), (0.1, 1000)])
def test_no_wrong_value_is_delivered_and_the_bus_recovers_every_time(
    rate: float, transactions: int, models: Sequence[str]
) -> None:
    chain = varied_chain(models, paced=True)
    bus, _, _ = direct_bus(chain)
    chain.poll(0.0)
    chain.injection = injection(rate, seed=6)
    campaign = Campaign(chain, bus)
    campaign.run(transactions)
    assert set(campaign.outcomes) == {"done", "NoReply", "of many"}
    assert campaign.outcomes["done"] > 0.9 * transactions * (1 - rate)
    assert set(chain.injection.happened) == {"drop", "flip", "split", "noise", "echo", "late", "truncate"}
    tallies = [bus.statistics(at.id) for at in campaign.servos]
    assert min(tally.misses for tally in tallies) > 0
    assert min(tally.corrupt for tally in tallies) > 0
    assert sum(tally.late for tally in tallies) > 0
    assert bus.noise_bytes() > 0


@pytest.fixture
def terminal() -> Iterator[PseudoTerminal]:
    terminal = PseudoTerminal("servos", varied_chain(paced=False), SystemClock())
    terminal.open()
    yield terminal
    terminal.close()


@pytest.mark.real_time
def test_nor_over_a_port_in_real_time(terminal: PseudoTerminal) -> None:
    chain = terminal.device
    assert isinstance(chain, VirtualServoBus)
    chain.injection = injection(0.01, seed=7)
    bus = ServoBus(terminal.path, SystemClock(), reply_timeout=0.02)
    bus.open()
    try:
        campaign = Campaign(chain, bus)
        campaign.run(400)
        assert campaign.outcomes["done"] > 300
    finally:
        bus.close()
