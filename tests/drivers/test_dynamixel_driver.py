"""The arm's driver over virtual servos: real packets, simulated time, every fault that an arm has."""

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from math import inf, nan
from pathlib import Path

import pytest

from drivers.api import JointState, Quality, Reading, ReconnectPolicy
from drivers.clock import SystemClock
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.servos import tables as m
from drivers.servos.bus import ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.models import MODELS
from drivers.servos.register import Register
from drivers.servos.torque import hold_or_relax
from drivers.servos.wire import Protocol1Instruction, ServoFault, status
from drivers.virtual.terminal import PseudoTerminal
from tests.drivers.arms import PLAIN, TICK, Make, making
from tests.drivers.chains import chain
from tests.waiting import wait_until


@pytest.fixture
def make() -> Iterator[Make]:
    with making() as build:
        yield build


# --- joints as described ----------------------------------------------------------------------------------------------


def test_all_faults_of_joint_specs_are_reported_together() -> None:
    specs = {
        "a": JointSpec(1, model="AX-99"),
        "b": JointSpec(1, direction=2, speed=nan),
        "c": JointSpec(300, torque_limit=0, lower=1, upper=-1),
        "d": JointSpec(4, zero=1.0),
    }
    with pytest.raises(BadRequest) as caught:
        DynamixelJoints(ServoBus("nowhere", SystemClock()), specs, SystemClock())
    for fault in ("'AX-99'", "direction is 1 or -1", "not nan", "0..253, not 300", "torque_limit", "lower limit 1"):
        assert fault in str(caught.value)
    assert "b: servo 1 is a already" in str(caught.value)
    assert "d: limits -2.6..2.6 rad reach beyond" in str(caught.value)


def test_limits_are_in_the_order_of_the_robot_file(make: Make) -> None:
    arm = make({"z": JointSpec(2, lower=-1, upper=1, speed=3), "a": JointSpec(1, speed=99)})
    assert list(arm.joints.limits) == ["z", "a"]
    assert (arm.joints.limits["z"].lower, arm.joints.limits["z"].upper, arm.joints.limits["z"].speed) == (-1, 1, 3)
    assert arm.joints.limits["a"].speed == pytest.approx(1023 * MODELS["AX-12A"].speed_unit)


# --- finding the servos -----------------------------------------------------------------------------------------------


def test_arm_opens_without_hardware_and_connects_later(make: Make) -> None:
    arm = make()
    arm.line.plugged = False
    arm.joints.open()
    arm.until(lambda: "no such device" in arm.joints.health().detail)
    assert not arm.joints.health().online
    assert {reading.quality for reading in arm.joints.states().values()} == {Quality.NONE}
    with pytest.raises(NotConnected, match="no such device"):
        arm.joints.move({"elbow": 0.1})
    arm.line.plugged = True
    arm.until(lambda: arm.joints.health().online)
    arm.until(lambda: arm.told("3 of 3 servos answer"))
    arm.until(lambda: all(reading.good for reading in arm.joints.states().values()))
    assert [notice.kind for notice in arm.notices] == ["online"]
    assert arm.joints.health().detail == arm.joints.health().hint == ""


def test_replugged_arm_is_online_once_every_servo_has_its_settings(make: Make) -> None:
    arm = make().start()
    arm.joints.move({"elbow": 0.3})
    arm.until(lambda: arm.at("elbow", 0.3))
    arm.line.plugged = False
    arm.until(lambda: arm.told("offline"))
    online_at: list[tuple[int, bool]] = []
    who_are_you = bytes((m.MODEL_NUMBER.address, 6))

    def note(data: bytes) -> bytes:
        asked = [packet for packet in arm.wire.requests[seen:] if packet.parameters == who_are_you]
        online_at.append((len(asked), arm.joints.health().online))
        return data

    seen = len(arm.wire.requests)
    arm.line.distort = note
    arm.line.plugged = True
    arm.until(lambda: arm.joints.health().online)
    assert [asked for asked, online in online_at if asked < 3 and online] == []
    assert (1, False) in online_at
    # A move that came earlier would have been undone: the elbow is stopped where it stands when it is found.
    arm.joints.move({"elbow": -0.3})
    arm.until(lambda: arm.at("elbow", -0.3))


def test_missing_and_mismatched_servos_are_in_one_message(make: Make) -> None:
    specs = {"a": JointSpec(1), "b": JointSpec(2), "c": JointSpec(3), "d": JointSpec(4)}
    arm = make({**specs, "e": JointSpec(5)})
    arm.chain.servo(1).set(m.MODEL_NUMBER, 18)
    arm.chain.servo(2).set(m.CCW_ANGLE_LIMIT, 0)
    arm.start()
    arm.until(lambda: arm.told("fault"))
    (fault,) = [notice for notice in arm.notices if notice.kind == "fault"]
    assert "4 of 5 servos" in fault.message
    assert "a (servo 1) is model 18 (AX-18A), not 12 (AX-12A)" in fault.message
    assert "b (servo 2) is in wheel mode" in fault.message
    assert "d (servo 4) does not answer; e (servo 5) does not answer" in fault.message
    assert "power" in fault.hint
    assert "1000000" in fault.hint
    health = arm.joints.health()
    assert health.online
    assert "d (servo 4) does not answer" in health.detail
    assert arm.joints.move({"a": 0.5, "c": 0.5}) == {"a": 0.5, "c": 0.5}
    arm.until(lambda: arm.at("c", 0.5))
    assert arm.chain.servo(1).angle == 0
    arm.until(lambda: arm.told("a move left a (servo 1) out: it is model 18"))


@pytest.mark.parametrize(
    ("register", "value", "complaint"),
    [
        (m.CCW_ANGLE_LIMIT, 600, "has angle limits of 0..600 ticks, but the joint needs 4..1020"),
        (m.STATUS_RETURN_LEVEL, 1, "does not acknowledge writes"),
    ],
)
def test_mismatched_servo_is_not_driven_until_corrected(
    make: Make, register: Register, value: int, complaint: str
) -> None:
    arm = make()
    right = arm.chain.servo(2).get(register)
    arm.chain.servo(2).set(register, value)
    arm.start()
    arm.until(lambda: arm.told(f"elbow (servo 2) {complaint}") or complaint in arm.joints.health().detail)
    arm.chain.servo(2).set(register, right)
    arm.until(lambda: arm.told("elbow (servo 2) is back"))
    assert arm.joints.health().detail == ""


def test_offline_when_no_servo_answers(make: Make) -> None:
    arm = make().start()
    for servo in arm.chain.servos:
        servo.present = False
    arm.until(lambda: arm.told("offline"))
    health = arm.joints.health()
    assert not health.online
    assert "does not answer" in health.detail
    assert "power" in health.hint
    arm.joints.move({"elbow": 0.3})  # the bus is there: no error, and nobody moves
    for servo in arm.chain.servos:
        servo.present = True
    arm.until(lambda: arm.joints.health().online and arm.joints.health().detail == "")


def test_dead_servo_is_reported_and_does_not_slow_down_the_others(make: Make) -> None:
    arm = make().start()
    arm.chain.servo(2).present = False
    arm.until(lambda: arm.told("elbow (servo 2) no longer answers"))
    arm.until(lambda: arm.joints.states()["elbow"].quality is Quality.STALE)
    before = {servo: arm.bus.statistics(servo).tries for servo in (1, 2)}
    arm.until(lambda: arm.bus.statistics(1).tries >= before[1] + 25)
    assert arm.bus.statistics(2).tries - before[2] <= 6
    assert arm.joints.health().online
    assert arm.joints.health().counters["misses of elbow"] > 0
    arm.chain.servo(2).present = True
    arm.until(lambda: arm.told("elbow (servo 2) is back"))
    arm.until(lambda: arm.joints.states()["elbow"].good)


# --- moving -----------------------------------------------------------------------------------------------------------


def test_joints_reach_their_goals_and_report_their_state(make: Make) -> None:
    arm = make().start()
    assert arm.joints.move({"shoulder": 0.4, "elbow": -0.4}, speeds={"elbow": 1.0}) == {"shoulder": 0.4, "elbow": -0.4}
    arm.until(lambda: arm.state("elbow").moving)
    assert arm.state("elbow").velocity == pytest.approx(-1.0, rel=0.02)
    arm.until(lambda: arm.at("shoulder", 0.4) and arm.at("elbow", -0.4))
    arm.fresh()
    state = arm.state("elbow")
    assert (state.goal, state.voltage, state.temperature, state.torque) == (-0.4, 12.0, 35.0, True)
    assert arm.limp(3)


def test_a_move_of_stiff_joints_is_one_packet_of_goals_and_speeds(make: Make) -> None:
    arm = make().start()
    arm.joints.hold()
    servo = arm.chain.servo(1)
    already = len(arm.wire.requests)
    arm.joints.move({"shoulder": 0.1, "wrist": -0.2}, speeds={"shoulder": 0.5})
    arm.until(lambda: servo.get(m.GOAL_POSITION) == servo.model.ticks(0.1))
    (packet,) = [p for p in arm.wire.requests[already:] if p.code != Protocol1Instruction.READ]
    assert packet.code == Protocol1Instruction.SYNC_WRITE
    assert servo.get(m.MOVING_SPEED) == servo.model.speed_ticks(0.5)
    assert arm.chain.servo(3).get(m.MOVING_SPEED) == servo.model.speed_ticks(2.0)
    assert arm.chain.servo(3).get(m.GOAL_POSITION) == servo.model.ticks(-0.2)


def test_goal_is_the_present_position_before_torque_is_enabled(make: Make) -> None:
    arm = make().start()
    arm.chain.servo(1).turn_by_hand(0.7)
    arm.until(lambda: arm.at("shoulder", 0.7))
    arm.joints.move({"shoulder": 0.0})
    arm.until(lambda: arm.at("shoulder", 0.0))
    here = m.GOAL_POSITION.encode(MODELS["AX-12A"].ticks(0.7))
    writes = arm.wire.writes(1)
    first_goal = next(i for i, (address, _) in enumerate(writes) if address == m.GOAL_POSITION.address)
    assert writes[first_goal][1][:2] == here
    assert writes[first_goal + 1] == (m.TORQUE_ENABLE.address, b"\x01")


def test_the_eeprom_is_never_written_and_no_speed_is_ever_0(make: Make) -> None:
    arm = make(at_rest="relax").start()
    arm.joints.move({"shoulder": 0.2, "elbow": 0.1}, speeds={"elbow": 0.0})
    arm.joints.hold()
    arm.joints.recover()
    arm.joints.close()
    for servo in (1, 2, 3):
        writes = arm.wire.writes(servo)
        assert writes
        assert min(address for address, _ in writes) >= m.TORQUE_ENABLE.address
        assert all(data[2:4] != bytes(2) for address, data in writes if address == m.GOAL_POSITION.address)
        assert all(data != bytes(2) for address, data in writes if address == m.MOVING_SPEED.address)


def test_a_joint_mounted_the_other_way_round_turns_the_other_way(make: Make) -> None:
    arm = make({"neck": JointSpec(1, zero=0.5, direction=-1, lower=-0.4, upper=0.4)}).start()
    arm.chain.servo(1).turn_by_hand(0.5)
    arm.until(lambda: arm.at("neck", 0.0))
    arm.joints.move({"neck": 0.3}, speeds={"neck": 0.5})
    arm.until(lambda: arm.state("neck").velocity > 0)
    arm.until(lambda: arm.at("neck", 0.3) and not arm.state("neck").moving)
    assert arm.chain.servo(1).angle == pytest.approx(0.2, abs=TICK)


def test_goals_and_speeds_are_clamped(make: Make) -> None:
    arm = make({"elbow": JointSpec(2, lower=-0.3, upper=0.3, speed=1.5)}).start()
    assert arm.joints.move({"elbow": 9.0}, speeds={"elbow": 50.0}) == {"elbow": 0.3}
    servo = arm.chain.servo(2)
    arm.until(lambda: servo.get(m.GOAL_POSITION) == servo.model.ticks(0.3))
    assert servo.get(m.MOVING_SPEED) == servo.model.speed_ticks(1.5)
    arm.joints.move({"elbow": -9.0}, speeds={"elbow": 0.0})
    arm.until(lambda: servo.get(m.MOVING_SPEED) == 1)
    arm.fresh()
    assert arm.state("elbow").goal == -0.3


def test_invalid_move_reports_every_fault_and_moves_nothing(make: Make) -> None:
    arm = make().start()
    with pytest.raises(BadRequest) as caught:
        arm.joints.move({"elbow": nan, "knee": 0.1, "wrist": 0.5}, speeds={"shoulder": inf})
    assert "no joint 'knee' (there are shoulder, elbow, wrist)" in str(caught.value)
    assert "elbow: a goal of nan is not finite" in str(caught.value)
    assert "shoulder: a speed of inf is not finite" in str(caught.value)
    arm.fresh()
    assert all(servo.limp for servo in arm.chain.servos)


def test_missing_servo_is_left_out_of_a_move_with_one_notice(make: Make) -> None:
    arm = make().start()
    arm.chain.servo(2).present = False
    arm.until(lambda: arm.told("elbow (servo 2) no longer answers"))
    for goal in (0.2, 0.3):
        assert arm.joints.move({"elbow": goal, "wrist": goal}) == {"elbow": goal, "wrist": goal}
        arm.until(partial(arm.at, "wrist", goal))
    arm.until(lambda: arm.told("a move left elbow (servo 2) out: it does not answer"))
    assert sum("left elbow" in notice.message for notice in arm.notices) == 1


# --- stiff and limp ---------------------------------------------------------------------------------------------------


def test_stiffening_never_jumps_to_an_old_goal(make: Make) -> None:
    arm = make().start()
    servo = arm.chain.servo(1)
    arm.joints.move({"shoulder": 0.8})
    arm.until(lambda: arm.at("shoulder", 0.8))
    arm.joints.relax()
    assert arm.limp(1)
    servo.turn_by_hand(-0.5)
    arm.until(lambda: arm.at("shoulder", -0.5))
    reached = [servo.angle]
    arm.joints.hold()
    assert not arm.limp(1)
    arm.fresh()
    reached.append(servo.angle)
    assert reached == pytest.approx([-0.5, -0.5], abs=TICK)
    arm.fresh()
    assert arm.state("shoulder").goal == pytest.approx(-0.5, abs=TICK)


def test_move_from_limp_starts_at_the_present_position(make: Make) -> None:
    arm = make().start()
    servo = arm.chain.servo(1)
    servo.turn_by_hand(1.0)
    arm.until(lambda: arm.at("shoulder", 1.0))
    arm.joints.move({"shoulder": 1.05}, speeds={"shoulder": 0.1})
    seen = []

    def arrived() -> bool:
        seen.append(servo.angle)
        return arm.at("shoulder", 1.05)

    arm.until(arrived)
    assert min(seen) >= 1.0 - TICK
    assert max(seen) <= 1.05 + TICK


def test_holding_stops_a_move_half_way(make: Make) -> None:
    arm = make().start()
    arm.joints.move({"elbow": 2.0}, speeds={"elbow": 1.0})
    arm.until(lambda: arm.state("elbow").position > 0.2)
    arm.joints.hold()
    arm.fresh()
    arm.until(lambda: not arm.state("elbow").moving)
    stopped = arm.chain.servo(2).angle
    assert 0.1 < stopped < 1.9
    arm.fresh()
    assert arm.chain.servo(2).angle == stopped
    assert not arm.limp(2)


def test_joint_beyond_its_limits_is_held_at_the_limit(make: Make) -> None:
    arm = make({"elbow": JointSpec(2, lower=-0.3, upper=0.3)}).start()
    arm.chain.servo(2).turn_by_hand(0.6)
    arm.until(lambda: arm.at("elbow", 0.6))
    arm.joints.hold()
    arm.until(lambda: arm.at("elbow", 0.3))


def test_hold_relax_and_rest_are_safe_before_open_after_close_and_twice(make: Make) -> None:
    arm = make()
    for _ in range(2):
        arm.joints.hold()
        arm.joints.relax()
        arm.joints.rest()
        arm.joints.close()
    arm.start()
    for _ in range(2):
        arm.joints.relax()
        arm.joints.rest()
    arm.joints.open()
    arm.joints.close()
    arm.joints.close()
    arm.joints.rest()
    arm.joints.relax()
    assert not any(notice.kind == "fault" for notice in arm.notices)


def test_closed_arm_can_be_opened_again(make: Make) -> None:
    arm = make().start()
    arm.joints.close()
    assert "closed" in arm.joints.health().detail
    arm.notices.clear()
    arm.start()
    arm.joints.move({"elbow": 0.1})
    arm.until(lambda: arm.at("elbow", 0.1))
    assert [notice.kind for notice in arm.notices] == ["online"]


def test_closed_arm_rests_as_configured(make: Make) -> None:
    for policy, limp in (("hold", False), ("relax", True)):
        arm = make(at_rest=policy).start()
        arm.joints.move({"shoulder": 0.2, "elbow": 0.2, "wrist": 0.2})
        arm.until(partial(arm.at, "wrist", 0.2))
        arm.joints.close()
        assert [servo.limp for servo in arm.chain.servos] == [limp] * 3
        assert not arm.bus.is_open


def test_close_reports_servos_that_were_not_relaxed(make: Make) -> None:
    arm = make(at_rest="relax").start()
    arm.joints.move({"shoulder": 0.2, "elbow": 0.2, "wrist": 0.2})
    arm.until(lambda: arm.at("wrist", 0.2))
    arm.chain.servo(1).present = False
    arm.joints.close()
    assert [servo.limp for servo in arm.chain.servos] == [False, True, True]
    last = arm.notices[-1]
    assert (last.kind, last.message) == ("fault", "could not be relaxed: shoulder (servo 1)")
    assert last.hint


def test_closing_with_the_plug_pulled_names_every_servo(make: Make) -> None:
    arm = make(at_rest="relax").start()
    arm.joints.move({"elbow": 0.2})
    arm.line.plugged = False
    arm.joints.close()
    (fault,) = [notice for notice in arm.notices if "could not be relaxed" in notice.message]
    assert fault.message.count("servo") == 3


def test_estimated_position_is_extrapolated_up_to_the_goal() -> None:
    joint = Joint("elbow", JointSpec(2), MODELS["AX-12A"])
    assert joint.estimated_position(5.0) is None

    def at(now: float, *, velocity: float, goal: float | None) -> float | None:
        joint.goal = goal
        state = JointState(0.5, velocity, goal, 0.0, 12.0, 35.0, moving=True, torque=True)
        joint.reading = Reading(state, 1.0, Quality.GOOD)
        return joint.estimated_position(now)

    assert at(1.05, velocity=6.0, goal=2.0) == pytest.approx(0.8)
    assert at(1.05, velocity=-6.0, goal=-2.0) == pytest.approx(0.2)
    assert at(1.05, velocity=6.0, goal=0.6) == pytest.approx(0.6)
    assert at(1.05, velocity=6.0, goal=-2.0) == 0.5  # it is turning round: nobody knows how far it got
    assert at(1.05, velocity=6.0, goal=None) == 0.5
    assert at(1.0, velocity=6.0, goal=2.0) == 0.5


def test_hold_at_full_speed_uses_the_estimated_position(make: Make) -> None:
    arm = make()
    arm.bus.open()
    joint = Joint(
        "elbow", JointSpec(2), MODELS["AX-12A"], undriven_reason="", is_answering=True, goal=2.0, may_have_torque=True
    )
    seen = JointState(0.5, 5.0, 2.0, 0.0, 12.0, 35.0, moving=True, torque=True)
    joint.reading = Reading(seen, 1.0, Quality.GOOD)
    assert hold_or_relax(arm.bus, [joint], stiff=True, now=1.05) == []
    assert arm.chain.servo(2).get(m.GOAL_POSITION) == joint.ticks(0.75)
    assert joint.goal == pytest.approx(0.75, abs=TICK)
    arm.bus.close()


# --- what goes wrong on the way ---------------------------------------------------------------------------------------


def test_replugged_arm_restores_its_settings(make: Make) -> None:
    arm = make({"elbow": JointSpec(2, torque_limit=0.5)}).start()
    arm.joints.move({"elbow": 0.4})
    arm.until(lambda: arm.at("elbow", 0.4))
    arm.line.plugged = False
    arm.until(lambda: arm.told("offline"))
    with pytest.raises(NotConnected):
        arm.joints.move({"elbow": 0.0})
    arm.chain.servo(2).power_cycle()
    assert arm.limp(2)
    arm.line.plugged = True
    arm.until(lambda: arm.joints.health().online)
    arm.until(lambda: not arm.limp(2))
    assert arm.chain.servo(2).get(m.TORQUE_LIMIT) == round(0.5 * 1023)
    assert arm.chain.servo(2).angle == pytest.approx(0.4, abs=TICK)
    arm.until(lambda: arm.joints.health().counters["connections"] == 2)
    assert [notice.kind for notice in arm.notices[:3]] == ["online", "offline", "online"]


def test_relaxed_arm_stays_limp_when_a_servo_returns(make: Make) -> None:
    arm = make().start()
    arm.joints.move({"elbow": 0.1})
    arm.until(lambda: arm.at("elbow", 0.1))
    arm.chain.servo(2).present = False
    arm.until(lambda: arm.told("elbow (servo 2) no longer answers"))
    arm.joints.relax()
    assert not arm.limp(2)  # it could not hear
    arm.chain.servo(2).present = True
    arm.until(lambda: arm.told("elbow (servo 2) is back"))
    assert arm.limp(2)


@pytest.mark.parametrize("latch", [1000.0, 0.2], ids=["for a while", "for long"])
@pytest.mark.parametrize("gone", [(2,), (1, 2, 3)], ids=["one servo", "the power of all"])
def test_move_is_not_resumed_after_a_disconnect_of_servos(make: Make, gone: tuple[int, ...], latch: float) -> None:
    arm = make(away=ReconnectPolicy(decide_after=0.1, latch_after=latch)).start()
    arm.joints.move({"shoulder": 1.5, "elbow": 1.5}, speeds={"shoulder": 0.1, "elbow": 0.1})
    for number in gone:
        arm.chain.servo(number).present = False
    arm.until(lambda: arm.told("elbow (servo 2) no longer answers"))
    seen = arm.joints.states()["elbow"].stamp
    arm.until(lambda: arm.clock.now() - seen > 0.6)
    for number in gone:
        arm.chain.servo(number).present = True
    arm.until(lambda: arm.joints.health().online and not arm.joints.health().detail)
    assert arm.joints.health().reconnected_at is not None
    arm.until(lambda: all(arm.state(joint).goal != 1.5 for joint in ("shoulder", "elbow")))
    if latch < 1:
        with pytest.raises(DeviceFault, match="was away for"):
            arm.joints.move({"shoulder": 0.0})
        arm.joints.enable()
    arm.joints.move({"shoulder": 0.0, "elbow": 0.0})
    arm.until(lambda: arm.at("shoulder", 0.0) and arm.at("elbow", 0.0))


def test_servo_that_refuses_reads_is_given_up_until_it_recovers(make: Make) -> None:
    arm = make().start()
    refusal = status(2, ServoFault.RANGE)
    arm.line.distort = lambda data: refusal if data[2:3] == b"\x02" else data
    arm.until(lambda: arm.told("elbow (servo 2) no longer answers"))
    arm.fresh_of("wrist")
    arm.line.distort = bytes
    arm.until(lambda: arm.told("elbow (servo 2) is back"))


def test_a_dip_of_the_supply_is_noticed_and_made_good(make: Make) -> None:
    arm = make().start()
    arm.joints.move({"elbow": 0.3})
    arm.until(lambda: arm.at("elbow", 0.3))
    arm.chain.servo(2).power_cycle()
    arm.until(lambda: arm.told("elbow (servo 2) had lost its settings and was held again at its position"))
    assert not arm.limp(2)
    assert arm.chain.servo(2).get(m.MOVING_SPEED) > 0


def test_lasting_fault_is_reported_once(make: Make) -> None:
    arm = make().start()
    arm.chain.servo(3).voltage = 5.5
    arm.until(lambda: arm.told("wrist (servo 3) reports voltage (5.5 V, 35 °C, load +0%)"))
    for _ in range(3):
        arm.fresh()
    assert sum("reports voltage" in notice.message for notice in arm.notices) == 1
    assert arm.joints.states()["wrist"].good
    arm.chain.servo(3).voltage = 12.0
    arm.until(lambda: arm.state("wrist").voltage == 12.0)
    arm.chain.servo(3).voltage = 5.5
    arm.until(lambda: sum("reports voltage" in notice.message for notice in arm.notices) == 2)


def test_shut_down_servo_is_left_out_and_recovers_on_request(make: Make) -> None:
    arm = make().start()
    servo = arm.chain.servo(2)
    arm.joints.move({"elbow": 0.5})
    arm.until(lambda: arm.at("elbow", 0.5))
    servo.overload()
    arm.until(lambda: arm.told("elbow (servo 2) reports overload"))
    arm.until(lambda: arm.told("elbow (servo 2) has shut down"))
    assert "elbow (servo 2) has shut down" in arm.joints.health().detail
    servo.turn_by_hand(0.2)
    arm.until(lambda: arm.at("elbow", 0.2))
    arm.joints.move({"elbow": 1.0})
    arm.until(lambda: arm.told("a move left elbow (servo 2) out: it has shut down"))
    arm.joints.hold()
    assert arm.limp(2)
    assert arm.joints.recover() == ("elbow",)
    assert not arm.limp(2)
    arm.fresh()
    assert servo.angle == pytest.approx(0.2, abs=TICK)
    assert arm.joints.recover() == ()
    assert arm.joints.health().detail == ""


@pytest.mark.parametrize("error", [ValueError("broken"), SystemExit(1)])
def test_exceptions_in_callbacks_do_not_end_the_monitor(make: Make, error: BaseException) -> None:
    def throw(*_: object) -> None:
        raise error

    arm = make()
    joints = arm.driver(PLAIN, at_rest="relax", report=throw, changed=throw)
    joints.open()
    arm.until(lambda: joints.health().online)
    joints.move({"elbow": 0.2})
    arm.chain.servo(1).present = False
    arm.until(lambda: "does not answer" in joints.health().detail)
    stamp = arm.clock.now()
    arm.until(lambda: joints.states()["wrist"].stamp > stamp)
    joints.close()
    assert not joints.health().online
    assert not arm.bus.is_open
    assert arm.limp(2)


def test_exception_in_the_monitor_is_reported_once_and_survived(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = make().start()
    rounds = []

    def broken(*_: object, **__: object) -> None:
        rounds.append(arm.clock.now())
        raise ValueError("broken")

    with monkeypatch.context() as patched:
        patched.setattr(arm.joints._monitor, "read", broken)
        arm.until(lambda: len(rounds) >= 2)
    arm.fresh()
    assert [notice.message for notice in arm.notices if notice.kind == "fault"] == ["ValueError: broken"]


def test_close_releases_the_bus_although_the_rest_fails(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = make().start()

    def broken(*_: object, **__: object) -> None:
        raise ValueError("broken")

    monkeypatch.setattr(arm.joints, "_hold_or_relax", broken)
    arm.joints.close()
    assert not arm.bus.is_open
    assert arm.told("could not be held: shoulder (servo 1), elbow (servo 2), wrist (servo 3) (ValueError: broken)")


def test_arm_without_its_thread_is_offline(make: Make) -> None:
    arm = make().start()
    arm.joints._loop.end()
    arm.until(lambda: not arm.joints.health().online)
    assert arm.bus.is_open


def test_readings_without_renewal_turn_stale(make: Make) -> None:
    arm = make().start()
    arm.until(lambda: all(reading.good for reading in arm.joints.states().values()))
    assert arm.rounds > 0
    arm.line.distort = lambda _: b""
    arm.until(lambda: {reading.quality for reading in arm.joints.states().values()} == {Quality.STALE})
    assert all(reading.value is not None for reading in arm.joints.states().values())


def test_nothing_is_opened_before_open(tmp_path: Path) -> None:
    bus = ServoBus(str(tmp_path / "servos"), SystemClock(), name="arm")
    joints = DynamixelJoints(bus, PLAIN, SystemClock())
    assert joints.name == "arm"
    assert joints.health().detail.endswith("not opened yet")
    with pytest.raises(NotConnected, match="not opened yet"):
        joints.move({})


# --- over a port, in real time ----------------------------------------------------------------------------------------


class Ported:
    """The driver on its thread, with virtual servos on a pseudo-terminal."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.chain = chain(3)
        self.terminal = PseudoTerminal("arm", self.chain, self.clock)
        self.terminal.open()
        self.joints = DynamixelJoints(self.bus(), PLAIN, self.clock, at_rest="relax")

    def bus(self) -> ServoBus:
        return ServoBus(self.terminal.path, self.clock, name="arm", reply_timeout=0.04)

    def goes(self, goal: float) -> None:
        """Move a joint as soon as it can be moved; wait until it is there."""

        def moved() -> bool:
            with suppress(NotConnected):
                self.joints.move({"elbow": goal})
            value = self.joints.states()["elbow"].value
            return value is not None and abs(value.position - goal) <= TICK

        wait_until(moved)


@pytest.fixture
def ported() -> Iterator[Ported]:
    ported = Ported()
    yield ported
    ported.joints.close()
    ported.terminal.close()


def test_over_a_port_the_arm_is_moved_lost_found_again_and_relaxed(ported: Ported) -> None:
    ported.joints.open()
    ported.goes(0.3)
    ported.terminal.unplug()
    wait_until(lambda: not ported.joints.health().online)
    ported.terminal.replug()
    wait_until(lambda: ported.joints.health().online)
    ported.joints.enable()  # a slow machine may have made a long absence of a short one
    ported.goes(-0.2)
    ported.joints.close()
    assert [servo.limp for servo in ported.chain.servos] == [True] * 3


def test_busy_port_is_reported_in_health(ported: Ported) -> None:
    other = ported.bus()
    other.open()
    ported.joints.open()
    wait_until(lambda: "in use" in ported.joints.health().detail)
    other.close()
    wait_until(lambda: ported.joints.health().online)
