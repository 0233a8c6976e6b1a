"""Shapes told by their outlines."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.api import BALL, BOX
from perception.colour_spots import Contour, judge_outline


def contour(mask: object) -> Contour:
    """The one contour of what is not zero."""
    (found,), _ = cv2.findContours(np.asarray(mask, np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(found, np.int32)


def disc(radius: float, x: float = 80.0, y: float = 80.0, squeeze: float = 1.0) -> Contour:
    rows, columns = np.mgrid[0:160, 0:160]
    return contour(np.hypot(columns - x, (rows - y) / squeeze) <= radius)


def turned_box(width: float, height: float, angle: float) -> Contour:
    corners = cv2.boxPoints(((80.0, 80.0), (width, height), angle))
    mask = np.zeros((160, 160), np.uint8)
    cv2.fillConvexPoly(mask, np.rint(corners).astype(np.int32), 1)
    return contour(mask)


@given(st.floats(5.5, 70), st.floats(78, 82), st.floats(78, 82), st.floats(0.95, 1.05))
def test_disc_is_a_ball_of_its_width(radius: float, x: float, y: float, squeeze: float) -> None:
    seen = judge_outline(disc(radius, x, y, squeeze))
    assert seen is not None
    assert seen.shape == BALL
    assert seen.width == pytest.approx(2 * radius, rel=0.13)


@given(st.floats(14, 70), st.floats(0.4, 1.0), st.floats(0, 90))
def test_rotated_rectangle_is_a_box(width: float, share: float, angle: float) -> None:
    if width * share >= 10:
        seen = judge_outline(turned_box(width, width * share, angle))
        assert seen is not None
        assert seen.shape == BOX


def test_cube_seen_at_its_edge_is_a_box() -> None:
    mask = np.zeros((160, 160), np.uint8)
    hexagon = np.array([(40, 60), (80, 52), (120, 60), (120, 100), (80, 111), (40, 100)], np.int32)
    cv2.fillConvexPoly(mask, hexagon, 1)
    seen = judge_outline(contour(mask))
    assert seen is not None
    assert seen.shape == BOX


@pytest.mark.parametrize(
    "points",
    [
        [(20, 20), (140, 20), (140, 40), (40, 40), (40, 140), (20, 140)],  # a corner
        [(20, 140), (80, 20), (140, 140)],  # a triangle
        [(10, 70), (150, 70), (150, 80), (10, 80)],  # a strip
    ],
)
def test_other_outline_has_no_shape(points: list[tuple[int, int]]) -> None:
    mask = np.zeros((160, 160), np.uint8)
    cv2.fillPoly(mask, [np.array(points, np.int32)], 1)
    assert judge_outline(contour(mask)) is None
