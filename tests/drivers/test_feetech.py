"""Feetech's STS servos: published frames, what their EEPROM keeps, and how the driver keeps them from leaping."""

from collections.abc import Iterator
from math import radians
from random import Random

import pytest

from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.servos.bus import ServoAddress, ServoBus, ServoIdentity
from drivers.servos.bus_scan import scan_bus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.setpoint_lookahead import LOOKAHEAD_TIME
from drivers.servos.settings import apply_changes, plan_changes
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import STALL_TIME, VirtualServo
from tests.cases import each
from tests.drivers.arms import Arm, Make, making
from tests.drivers.chains import chain, mixed_chain
from tests.drivers.cranked import PERIOD
from tests.drivers.wired import Wired
from tests.tries import tries

STS = "STS3215"
MIDDLE = " 00 08 00 00 E8 03 "
"""Position 2048 at 1000 steps a second."""
SIX = {name: JointSpec(number, STS) for number, name in enumerate(("pan", "lift", "elbow", "flex", "roll", "jaw"), 1)}


@pytest.fixture
def make() -> Iterator[Make]:
    with making() as build:
        yield build


def six(make: Make, **options: object) -> Arm:
    return make(SIX, servos=chain(6, STS), **options)


def first(servo: VirtualServo) -> tuple[ServoBus, ServoAddress]:
    return Wired(VirtualServoBus([servo])).bus(), ServoAddress(servo.number, "STS")


# --- the wire ---------------------------------------------------------------------------------------------------------


@each(
    ("question", "answer"),
    [  # the maker's protocol manual
        ("FF FF 01 02 01 FB", "FF FF 01 02 00 FC"),
        ("FF FF 01 04 02 38 02 BE", "FF FF 01 04 00 18 05 DD"),
        ("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5", "FF FF 01 02 00 FC"),
        ("FF FF 01 04 02 38 02 BF", ""),  # damaged: nobody answers
        ("FF FF FE 20 83 2A 06 01" + MIDDLE + "02" + MIDDLE + "03" + MIDDLE + "04" + MIDDLE + "58", ""),
    ],
)
def test_published_packets_are_answered_as_published(question: str, answer: str) -> None:
    servos = chain(4, STS)
    servos.servo(1).turn_by_hand((0x0518 - 2048) * servos.servo(1).model.tick)
    assert servos.feed(bytes.fromhex(question), 0.0) == bytes.fromhex(answer)
    if "83 2A" in question:
        assert {(servo.get("goal_position"), servo.get("goal_speed")) for servo in servos.servos} == {(2048, 1000)}


def test_a_reading_of_many_is_answered_in_turn() -> None:
    servos = chain(2, STS)
    answer = servos.feed(bytes.fromhex("FF FF FE 06 82 38 02 01 02 3C"), 0.0)
    assert answer == bytes.fromhex("FF FF 01 04 00 00 08 F2") + bytes.fromhex("FF FF 02 04 00 00 08 F1")


def test_broadcast_ping_collides_and_the_scan_pings_each_id() -> None:
    servos = chain(3, STS)
    assert len(servos.feed(bytes.fromhex("FF FF FE 02 01 FE"), 0.0)) == 6
    found = list(scan_bus(Wired(servos).bus(), [1_000_000], ids=range(5)))
    assert [(row.address, row.number) for row in found] == [(ServoAddress(number, "STS"), 777) for number in (1, 2, 3)]
    assert not any(row.has_damaged_replies for row in found)


def test_dynamixel_and_feetech_servos_on_one_wire_are_distinguished() -> None:
    bus = Wired(mixed_chain("AX-12A", STS, "MX-28", "XL330-M288")).bus()
    found = [(row.address.id, row.address.protocol, row.number) for row in scan_bus(bus, [1_000_000], ids=range(6))]
    assert sorted(found, key=str) == [(1, 1, 12), (2, "STS", 777), (3, 1, 29), (4, 2, 1200)]
    assert (
        bus.identify(ServoAddress(2, 1))
        == bus.identify(ServoAddress(2, "STS"))
        == ServoIdentity(ServoAddress(2, "STS"), 777, 3 | 10 << 8)
    )
    assert bus.identify(ServoAddress(1, "STS")) == bus.identify(ServoAddress(1, 1))
    assert [row.address.protocol for row in scan_bus(bus, [1_000_000], ["STS"], range(6))] == ["STS"]


def test_ax_with_an_sts_like_table_is_identified_as_ax() -> None:
    servo = VirtualServo(9)
    chain = VirtualServoBus([servo], 500_000)  # 0C 00 18 09 03 09: number 777 and ID 9, where an STS has them
    servo.set("return_delay", 9)
    bus = Wired(chain).bus()
    bus.baud = 500_000
    assert bus.identify(ServoAddress(9, 1)).number == 12
    assert bus.identify(ServoAddress(9, 1)).address == ServoAddress(9, 1)


def test_unsupported_sts_operations_are_refused() -> None:
    servo = VirtualServo(1, model=STS)
    bus, at = first(servo)
    with pytest.raises(BadRequest, match="the STS protocol has no bulk read"):
        bus.read_many({at: servo.model.table.fast_block}, mode="bulk")
    with pytest.raises(BadRequest, match="the STS protocol has no reboot"):
        bus.reboot(at)


# --- the EEPROM -------------------------------------------------------------------------------------------------------


def test_write_to_a_locked_sts_is_lost_at_power_off() -> None:
    servo = VirtualServo(1, model=STS)
    bus, at = first(servo)
    bus.write(at, servo.model.table["temperature_limit"], 60)
    assert servo.get("temperature_limit") == 60
    servo.power_cycle()
    assert servo.get("temperature_limit") == 70


@each(
    "wanted",
    [
        {"temperature_limit": 60},
        {"id": 7},
        {"baud": 4},
        {"id": 7, "baud": 4, "position_offset": -100, "max_torque": 500},
    ],
)
def test_settings_are_written_unlocked_and_locked_again(wanted: dict[str, int]) -> None:
    servo = VirtualServo(1, model=STS)
    bus, at = first(servo)
    bus.write(at, servo.model.table["torque_enable"], 1)
    assert apply_changes(bus, at, servo.model.table, plan_changes(bus, at, servo.model.table, wanted))
    assert (servo.get("lock"), servo.get("torque_enable")) == (1, 0)
    servo.power_cycle()
    assert {name: servo.get(name) for name in wanted} == wanted


def test_rejected_setting_is_reported_and_the_servo_is_locked_again() -> None:
    servo = VirtualServo(1, model=STS)
    bus, at = first(servo)
    changes = plan_changes(bus, at, servo.model.table, {"temperature_limit": 60})
    stubborn = servo.write
    servo.write = lambda address, data, *, clamp=False: stubborn(  # type: ignore[method-assign]
        address, b"\x50" if address == 13 else data, clamp=clamp
    )
    with pytest.raises(DeviceFault, match="temperature_limit holds 80 after 60"):
        apply_changes(bus, at, servo.model.table, changes)
    assert servo.get("lock") == 1


def test_position_offset_is_subtracted_from_positions_and_goals() -> None:
    servo = VirtualServo(1, model=STS, angle=radians(100))
    table = servo.model.table
    bus, at = first(servo)
    seen = bus.read(at, table["present_position"])
    servo.set("position_offset", 1000)
    assert bus.read(at, table["present_position"]) == seen - 1000
    servo.set("position_offset", -2000)
    assert bus.read(at, table["present_position"]) == (seen + 2000) % 4096  # beyond a turn it begins anew
    bus.write_block(at, 42, bytes.fromhex("00 04 00 00 E8 03"))
    for step in range(300):
        servo.advance(step / 100)
    assert bus.read(at, table["present_position"]) == 0x400
    servo.write(40, b"\x80")  # the maker's way to make where it stands its middle
    assert bus.read(at, table["present_position"]) == 2048


# --- the driver -------------------------------------------------------------------------------------------------------


def test_old_goal_in_the_servo_does_not_cause_a_jump_on_hold(make: Make) -> None:
    arm = six(make)
    for servo in arm.chain.servos:
        servo.set("goal_position", 3500)
    arm.start()
    arm.joints.hold()
    arm.fresh()
    assert all(abs(servo.angle) < 0.01 for servo in arm.chain.servos)
    assert all(servo.get("torque_enable") for servo in arm.chain.servos)


def test_feetech_arm_rests_within_half_a_second_of_silence(make: Make) -> None:
    arm = six(make).start()
    arm.joints.move(dict.fromkeys(SIX, 1.5), speeds=dict.fromkeys(SIX, 1.0))
    arm.until(lambda: arm.state("elbow").position > 0.3)
    assert isinstance(arm.joints, DynamixelJoints)
    began, at = arm.clock.now(), arm.chain.servo(3).angle
    for step in range(50):  # the program is silent: the chain alone goes on
        for servo in arm.chain.servos:
            servo.advance(began + step / 100)
    assert not any(servo.is_moving for servo in arm.chain.servos)
    assert 0 < arm.chain.servo(3).angle - at <= LOOKAHEAD_TIME + 0.05


def test_arm_replugged_in_mid_move_does_not_jump(make: Make) -> None:
    arm = six(make).start()
    arm.joints.move(dict.fromkeys(SIX, 1.5), speeds=dict.fromkeys(SIX, 1.0))
    arm.until(lambda: arm.state("elbow").position > 0.3)
    arm.line.plugged = False
    began = arm.clock.now()
    arm.until(lambda: arm.clock.now() > began + 0.7)
    arm.chain.servo(4).power_cycle()
    arm.chain.servo(4).turn_by_hand(-0.5)
    before = {servo.number: servo.angle for servo in arm.chain.servos}
    arm.line.plugged = True
    arm.until(lambda: arm.joints.health().online)
    steps = []
    for _ in range(200):
        arm.timeline.run_until(arm.clock.now() + 0.005)
        now = {servo.number: servo.angle for servo in arm.chain.servos}
        steps.append(max(abs(now[number] - before[number]) for number in now))
        before = now
    assert max(steps) < 0.02
    assert arm.told("flex (servo 4) stands at")


def test_arm_unplugged_at_random_never_jumps(make: Make) -> None:
    chance = Random(19)  # noqa: S311 - chance, not a secret
    arm = six(make).start()
    before = [servo.angle for servo in arm.chain.servos]
    slack = 3 * arm.chain.servos[0].model.tick

    def pass_by(seconds: float) -> None:
        nonlocal before
        end = arm.clock.now() + seconds
        while arm.clock.now() < end:
            for _ in range(4):
                arm.timeline.run_until(arm.clock.now() + PERIOD)
            for servo in arm.chain.servos:
                servo.advance(arm.clock.now())
            now = [servo.angle for servo in arm.chain.servos]
            way = max(abs(one - other) for one, other in zip(now, before, strict=True))
            assert way <= 2.0 * 4 * PERIOD * 1.3 + slack  # no faster than its joints may
            before = now

    for _ in range(tries(20, most=60)):
        try:
            arm.joints.move({name: chance.uniform(-2.0, 2.0) for name in SIX})
        except DeviceFault:
            arm.joints.recover()  # away for longer than five seconds, it is latched
        except NotConnected:
            arm.until(lambda: arm.joints.health().online)
        pass_by(chance.uniform(0.0, 1.0))
        arm.line.plugged = False
        pass_by(chance.choice((0.02, 0.3, 0.8, 2.0, 6.0)))
        if chance.random() < 0.3:
            chance.choice(arm.chain.servos).power_cycle()
        arm.line.plugged = True
        pass_by(0.6)


def test_overheated_servo_is_relaxed_and_does_not_jump(make: Make) -> None:
    arm = six(make).start()
    arm.joints.hold()
    elbow = arm.chain.servo(3)
    elbow.temperature = 90.0
    arm.until(lambda: arm.told("elbow (servo 3) has shut down: its torque was switched off"))
    assert arm.told("elbow (servo 3) reports overheating")
    elbow.turn_by_hand(-1.0)
    elbow.temperature = 35.0
    began = arm.clock.now()
    arm.until(lambda: arm.clock.now() > began + 0.2)
    assert elbow.angle == pytest.approx(-1.0, abs=0.01)


def test_overload_lasts_until_recovery_in_place(make: Make) -> None:
    arm = six(make).start()
    arm.joints.move({"elbow": 0.5})
    elbow = arm.chain.servo(3)
    elbow.load = 1.5
    began = arm.clock.now()
    arm.until(lambda: arm.told("elbow (servo 3) reports overload"))
    assert arm.clock.now() - began >= STALL_TIME
    elbow.load = 0.0
    arm.until(lambda: arm.state("elbow").torque is False)
    elbow.turn_by_hand(0.2)
    began = arm.clock.now()
    arm.until(lambda: arm.clock.now() > began + 5.0)
    assert elbow.limp
    assert arm.joints.health().detail == "arm: elbow (servo 3) has shut down"
    assert arm.joints.recover() == ("elbow",)
    arm.until(lambda: arm.state("elbow").torque)
    assert elbow.angle == pytest.approx(0.2, abs=0.01)
    arm.joints.move({"elbow": 0.4})
    arm.until(lambda: abs(arm.state("elbow").position - 0.4) < 0.01)


@each(
    ("register", "value", "words"),
    [
        ("mode", 1, "is not in position mode"),
        ("phase", 8, "has other units of speed or turns (phase 8, not 12)"),
        ("phase", 28, "has other units of speed or turns (phase 28, not 12)"),
        ("response_level", 0, "does not acknowledge writes"),
        ("position_offset", 5, "has position offset 5, its calibration says 7: it was recalibrated"),
    ],
)
def test_mismatched_feetech_servo_is_not_driven(register: str, value: int, words: str) -> None:
    servos = chain(1, STS)
    servos.servo(1).set(register, value)
    arm = Arm({"elbow": JointSpec(1, STS, offset=7 if register == "position_offset" else None)}, servos=servos)
    try:
        arm.joints.open()
        arm.until(lambda: arm.told(words))
        assert not arm.joints.health().online or "elbow" in arm.joints.health().detail
    finally:
        arm.close()
