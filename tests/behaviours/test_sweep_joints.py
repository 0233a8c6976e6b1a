"""To and fro: between two angles, evenly or as sines, slowly to where it begins, and held where it is halted."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.joint_motion import RUN_IN_SPEED
from behaviours.leaf import FAILURE, RUNNING
from behaviours.sweep_joints import SweepLeaf, SwingPath
from missions.plugins.testing.recorders import HOLD, LeafTestBench
from tests.behaviours.servo_arm import TICK, moves, tick, with_servos

BETWEEN = (0.2, 1.2)


def sweeping(bench: LeafTestBench, joints: tuple[str, ...] = ("elbow",), **arguments: object) -> SweepLeaf:
    return bench.put(SweepLeaf("sweep"), **{"joints": joints, "between": BETWEEN, **arguments})


@given(
    st.booleans(),
    st.floats(0.5, 10.0),
    st.floats(0.0, math.tau),
    st.floats(0.0, 100.0),
)
def test_swing_stays_between_its_ends_and_below_its_max_speed(
    sine: bool, period: float, phase: float, time: float
) -> None:
    swing = SwingPath(0.2, 1.2, period, {"elbow": phase}, sine=sine)
    here, there = swing.at(time)["elbow"], swing.at(time + 1e-3)["elbow"]
    assert 0.2 - 1e-9 <= here <= 1.2 + 1e-9
    assert abs(there - here) <= swing.max_speed * 1e-3 * (1 + 1e-6)
    assert swing.at(time + period)["elbow"] == pytest.approx(here, abs=1e-6)


def test_a_phase_is_how_far_ahead_a_joint_is() -> None:
    swing = SwingPath(0.0, 1.0, 4.0, {"one": 0.0, "other": math.pi / 2}, sine=True)
    assert swing.at(2.0)["other"] == pytest.approx(swing.at(3.0)["one"])


def test_sweep_joints_runs_in_slowly_and_then_swings_evenly() -> None:
    bench, servos = with_servos()
    servos.turn_by_hand("elbow", 2.0)
    assert tick(bench, sweeping(bench, period=4.0), 12.0) is RUNNING
    told = [move["elbow"] for move in moves(servos)]
    assert max(abs(there - here) for here, there in pairwise(told)) <= RUN_IN_SPEED * TICK + 1e-9
    swinging = told[round(4.0 / TICK) :]
    assert (min(swinging), max(swinging)) == pytest.approx(BETWEEN, abs=0.03)
    steps = [abs(there - here) for here, there in pairwise(swinging)]
    assert sorted(steps)[len(steps) // 2] == pytest.approx(2.0 * 1.0 / 4.0 * TICK, rel=0.01)


def test_sweep_joints_lengthens_a_too_short_period() -> None:
    bench, servos = with_servos()
    tick(bench, sweeping(bench, ("shoulder", "elbow"), period=0.2, sine=True), 6.0)
    told = moves(servos)[round(2.0 / TICK) :]
    for joint, limits in servos.limits.items():
        fastest = max(abs(there[joint] - here[joint]) for here, there in pairwise(told)) / TICK
        assert fastest <= limits.speed * (1 + 1e-6)


def test_sweep_joints_applies_the_phases() -> None:
    bench, servos = with_servos()
    tick(bench, sweeping(bench, ("shoulder", "elbow"), sine=True, period=2.0, phases={"elbow": math.pi}), 8.0)
    for move in moves(servos)[round(4.0 / TICK) :]:
        assert move["shoulder"] + move["elbow"] == pytest.approx(sum(BETWEEN), abs=1e-6)


def test_sweep_joints_halt_holds_only_its_joints() -> None:
    bench, servos = with_servos(bend=("elbow",))
    leaf = sweeping(bench, ("bend",))
    tick(bench, leaf, 1.0)
    assert bench.halt(leaf)
    assert servos.commands[-1] == (HOLD, "elbow")


def test_sweep_joints_reports_all_violations_before_any_motion() -> None:
    bench = LeafTestBench()
    leaf = sweeping(bench, ("elbow",), between=(-1.0, 3.0), phases={"hand": 1.0})
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == (
        "elbow at -57.3 deg is outside its limits (0 deg to 126.1 deg); "
        "there is a phase for 'hand', which does not move"
    )
    assert bench.tick(sweeping(bench, ("hand",))) is FAILURE
    assert bench.arm.commands == []


def test_after_a_lost_tick_nothing_leaps() -> None:
    bench, servos = with_servos()
    leaf = sweeping(bench)
    tick(bench, leaf, 3.0)
    before = moves(servos)[-1]["elbow"]
    bench.tick(leaf, after=9.3)
    assert abs(moves(servos)[-1]["elbow"] - before) < 0.1
