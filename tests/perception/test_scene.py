"""How much a picture shows: nothing on a blank wall or behind a hand, a lot in a room."""

import cv2
import numpy as np
import pytest
import skimage
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.api import Image
from perception.scene_motion import measure_scene

UNIFORM = 6.0
"""The contrast up to which `scene_uniform` calls a picture uniform."""


def noisy(picture: object, *, noise: float) -> Image:
    """Return a picture as uint8, with the noise (grey levels) of a camera on it."""
    random = np.random.default_rng(0)
    grains = random.normal(0.0, noise, (480, 640, 3)) + np.asarray(picture, np.float64)
    return np.asarray(np.clip(grains, 0, 255), np.uint8)


@settings(max_examples=20, deadline=None)
@given(level=st.integers(0, 255), noise=st.floats(0.0, 12.0))
def test_one_colour_is_uniform_however_dark_and_noisy(level: int, noise: float) -> None:
    assert measure_scene(noisy(level, noise=noise), stamp=1.0).contrast <= UNIFORM


def test_unevenly_lit_wall_is_uniform() -> None:
    shade = np.linspace(80.0, 200.0, 640)[None, :, None]
    assert measure_scene(noisy(shade, noise=4.0), stamp=1.0).contrast <= UNIFORM


def test_a_wall_with_a_few_hot_pixels_is_uniform() -> None:
    picture = noisy(100, noise=3.0)
    picture[::160, ::160] = 255
    assert measure_scene(picture, stamp=1.0).contrast <= UNIFORM


def test_a_real_picture_is_not_even_in_bad_light() -> None:
    picture = np.asarray(cv2.cvtColor(skimage.data.astronaut(), cv2.COLOR_RGB2BGR), np.uint8)
    assert measure_scene(picture, stamp=1.0).contrast > 50
    assert measure_scene(picture // 5, stamp=1.0).contrast > UNIFORM


def test_one_picture_on_a_wall_is_enough_to_see() -> None:
    picture = noisy(200, noise=3.0)
    picture[100:300, 200:400] = 120
    assert measure_scene(picture, stamp=1.0).contrast > UNIFORM


def test_scene_has_the_stamp_and_brightness_of_the_frame() -> None:
    scene = measure_scene(np.full((480, 640, 3), 77, np.uint8), stamp=4.5)
    assert (scene.stamp, scene.brightness, scene.contrast) == (4.5, 77.0, 0.0)


@pytest.mark.parametrize("shape", [(480, 640), (1, 1, 3), (7, 3, 3), (33, 9), (1, 500, 3)])
def test_any_size_can_be_measured(shape: tuple[int, ...]) -> None:
    assert measure_scene(np.full(shape, 50, np.uint8), stamp=0.0).contrast == 0.0


@pytest.mark.parametrize("picture", [np.zeros((0, 4, 3), np.uint8), np.zeros((8, 8, 3)), np.zeros(9, np.uint8)])
def test_malformed_picture_is_refused(picture: Image) -> None:
    with pytest.raises(ValueError, match="picture: expected"):
        measure_scene(picture, stamp=0.0)
