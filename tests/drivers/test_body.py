"""The body of a base against walls, people and edges, in simulated time."""

from collections.abc import Callable, Sequence
from math import cos, degrees, hypot, pi, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import BASE_RADIUS, Pose2D, Sides, Velocity
from drivers.sim.base_body import BODY_COMMAND_TIMEOUT, NO_SIDES, BaseBody, merge_sides
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world_objects import OpenFloor

WALL = 1.0
"""Where the wall of ``Walled`` stands, in metres along x; all that is beyond is solid."""


class Walled(OpenFloor):
    """A ``Ground`` with a wall across the x axis."""

    def contact_directions(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        del y, time
        return (0.0,) if x + radius >= WALL else ()


class Felt(OpenFloor):
    """A ``Ground`` on which something is touched in a direction that the test chooses (degrees), or nothing."""

    def __init__(self, *directions: float) -> None:
        self.directions = [radians(direction) for direction in directions]

    def contact_directions(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        del x, y, radius, time
        return self.directions


class Holed(OpenFloor):
    """A ``Ground`` whose floor is missing wherever ``hole`` says so."""

    def __init__(self, hole: Callable[[float, float], bool]) -> None:
        self.hole = hole

    def has_floor(self, x: float, y: float) -> bool:
        return not self.hole(x, y)


def drive(body: BaseBody, linear: float, angular: float, start: float, seconds: float) -> float:
    """Renew a command every 20 ms, as the driver does; return the time at the end."""
    for step in range(round(seconds / 0.02)):
        body.command(linear, angular, start + step * 0.02)
    body.advance(start + seconds)
    return start + seconds


def test_body_follows_its_wheels_on_an_open_floor() -> None:
    body, wheels = BaseBody(), SimulatedWheels()
    body.command(0.3, 0.4, 0.0)
    wheels.command(0.3, 0.4, 0.0)
    pose, rolled = body.advance(0.4), wheels.advance(0.4)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((rolled.x, rolled.y, rolled.heading), abs=1e-6)
    assert body.velocity == wheels.velocity
    assert (body.bumper, body.cliff, body.wheel_drop) == (NO_SIDES, NO_SIDES, NO_SIDES)


@given(
    st.floats(-pi, pi),
    st.lists(st.tuples(st.floats(-0.7, 0.7), st.floats(-3, 3), st.floats(0.02, 2.0)), min_size=1, max_size=8),
)
def test_body_never_passes_a_wall(heading: float, moves: list[tuple[float, float, float]]) -> None:
    body = BaseBody(wheels=SimulatedWheels(pose=Pose2D(0.5, 0.0, heading)), ground=Walled())
    now = 0.0
    for linear, angular, seconds in moves:
        now = drive(body, linear, angular, now, seconds)
        assert body.pose.x <= WALL - BASE_RADIUS + 0.001


def test_body_reaches_the_wall_and_its_bumper_stays_pressed() -> None:
    body = BaseBody(ground=Walled())
    now = drive(body, 0.5, 0.0, 0.0, 4.0)
    assert body.pose.x == pytest.approx(WALL - BASE_RADIUS, abs=0.001)
    assert body.bumper == Sides(centre=True)
    assert body.velocity == Velocity(0.0, 0.0)
    now = drive(body, 0.0, 0.0, now, 2.0)
    assert body.bumper == Sides(centre=True)
    drive(body, -0.2, 0.0, now, 1.0)
    assert body.bumper == NO_SIDES
    assert body.pose.x == pytest.approx(WALL - BASE_RADIUS - 0.19, abs=0.01)


def test_blocked_body_slips_its_wheels_and_turns_on_the_spot() -> None:
    body = BaseBody(ground=Walled())
    now = drive(body, 0.5, 0.0, 0.0, 4.0)
    left, right = body.encoders
    before = body.pose
    drive(body, 0.2, 0.5, now, 1.0)
    assert (body.pose.x, body.pose.y) == (before.x, before.y)
    assert body.pose.heading == pytest.approx(0.5, abs=0.1)
    assert (body.velocity.linear, body.velocity.angular) == pytest.approx((0.0, 0.5))
    assert body.encoders[0] > left + 1000
    assert body.encoders[1] > right + 2000


def test_rounding_error_in_time_does_not_release_the_body() -> None:
    body = BaseBody(wheels=SimulatedWheels(pose=Pose2D(0.0, 0.0, 0.5)), ground=Walled())
    now = drive(body, 0.5, 0.0, 0.0, 4.0)
    body.advance(now + 1e-12)
    assert body.velocity == Velocity(0.0, 0.0)
    assert min(body.currents) > 3.0


def test_blocked_wheel_is_overloaded_after_a_while_until_it_is_free() -> None:
    body = BaseBody(ground=Walled())
    now = drive(body, 0.3, 0.0, 0.0, 2.7)
    assert body.overcurrent == NO_SIDES
    assert body.velocity.linear == pytest.approx(0.3)
    now = drive(body, 0.3, 0.0, now, 0.7)
    assert body.overcurrent == Sides(left=True, right=True)
    drive(body, -0.3, 0.0, now, 0.5)
    assert body.overcurrent == NO_SIDES
    assert body.currents == pytest.approx((0.24, 0.24))


def test_motors_draw_nothing_while_standing_at_a_wall() -> None:
    body = BaseBody(ground=Walled())
    drive(body, 0.0, 0.0, drive(body, 0.3, 0.0, 0.0, 4.0), 1.0)
    assert (body.bumper, body.currents, body.overcurrent) == (Sides(centre=True), (0.0, 0.0), NO_SIDES)


@given(st.lists(st.floats(0.001, 0.3), min_size=1, max_size=20))
def test_wall_stops_the_body_at_the_same_place_at_any_update_rate(pauses: list[float]) -> None:
    body, now = BaseBody(ground=Walled()), 0.0
    for pause in pauses * 30:
        now += pause
        body.command(0.4, 0.0, now)
        if now > 6.0:
            break
    drive(body, 0.4, 0.0, now, max(0.0, 6.0 - now))
    assert body.pose.x == pytest.approx(WALL - BASE_RADIUS, abs=0.001)


@pytest.mark.parametrize(
    ("direction", "felt"),
    [
        (0, Sides(centre=True)),
        (24, Sides(centre=True)),
        (-24, Sides(centre=True)),
        (26, Sides(left=True)),
        (89, Sides(left=True)),
        (-26, Sides(right=True)),
        (-89, Sides(right=True)),
        (91, NO_SIDES),
        (180, NO_SIDES),
        (-91, NO_SIDES),
    ],
)
@pytest.mark.parametrize("heading", [0.0, 170.0, -90.0, 720.0])
def test_bumper_side_depends_on_direction_relative_to_heading(direction: float, felt: Sides, heading: float) -> None:
    ground = Felt(direction + heading)
    body = BaseBody(wheels=SimulatedWheels(pose=Pose2D(0.0, 0.0, radians(heading))), ground=ground)
    body.advance(0.0)
    assert body.bumper == felt


def test_two_contacts_press_two_bumper_sides() -> None:
    body = BaseBody(ground=Felt(-40.0, 10.0))
    body.advance(0.0)
    assert body.bumper == Sides(centre=True, right=True)


def test_contact_behind_stops_the_body_without_a_bumper() -> None:
    body = BaseBody(ground=Felt(180.0))
    now = drive(body, -0.3, 0.0, 0.0, 1.0)
    assert (body.pose.x, body.bumper) == (0.0, NO_SIDES)
    drive(body, 0.3, 0.0, now, 1.0)
    assert body.pose.x > 0.2


@given(st.floats(-180, 180), st.floats(-180, 180))
def test_body_can_leave_a_contact_but_not_enter_it(heading: float, direction: float) -> None:
    body = BaseBody(wheels=SimulatedWheels(pose=Pose2D(0.0, 0.0, radians(heading))), ground=Felt(direction))
    drive(body, 0.4, 0.0, 0.0, 1.0)
    away = cos(radians(direction - heading)) < -0.001
    into = cos(radians(direction - heading)) > 0.001
    assert (hypot(body.pose.x, body.pose.y) > 0.1) >= away
    assert (body.pose.x, body.pose.y) == (0.0, 0.0) or not into


def test_person_walking_into_a_standing_body_presses_its_bumper() -> None:
    ground = Felt()
    body = BaseBody(ground=ground)
    body.advance(1.0)
    assert body.bumper == NO_SIDES
    ground.directions = [radians(-30.0)]
    body.advance(1.02)
    assert body.bumper == Sides(right=True)
    assert body.pose == Pose2D(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("spot", "felt"),
    [((0.156, 0.0), Sides(centre=True)), ((0.087, 0.136), Sides(left=True)), ((0.087, -0.136), Sides(right=True))],
)
@pytest.mark.parametrize("heading", [0.0, 130.0])
def test_each_floor_sensor_detects_a_hole_beneath(spot: tuple[float, float], felt: Sides, heading: float) -> None:
    c, s = cos(radians(heading)), sin(radians(heading))
    x, y = 2.0 + spot[0] * c - spot[1] * s, 3.0 + spot[0] * s + spot[1] * c
    body = BaseBody(
        wheels=SimulatedWheels(pose=Pose2D(2.0, 3.0, radians(heading))),
        ground=Holed(lambda at_x, at_y: hypot(at_x - x, at_y - y) < 0.02),
    )
    body.advance(0.0)
    assert (body.cliff, body.wheel_drop) == (felt, NO_SIDES)


def test_body_over_an_edge_hangs_until_put_down_elsewhere() -> None:
    body = BaseBody(ground=Holed(lambda x, _: x > 0.5))
    now = drive(body, 0.3, 0.0, 0.0, 4.0)
    assert body.cliff == Sides(left=True, centre=True, right=True)
    assert body.wheel_drop == Sides(left=True, right=True)
    assert body.pose.x == pytest.approx(0.5, abs=0.01)
    assert body.velocity == Velocity(0.0, 0.0)
    there = body.pose
    now = drive(body, -0.3, 0.5, now, 1.0)
    assert body.pose == there
    body.wheels.pose = Pose2D(-1.0, 0.0, 0.0)
    drive(body, 0.3, 0.0, now, 1.0)
    assert (body.wheel_drop, body.cliff) == (NO_SIDES, NO_SIDES)
    assert body.pose.x > -0.8


def test_one_wheel_over_an_edge_drops() -> None:
    body = BaseBody(ground=Holed(lambda _, y: y > 0.1))
    body.advance(0.0)
    assert (body.wheel_drop, body.cliff) == (Sides(left=True), Sides(left=True))


def test_lifted_body_turns_its_wheels_in_the_air() -> None:
    body = BaseBody()
    body.lifted = True
    now = drive(body, 0.3, 0.2, 0.0, 1.0)
    assert body.wheel_drop == Sides(left=True, right=True)
    assert (body.pose, body.velocity) == (Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0))
    assert min(body.encoders) > 1000
    body.lifted = False
    drive(body, 0.3, 0.0, now, 1.0)
    assert body.wheel_drop == NO_SIDES
    assert body.pose.x > 0.2


@given(st.lists(st.floats(0.01, 0.4), min_size=1, max_size=20))
def test_body_stops_without_a_new_command(pauses: list[float]) -> None:
    body, now = BaseBody(), 0.0
    body.command(0.3, 0.0, 0.0)
    for pause in pauses:
        now += pause
        body.advance(now)
        moving = 0.0 < now <= BODY_COMMAND_TIMEOUT + 0.3 / 2.0
        assert (body.velocity.linear > 0.0) == moving or now == pytest.approx(BODY_COMMAND_TIMEOUT + 0.15)
    assert body.advance(now + 5.0) == body.advance(now + 6.0)
    assert degrees(body.pose.heading) == 0.0
    assert body.pose.x == pytest.approx(0.3 * BODY_COMMAND_TIMEOUT, abs=1e-6)


@pytest.mark.parametrize(
    ("first", "second", "both"),
    [
        (NO_SIDES, NO_SIDES, NO_SIDES),
        (Sides(left=True), NO_SIDES, Sides(left=True)),
        (NO_SIDES, Sides(centre=True), Sides(centre=True)),
        (Sides(left=True), Sides(left=True, right=True), Sides(left=True, right=True)),
    ],
)
def test_merged_sides_contain_both_contacts(first: Sides, second: Sides, both: Sides) -> None:
    assert merge_sides(first, second) == both
