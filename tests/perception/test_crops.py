"""Crops and portraits: one face, upright and of one size."""

from math import radians

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.api import Box, Image
from perception.crops import EYE_INSET, EYE_LINE, LARGEST, MARGIN, SIDE, crop, face_in, portrait, variants
from perception.light import Grey

FACE = Box(200, 150, 100, 100)
LEFT, RIGHT = (SIDE * EYE_INSET, SIDE * EYE_LINE), (SIDE * (1 - EYE_INSET), SIDE * EYE_LINE)


def dots(*places: tuple[float, float], size: tuple[int, int] = (640, 480)) -> Image:
    """Draw a bright dot at each place."""
    picture = np.zeros((size[1], size[0], 3), np.uint8)
    for x, y in places:
        cv2.circle(picture, (round(x), round(y)), 3, (255, 255, 255), -1)
    return picture


def eye(x: float, y: float) -> Box:
    return Box(x - 10, y - 10, 20, 20)


def brightest(shown: Grey, half: slice) -> tuple[float, float]:
    """Return the middle of what is bright in some columns of a crop."""
    ys, xs = np.nonzero(shown[:, half] > 128)
    return float(xs.mean()) + (half.start or 0), float(ys.mean())


@given(st.floats(-20, 20), st.floats(28, 55), st.integers(-15, 15))
def test_eyes_come_to_lie_in_the_same_places_whatever_the_roll_and_the_size(
    roll: float, apart: float, aside: int
) -> None:
    across, down = apart / 2 * np.cos(radians(roll)), apart / 2 * np.sin(radians(roll))
    left, right = (250 + aside - across, 190 - down), (250 + aside + across, 190 + down)
    shown = crop(dots(left, right), FACE, (eye(*left), eye(*right)))
    assert shown.shape == (SIDE, SIDE)
    assert brightest(shown, slice(0, SIDE // 2)) == pytest.approx(LEFT, abs=2.5)
    assert brightest(shown, slice(SIDE // 2, SIDE)) == pytest.approx(RIGHT, abs=2.5)


@pytest.mark.parametrize(
    "eyes",
    [(), (eye(230, 189),), (eye(230, 189), eye(235, 189)), (eye(230, 160), eye(260, 220))],
    ids=["none", "one", "too near", "too steep"],
)
def test_without_a_pair_of_eyes_they_are_taken_to_be_where_they_mostly_are(eyes: tuple[Box, ...]) -> None:
    picture = dots((230, 189), (270, 189))
    assert np.array_equal(crop(picture, FACE, eyes), crop(picture, FACE, ()))
    assert brightest(crop(picture, FACE, ()), slice(0, SIDE // 2)) == pytest.approx(LEFT, abs=2.0)


def test_a_box_that_shows_nothing_is_refused() -> None:
    for box in (Box(700, 700, 50, 50), Box(10, 10, 0, 0)):
        with pytest.raises(ValueError, match="shows nothing"):
            crop(dots(), box, ())


def test_variants_begin_with_the_crop_itself_and_are_the_same_for_the_same_random(astronaut: Image) -> None:
    shown = crop(astronaut, Box(176, 65, 97, 97), ())
    found, again = (variants(shown, np.random.default_rng(3)) for _ in range(2))
    assert len(found) == 7
    assert found[0] is shown
    assert all(np.array_equal(one, other) for one, other in zip(found, again, strict=True))
    assert all(not np.array_equal(shown, other) for other in found[1:])


@given(st.floats(20, 600), st.floats(-0.02, 1.0), st.floats(-0.02, 1.0))
def test_a_portrait_has_the_face_in_its_middle_also_at_the_edge_of_the_picture(
    width: float, x: float, y: float
) -> None:
    face = Box(x * 300, y * 200, width, width)
    kept = portrait(dots(face.centre), face)
    assert kept.shape[0] == kept.shape[1] <= round(MARGIN * LARGEST)
    place = face_in(kept)
    assert place.width == pytest.approx(min(width, LARGEST), abs=1.0)
    assert place.centre == (kept.shape[1] / 2, kept.shape[0] / 2)


def test_nothing_of_the_picture_but_the_face_and_a_little_around_it_is_kept() -> None:
    kept = portrait(dots((250, 200), (450, 200), (250, 40)), FACE)
    assert kept.max() > 200
    bright = cv2.connectedComponents((kept[:, :, 0] > 128).astype(np.uint8))[0] - 1
    assert bright == 1
