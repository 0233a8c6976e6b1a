"""One face out of a picture, upright and of one size, so that only what is its own tells it from another."""

from dataclasses import dataclass
from math import atan2, degrees, hypot
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Image
from perception.light import Grey, grey, resized, window

SIDE = 96
"""Pixels of a crop's side."""

EYE_LINE = 0.34
"""Where both eyes are in a crop, from its top to its bottom."""

EYE_INSET = 0.28
"""Where the eyes are from its sides: the left one from the left, the right one from the right."""

GUESSED = ((0.3, 0.39), (0.7, 0.39))
"""Where the eyes of a Haar box are where none are found: as shares of its width and height."""

APART = (0.2, 0.6)
"""Widths of the box by which the two eyes of one face are apart; what is nearer or farther is no pair of eyes."""

STEEPEST = 0.5
"""How much higher one eye may be than the other, over the distance between them: a head that is rolled by 27 deg."""

MARGIN = 1.6
"""Side of a portrait, in widths of the face."""

LARGEST = 200
"""Pixels to which the face in a portrait is shrunk: twice what a crop needs."""


def crop(image: Image | Grey, face: Box, eyes: tuple[Box, ...]) -> Grey:
    """Return the face in the box ``face``, turned and scaled by its ``eyes`` (left one first): (SIDE, SIDE), uint8.

    Where there are not two eyes, or they cannot be those of one face, they are taken to be where they mostly are in a
    box. Raises ValueError for what is not a picture, and for a box without pixels.
    """
    picture = _surroundings(image, face)
    shown, scale, (left, top) = grey(picture.image), picture.scale, picture.corner
    (x0, y0), (x1, y1) = ((scale * (x - left), scale * (y - top)) for x, y in _pupils(face, eyes))
    apart, angle = hypot(x1 - x0, y1 - y0), atan2(y1 - y0, x1 - x0)
    turn = _turn((x0, y0), degrees(angle), SIDE * (1 - 2 * EYE_INSET) / apart)
    turn[:, 2] += np.array([SIDE * EYE_INSET - x0, SIDE * EYE_LINE - y0])
    return cast(Grey, cv2.warpAffine(shown, turn, (SIDE, SIDE), borderMode=cv2.BORDER_REPLICATE))


def variants(crop: Grey, random: np.random.Generator) -> list[Grey]:
    """Return a crop and six more as the camera might have shown it: moved, rolled, lit from a side, from far away.

    Without them a recogniser takes the distance of somebody for who it is.
    """
    found = [crop]
    for sharpness in (1.0, 1.0, 0.5, 0.5, 0.35, 0.35):
        turn = _turn((SIDE / 2, SIDE * EYE_LINE), random.uniform(-5.0, 5.0), random.uniform(0.94, 1.06))
        turn[:, 2] += random.uniform(-2.5, 2.5, 2)
        moved = cast(Grey, cv2.warpAffine(crop, turn, (SIDE, SIDE), borderMode=cv2.BORDER_REPLICATE))
        small = cv2.resize(moved, None, fx=sharpness, fy=sharpness, interpolation=cv2.INTER_AREA)
        coarse = cv2.resize(small, (SIDE, SIDE)).astype(np.float32)
        light = 1 + np.linspace(-0.25, 0.25, SIDE) * random.uniform(-1.0, 1.0)
        lit = coarse * light[None] + random.normal(0.0, 2.0, coarse.shape)
        found.append(np.clip(lit, 0, 255).astype(np.uint8))
    return found


def portrait(image: Image, face: Box) -> Image:
    """Return the face and a little around it, and nothing else of the picture: what is kept of somebody.

    The face is in its middle (``face_in``), also where the picture cuts it off: there its edge goes on.
    Raises ValueError as ``crop`` does.
    """
    picture = _surroundings(image, face)
    side = MARGIN * face.width * picture.scale
    x, y = ((middle - corner) * picture.scale for middle, corner in zip(face.centre, picture.corner, strict=True))
    size = max(2, round(side))
    place = np.array([[1.0, 0.0, (size - 1) / 2 - x], [0.0, 1.0, (size - 1) / 2 - y]])
    return cast(Image, cv2.warpAffine(picture.image, place, (size, size), borderMode=cv2.BORDER_REPLICATE))


def face_in(portrait: Image | Grey) -> Box:
    """Return where the face is in a portrait."""
    height, width = portrait.shape[:2]
    side = width / MARGIN
    return Box((width - side) / 2, (height - side) / 2, side, side)


def _turn(about: tuple[float, float], angle: float, scale: float) -> npt.NDArray[np.float64]:
    """Return the matrix, (2, 3), that turns a picture by ``angle`` (degrees) and scales it, ``about`` a place."""
    return np.asarray(cv2.getRotationMatrix2D(about, angle, scale), np.float64)


@dataclass(frozen=True, slots=True)
class _Surroundings:
    """A part of a picture, ``scale`` times as large; ``corner`` is where its top left one was in the picture."""

    image: Image | Grey
    scale: float
    corner: tuple[float, float]


def _surroundings(image: Image | Grey, face: Box) -> _Surroundings:
    """Cut the surroundings of a face out, and shrink them where it is large: what is turned must not flicker."""
    rows, columns = window(image.shape, face, 2.0)
    region = image[rows, columns]
    if face.width <= 0 or region.size == 0:
        raise ValueError(f"face: a box of {face.width:g} x {face.height:g} at ({face.x:g}, {face.y:g}) shows nothing")
    scale = min(1.0, LARGEST / face.width)
    return _Surroundings(resized(region, scale), scale, (columns.start, rows.start))


def _pupils(face: Box, eyes: tuple[Box, ...]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return where the two eyes are in the picture (x, y), the left one first."""
    if len(eyes) == 2:
        (x0, y0), (x1, y1) = eyes[0].centre, eyes[1].centre
        apart = x1 - x0
        if APART[0] <= apart / face.width <= APART[1] and abs(y1 - y0) <= STEEPEST * apart:
            return (x0, y0), (x1, y1)
    left, right = ((face.x + x * face.width, face.y + y * face.height) for x, y in GUESSED)
    return left, right
