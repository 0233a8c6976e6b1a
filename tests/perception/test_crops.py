"""Crops and portraits: one face, and all of one size."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.api import Box, Image
from perception.crops import (
    CENTRE_DROP,
    CROP_REACH,
    CROP_SIDE,
    MAX_FACE_PIXELS,
    PORTRAIT_MARGIN,
    crop_face,
    make_portrait,
    portrait_face_box,
)
from perception.image_preparation import GreyImage

FACE = Box(200, 150, 100, 100)


def dots(*places: tuple[float, float], size: tuple[int, int] = (640, 480)) -> Image:
    """Draw a bright dot at each place."""
    picture = np.zeros((size[1], size[0], 3), np.uint8)
    for x, y in places:
        cv2.circle(picture, (round(x), round(y)), 3, (255, 255, 255), -1)
    return picture


def brightest(shown: GreyImage) -> tuple[float, float]:
    """Return the middle of what is bright in a crop."""
    ys, xs = np.nonzero(shown > 100)
    return float(xs.mean()), float(ys.mean())


@given(st.floats(0.3, 3.0), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_crop_is_independent_of_the_face_size(size: float, x: float, y: float) -> None:
    face = Box(200.0, 150.0, 100 * size, 100 * size)
    across, down = face.centre[0] + x * face.width, face.centre[1] + y * face.height
    picture = np.zeros((600, 700, 3), np.uint8)
    cv2.circle(picture, (round(across), round(down)), max(2, round(6 * size)), (255, 255, 255), -1)
    shown = crop_face(picture, face)
    assert shown.shape == (CROP_SIDE, CROP_SIDE)
    middle = (CROP_SIDE - 1) / 2
    wanted = (middle + CROP_SIDE / CROP_REACH * x, middle + CROP_SIDE / CROP_REACH * (y - CENTRE_DROP))
    assert brightest(shown) == pytest.approx(wanted, abs=2.0)


def test_crop_is_rotated_and_scaled_about_its_middle() -> None:
    right = dots((FACE.centre[0] + 25, FACE.centre[1] + CENTRE_DROP * 100))
    middle, apart = (CROP_SIDE - 1) / 2, 25 * CROP_SIDE / CROP_REACH / 100
    assert brightest(crop_face(right, FACE)) == pytest.approx((middle + apart, middle), abs=1.0)
    assert brightest(crop_face(right, FACE, roll=90)) == pytest.approx((middle, middle - apart), abs=1.0)


def test_empty_box_is_refused() -> None:
    for box in (Box(700, 700, 50, 50), Box(10, 10, 0, 0)):
        with pytest.raises(ValueError, match="shows nothing"):
            crop_face(dots(), box)


@given(st.floats(20, 600), st.floats(-0.02, 1.0), st.floats(-0.02, 1.0))
def test_portrait_is_centred_on_the_face_even_at_the_edge(width: float, x: float, y: float) -> None:
    face = Box(x * 300, y * 200, width, width)
    kept = make_portrait(dots(face.centre), face)
    assert kept.shape[0] == kept.shape[1] <= round(PORTRAIT_MARGIN * MAX_FACE_PIXELS)
    place = portrait_face_box(kept)
    assert place.width == pytest.approx(min(width, MAX_FACE_PIXELS), abs=1.0)
    assert place.centre == (kept.shape[1] / 2, kept.shape[0] / 2)


def test_portrait_contains_only_the_face() -> None:
    kept = make_portrait(dots((250, 200), (450, 200), (250, 40)), FACE)
    assert kept.max() > 200
    bright = cv2.connectedComponents((kept[:, :, 0] > 128).astype(np.uint8))[0] - 1
    assert bright == 1
