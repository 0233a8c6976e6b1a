"""Colours: each its own name, in any light; and what has no colour, none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.colours import COLOURS
from config.object import HUES
from perception.api import Image
from perception.colour_spots import Palette, balance_white, to_colour_disc

PALETTE = Palette(COLOURS)


def plain(red: float, green: float, blue: float) -> Image:
    return np.full((8, 8, 3), (round(blue), round(green), round(red)), np.uint8)


def named(picture: Image) -> str | None:
    """The one name that all of a picture has."""
    (number,) = np.unique(PALETTE.label(picture)).tolist()
    return PALETTE.names[number] if number < len(PALETTE.names) else None


@pytest.mark.parametrize("name", HUES)
@pytest.mark.parametrize("light", [1.0, 0.6, 0.3])
def test_colour_name_is_independent_of_brightness(name: str, light: float) -> None:
    red, green, blue = COLOURS[name]
    assert named(plain(red * light, green * light, blue * light)) == name


@given(st.integers(0, 255), st.integers(-3, 3))
def test_grey_has_no_hue(level: int, tint: int) -> None:
    assert named(plain(level, level, min(max(level + tint, 0), 255))) not in HUES


@pytest.mark.parametrize("tint", [(1.0, 0.85, 0.62), (0.72, 0.9, 1.0), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("name", HUES)
def test_colour_is_kept_in_warm_and_cold_light(name: str, tint: tuple[float, float, float]) -> None:
    scene = np.full((64, 64, 3), 200.0)
    scene[24:40, 24:40] = COLOURS[name][::-1]
    lit = np.asarray(np.rint(scene * tint[::-1]), np.uint8)
    labels = PALETTE.label(balance_white(lit))
    assert set(labels[24:40, 24:40].ravel().tolist()) == {PALETTE.names.index(name)}
    assert labels[0, 0] not in [PALETTE.names.index(hue) for hue in HUES]


def test_wood_is_neither_red_nor_orange() -> None:
    for wood in ((142, 116, 88), (123, 84, 52), (160, 110, 70), (96, 60, 40)):
        assert named(plain(*wood)) not in HUES


@given(st.integers(0, 2**32 - 1))
def test_balance_keeps_the_shape_and_does_not_invent_light(seed: int) -> None:
    picture = np.random.default_rng(seed).integers(0, 256, (16, 16, 3), np.uint8)
    assert balance_white(picture).shape == picture.shape
    assert not balance_white(np.zeros((16, 16, 3), np.uint8)).any()


@given(st.tuples(st.integers(0, 255), st.integers(0, 255), st.integers(0, 255)))
def test_every_colour_lies_in_the_disc(colour: tuple[int, int, int]) -> None:
    assert np.linalg.norm(to_colour_disc(plain(*colour))[0, 0]) <= 1.0 + 1e-6
