"""Driving to a place: where a base with a Kobuki's lags really ends up, and how it fails."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours.driving.go_to import MAX_TRIES, GoTo
from behaviours.leaf import FAILURE, SUCCESS
from drivers.api import BaseState, Pose2D, Sides, Source, Steering, Velocity
from missions.plugins.testing.recorders import STOP, LeafTestBench, good
from tests.behaviours.test_base import Track

STILL = Velocity(0.0, 0.0)


def going(bench: LeafTestBench, x: float, y: float, **arguments: object) -> GoTo:
    return bench.put(GoTo("go_to"), x=x, y=y, **arguments)


@settings(max_examples=30, deadline=None)
@given(
    x=st.floats(-1.0, 1.0),
    y=st.floats(-1.0, 1.0),
    heading=st.floats(-math.pi, math.pi),
    dead_time=st.sampled_from([0.0, 0.1, 0.2]),
)
def test_go_to_ends_at_the_goal_with_its_heading(x: float, y: float, heading: float, dead_time: float) -> None:
    bench = LeafTestBench()
    track = Track(going(bench, x, y, heading=heading), bench, dead_time)
    assert track.pass_time(40.0) is SUCCESS
    pose = track.pose
    assert math.hypot(pose.x - x, pose.y - y) < 0.025
    assert abs(math.remainder(pose.heading - heading, math.tau)) < math.radians(0.5)


def test_go_to_without_a_heading_keeps_the_direction_of_arrival() -> None:
    bench = LeafTestBench()
    track = Track(going(bench, 0.5, 0.5), bench)
    assert track.pass_time(20.0) is SUCCESS
    assert math.degrees(track.pose.heading) == pytest.approx(45.0, abs=5.0)


def test_go_to_the_current_pose_does_not_move() -> None:
    bench = LeafTestBench()
    leaf = going(bench, 0.0, 0.0, heading=0.0)
    assert bench.tick(leaf) is SUCCESS
    assert set(bench.base.commands) == {STOP}


def test_go_to_turns_on_the_spot_to_a_goal_behind() -> None:
    bench = LeafTestBench()
    bench.tick(going(bench, -1.0, 0.1))
    (command,) = bench.base.commands
    assert isinstance(command, Velocity)
    assert command.linear == 0.0
    assert command.angular > 0.5


def test_go_to_turns_the_shorter_way_after_full_turns() -> None:
    bench = LeafTestBench()
    bench.base.reading = good(BaseState(Pose2D(1.0, 0.0, 4 * math.pi + 0.3), STILL))
    leaf = going(bench, 1.0, 0.0, heading=0.0)
    for _ in range(3):
        bench.tick(leaf)
    command = bench.base.commands[-1]
    assert isinstance(command, Velocity)
    assert command.angular < 0.0


def test_go_to_reaches_the_goal_after_teleoperation() -> None:
    bench = LeafTestBench()
    track = Track(going(bench, 1.0, 0.0, heading=0.0), bench)
    track.pass_time(2.0)
    track.base.steers = Steering(Source.TELEOP, STILL, STILL)
    track.pass_time(1.5)  # by then the base rests: a jump under way would be a motion fault
    track.base.wheels.pose = Pose2D(0.2, -0.6, 2.0)
    track.base.steers = Steering(None, STILL, STILL)
    assert track.pass_time(40.0) is SUCCESS


def test_go_to_fails_and_stops_at_an_obstacle() -> None:
    bench = LeafTestBench()
    leaf = going(bench, 1.0, 0.0)
    bench.tick(leaf)
    bench.base.reading = good(BaseState(Pose2D(0.1, 0.0, 0.0), STILL, bumper=Sides(centre=True)))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "bumped into something"
    assert bench.base.commands[-1] == STOP


def test_go_to_fails_after_too_many_misses() -> None:
    bench = LeafTestBench()
    leaf = going(bench, 1.0, 0.0)
    for rolls in (True, False) * MAX_TRIES:  # it was there, but rolls on beyond
        linear, x = (0.1, 1.0) if rolls else (0.0, 1.05)
        bench.base.reading = good(BaseState(Pose2D(x, 0.0, 0.0), Velocity(linear, 0.0)))
        status = bench.tick(leaf)
    assert status is FAILURE
    assert leaf.reason == "missed the place by 5 cm"
