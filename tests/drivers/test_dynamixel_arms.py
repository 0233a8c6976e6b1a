"""Arms of all models, over both protocols on one bus, and joints that follow others there."""

from collections import Counter
from collections.abc import Iterator
from functools import partial
from math import inf, nan
from typing import Any

import pytest

from drivers.api import Coupling, JointState, Quality, ReconnectPolicy
from drivers.clock import SystemClock
from drivers.errors import BadRequest
from drivers.servos import sync_read, wire2
from drivers.servos.bus import ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import Protocol1Instruction
from tests.drivers.arms import Arm, Make, making
from tests.drivers.chains import chain, mixed_chain

MIXED = {"hip": "MX-64", "knee": "MX-28", "elbow": "XM430-W350", "wrist": "XL430-W250", "finger": "AX-12A"}


@pytest.fixture
def make() -> Iterator[Make]:
    with making() as build:
        yield build


def spec(servo: int, model: str = "AX-12A", **others: Any) -> JointSpec:
    return JointSpec(servo, model=model, **{"lower": -2.0, "upper": 2.0, **others})


def mixed(make: Make, **options: Any) -> Arm:
    """An arm of five models, read in three ways."""
    specs = {name: spec(servo, model) for servo, (name, model) in enumerate(MIXED.items(), 1)}
    arm: Arm = make(specs, servos=mixed_chain(*MIXED.values()), **options)
    return arm


def there(arm: Arm, name: str, angle: float) -> bool:
    return abs(arm.state(name).position - angle) <= 0.006


# --- models -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_every_model_is_moved_read_held_and_relaxed_in_the_same_units(make: Make, model: str) -> None:
    specs = {"a": spec(1, model, torque_limit=0.6), "b": spec(2, model, direction=-1, zero=0.1, lower=-1.5)}
    arm = make(specs, servos=chain(2, model)).start()
    assert [notice.kind for notice in arm.notices] == ["online"]
    assert arm.joints.move({"a": 0.2, "b": 0.2}, speeds={"a": 0.5}) == {"a": 0.2, "b": 0.2}
    seen: list[JointState] = []

    def turns() -> bool:
        seen.append(arm.state("a"))
        return seen[-1].moving

    arm.until(turns)
    assert seen[-1].velocity == pytest.approx(0.5, rel=0.03)
    assert seen[-1].load > 0
    arm.until(lambda: there(arm, "a", 0.2) and there(arm, "b", 0.2))
    arm.until(lambda: not arm.state("b").moving)
    state = arm.state("b")
    assert (state.goal, state.voltage, state.temperature, state.torque) == (
        0.2,
        MODELS[model].nominal_voltage,
        35.0,
        True,
    )
    assert state.error == pytest.approx(state.position - 0.2)
    assert arm.chain.servo(2).angle == pytest.approx(0.1 - 0.2, abs=0.006)
    servo = arm.chain.servo(1)
    full = servo.model.full_torque
    assert servo.get(servo.model.table.torque_limit) == pytest.approx(0.6 * full, abs=1)
    assert servo.get(servo.model.table.speed) == servo.model.speed_ticks(0.5)
    arm.joints.relax(["a"])
    arm.joints.hold(["b"])
    assert (arm.limp(1), arm.limp(2)) == (True, False)


def test_servos_of_both_protocols_are_read_in_groups_and_moved_in_a_packet_for_each_kind(make: Make) -> None:
    arm = mixed(make).start()
    arm.joints.hold()
    before, before2 = len(arm.wire.requests), len(arm.wire.requests2)
    goals = dict.fromkeys(MIXED, 0.3)
    assert arm.joints.move(goals, speeds=dict.fromkeys(MIXED, 1.2)) == goals
    arm.until(lambda: all(there(arm, name, 0.3) for name in MIXED))
    requests, requests2 = arm.wire.requests[before:], arm.wire.requests2[before2:]
    sync = Protocol1Instruction.SYNC_WRITE
    assert [sum(p.code == sync for p in list_) for list_ in (requests, requests2)] == [1, 1]
    bulk = [packet for packet in requests if packet.code == Protocol1Instruction.BULK_READ]
    both = [packet for packet in requests2 if packet.code == wire2.Protocol2Instruction.SYNC_READ]
    single = [packet for packet in requests if packet.code == Protocol1Instruction.READ and packet.parameters[0] == 36]
    assert min(len(bulk), len(both), len(single)) > 1
    assert {packet.id for packet in single} >= {5}
    assert len([packet for packet in single if packet.id != 5]) < len(bulk)  # now and then, after a miss


def test_slow_registers_are_read_about_once_a_second(make: Make) -> None:
    arm = mixed(make).start()
    before, began = len(arm.wire.requests), arm.clock.now()
    arm.until(lambda: arm.clock.now() >= began + 5.0)
    requests = arm.wire.requests[before:]
    slow = Counter(
        packet.id for packet in requests if packet.code == Protocol1Instruction.READ and packet.parameters[0] == 24
    )
    assert slow
    assert all(4 <= count <= 6 for count in slow.values())


def test_missing_servo_in_a_group_does_not_slow_down_the_others(make: Make) -> None:
    specs = {name: spec(servo, "XM430-W350") for servo, name in enumerate("abcd", 1)}
    arm = make(specs, servos=chain(4, "XM430-W350")).start()
    arm.chain.servo(2).present = False
    arm.until(lambda: arm.told("b (servo 2) no longer answers"))
    tries = {servo: arm.bus.statistics(servo).tries for servo in (1, 2, 4)}
    arm.until(lambda: arm.bus.statistics(4).tries >= tries[4] + 60)
    assert arm.bus.statistics(1).tries - tries[1] == pytest.approx(60, abs=10)
    assert arm.bus.statistics(2).tries - tries[2] <= 6
    arm.chain.servo(2).present = True
    arm.until(lambda: arm.told("b (servo 2) is back"))
    arm.until(lambda: arm.joints.states()["b"].good)


def test_single_missed_reply_costs_one_reading_without_a_notice(make: Make) -> None:
    arm = mixed(make).start()
    missed: list[bytes] = []

    def lose_one(data: bytes) -> bytes:
        if data[:3] == b"\xff\xff\x05" and not missed:
            missed.append(data)
            return b""
        return data

    arm.line.distort = lose_one
    arm.until(lambda: missed)
    arm.fresh()
    assert arm.joints.health().detail == ""
    assert [notice.kind for notice in arm.notices] == ["online"]
    assert arm.joints.health().counters["misses of finger"] == 1


def test_firmware_without_bulk_read_falls_back_to_single_reads(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sync_read, "GROUP_READ_TIMEOUT", 0.3)
    specs = {"a": spec(1, "MX-28"), "b": spec(2, "MX-28")}
    arm: Arm = make(specs, servos=chain(2, "MX-28"))
    arm.wire.deaf_to = {Protocol1Instruction.BULK_READ}
    arm.start()

    def asked() -> int:
        return sum(packet.code == Protocol1Instruction.BULK_READ for packet in arm.wire.requests)

    began = arm.clock.now()
    arm.until(lambda: arm.clock.now() > began + sync_read.GROUP_READ_TIMEOUT + 0.2)
    arm.fresh()
    tried = asked()
    for _ in range(20):
        arm.fresh()
    assert asked() == tried > 0
    assert all(reading.good for reading in arm.joints.states().values())
    assert [notice.kind for notice in arm.notices] == ["online"]


def test_occasionally_lost_bulk_reads_are_not_given_up(make: Make) -> None:
    specs = {"a": spec(1, "MX-28"), "b": spec(2, "MX-28")}
    arm: Arm = make(specs, servos=chain(2, "MX-28")).start()

    def asked() -> int:
        return sum(packet.code == Protocol1Instruction.BULK_READ for packet in arm.wire.requests)

    for _ in range(3):
        for deaf_to in ((Protocol1Instruction.BULK_READ,), ()):
            before = asked()
            arm.wire.deaf_to = set(deaf_to)
            arm.until(partial(lambda before: asked() > before + 1, before))
    now = asked()
    arm.until(lambda: asked() > now + 5)
    assert [notice.kind for notice in arm.notices] == ["online"]


# --- servos that are not what they should be --------------------------------------------------------------------------


def test_all_mismatches_of_a_servo_are_in_one_message(make: Make) -> None:
    servos = mixed_chain("XM430-W350", "MX-106", "EX-106+")
    first, second, third = servos.servos
    first.set("operating_mode", 4)
    first.set("homing_offset", -100)
    first.set("drive_mode", 5)
    first.set("max_position", 3000)
    second.set("resolution_divider", 2)
    second.set("cw_angle_limit", 4095)
    third.set("drive_mode", 1)
    specs = {"a": spec(1, "XM430-W350"), "b": spec(2, "MX-106"), "c": spec(3, "EX-106+"), "d": spec(4, "MX-28")}
    arm = make(specs, servos=servos).start()
    arm.until(lambda: arm.told("fault"))
    (fault,) = [notice for notice in arm.notices if notice.kind == "fault"]
    for words in (
        "4 of 4 servos: a (servo 1) has angle limits of 0..3000 ticks, but the joint needs 744..3352",
        " and is not in position mode (operating mode 4, not 3)",
        " and has another zero (homing offset -100, not 0)",
        " and is reversed, timed or driven by another (drive mode 5, not 0)",
        "b (servo 2) is in multi-turn mode (both its angle limits are 4095)",
        " and has another resolution (resolution divider 2, not 1)",
        "c (servo 3) is reversed, timed or driven by another (drive mode 1, not 0)",
        "d (servo 4) does not answer",
    ):
        assert words in fault.message
    first.set("drive_mode", 8)  # torque comes on with a goal: no harm
    first.set("operating_mode", 3)
    first.set("homing_offset", 0)
    first.set("max_position", 4095)
    arm.until(lambda: arm.told("a (servo 1) is back"))


def test_the_same_servo_with_the_firmware_of_the_other_protocol_is_recognised(make: Make) -> None:
    specs = {"a": spec(1, "MX-28"), "b": spec(2, "XL430-W250")}
    arm = make(specs, servos=mixed_chain("MX-28(2.0)", "AX-12A"))
    arm.joints.open()
    alone = "a (servo 1) answers only in protocol 2.0, as model 30, not as MX-28: write model: MX-28(2.0)"
    arm.until(lambda: alone in arm.joints.health().detail)
    arm.until(lambda: "b (servo 2) answers only in protocol 1.0, as model 12" in arm.joints.health().detail)
    assert not arm.joints.health().online


def test_id_reserved_by_the_other_protocol_is_refused() -> None:
    bus = ServoBus("nowhere", SystemClock())
    with pytest.raises(BadRequest, match=r"a: servo 253 takes packets of protocol 2\.0 for its own"):
        DynamixelJoints(bus, {"a": spec(253), "b": spec(2, "XL430-W250")}, SystemClock())
    with pytest.raises(BadRequest, match=r"b: id is 0\.\.252, not 253"):
        DynamixelJoints(bus, {"b": spec(253, "XL430-W250")}, SystemClock())
    assert list(DynamixelJoints(bus, {"a": spec(253)}, SystemClock()).limits) == ["a"]


def test_too_slow_wire_is_reported_once_with_a_hint(make: Make) -> None:
    specs = {f"joint_{servo}": spec(servo) for servo in range(1, 23)}
    arm = make(specs, servos=chain(22)).start()
    arm.until(lambda: arm.told("fault"))
    (fault,) = [notice for notice in arm.notices if notice.kind == "fault"]
    assert fault.message == "a round of 22 servos takes 16 ms, 11 ms of it return delay: 61 Hz instead of 100 Hz"
    assert "mission servo set all return_delay 0 --robot FILE" in fault.hint


def test_too_low_baud_rate_is_reported(make: Make) -> None:
    servos = VirtualServoBus([VirtualServo(number) for number in range(1, 7)], 57_600)
    for servo in servos.servos:
        servo.set("return_delay", 0)
    arm = make({f"joint_{servo}": spec(servo) for servo in range(1, 7)}, servos=servos, baud=57_600).start()
    arm.until(lambda: arm.told("0 ms of it return delay: 38 Hz instead of 100 Hz"))
    assert "baud rate" in arm.notices[-1].hint
    quiet = make(servos=chain(3), rate=10.0).start()
    assert [notice.kind for notice in quiet.notices] == ["online"]


@pytest.mark.parametrize("rate", [0.0, -1.0, nan, inf])
def test_invalid_poll_rate_is_refused(rate: float) -> None:
    with pytest.raises(BadRequest, match="poll rate must be above 0"):
        DynamixelJoints(ServoBus("nowhere", SystemClock()), {"a": spec(1)}, SystemClock(), rate=rate)


def test_health_counters_include_rate_and_utilisation(make: Make) -> None:
    arm = make(servos=chain(3, paced=True), rate=50.0).start()
    arm.until(lambda: arm.joints.health().counters["achieved rate (Hz)"])
    counters = arm.joints.health().counters
    assert 0 < counters["achieved rate (Hz)"] <= 60
    assert 0 < counters["utilisation (%)"] <= 100
    assert counters["rounds"] > 1
    assert counters["connections"] == 1
    assert counters["tries"] > 0
    assert (counters["late"], counters["refused"]) == (0, 0)


# --- what goes wrong on the way ---------------------------------------------------------------------------------------


def test_shut_down_protocol_2_servo_is_reported_and_recovers_by_reboot(make: Make) -> None:
    arm = mixed(make).start()
    arm.joints.move({"elbow": 0.5})
    arm.until(lambda: there(arm, "elbow", 0.5))
    servo = arm.chain.servo(3)
    servo.overload()
    arm.until(lambda: arm.told("elbow (servo 3) has shut down: its torque is off until it reboots"))
    assert arm.told("elbow (servo 3) reports overload (12.0 V, 35 °C")
    assert all(notice.hint for notice in arm.notices if notice.kind == "fault")
    assert arm.limp(3)
    arm.joints.move({"elbow": 1.0, "knee": 0.2})
    arm.until(lambda: arm.told("a move left elbow (servo 3) out: it has shut down"))
    arm.until(lambda: there(arm, "knee", 0.2))
    arm.joints.hold()
    assert arm.limp(3)
    servo.turn_by_hand(0.3)
    assert arm.joints.recover() == ("elbow",)
    assert arm.joints.recover() == ()
    arm.until(lambda: arm.told("elbow (servo 3) is back"))
    assert not arm.limp(3)
    arm.until(lambda: arm.joints.states()["elbow"].good and arm.state("elbow").torque)
    assert servo.angle == pytest.approx(0.3, abs=0.006)
    assert servo.get("profile_velocity") > 0
    assert arm.joints.health().detail == ""


def test_hot_protocol_2_servo_is_reported_once(make: Make) -> None:
    arm = mixed(make).start()
    arm.chain.servo(4).set("shutdown", 0)
    arm.chain.servo(4).temperature = 90.0
    arm.until(lambda: arm.told("wrist (servo 4) reports overheating"))
    for _ in range(5):
        arm.fresh()
    assert sum("overheating" in notice.message for notice in arm.notices) == 1
    assert arm.joints.states()["wrist"].good


@pytest.mark.parametrize("servo", [1, 3, 5])
def test_brown_out_ends_with_every_joint_restored(make: Make, servo: int) -> None:
    arm = mixed(make).start()
    name = list(MIXED)[servo - 1]
    arm.joints.move({name: 0.4})
    arm.until(lambda: there(arm, name, 0.4))
    before = len(arm.notices)
    arm.chain.servo(servo).brown_out(0.3)
    arm.until(lambda: len(arm.notices) > before and not arm.limp(servo))
    arm.until(lambda: arm.joints.states()[name].good and arm.state(name).torque)
    table = arm.chain.servo(servo).model.table
    assert arm.chain.servo(servo).get(table.speed) > 0
    arm.joints.move({name: 0.0})
    arm.until(partial(there, arm, name, 0.0))


@pytest.mark.parametrize("model", ["AX-12A", "XL430-W250"])
def test_limp_servo_gets_its_torque_limit_back_after_a_power_dip(make: Make, model: str) -> None:
    arm = make({"elbow": spec(1, model, torque_limit=0.3)}, servos=chain(1, model)).start()
    servo = arm.chain.servo(1)
    limit = servo.model.table.torque_limit
    wanted = servo.get(limit)
    assert wanted == round(0.3 * servo.model.full_torque)
    servo.power_cycle()
    assert servo.get(limit) != wanted
    arm.until(lambda: arm.told("elbow (servo 1) had lost its settings and was given them back"))
    assert servo.get(limit) == wanted
    assert servo.limp


def test_active_bus_watchdog_is_switched_off(make: Make) -> None:
    servos = chain(1, "XM430-W350")
    servos.servo(1).set("bus_watchdog", -1)  # it has fired: goals are locked
    arm = make({"elbow": spec(1, "XM430-W350")}, servos=servos).start()
    arm.joints.move({"elbow": 0.2})
    arm.until(lambda: there(arm, "elbow", 0.2))


def test_limits_stored_in_the_servo_are_kept(make: Make) -> None:
    servos = chain(1, "XM430-W350")
    servo = servos.servo(1)
    servo.set("velocity_limit", 50)
    servo.set("pwm_limit", 400)
    servo.power_cycle()
    arm = make({"elbow": spec(1, "XM430-W350")}, servos=servos).start()
    arm.joints.move({"elbow": 0.2}, speeds={"elbow": 99.0})
    arm.until(lambda: there(arm, "elbow", 0.2))
    assert (servo.get("profile_velocity"), servo.get("goal_pwm")) == (50, 400)


def test_servos_of_both_protocols_not_relaxed_are_named(make: Make) -> None:
    arm = mixed(make, at_rest="relax").start()
    arm.joints.move(dict.fromkeys(MIXED, 0.2))
    arm.until(lambda: all(there(arm, name, 0.2) for name in MIXED))
    for servo in (2, 4):
        arm.chain.servo(servo).present = False
    arm.joints.close()
    assert [arm.limp(servo) for servo in range(1, 6)] == [True, False, True, False, True]
    assert arm.notices[-1].message == "could not be relaxed: knee (servo 2), wrist (servo 4)"


# --- following --------------------------------------------------------------------------------------------------------


def test_follower_goal_is_sent_in_the_round_of_the_leader_reading(make: Make) -> None:
    arm = make(rate=50.0).start()
    arm.joints.follow([Coupling("elbow", "wrist")])
    arm.until(lambda: not arm.limp(3))
    leader, follower = arm.chain.servo(2), arm.chain.servo(3)
    before = len(arm.wire.requests)
    for angle in (0.3, 0.6, 0.2, -0.3):
        leader.turn_by_hand(angle)
        arm.until(partial(lambda goal: follower.get("goal_position") == goal, follower.model.ticks(angle)))
    order = ""
    for packet in arm.wire.requests[before:]:
        if packet.code == Protocol1Instruction.READ and packet.id == 2 and packet.parameters[0] == 36:
            order += "R"
        elif packet.code == Protocol1Instruction.SYNC_WRITE and packet.parameters[0] == 30:
            order += "G"
    assert order.count("RG") == order.count("G") >= 4
    arm.until(lambda: abs(follower.angle - leader.angle) < 0.01)
    assert arm.limp(2)


def test_silent_leader_holds_its_follower_with_one_notice(make: Make) -> None:
    arm = mixed(make, away=ReconnectPolicy(decide_after=30.0, latch_after=60.0)).start()
    arm.joints.follow([Coupling("elbow", "finger", scale=-1.0), Coupling("elbow", "knee")])
    arm.chain.servo(3).turn_by_hand(0.5)
    arm.until(lambda: there(arm, "finger", -0.5) and there(arm, "knee", 0.5))
    arm.chain.servo(3).present = False
    words = "holds its position: no readings of its leader elbow (servo 3)"
    arm.until(lambda: arm.told(f"finger (servo 5) {words}") and arm.told(f"knee (servo 2) {words}"))
    arm.until(lambda: arm.joints.states()["elbow"].quality is Quality.STALE)
    for _ in range(5):
        arm.fresh_of("finger")
    assert there(arm, "finger", -0.5)
    assert sum(words in notice.message for notice in arm.notices) == 2
    arm.chain.servo(3).turn_by_hand(0.2)
    arm.chain.servo(3).present = True
    arm.until(lambda: there(arm, "finger", -0.2) and there(arm, "knee", 0.2))


def test_shut_down_follower_is_left_out_and_the_others_follow(make: Make) -> None:
    arm = make().start()
    arm.joints.follow([Coupling("elbow", "wrist"), Coupling("elbow", "shoulder")])
    arm.until(lambda: not arm.limp(3) and not arm.limp(1))
    arm.chain.servo(3).overload()
    arm.until(lambda: arm.told("a move left wrist (servo 3) out: it has shut down"))
    arm.chain.servo(2).turn_by_hand(0.4)
    arm.until(lambda: there(arm, "shoulder", 0.4))
    assert arm.limp(3)
    assert sum("a move left" in notice.message for notice in arm.notices) == 1


def test_at_rest_nothing_follows_any_more(make: Make) -> None:
    arm = make(at_rest="relax").start()
    arm.joints.follow([Coupling("elbow", "wrist")])
    arm.until(lambda: not arm.limp(3))
    arm.joints.rest()
    arm.fresh()
    assert all(arm.limp(servo) for servo in (1, 2, 3))
    arm.fresh()
    assert arm.limp(3)
