"""Gestures: what the arm is told, on an arm that only takes it down, and on servos that take their time."""

from itertools import pairwise

import pytest
from py_trees.common import Status

from behaviours.joint_motion import CATCH_UP_TIME, GOAL_LEAD_TIME, MAX_STEP_TIME, SPEED_MARGIN
from behaviours.keyframe_playback import ARRIVAL_TIMEOUT, PEAK_SPEED_FACTORS, GestureLeaf
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from drivers.api import Gesture as Movement
from drivers.api import Keyframe, Quality, Reading
from drivers.errors import DeviceFault
from missions.plugins.testing.recorders import HOLD, OFFLINE_ERROR, LeafTestBench, none
from tests.behaviours.servo_arm import TICK, moves, play, tick, with_servos

WAVE = Movement(
    "wave",
    "Lift the arm and wave.",
    (
        Keyframe(1.0, {"shoulder": 0.6, "elbow": 0.9}),
        Keyframe(1.5, {"elbow": 0.5}),
        Keyframe(2.5, {"shoulder": 0.0, "elbow": 0.0}),
    ),
)


def waving(bench: LeafTestBench, movement: Movement = WAVE, **arguments: object) -> GestureLeaf:
    return bench.put(GestureLeaf("gesture"), gesture=movement, **arguments)


# --- what it tells the arm -------------------------------------------------------------------------------------------


def test_gesture_plays_every_keyframe_on_time() -> None:
    bench = LeafTestBench()
    leaf = waving(bench)
    statuses: list[Status] = []
    while not statuses or statuses[-1] is RUNNING:
        statuses.append(bench.tick(leaf, after=TICK))
        bench.arm.place(moves(bench.arm)[-1])
    assert statuses[-1] is SUCCESS
    assert len(statuses) == pytest.approx(1 + 2.5 / TICK, abs=1)
    told = moves(bench.arm)
    assert bench.arm.commands == told
    # The first tick tells where to be a tick later, and so on.
    assert told[19] == pytest.approx({"shoulder": 0.6, "elbow": 0.9}, abs=1e-3)
    assert told[29] == pytest.approx({"shoulder": 0.6, "elbow": 0.5}, abs=1e-3)
    assert told[-1] == {"shoulder": 0.0, "elbow": 0.0}


def test_gesture_moves_only_its_own_joints() -> None:
    bench = LeafTestBench()
    bench.tick(waving(bench, Movement("nod", "", (Keyframe(1.0, {"elbow": 0.5}),))))
    assert [move.keys() for move in moves(bench.arm)] == [{"elbow"}]


def test_gesture_starts_from_the_measured_joint_angles() -> None:
    bench = LeafTestBench()
    bench.arm.place({"shoulder": 0.5, "elbow": 1.0})
    bench.tick(waving(bench))
    assert moves(bench.arm)[0] == pytest.approx({"shoulder": 0.5, "elbow": 1.0}, abs=1e-3)


def test_gesture_at_half_speed_takes_twice_as_long() -> None:
    bench, _ = with_servos()
    usual = play(bench, waving(bench))
    assert play(bench, waving(bench, speed=0.5)) == pytest.approx(2 * usual, abs=0.2)


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_no_goal_is_farther_from_the_last_than_a_joint_gets_in_a_tick(speed: float) -> None:
    bench = LeafTestBench()
    leaf = waving(bench, speed=speed)
    while bench.tick(leaf, after=TICK) is RUNNING:
        bench.arm.place(moves(bench.arm)[-1])
    for here, there in pairwise(moves(bench.arm)):
        for joint, limits in bench.arm.limits.items():
            assert abs(there[joint] - here[joint]) <= limits.speed * TICK + 1e-9


def test_gesture_speeds_fit_each_step() -> None:
    bench, servos = with_servos()
    servos.short = 0.0
    leaf = waving(bench, Movement("lift", "", (Keyframe(2.0, {"elbow": 1.0}),)))
    play(bench, leaf)
    told = [speeds["elbow"] for speeds in servos.speeds]
    fastest = PEAK_SPEED_FACTORS["minimum_jerk"] * 1.0 / 2.0
    assert max(told) == pytest.approx(SPEED_MARGIN * fastest, rel=0.1)
    assert told[0] < 0.2 * fastest
    assert max(told) < servos.limits["elbow"].speed


def test_lagging_joint_gets_a_higher_speed() -> None:
    bench, servos = with_servos()
    leaf = waving(bench, Movement("lift", "", (Keyframe(4.0, {"elbow": 1.0}),)))
    tick(bench, leaf, 2.0)
    before = servos.speeds[-1]["elbow"]
    servos.turn_by_hand("elbow", servos.shafts["elbow"].position - 0.2)
    tick(bench, leaf, TICK)
    assert servos.speeds[-1]["elbow"] == pytest.approx(before + SPEED_MARGIN * 0.2 / CATCH_UP_TIME, abs=0.2)


def test_cubic_gesture_does_not_stop_at_its_keyframes() -> None:
    bench, _ = with_servos()
    frames = tuple(Keyframe(1.0 + 0.2 * n, {"elbow": 0.1 * n}) for n in range(6))
    leaf = waving(bench, Movement("rise", "", frames, "cubic"))
    play(bench, leaf)
    assert leaf.status is SUCCESS
    told = [move["elbow"] for move in moves(bench.arm)]
    steps = [there - here for here, there in pairwise(told) if 0.1 < here < 0.4]
    assert min(steps) > 0.8 * max(steps)


# --- what it refuses -------------------------------------------------------------------------------------------------


def test_gesture_with_a_missing_joint_fails_before_any_motion() -> None:
    bench = LeafTestBench()
    leaf = waving(bench, Movement("clap", "", (Keyframe(1.0, {"elbow": 0.5}), Keyframe(2.0, {"hand": 0.0}))))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "the arm has no joint 'hand'"
    assert bench.arm.commands == []


def test_gesture_with_a_keyframe_outside_the_limits_fails_before_any_motion() -> None:
    bench = LeafTestBench()
    leaf = waving(bench, Movement("clap", "", (Keyframe(1.0, {"elbow": 0.5}), Keyframe(2.0, {"elbow": -0.2}))))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "elbow at -11.5 deg is outside its limits (0 deg to 126.1 deg)"
    assert bench.arm.commands == []


def test_gesture_reports_all_unfit_joints_together() -> None:
    bench = LeafTestBench()
    frames = (Keyframe(1.0, {"elbow": -0.2, "hand": 1.0}), Keyframe(2.0, {"shoulder": 3.0, "elbow": 9.0}))
    leaf = waving(bench, Movement("clap", "", frames))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == (
        "the arm has no joint 'hand'; elbow at -11.5 deg is outside its limits (0 deg to 126.1 deg); "
        "shoulder at 171.9 deg is outside its limits (-57.3 deg to 114.6 deg)"
    )


def test_a_keyframe_at_the_limit_is_played() -> None:
    bench = LeafTestBench()
    limit = bench.arm.limits["elbow"].upper
    assert bench.tick(waving(bench, Movement("up", "", (Keyframe(1.0, {"elbow": limit}),)))) is RUNNING


@pytest.mark.parametrize("quality", [Quality.NONE, Quality.STALE])
def test_gesture_waits_for_silent_joints_and_names_them(quality: Quality) -> None:
    bench = LeafTestBench()
    before = bench.arm.readings["elbow"]
    bench.arm.readings["elbow"] = none() if quality is Quality.NONE else Reading(before.value, 0.0, quality)
    leaf = waving(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting for elbow to report"
    assert bench.arm.commands == []
    bench.arm.readings["elbow"] = before
    bench.tick(leaf, after=9.0)
    assert moves(bench.arm)[0] == pytest.approx({"shoulder": 0.0, "elbow": 0.0}, abs=2e-3)


def test_gesture_halted_before_the_first_report_sends_no_command() -> None:
    bench = LeafTestBench()
    bench.arm.readings["elbow"] = none()
    leaf = waving(bench)
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.arm.commands == []


# --- how it ends -----------------------------------------------------------------------------------------------------


def test_gesture_halt_holds_its_joints_once() -> None:
    bench = LeafTestBench()
    leaf = waving(bench, Movement("nod", "", (Keyframe(1.0, {"elbow": 0.5}),)))
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.halt(leaf)
    assert bench.arm.commands[1:] == [(HOLD, "elbow")]


def test_gesture_succeeds_although_servos_stay_slightly_short() -> None:
    bench, _ = with_servos()
    leaf = waving(bench)
    took = play(bench, leaf)
    assert leaf.status is SUCCESS
    assert took == pytest.approx(2.5, abs=0.2)
    assert bench.arm.commands == moves(bench.arm)


def test_gesture_with_a_stuck_joint_fails_and_holds_the_arm() -> None:
    bench, servos = with_servos()
    servos.shafts["elbow"].position = servos.shafts["elbow"].goal = 1.5
    servos.stuck = {"elbow"}
    leaf = waving(bench)
    took = play(bench, leaf)
    assert leaf.status is FAILURE
    assert leaf.reason == "wave: elbow did not arrive"
    assert took == pytest.approx(2.5 + ARRIVAL_TIMEOUT, abs=0.5)
    assert servos.commands[-1] == (HOLD, "shoulder", "elbow")


def test_silent_joint_has_not_arrived() -> None:
    bench = LeafTestBench()
    leaf = waving(bench)
    bench.tick(leaf)
    bench.arm.readings["elbow"] = Reading(bench.arm.readings["elbow"].value, 0.0, Quality.STALE)
    for _ in range(60):
        bench.tick(leaf)
    assert leaf.reason == "wave: waiting for elbow"


def test_gesture_fails_and_holds_the_arm_on_a_device_fault() -> None:
    bench = LeafTestBench()
    leaf = waving(bench)
    bench.tick(leaf)
    bench.arm.trouble = DeviceFault("arm: elbow overload")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "arm: elbow overload"
    assert bench.arm.commands[-1] == (HOLD, "shoulder", "elbow")


def test_gesture_restarts_at_the_first_keyframe_after_success_and_halt() -> None:
    bench, _ = with_servos()
    leaf = waving(bench)
    first = play(bench, leaf)
    assert play(bench, leaf) == pytest.approx(first, abs=0.2)
    for _ in range(20):
        bench.tick(leaf, after=TICK)
    bench.halt(leaf)
    assert play(bench, leaf) == pytest.approx(first, abs=0.2)


# --- late ticks and a lost arm ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("lost", [True, False])
def test_gesture_resumes_after_a_disconnect_or_a_pause(lost: bool) -> None:
    bench = LeafTestBench()
    leaf = waving(bench)
    for _ in range(9):
        bench.tick(leaf, after=TICK)
    before = moves(bench.arm)[-1]
    if lost:
        bench.arm.trouble = OFFLINE_ERROR
        for _ in range(40):
            assert bench.tick(leaf, after=TICK) is RUNNING
        assert leaf.reason == "waiting: the cable is out"
        bench.arm.trouble = None
    bench.tick(leaf, after=TICK if lost else 5.0)
    after = moves(bench.arm)[-1]
    for joint, limits in bench.arm.limits.items():
        assert abs(after[joint] - before[joint]) <= limits.speed * MAX_STEP_TIME
    assert leaf.reason == "wave: 0.5 of 2.5 s"


def test_goals_run_ahead_by_about_a_tick() -> None:
    assert pytest.approx(TICK) == GOAL_LEAD_TIME
