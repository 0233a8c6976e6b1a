"""Single joints: they go where they are told, and are stiff or limp as told; what cannot be is said at once."""

import math

import pytest

from behaviours.joints import CONFIRMATION_TIMEOUT, RESEND_INTERVAL, MoveJoints, Torque
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from drivers.errors import DeviceFault
from missions.plugins.testing.recorders import HOLD, OFFLINE_ERROR, RELAX, LeafTestBench, none
from tests.behaviours.servo_arm import SHORT, TICK, moves, play, tick, with_servos


def moving(bench: LeafTestBench, to: dict[str, float], **arguments: object) -> MoveJoints:
    return bench.put(MoveJoints("move_joints"), to=to, **arguments)


# --- to angles -------------------------------------------------------------------------------------------------------


def test_move_joints_reaches_its_angles_and_stores_the_time() -> None:
    bench, servos = with_servos()
    leaf = moving(bench, {"shoulder": 1.0, "elbow": 1.5})
    took = play(bench, leaf)
    assert leaf.status is SUCCESS
    assert leaf.result == pytest.approx(took - TICK)
    assert took == pytest.approx((1.0 - SHORT) / servos.limits["shoulder"].speed, abs=2 * TICK)
    assert all(move == {"shoulder": 1.0, "elbow": 1.5} for move in moves(servos))
    assert servos.commands == moves(servos)


def test_move_joints_moves_at_the_given_speed() -> None:
    bench, servos = with_servos()
    leaf = moving(bench, {"elbow": 1.0}, speed=0.5)
    assert play(bench, leaf) == pytest.approx(2.0, abs=0.2)
    assert set(servos.speeds[0].values()) == {0.5}


def test_move_joints_at_its_goal_succeeds_at_once() -> None:
    bench = LeafTestBench()
    assert bench.tick(moving(bench, {"elbow": 0.02})) is SUCCESS


def test_move_joints_reports_all_violations_before_any_motion() -> None:
    bench = LeafTestBench()
    leaf = moving(bench, {"elbow": -0.5, "hand": 1.0, "shoulder": 0.0}, speed=2.5)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == (
        "the arm has no joint 'hand'; elbow at -28.6 deg is outside its limits (0 deg to 126.1 deg); "
        "shoulder at 143.2 deg/s exceeds its maximum speed (114.6 deg/s)"
    )
    assert bench.arm.commands == []


def test_move_joints_reports_a_blocked_joint_and_holds() -> None:
    bench, servos = with_servos()
    servos.stuck = {"elbow"}
    leaf = moving(bench, {"elbow": math.radians(30), "shoulder": 0.5}, patience=1.0)
    took = play(bench, leaf)
    assert leaf.status is FAILURE
    assert leaf.reason == "elbow stopped 30 deg short of 30 deg"
    assert took == pytest.approx(1.0 + 0.25, abs=0.3)
    assert servos.commands[-1] == (HOLD, "elbow", "shoulder")


def test_move_joints_waits_for_silent_joints() -> None:
    bench = LeafTestBench()
    bench.arm.readings["elbow"] = none()
    leaf = moving(bench, {"elbow": 1.0})
    assert bench.tick(leaf, after=60.0) is RUNNING
    assert leaf.reason == "waiting for elbow to report"
    assert bench.halt(leaf)
    assert bench.arm.commands == []


def test_move_joints_fails_if_a_joint_falls_silent() -> None:
    bench, servos = with_servos()
    leaf = moving(bench, {"elbow": 1.0}, patience=0.5)
    tick(bench, leaf, 0.1)
    servos.silent = {"elbow"}
    assert tick(bench, leaf, 3.0) is FAILURE
    assert leaf.reason == "elbow does not report"


def test_move_joints_sends_its_goal_again_after_a_reconnect() -> None:
    bench, servos = with_servos()
    leaf = moving(bench, {"elbow": 1.0}, patience=0.5)
    tick(bench, leaf, 0.1)
    servos.trouble = OFFLINE_ERROR
    assert tick(bench, leaf, 10.0) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    servos.hold()  # as a driver does that finds its joints again
    servos.trouble = None
    play(bench, leaf)
    assert leaf.status is SUCCESS


def test_move_joints_halt_holds_only_its_joints() -> None:
    bench, servos = with_servos()
    leaf = moving(bench, {"elbow": 1.0})
    tick(bench, leaf, 0.1)
    assert bench.halt(leaf)
    assert servos.commands[-1] == (HOLD, "elbow")


def test_move_joints_fails_and_holds_on_a_device_fault() -> None:
    bench, servos = with_servos()
    leaf = moving(bench, {"elbow": 1.0})
    tick(bench, leaf, 0.1)
    servos.trouble = DeviceFault("arm: elbow overload")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "arm: elbow overload"
    assert servos.commands[-1] == (HOLD, "elbow")


def test_move_joints_can_be_repeated() -> None:
    bench, _ = with_servos()
    leaf = moving(bench, {"elbow": 1.0})
    first = play(bench, leaf)
    back = moving(bench, {"elbow": 0.0})
    assert play(bench, back) == pytest.approx(first, abs=2 * TICK)
    assert play(bench, leaf) == pytest.approx(first, abs=2 * TICK)


# --- stiff and limp --------------------------------------------------------------------------------------------------


def test_torque_off_makes_the_named_joints_limp() -> None:
    bench, servos = with_servos(upper=("shoulder",))
    assert play(bench, bench.put(Torque("torque"), stiff=False, joints=("upper",))) <= 2 * TICK
    assert servos.commands == [(RELAX, "shoulder")]


def test_torque_on_holds_all_joints_where_they_are() -> None:
    bench, servos = with_servos()
    servos.relax()
    servos.turn_by_hand("elbow", 0.7)
    leaf = bench.put(Torque("torque"), stiff=True)
    play(bench, leaf)
    assert leaf.status is SUCCESS
    assert servos.commands[1:] == [(HOLD, "shoulder", "elbow")]
    assert servos.states()["elbow"].value is not None


def test_torque_on_reports_a_joint_that_stays_limp() -> None:
    bench, servos = with_servos()
    servos.relax()
    servos.stuck = {"elbow"}
    leaf = bench.put(Torque("torque"), stiff=True)
    took = play(bench, leaf)
    assert leaf.status is FAILURE
    assert leaf.reason == "elbow did not become stiff"
    assert took == pytest.approx(CONFIRMATION_TIMEOUT, abs=0.2)
    told = [command for command in servos.commands[1:-1] if command == (HOLD, "shoulder", "elbow")]
    assert len(told) == pytest.approx(CONFIRMATION_TIMEOUT / RESEND_INTERVAL, abs=1)


def test_torque_waits_for_an_offline_arm() -> None:
    bench, servos = with_servos()
    leaf = bench.put(Torque("torque"), stiff=False)
    servos.trouble = OFFLINE_ERROR
    assert tick(bench, leaf, 30.0) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    assert servos.commands == []
    servos.trouble = None
    play(bench, leaf)
    assert servos.commands == [(RELAX, "shoulder", "elbow")]


def test_torque_off_halted_halfway_leaves_the_joints_stiff() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Torque("torque"), stiff=False, joints=("elbow",))
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting for elbow to be limp"
    assert bench.halt(leaf)
    assert bench.arm.commands == [(RELAX, "elbow"), (HOLD, "elbow")]


def test_unconfirmed_torque_off_leaves_the_other_joints_limp() -> None:
    bench, servos = with_servos()
    servos.stuck = {"elbow"}
    leaf = bench.put(Torque("torque"), stiff=False)
    play(bench, leaf)
    assert leaf.status is FAILURE
    assert leaf.reason == "elbow did not become limp"
    assert servos.limp == {joint for joint in servos.limits if joint != "elbow"}


def test_torque_of_an_unknown_joint_fails_without_commands() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Torque("torque"), stiff=False, joints=("elbo",))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "the arm has no joint or group 'elbo' (did you mean 'elbow'?)"
    assert bench.arm.commands == []
