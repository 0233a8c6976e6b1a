"""How far a base can go before what it sees, and how fast; and where it has been."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.clearance import (
    CLEARANCE_MARGIN,
    ObstacleView,
    Points,
    free_distance,
    rotate_points,
    safe_speed,
    scan_points,
)
from behaviours.wander import CELL_SIZE, VisitedCells
from drivers.api import BASE_RADIUS, BaseState, Pose2D, RangeScan, Velocity
from missions.plugins.testing.recorders import LeafTestBench, none

REACH = BASE_RADIUS + CLEARANCE_MARGIN


def seen(*points: tuple[float, float]) -> Points:
    return list(points)


@pytest.mark.parametrize(
    ("point", "way"),
    [
        ((1.0, 0.0), 1.0 - REACH),
        ((1.0, REACH * 0.6), 1.0 - REACH * 0.8),
        ((1.0, REACH + 0.001), math.inf),
        ((1.0, -REACH - 0.001), math.inf),
        ((-1.0, 0.0), math.inf),
        ((REACH / 2, 0.0), 0.0),
    ],
)
def test_free_distance_ends_where_the_rim_and_margin_would_touch(point: tuple[float, float], way: float) -> None:
    assert free_distance(seen(point)) == pytest.approx(way)


def test_the_nearest_of_several_things_counts_and_without_any_the_way_is_free() -> None:
    assert free_distance(seen((2.0, 0.0), (1.0, 0.0), (3.0, 0.1))) == pytest.approx(1.0 - REACH)
    assert free_distance(seen()) == math.inf


def test_free_distance_in_a_heading_equals_that_of_a_turned_base() -> None:
    points = seen((1.0, 0.3), (0.2, -1.5), (-1.0, 0.1))
    headings = [math.radians(degrees) for degrees in range(-180, 180, 5)]
    ways = [free_distance(points, heading) for heading in headings]
    assert ways == pytest.approx([free_distance(rotate_points(points, heading)) for heading in headings])


def test_a_scan_is_seen_from_the_middle_of_the_base() -> None:
    scan = RangeScan(np.array([1.0, np.nan, 2.0], dtype=np.float32), 0.0, math.pi / 2, 0.0, 0, least=0.1, most=12.0)
    assert scan_points(scan, (0.05, 0.1, 0.3)) == [pytest.approx((1.05, 0.1)), pytest.approx((-1.95, 0.1))]


@given(way=st.floats(0.0, 10.0), braking=st.floats(0.05, 2.0), reaction=st.floats(0.0, 0.5))
def test_a_safe_speed_ends_within_the_way(way: float, braking: float, reaction: float) -> None:
    speed = safe_speed(way, braking=braking, reaction=reaction)
    assert speed >= 0.0
    assert speed * reaction + speed**2 / (2 * braking) == pytest.approx(way, abs=1e-6)


# --- as from where the base is now -----------------------------------------------------------------------------------


def state(heading: float = 0.0, speed: float = 0.0) -> BaseState:
    return BaseState(Pose2D(0.0, 0.0, heading), Velocity(speed, 0.0))


def test_points_are_moved_by_the_drive_since_the_scan() -> None:
    bench = LeafTestBench()
    lookout = ObstacleView(bench.robot)
    bench.ranger.show({0: 1.0})
    points = lookout.points_around(state(speed=0.5), bench.clock.now() + 0.2)
    assert points is not None
    assert points == [pytest.approx((0.9, 0.0))]


def test_points_are_rotated_by_the_turn_since_the_scan() -> None:
    bench = LeafTestBench()
    lookout = ObstacleView(bench.robot)
    bench.ranger.show({0: 1.0})
    points = lookout.points_around(state(heading=math.pi / 2), bench.clock.now())  # the recorder's heading then was 0
    assert points is not None
    assert points == [pytest.approx((0.0, -1.0))]


def test_obstacle_view_is_none_without_a_range_report() -> None:
    bench = LeafTestBench()
    bench.ranger.reading = none()
    assert ObstacleView(bench.robot).points_around(state(), 0.0) is None


# --- where it has been -----------------------------------------------------------------------------------------------


def test_cell_is_unvisited_until_the_base_was_there() -> None:
    visited = VisitedCells()
    here = Pose2D(CELL_SIZE / 2, CELL_SIZE / 2, 0.0)
    visited.visit(here)
    assert visited.unvisited_share(here, 0.0, 4 * CELL_SIZE) == 1.0
    for cell in (1, 2):
        visited.visit(Pose2D(CELL_SIZE / 2 + cell * CELL_SIZE, CELL_SIZE / 2, 0.0))
    assert visited.unvisited_share(here, 0.0, 4 * CELL_SIZE) == 0.5
    assert visited.unvisited_share(here, math.pi, 4 * CELL_SIZE) == 1.0
    assert len(visited) == 3


def test_too_short_way_has_no_unvisited_cells() -> None:
    assert VisitedCells().unvisited_share(Pose2D(0.0, 0.0, 0.0), 0.0, CELL_SIZE / 2) == 0.0
