"""The time limit of motions: it ends those that never get there, and its clock stands while they are held up."""

from dataclasses import replace

import pytest

from behaviours.docking import DockLeaf
from behaviours.driving.go_to import GoTo
from behaviours.driving.motion import (
    NO_PROGRESS_TIMEOUT,
    SETTLING_TIMEOUT,
    STOP_TIMEOUT,
    TIME_LIMIT_MARGIN,
    Arc,
    BaseMotion,
    DriveLeaf,
    StopLeaf,
    TurnLeaf,
    seconds_to_drive,
    time_limit,
)
from behaviours.leaf import FAILURE, RUNNING
from behaviours.legs import Sit, Stand, TurnInPlace, WalkLeaf
from drivers.api import ZERO_VELOCITY, BaseState, Pose2D, Source, Steering, Velocity
from missions.plugins.testing.recorders import LeafTestBench, good

TICK = 0.05
AHEAD = Velocity(0.2, 0.0)


def bounded(bench: LeafTestBench) -> list[BaseMotion]:
    return [
        bench.put(DriveLeaf("drive"), distance=0.5),
        bench.put(TurnLeaf("turn"), angle=1.0),
        bench.put(Arc("arc"), radius=0.5),
        bench.put(GoTo("go_to"), x=1.0, y=1.0),
        bench.put(WalkLeaf("walk"), distance=0.5),
        bench.put(TurnInPlace("turn_in_place"), angle=1.0),
        bench.put(Stand("stand")),
        bench.put(Sit("sit")),
        bench.put(DockLeaf("dock")),
    ]


def seconds_to_end(bench: LeafTestBench, leaf: BaseMotion, most: float = 300.0) -> float:
    """Return after how long a leaf ends."""
    began = bench.clock.now()
    while bench.tick(leaf, after=TICK) is RUNNING:
        assert bench.clock.now() - began < most, "it goes on and on"
    return bench.clock.now() - began


@pytest.mark.parametrize("number", range(9))
@pytest.mark.parametrize("reckoned", [False, True])
def test_motion_without_arrival_fails_at_its_time_limit(number: int, reckoned: bool) -> None:
    bench = LeafTestBench()
    bench.robot = replace(bench.robot, ros2_part=None)
    bench.base.reading = good(replace(BaseState(Pose2D(0.0, 0.0, 0.0), AHEAD), reckoned=reckoned))
    leaf = bounded(bench)[number]
    assert seconds_to_end(bench, leaf) > TIME_LIMIT_MARGIN
    assert leaf.status is FAILURE


def test_time_limit_is_the_expected_time_plus_a_margin() -> None:
    bench = LeafTestBench()
    leaf = bounded(bench)[0]
    limit = time_limit(seconds_to_drive(0.5, 0.2, bench.base.limits))
    assert seconds_to_end(bench, leaf) == pytest.approx(limit, abs=0.2)
    assert leaf.reason == f"not done within its time limit of {limit:.0f} s"


def test_time_limit_restarts_after_teleoperation() -> None:
    bench = LeafTestBench()
    leaf = bounded(bench)[0]
    limit = time_limit(seconds_to_drive(0.5, 0.2, bench.base.limits))
    bench.tick(leaf)
    bench.base.steers = Steering(Source.TELEOP, AHEAD, AHEAD)
    for _ in range(round(2 * limit / TICK)):
        assert bench.tick(leaf, after=TICK) is RUNNING
    bench.base.steers = Steering(None, ZERO_VELOCITY, ZERO_VELOCITY)
    assert seconds_to_end(bench, leaf) == pytest.approx(limit, abs=0.2)


def test_time_limit_is_paused_with_the_run() -> None:
    bench = LeafTestBench()
    leaf = bounded(bench)[0]
    bench.tick(leaf)
    for _ in range(3):
        assert bench.tick(leaf, after=600.0) is RUNNING  # no tick comes in a pause


def test_time_limit_stretches_while_the_base_is_slowed_down() -> None:
    bench = LeafTestBench()
    leaf = bounded(bench)[0]
    limit = time_limit(seconds_to_drive(0.5, 0.2, bench.base.limits))
    bench.base.steers = Steering(Source.MISSION, AHEAD, Velocity(0.05, 0.0), "something is in the way, 0.4 m ahead")
    assert seconds_to_end(bench, leaf) == pytest.approx(4 * limit, rel=0.02)


@pytest.mark.parametrize("number", [0, 1, 2, 3, 4, 5, 8])
@pytest.mark.parametrize("share", [0.3, 0.6])
def test_the_limit_follows_a_changed_limit_of_the_base(number: int, share: float) -> None:
    bench = LeafTestBench()
    bench.robot = replace(bench.robot, ros2_part=None)
    leaf, usual = bounded(bench)[number], bench.base.limits
    slow = replace(usual, speed=0.2 * share, turn=0.4 * share)
    bench.base.reading = good(BaseState(Pose2D(0.0, 0.0, 0.0), AHEAD))
    whole = seconds_to_end(bench, leaf)
    bench.base.limits = slow
    slowly = seconds_to_end(bench, leaf, most=2000.0)
    assert slowly > whole + 1.0
    bench.base.limits = usual
    for _ in range(round(whole / 2 / TICK)):
        bench.tick(leaf, after=TICK)
    bench.base.limits = slow
    assert seconds_to_end(bench, leaf, most=2000.0) == pytest.approx(slowly / 2, abs=0.5)
    assert leaf.status is FAILURE


def test_changing_speed_limits_do_not_extend_a_motion_forever() -> None:
    bench = LeafTestBench()
    leaf, usual = bounded(bench)[0], bench.base.limits
    bench.base.reading = good(BaseState(Pose2D(0.0, 0.0, 0.0), AHEAD))
    status, began = bench.tick(leaf), bench.clock.now()
    while status is RUNNING:
        bench.base.limits = replace(usual, speed=0.1 if bench.base.limits == usual else usual.speed)
        status = bench.tick(leaf, after=TICK)
        assert bench.clock.now() - began < time_limit(seconds_to_drive(0.5, 0.1, usual))


@pytest.mark.parametrize("number", range(6))
def test_a_motion_waits_for_the_gyro_for_a_while_only(number: int) -> None:
    bench = LeafTestBench()
    bench.robot = replace(bench.robot, ros2_part=None)
    bench.base.reading = good(BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY, settling=True))
    leaf = bounded(bench)[number]
    bench.tick(leaf)
    assert leaf.reason == "waiting for the drift of the gyro to be known"
    assert bench.base.commands == []
    for _ in range(round((SETTLING_TIMEOUT + 0.5) / TICK)):
        bench.tick(leaf, after=TICK)
    assert bench.base.commands != []
    assert seconds_to_end(bench, leaf) > TIME_LIMIT_MARGIN


def test_stop_fails_if_the_base_keeps_moving() -> None:
    bench = LeafTestBench()
    bench.base.reading = good(BaseState(Pose2D(0.0, 0.0, 0.0), AHEAD))
    assert seconds_to_end(bench, bench.put(StopLeaf("stop"))) == pytest.approx(STOP_TIMEOUT, abs=0.2)


def test_nav2_motion_fails_without_progress() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bounded(bench)[3]
    bench.tick(leaf)
    assert leaf.reason.endswith("by Nav2")
    assert seconds_to_end(bench, leaf) == pytest.approx(NO_PROGRESS_TIMEOUT, abs=1.0)
    assert leaf.reason == f"no progress for {NO_PROGRESS_TIMEOUT:g} s"
