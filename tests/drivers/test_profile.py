"""The motion profile: never too fast, never too hard, never past its goal, and never later than it need be."""

from itertools import pairwise
from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import HeadLimits
from drivers.head.pantilt import MAX_STEP, MotionProfile

SPEED, ACCELERATION = 2.0, 7.0
angles = st.floats(-3, 3)


def profile(position: float = 0.0) -> MotionProfile:
    return MotionProfile(position, SPEED, ACCELERATION)


def seconds_to(goal: float, step: float) -> float:
    """How long it takes from rest at 0 to rest at ``goal``, asked every ``step`` seconds."""
    way, steps = profile(), 0
    way.set_goal(goal, now=0.0)
    while way.position != goal or way.velocity != 0.0:
        steps += 1
        way.advance(steps * step)
        assert steps * step < 20.0
    return steps * step


@given(angles, st.lists(st.tuples(angles, st.floats(0, 0.5)), max_size=20))
def test_profile_respects_speed_and_acceleration(start: float, moves: list[tuple[float, float]]) -> None:
    way, now = profile(start), 0.0
    for goal, seconds in moves:
        way.set_goal(goal, now)
        before, speed, now = way.position, way.velocity, now + seconds
        after, time = way.advance(now), min(seconds, MAX_STEP)
        assert abs(after - before) <= SPEED * time + 1e-9
        assert abs(way.velocity) <= SPEED + 1e-9
        assert abs(way.velocity - speed) <= ACCELERATION * time + 1e-6


@given(angles, angles, st.floats(0.001, MAX_STEP))
def test_profile_from_rest_never_overshoots_or_turns_back(start: float, goal: float, step: float) -> None:
    way = profile(start)
    way.set_goal(goal, now=0.0)
    positions = [way.advance(number * step) for number in range(1, 200)]
    low, high = sorted((start, goal))
    assert all(low - 1e-9 <= position <= high + 1e-9 for position in positions)
    assert all((later - sooner) * (goal - start) >= -1e-12 for sooner, later in pairwise(positions))


@given(angles.filter(lambda goal: abs(goal) > 1e-3), st.sampled_from([0.003, 0.02, 0.05]))
def test_profile_arrives_in_minimum_time(goal: float, step: float) -> None:
    limits = HeadLimits((-3, 3), (-3, 3), SPEED, ACCELERATION)
    assert seconds_to(goal, step) == pytest.approx(limits.time_for(goal), abs=step + 1e-6)


@pytest.mark.parametrize(("angle", "seconds"), [(0.0, 0.0), (0.28, 0.4), (-0.28, 0.4), (2.0, 1.0 + 2.0 / 7.0)])
def test_time_for_a_turn_is_that_of_a_trapezoid(angle: float, seconds: float) -> None:
    assert HeadLimits((-3, 3), (-3, 3), SPEED, ACCELERATION).time_for(angle) == pytest.approx(seconds)


@given(angles, angles, angles, st.floats(0.0, 1.0))
def test_profile_position_is_independent_of_the_step_rate(
    start: float, goal: float, other: float, turned: float
) -> None:
    often, seldom = profile(start), profile(start)
    for way in (often, seldom):
        way.set_goal(goal, now=0.0)
    for number in range(1, 401):
        now = number / 200
        if number == round(turned * 400):
            for way in (often, seldom):
                way.set_goal(other, now)
        often.advance(now)
        if number % 16 == 0:
            assert seldom.advance(now) == pytest.approx(often.position, abs=1e-6)


@given(angles, st.floats(0.05, 2.0))
def test_braking_takes_the_distance_of_the_acceleration(goal: float, after: float) -> None:
    way = profile()
    way.set_goal(goal, now=0.0)
    steps = round(after / 0.01)
    for number in range(steps):
        way.advance(number * 0.01)
    began, speed = way.position, way.velocity
    now = way.stamp
    way.brake(now)
    for number in range(1, 101):
        way.advance(now + number * 0.01)
    assert way.velocity == 0.0
    assert abs(way.position - began) == pytest.approx(speed**2 / (2 * ACCELERATION), abs=1e-9)


def test_reversed_profile_brakes_first() -> None:
    way = profile()
    way.set_goal(3.0, now=0.0)
    for number in range(1, 11):
        way.advance(number / 10)
    assert way.velocity == pytest.approx(SPEED)
    there = way.position
    way.set_goal(0.0, now=1.0)
    assert way.advance(1.1) > there
    assert way.velocity == pytest.approx(SPEED - ACCELERATION * 0.1)


def test_halted_profile_stops_at_once_and_can_be_placed() -> None:
    way = profile()
    way.set_goal(1.0, now=0.0)
    way.advance(0.1)
    way.halt()
    assert way.advance(0.2) == pytest.approx(ACCELERATION * 0.01 / 2)
    assert way.velocity == 0.0
    way.set_goal(1.0, now=0.2)
    way.set_position(-1.0, now=0.3)
    assert way.goal == 1.0
    assert -1.0 < way.advance(0.4) < -0.9


def test_shifted_profile_continues_smoothly() -> None:
    way = profile()
    way.set_goal(1.0, now=0.0)
    way.advance(0.1)
    speed = way.velocity
    way.shift(0.5)
    assert (way.velocity, way.goal) == (speed, 1.0)
    assert way.position == pytest.approx(0.5 + ACCELERATION * 0.01 / 2)


def test_delayed_thread_makes_no_jump() -> None:
    way = profile()
    way.set_goal(1.0, now=0.0)
    assert way.advance(5.0) == pytest.approx(ACCELERATION * MAX_STEP**2 / 2)
    assert way.advance(4.0) == way.position
    assert sqrt(2 * way.position / ACCELERATION) == pytest.approx(MAX_STEP)
