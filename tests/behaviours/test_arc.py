"""Driving along a part of a circle: what the base is told, and where a base with a Kobuki's lags really ends up."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours.driving.motion import Arc
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from drivers.api import BaseState, Pose2D, Sides, Velocity
from missions.plugins.testing.recorders import STOP, LeafTestBench, good, none
from tests.behaviours.test_base import Track

SIDE = Sides(left=True)
STILL = BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0))


def arc(bench: LeafTestBench, radius: float = 0.5, degrees: float = 360.0, **arguments: object) -> Arc:
    return bench.put(Arc("arc"), radius=radius, angle=math.radians(degrees), **arguments)


def at(heading: float, *, linear: float = 0.0, angular: float = 0.0) -> BaseState:
    return BaseState(Pose2D(0.0, 0.0, heading), Velocity(linear, angular))


@pytest.mark.parametrize("side", [1, -1])
def test_a_positive_angle_goes_round_to_the_left_and_a_negative_one_to_the_right(side: int) -> None:
    bench = LeafTestBench()
    bench.tick(arc(bench, 0.5, side * 360.0, speed=0.2))
    (command,) = bench.base.commands
    assert isinstance(command, Velocity)
    assert (command.linear, command.angular) == pytest.approx((0.2, side * 0.4))


def test_arc_slows_down_towards_the_goal_on_the_same_circle() -> None:
    bench = LeafTestBench()
    leaf = arc(bench, 0.5, 90.0, speed=0.3)
    speeds = []
    for degrees in (0, 45, 80, 88):
        bench.base.reading = good(at(math.radians(degrees)))
        assert bench.tick(leaf) is RUNNING
        command = bench.base.commands[-1]
        assert isinstance(command, Velocity)
        assert command.linear == pytest.approx(0.5 * command.angular)
        speeds.append(command.linear)
    assert speeds[0] == pytest.approx(0.3)
    assert speeds == sorted(speeds, reverse=True)
    assert leaf.reason == "88 of 90 deg"


def test_arc_stops_once_at_the_goal_and_succeeds_at_standstill() -> None:
    bench = LeafTestBench()
    leaf = arc(bench, 0.5, 90.0)
    bench.tick(leaf)
    bench.base.commands.clear()
    for linear, angular, status in ((0.1, 0.0, RUNNING), (0.0, 0.1, RUNNING), (0.0, 0.0, SUCCESS)):
        bench.base.reading = good(at(math.pi / 2, linear=linear, angular=angular))
        assert bench.tick(leaf) is status
    assert bench.base.commands == [STOP]


@pytest.mark.parametrize(
    ("felt", "reason"),
    [
        (replace(STILL, bumper=SIDE), "bumped into something"),
        (replace(STILL, cliff=SIDE), "a cliff ahead"),
        (replace(STILL, wheel_drop=SIDE), "a wheel has dropped"),
    ],
)
def test_arc_fails_and_stops_the_base_at_an_obstacle(felt: BaseState, reason: str) -> None:
    bench = LeafTestBench()
    leaf = arc(bench)
    bench.tick(leaf)
    bench.base.reading = good(felt)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason
    assert bench.base.commands[-1] == STOP


def test_arc_waits_without_commands_until_the_base_reports() -> None:
    bench = LeafTestBench()
    bench.base.reading = none()
    leaf = arc(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting for the base to report"
    assert bench.base.commands == []


@settings(max_examples=30, deadline=None)
@given(
    radius=st.floats(0.05, 1.0),
    angle=st.floats(-400.0, 400.0),
    speed=st.floats(0.05, 0.5),
    dead_time=st.sampled_from([0.0, 0.1, 0.2]),
)
def test_an_arc_ends_within_two_degrees(radius: float, angle: float, speed: float, dead_time: float) -> None:
    bench = LeafTestBench()
    track = Track(arc(bench, radius, angle, speed=speed), bench, dead_time)
    assert track.pass_time(8.0 + math.radians(abs(angle)) * max(radius / speed, 0.6)) is SUCCESS
    assert math.degrees(track.pose.heading) == pytest.approx(angle, abs=2.0)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("radius", [0.1, 0.3, 1.0])
def test_full_circle_ends_at_its_start_with_its_radius(radius: float, side: int) -> None:
    bench = LeafTestBench()
    track = Track(arc(bench, radius, side * 360.0, speed=0.3), bench)
    off = 0.0
    while track.pass_time(0.1) is RUNNING and bench.clock.now() < 200.0:
        place = track.base.wheels.pose
        off = max(off, abs(math.hypot(place.x, place.y - side * radius) - radius))
    assert track.leaf.status is SUCCESS
    assert off < 0.02
    assert math.hypot(track.pose.x, track.pose.y) < 0.03
