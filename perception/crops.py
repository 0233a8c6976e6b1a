"""One face out of a picture, and all of one size, so that only what is its own tells it from another."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, sin
from typing import cast

import cv2
import numpy as np

from perception.api import Box, Image
from perception.light import Grey, grey, resized, window

SIDE = 75
"""Pixels of a crop's side."""

REACH = 1.2
"""Side of a crop, in widths of the face's box: with some of the hair and the chin."""

LOWER = 0.02
"""How much lower the middle of a crop is than that of the box, in heights of the box."""

EYES_APART, EYES_ABOVE = 0.327, 0.121
"""Distance of the eyes, and of their middle from that of a crop, in widths of the face's box: medians of the Haar
boxes of people of the ORL database (s1 to s10)."""

MIN_SPACING, MAX_SPACING, MAX_ROLL = 0.25, 0.6, 25.0
"""Distance of the eyes, in widths of the face's box, and their slope in degrees that two eyes of one face have."""

MARGIN = 1.6
"""Side of a portrait, in widths of the face."""

LARGEST = 200
"""Pixels to which the face in a portrait is shrunk: as many as any recogniser needs."""


def crop(image: Image | Grey, face: Box, *, roll: float = 0.0) -> Grey:
    """Return the face in the box ``face``: (SIDE, SIDE), uint8; turned by ``roll`` degrees.

    Raises ValueError for what is not a picture, and for a box without pixels.
    """
    picture = _surroundings(image, face, 2 * SIDE / REACH)
    side, scale, (left, top) = face.width * picture.scale, picture.scale, picture.corner
    x, y = scale * (face.centre[0] - left), scale * (face.centre[1] - top) + LOWER * side
    turn = np.asarray(cv2.getRotationMatrix2D((x, y), roll, SIDE / (REACH * side)), np.float64)
    turn[:, 2] += np.array([(SIDE - 1) / 2 - x, (SIDE - 1) / 2 - y])
    return cast(Grey, cv2.warpAffine(grey(picture.image), turn, (SIDE, SIDE), borderMode=cv2.BORDER_REPLICATE))


def upright(face: Box, eyes: Sequence[Box]) -> tuple[Box, float] | None:
    """Return the box and the roll (degrees) with which ``crop`` puts the eyes of a face where all crops have them.

    ``eyes`` are as ``EyeFinder`` finds them, the left one in the picture first. None unless they are two of one face.
    """
    if len(eyes) != 2 or face.width <= 0:
        return None
    (left, top), (right, bottom) = (eye.centre for eye in eyes)
    apart, slope = hypot(right - left, bottom - top), atan2(bottom - top, right - left)
    if not MIN_SPACING < apart / face.width < MAX_SPACING or abs(degrees(slope)) > MAX_ROLL:
        return None
    side = apart / EYES_APART
    x = (left + right) / 2 - EYES_ABOVE * side * sin(slope)
    y = (top + bottom) / 2 + (EYES_ABOVE * cos(slope) - LOWER) * side
    return Box(x - side / 2, y - side / 2, side, side), degrees(slope)


def portrait(image: Image, face: Box) -> Image:
    """Return the face and a little around it, and nothing else of the picture: what is kept of somebody.

    The face is in its middle (``face_in``), also where the picture cuts it off: there its edge goes on.
    Raises ValueError as ``crop`` does.
    """
    picture = _surroundings(image, face, LARGEST)
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


@dataclass(frozen=True, slots=True)
class _Surroundings:
    """A part of a picture, ``scale`` times as large; ``corner`` is where its top left one was in the picture."""

    image: Image | Grey
    scale: float
    corner: tuple[float, float]


def _surroundings(image: Image | Grey, face: Box, largest: float) -> _Surroundings:
    """Cut the surroundings of a face out, and shrink it to ``largest`` pixels: what is turned must not flicker."""
    rows, columns = window(image.shape, face, 2.0)
    region = image[rows, columns]
    if face.width <= 0 or region.size == 0:
        raise ValueError(f"face: a box of {face.width:g} x {face.height:g} at ({face.x:g}, {face.y:g}) shows nothing")
    scale = min(1.0, largest / face.width)
    return _Surroundings(resized(region, scale), scale, (columns.start, rows.start))
