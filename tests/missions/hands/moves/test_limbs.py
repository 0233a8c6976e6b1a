"""Angles of limbs: the law of cosines, and what a servo's steps make of noise."""

from itertools import pairwise
from math import atan2, cos, dist, hypot, pi, radians, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from missions.library.moves.load import angle_at, apply_dead_band

LENGTH = st.floats(-10, 10)
POINTS = st.tuples(LENGTH, LENGTH, LENGTH)
ANGLES = st.lists(st.floats(-3, 3), max_size=30)


@pytest.mark.parametrize("degrees", [0, 1, 30, 90, 135, 179, 180])
@pytest.mark.parametrize("unit", [0.001, 1.0, 1000.0])
def test_angle_at_returns_the_angle_of_a_bent_limb(degrees: float, unit: float) -> None:
    angle = radians(degrees)
    wrist = (0.2 * unit * cos(angle), 0.2 * unit * sin(angle), 0.0)
    assert angle_at((0.3 * unit, 0.0, 0.0), (0.0, 0.0, 0.0), wrist) == pytest.approx(angle, abs=1e-6)


@given(POINTS, POINTS, POINTS)
def test_angle_at_agrees_with_vector_arithmetic(
    before: tuple[float, float, float], joint: tuple[float, float, float], behind: tuple[float, float, float]
) -> None:
    assume(min(dist(joint, before), dist(joint, behind)) > 0.01)
    a, b = ([p - q for p, q in zip(point, joint, strict=True)] for point in (before, behind))
    across = hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    along = sum(p * q for p, q in zip(a, b, strict=True))
    assert angle_at(before, joint, behind) == pytest.approx(atan2(across, along), abs=1e-4)


@given(POINTS, POINTS, POINTS)
def test_an_angle_is_the_same_from_either_end(
    before: tuple[float, float, float], joint: tuple[float, float, float], behind: tuple[float, float, float]
) -> None:
    assume(min(dist(joint, before), dist(joint, behind)) > 0.01)
    assert angle_at(before, joint, behind) == angle_at(behind, joint, before)
    assert 0.0 <= angle_at(before, joint, behind) <= pi


def test_two_points_are_enough_in_a_plane() -> None:
    assert angle_at((1.0, 0.0), (0.0, 0.0), (0.0, 2.0)) == pytest.approx(pi / 2)


@pytest.mark.parametrize(
    ("before", "behind"),
    [((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0), (0.0, 0.0)), ((0.0, 0.0), (0.0, 0.0)), ((1e-12, 0.0), (1.0, 0.0))],
)
def test_a_limb_without_length_has_no_angle(before: tuple[float, float], behind: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="coincide"):
        angle_at(before, (0.0, 0.0), behind)


def test_changes_below_a_step_repeat_the_angle_before() -> None:
    assert apply_dead_band([0.0, 0.004, -0.004, 0.006, 0.009, 0.0], 0.005) == [0.0, 0.0, 0.0, 0.006, 0.006, 0.0]
    assert apply_dead_band([0.1, 0.1001, 0.1], 0.0) == [0.1, 0.1001, 0.1]
    assert apply_dead_band([], 0.1) == []


@given(ANGLES, st.floats(0.001, 1))
def test_a_steadied_movement_is_never_a_step_off(angles: list[float], resolution: float) -> None:
    steady = apply_dead_band(angles, resolution)
    assert all(abs(was - now) < resolution for was, now in zip(angles, steady, strict=True))
    assert all(now == was or abs(now - was) >= resolution for was, now in pairwise(steady))
    assert apply_dead_band(steady, resolution) == steady
