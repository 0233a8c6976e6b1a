"""Parts of a picture, scaled and turned: what is found in them lies where it was in the picture."""

from math import radians

import cv2
import numpy as np
import pytest

from perception.api import Box, Image
from perception.haar_faces import prepare_picture, prepare_region
from perception.image_preparation import brighten

SPOT = (200.0, 120.0)


def picture() -> Image:
    """Grey, with one bright spot."""
    drawn = np.full((240, 320, 3), 90, np.uint8)
    cv2.circle(drawn, (int(SPOT[0]), int(SPOT[1])), 6, (250, 250, 250), -1)
    return drawn


def brightest(shown: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> Box:
    """A box about the brightest place."""
    _, _, _, (x, y) = cv2.minMaxLoc(cv2.GaussianBlur(shown, (0, 0), 3.0))
    return Box(x - 7.0, y - 7.0, 14.0, 14.0)


@pytest.mark.parametrize("roll", [0.0, radians(22), radians(-40)])
@pytest.mark.parametrize("scale", [0.5, 1.0, 1.5])
def test_detection_in_a_prepared_picture_maps_back(scale: float, roll: float) -> None:
    cut = prepare_picture(picture(), scale, roll)
    found = cut.to_detection(brightest(cut.image), 1.0)
    assert found.box.centre == pytest.approx(SPOT, abs=3)
    assert (found.roll, found.box.width) == (roll, 14 / scale)


@pytest.mark.parametrize("roll", [0.0, radians(22), radians(-40)])
def test_detection_in_a_prepared_region_maps_back(roll: float) -> None:
    cut = prepare_region(picture(), Box(170, 90, 50, 50), 1.7, 64, roll)
    assert cut is not None
    assert cut.to_detection(brightest(cut.image), 1.0).box.centre == pytest.approx(SPOT, abs=3)


def test_region_outside_the_picture_is_none() -> None:
    assert prepare_region(picture(), Box(-900, 0, 50, 50), 1.7, 64) is None
    assert prepare_region(picture(), Box(20, 20, 0, 0), 1.7, 64) is None


def test_dark_picture_is_brightened_and_others_are_unchanged() -> None:
    dark = np.asarray(picture() // 12, np.uint8)
    assert 190 <= brighten(dark).max() <= 255
    assert brighten(picture()) is not None
    assert np.array_equal(brighten(picture()), picture())
    assert brighten(np.zeros((4, 4), np.uint8)).max() == 0
