"""The physics of two wheels, against the formulas of a circle and of even acceleration."""

from math import cos, pi, sin
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import Pose2D, Velocity
from drivers.sim.wheels import SimulatedWheels


def rolling(linear: float, angular: float, *, slip: float = 0.0) -> SimulatedWheels:
    """Wheels that go at this speed from time 0 on, practically at once."""
    wheels = SimulatedWheels(acceleration=1e6, slip=slip)
    wheels.command(linear, angular, 0.0)
    wheels.advance(0.01)
    return wheels


def test_wheels_stand_still_without_a_command() -> None:
    wheels = SimulatedWheels()
    wheels.advance(1000.0)
    assert wheels.advance(1e9) == Pose2D(0.0, 0.0, 0.0)
    assert (wheels.left, wheels.right, wheels.velocity) == (0.0, 0.0, Velocity(0.0, 0.0))


def test_wheels_accelerate_at_their_limit() -> None:
    wheels = SimulatedWheels(acceleration=0.5)
    wheels.command(0.4, 0.0, 10.0)
    wheels.advance(10.4)
    assert wheels.velocity.linear == pytest.approx(0.2)
    assert wheels.pose.x == pytest.approx(0.5 * 0.5 * 0.4**2)
    wheels.advance(11.8)
    assert wheels.velocity.linear == pytest.approx(0.4)
    assert wheels.pose.x == pytest.approx(0.4**2 / (2 * 0.5) + 0.4 * 1.0)


def test_forward_rolls_along_x_and_left_turns_anticlockwise() -> None:
    straight = rolling(0.2, 0.0).advance(5.0)
    assert straight.x == pytest.approx(1.0, abs=1e-3)
    assert (straight.y, straight.heading) == (0.0, 0.0)
    turned = rolling(0.0, 0.5).advance(2.0)
    assert turned.heading == pytest.approx(1.0, abs=1e-3)
    assert turned.x == pytest.approx(0.0, abs=1e-6)


@given(st.floats(-0.7, 0.7), st.floats(-pi, pi).filter(lambda w: abs(w) > 0.01), st.floats(0.1, 20))
def test_a_constant_velocity_makes_a_circle(linear: float, angular: float, seconds: float) -> None:
    wheels = rolling(linear, angular)
    start = wheels.pose
    end = wheels.advance(0.01 + seconds)
    radius = linear / angular
    assert end.heading == pytest.approx(start.heading + angular * seconds)
    assert end.x == pytest.approx(start.x + radius * (sin(end.heading) - sin(start.heading)), abs=1e-6)
    assert end.y == pytest.approx(start.y - radius * (cos(end.heading) - cos(start.heading)), abs=1e-6)


@given(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=20))
def test_wheel_positions_are_independent_of_the_step_rate(pauses: list[float]) -> None:
    often, once = SimulatedWheels(), SimulatedWheels()
    for wheels in (often, once):
        wheels.command(0.5, 1.0, 0.0)
    now = 0.0
    for pause in pauses:
        now += pause
        often.advance(now)
    once.advance(now)
    assert often.left == pytest.approx(once.left)
    assert often.right == pytest.approx(once.right)
    assert (often.pose.x, often.pose.y) == pytest.approx((once.pose.x, once.pose.y), abs=1e-4)


def test_a_command_takes_effect_after_the_dead_time() -> None:
    wheels = SimulatedWheels(acceleration=1e6, dead_time=0.2)
    wheels.command(0.5, 0.0, 1.0)
    wheels.command(0.0, 0.0, 1.1)
    assert wheels.advance(1.19).x == 0.0
    assert wheels.advance(1.25).x == pytest.approx(0.5 * 0.05, abs=1e-3)
    assert wheels.advance(5.0).x == pytest.approx(0.5 * 0.1, abs=1e-3)


def test_slipping_wheels_turn_further_than_the_base_goes() -> None:
    wheels = rolling(0.4, 0.0, slip=0.1)
    wheels.advance(1.0)
    assert wheels.pose.x == pytest.approx(0.9 * (wheels.left + wheels.right) / 2)
    assert wheels.velocity.linear == pytest.approx(0.36)
    assert wheels.speeds == pytest.approx((0.4, 0.4))


def test_relocated_base_rolls_on_from_the_new_pose() -> None:
    wheels = rolling(0.5, 0.0)
    wheels.advance(1.0)
    travelled = wheels.left
    wheels.pose = Pose2D(3.0, 4.0, pi / 2)
    wheels.advance(2.0)
    assert (wheels.pose.x, wheels.pose.y) == pytest.approx((3.0, 4.5))
    assert wheels.left == pytest.approx(travelled + 0.5)


def test_time_running_backwards_changes_nothing() -> None:
    wheels = rolling(0.5, 0.0)
    pose = wheels.advance(2.0)
    assert wheels.advance(1.0) == pose


@pytest.mark.parametrize(
    "wrong", [{"separation": 0.0}, {"acceleration": -1.0}, {"dead_time": -0.1}, {"slip": 1.0}, {"slip": float("nan")}]
)
def test_invalid_wheels_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        SimulatedWheels(**wrong)
