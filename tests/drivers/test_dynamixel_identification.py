"""The proof that one servo alone has an ID: every trace of a second one counts, and a good servo passes."""

from collections.abc import Callable
from math import radians
from random import Random

import pytest

from drivers.errors import BadRequest, DeviceFault, DriverError, NoReply
from drivers.servos.bus import ServoAddress
from drivers.servos.identification import require_unique_id
from drivers.servos.models import MODELS
from drivers.servos.settings import apply_changes, plan_changes
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.virtual.slots import Slot, merge_replies
from tests.drivers.fault_injection import FaultInjection
from tests.drivers.lines import direct_bus

NAMES = ["AX-12A", "MX-28", "XL430-W250", "XL330-M288", "STS3215"]

Spoil = Callable[[VirtualServo, VirtualServo, VirtualServoBus], object]
"""Makes two servos of one ID unlike each other."""


def by_turns(seed: int = 1) -> Callable[[Slot], Slot]:
    chance = Random(seed)  # noqa: S311  # it must be repeatable, and guards nothing
    return lambda slot: [chance.choice(slot)]


def apart(one: VirtualServo, other: VirtualServo, chain: VirtualServoBus) -> None:  # noqa: ARG001
    one.set("return_delay", 0)
    other.reply_skew = 0.002


def overlapping(one: VirtualServo, other: VirtualServo, chain: VirtualServoBus) -> None:  # noqa: ARG001
    one.set("return_delay", 0)
    other.set("return_delay", 10)


def elsewhere(one: VirtualServo, other: VirtualServo, chain: VirtualServoBus) -> None:  # noqa: ARG001
    other.turn_by_hand(radians(20))


def a_moment_later(one: VirtualServo, other: VirtualServo, chain: VirtualServoBus) -> None:  # noqa: ARG001
    other.reply_skew = 2.5e-6


def louder_by_turns(one: VirtualServo, other: VirtualServo, chain: VirtualServoBus) -> None:  # noqa: ARG001
    other.turn_by_hand(radians(20))
    chain.contention = by_turns()


def other_settings_by_turns(one: VirtualServo, other: VirtualServo, chain: VirtualServoBus) -> None:
    one.set("temperature_limit", other.get("temperature_limit") - 5)
    chain.contention = by_turns(7)


def warmer_by_turns(one: VirtualServo, other: VirtualServo, chain: VirtualServoBus) -> None:  # noqa: ARG001
    other.temperature += 4
    chain.contention = by_turns(3)


SPOILED = [apart, overlapping, elsewhere, a_moment_later, louder_by_turns, other_settings_by_turns, warmer_by_turns]


def twins(name: str, spoil: Spoil, *, paced: bool = True) -> VirtualServoBus:
    one, other = VirtualServo(1, model=name), VirtualServo(1, model=name)
    chain = VirtualServoBus([one, other, VirtualServo(2, model=name)], paced=paced)
    spoil(one, other, chain)
    return chain


@pytest.mark.parametrize("paced", [True, False])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("spoil", SPOILED)
def test_two_servos_with_one_id_are_noticed_and_nothing_is_written(name: str, spoil: Spoil, *, paced: bool) -> None:
    chain = twins(name, spoil, paced=paced)
    before = [bytes(servo.table[:24]) for servo in chain.servos]
    bus, _, _ = direct_bus(chain)
    at, table = ServoAddress(1, MODELS[name].protocol), MODELS[name].table
    with pytest.raises(DriverError) as caught:
        apply_changes(bus, at, table, plan_changes(bus, at, table, {"id": 5}))
    assert isinstance(caught.value, DeviceFault), caught.value
    assert "two servos with ID 1" in str(caught.value)
    assert [bytes(servo.table[:24]) for servo in chain.servos] == before


@pytest.mark.parametrize("name", NAMES)
def test_second_servo_plugged_in_meanwhile_is_detected_before_the_write(name: str) -> None:
    one, other = VirtualServo(1, model=name), VirtualServo(1, model=name, angle=0.4)
    other.present = False
    bus, _, _ = direct_bus(VirtualServoBus([one, other]))
    at, table = ServoAddress(1, MODELS[name].protocol), MODELS[name].table
    changes = plan_changes(bus, at, table, {"id": 5})
    other.present = True
    with pytest.raises(DeviceFault, match="two servos with ID 1"):
        apply_changes(bus, at, table, changes)
    assert (one.number, other.number) == (1, 1)


@pytest.mark.parametrize("names", [("AX-12A", "STS3215"), ("STS3215", "AX-12A"), ("AX-12A", "MX-28")])
def test_two_models_with_one_id_are_noticed(names: tuple[str, str]) -> None:
    chain = VirtualServoBus([VirtualServo(1, model=name) for name in names])
    bus, _, _ = direct_bus(chain)
    for name in names:
        with pytest.raises(DeviceFault, match=r"two servos with ID 1|is model"):
            require_unique_id(bus, ServoAddress(1, MODELS[name].protocol))


@pytest.mark.parametrize("seed", range(10))
def test_two_alternating_models_are_detected(seed: int) -> None:
    chain = VirtualServoBus([VirtualServo(1, model="AX-12A"), VirtualServo(1, model="MX-28")])
    chain.contention = by_turns(seed)
    bus, _, _ = direct_bus(chain)
    with pytest.raises(DeviceFault):
        require_unique_id(bus, ServoAddress(1))


@pytest.mark.parametrize("name", list(MODELS))
@pytest.mark.parametrize("paced", [True, False])
def test_one_servo_passes_without_a_write(name: str, *, paced: bool) -> None:
    chain = VirtualServoBus([VirtualServo(1, model=name), VirtualServo(2, model=name)], paced=paced)
    bus, line, _ = direct_bus(chain)
    assert require_unique_id(bus, ServoAddress(1, MODELS[name].protocol)).number == MODELS[name].number
    reads = {0x01, 0x02}
    place = 7 if MODELS[name].protocol == 2 else 4
    assert {packet[place] for packet in line.sent} <= reads


@pytest.mark.parametrize("name", NAMES)
def test_moving_servo_passes_the_unique_id_check(name: str) -> None:
    servo = VirtualServo(1, model=name)
    chain = VirtualServoBus([servo], paced=True)
    bus, _, _ = direct_bus(chain)
    servo.set("torque_enable", 1)
    servo.set(servo.model.table.goal, servo.model.last_tick)
    require_unique_id(bus, ServoAddress(1, servo.model.protocol))
    assert servo.is_moving


@pytest.mark.parametrize("seed", range(20))
def test_noisy_line_is_not_a_second_servo(seed: int) -> None:
    injection = FaultInjection(seed=seed, flip=0.02, drop=0.01, split=0.2)
    bus, _, _ = direct_bus(VirtualServoBus([VirtualServo(1)], paced=True, injection=injection))
    assert require_unique_id(bus, ServoAddress(1)).number == 12


@pytest.mark.parametrize("echo", [0.0, 1.0])
def test_the_echo_of_an_adapter_is_no_second_servo(echo: float) -> None:
    bus, _, _ = direct_bus(VirtualServoBus([VirtualServo(1)], injection=FaultInjection(echo=echo)))
    assert require_unique_id(bus, ServoAddress(1)).number == 12
    assert bus.statistics(1).duplicates == 0


def test_unknown_or_different_model_is_refused() -> None:
    stranger, other = VirtualServo(1, model="XL430-W250"), VirtualServo(2, model="XL430-W250")
    stranger.set("model_number", 351)
    bus, _, _ = direct_bus(VirtualServoBus([stranger, other]))
    with pytest.raises(DeviceFault, match="model number 351 is unknown"):
        require_unique_id(bus, ServoAddress(1, 2))
    with pytest.raises(DeviceFault, match="not 1020"):
        require_unique_id(bus, ServoAddress(2, 2), 1020)


def test_table_of_another_model_is_not_written() -> None:
    servo = VirtualServo(1, model="MX-28")
    bus, _, _ = direct_bus(VirtualServoBus([servo]))
    with pytest.raises(DeviceFault, match="another control table"):
        plan_changes(bus, ServoAddress(1), MODELS["AX-12A"].table, {"return_delay": 0})


def test_id_of_a_ping_only_servo_is_taken() -> None:
    servo, mute = VirtualServo(1), VirtualServo(4)
    mute.set("status_return_level", 0)
    bus, _, _ = direct_bus(VirtualServoBus([servo, mute]))
    with pytest.raises(BadRequest, match="that ID is already taken"):
        plan_changes(bus, ServoAddress(1), MODELS["AX-12A"].table, {"id": 4})


def test_old_id_that_still_answers_is_reported() -> None:
    one, other = VirtualServo(1), VirtualServo(1)
    chain = VirtualServoBus([one, other])
    chain.contention = lambda slot: slot[:1]  # the stronger one alone is ever heard: no read tells them apart
    bus, _, _ = direct_bus(chain)
    other.write = lambda *_, **__: other.faults  # type: ignore[method-assign]  # it misses what both hear
    table = MODELS["AX-12A"].table
    with pytest.raises(DeviceFault, match="another servo still answers at 1"):
        apply_changes(bus, ServoAddress(1), table, plan_changes(bus, ServoAddress(1), table, {"id": 5}))


def test_unreliable_servo_is_not_written() -> None:
    bus, _, _ = direct_bus(VirtualServoBus([VirtualServo(1)], injection=FaultInjection(seed=4, drop=0.5)))
    with pytest.raises(NoReply):
        require_unique_id(bus, ServoAddress(1))


def test_overlapping_replies_are_merged_bitwise() -> None:
    same = b"\xff\xff\x01\x02\x00\xfc"
    assert merge_replies([(0.0, same), (0.0, same)]) == [(0.0, same)]
    assert merge_replies([(0.0, b"\x0f"), (0.0, b"\x3c")]) == [(0.0, b"\x0c")]
    assert [data for _, data in merge_replies([(0.0, same), (80.0, same)])] == [same, same]
    assert [data for _, data in merge_replies([(0.0, same), (2.5, same)])] != [same]
