"""Crops of single faces, all of one size and alignment, for recognition."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, sin
from typing import cast

import cv2
import numpy as np

from perception.api import Box, Image
from perception.image_preparation import GreyImage, resize, to_grey, window_slices

CROP_SIDE = 75
"""Side of a face's crop in pixels."""

CROP_REACH = 1.2
"""Side of a face's crop, in widths of the face's box: the crop includes some of the hair and the chin."""

CENTRE_DROP = 0.02
"""Distance from the middle of a face's box down to the middle of its crop, in heights of the box."""

EYE_SPACING, EYE_HEIGHT = 0.327, 0.121
"""Eye distance, and height of the eyes above the middle of a crop, in widths of the face's box.

Medians of the Haar boxes of people of the ORL database (s1 to s10).
"""

MIN_SPACING, MAX_SPACING, MAX_ROLL = 0.25, 0.6, 25.0
"""Limits of the eye distance, in widths of the face's box, and of the slope in degrees, for two eyes of one face."""

PORTRAIT_MARGIN = 1.6
"""Side of a portrait, in widths of the face."""

MAX_FACE_PIXELS = 200
"""Largest width of the face in a portrait, in pixels; no recogniser needs more."""


def crop_face(image: Image | GreyImage, face: Box, *, roll: float = 0.0) -> GreyImage:
    """Return a crop of the face in a box, rotated by ``roll`` degrees: (CROP_SIDE, CROP_SIDE), uint8.

    Raises ValueError for an invalid picture, and for a box without pixels.
    """
    picture = _cut_surroundings(image, face, 2 * CROP_SIDE / CROP_REACH)
    side, scale, (left, top) = face.width * picture.scale, picture.scale, picture.corner
    x, y = scale * (face.centre[0] - left), scale * (face.centre[1] - top) + CENTRE_DROP * side
    turn = np.asarray(cv2.getRotationMatrix2D((x, y), roll, CROP_SIDE / (CROP_REACH * side)), np.float64)
    turn[:, 2] += np.array([(CROP_SIDE - 1) / 2 - x, (CROP_SIDE - 1) / 2 - y])
    return cast(
        GreyImage, cv2.warpAffine(to_grey(picture.image), turn, (CROP_SIDE, CROP_SIDE), borderMode=cv2.BORDER_REPLICATE)
    )


def align_by_eyes(face: Box, eyes: Sequence[Box]) -> tuple[Box, float] | None:
    """Return the box and the roll (degrees) with which ``crop_face`` aligns the eyes of a face.

    ``eyes`` come from ``EyeFinder``, the left one in the picture first. None unless they are two eyes of one face.
    """
    if len(eyes) != 2 or face.width <= 0:
        return None
    (left, top), (right, bottom) = (eye.centre for eye in eyes)
    apart, slope = hypot(right - left, bottom - top), atan2(bottom - top, right - left)
    if not MIN_SPACING < apart / face.width < MAX_SPACING or abs(degrees(slope)) > MAX_ROLL:
        return None
    side = apart / EYE_SPACING
    x = (left + right) / 2 - EYE_HEIGHT * side * sin(slope)
    y = (top + bottom) / 2 + (EYE_HEIGHT * cos(slope) - CENTRE_DROP) * side
    return Box(x - side / 2, y - side / 2, side, side), degrees(slope)


def make_portrait(image: Image, face: Box) -> Image:
    """Return the face with a small margin, which is all that is stored of a person's picture.

    The face is in the middle (see ``portrait_face_box``). If the picture cuts it off, the edge pixels are repeated.
    Raises ValueError as ``crop_face`` does.
    """
    picture = _cut_surroundings(image, face, MAX_FACE_PIXELS)
    side = PORTRAIT_MARGIN * face.width * picture.scale
    x, y = ((middle - corner) * picture.scale for middle, corner in zip(face.centre, picture.corner, strict=True))
    size = max(2, round(side))
    place = np.array([[1.0, 0.0, (size - 1) / 2 - x], [0.0, 1.0, (size - 1) / 2 - y]])
    return cast(Image, cv2.warpAffine(picture.image, place, (size, size), borderMode=cv2.BORDER_REPLICATE))


def portrait_face_box(portrait: Image | GreyImage) -> Box:
    """Return the box of the face in a portrait."""
    height, width = portrait.shape[:2]
    side = width / PORTRAIT_MARGIN
    return Box((width - side) / 2, (height - side) / 2, side, side)


@dataclass(frozen=True, slots=True)
class _Surroundings:
    """Surroundings of a face in a picture, scaled by ``scale``; ``corner`` is their top left in the picture."""

    image: Image | GreyImage
    scale: float
    corner: tuple[float, float]


def _cut_surroundings(image: Image | GreyImage, face: Box, largest: float) -> _Surroundings:
    """Return the surroundings of a face, shrunk so that the face is at most ``largest`` pixels wide.

    Shrinking first keeps a later rotation from aliasing.
    """
    rows, columns = window_slices(image.shape, face, 2.0)
    region = image[rows, columns]
    if face.width <= 0 or region.size == 0:
        raise ValueError(f"face: a box of {face.width:g} x {face.height:g} at ({face.x:g}, {face.y:g}) shows nothing")
    scale = min(1.0, largest / face.width)
    return _Surroundings(resize(region, scale), scale, (columns.start, rows.start))
