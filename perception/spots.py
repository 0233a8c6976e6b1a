"""Finding balls and boxes of given colours in one picture."""

from collections.abc import Iterator, Mapping, Sequence
from typing import cast

import cv2
import numpy as np

from perception.api import Box, Image
from perception.colour import Colour, Contour, Labels, Palette, Places, balanced, in_disc, outline
from perception.tracks import SEARCH_WIDTH, SMALLEST_SPOT, Spot

LARGEST = 0.5
"""The share of the picture above which a spot is a wall and no thing."""

CORE = 0.22
"""How far a thing's mean colour may be from the one looked for, in the disc of hues and saturations (radius 1)."""

STEP = 0.2
"""How far from it a colour is another, in the same disc."""

LEAK = 0.3
"""The largest share of what is around a thing that has its colour too: else it is a part of something larger."""

BAND = 3
"""Pixels around a thing that are taken for what is around it."""

_WIDE = np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)
_BRUSH = np.ones((3, 3), np.uint8)


class SpotFinder:
    """Finds balls and boxes of the colours in ``looked_for``.

    ``colours`` has these, and all that they may be mistaken for, as red, green and blue in full light.
    Raises ValueError for a colour that is not among them.
    """

    def __init__(self, colours: Mapping[str, Colour], looked_for: Sequence[str]) -> None:
        self._palette = Palette(colours)
        unknown = sorted(set(looked_for) - set(colours))
        if unknown:
            raise ValueError(f"things: no such colour: {', '.join(unknown)}; known are: {', '.join(colours)}")
        self._looked_for = [(name, self._palette.names.index(name)) for name in dict.fromkeys(looked_for)]

    def find(self, image: Image) -> list[Spot]:
        """Return the balls and boxes in a picture of shape (height, width, 3), largest first."""
        scale = max(1.0, image.shape[1] / SEARCH_WIDTH)
        picture = balanced(_smooth(image, scale))
        labels = self._palette.label(picture)
        found = [
            Spot(_times(seen.box, scale), name, seen.shape, seen.width * scale)
            for name, number in self._looked_for
            for contour in _contours(labels, number)
            if self._stands_out(picture, contour, number)
            if (seen := outline(contour)) is not None
        ]
        return sorted(found, key=lambda spot: -spot.box.width * spot.box.height)

    def _stands_out(self, picture: Image, contour: Contour, number: int) -> bool:
        """Say whether a spot is of that colour as a whole, and little of what is around it is of its colour too."""
        inside, around = _inside_and_around(picture, contour)
        mean = inside.mean(axis=0)
        if np.linalg.norm(mean - self._palette.places[number]) > CORE:
            return False
        alike = np.linalg.norm(around - mean, axis=1) < STEP
        return bool(alike.mean() <= LEAK)


def _smooth(image: Image, scale: float) -> Image:
    """Return the picture ``scale`` times smaller, with less noise."""
    if scale > 1.0:
        size = round(image.shape[1] / scale), max(1, round(image.shape[0] / scale))
        image = cast(Image, cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    return cast(Image, cv2.GaussianBlur(image, (3, 3), 0))


def _contours(labels: Labels, number: int) -> Iterator[Contour]:
    """Yield the contours of all spots with this label that may be things. What the rim cuts off, may be anything."""
    mask = np.equal(labels, number).view(np.uint8)
    mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, _BRUSH), np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    height, width = labels.shape
    for contour in contours:
        x, y, across, down = cv2.boundingRect(contour)
        cut = x <= 0 or y <= 0 or x + across >= width or y + down >= height
        if not cut and min(across, down) >= SMALLEST_SPOT and across * down <= LARGEST * width * height:
            yield np.asarray(contour, np.int32)


def _inside_and_around(picture: Image, contour: Contour) -> tuple[Places, Places]:
    """Return the colours (in the disc, of shape (pixels, 2)) within a contour, and in a band around it.

    The band is a little away from the contour, where the colours mix.
    """
    x, y, across, down = cv2.boundingRect(contour)
    x, y = max(0, x - BAND), max(0, y - BAND)
    part = picture[y : y + down + 2 * BAND, x : x + across + 2 * BAND]
    inside = np.zeros(part.shape[:2], np.uint8)
    cv2.drawContours(inside, [contour], 0, 1, cv2.FILLED, offset=(-x, -y))
    around = cv2.dilate(inside, _WIDE) - cv2.dilate(inside, _BRUSH)
    places = in_disc(part)
    return places[inside > 0], places[around > 0]


def _times(box: Box, scale: float) -> Box:
    return Box(box.x * scale, box.y * scale, box.width * scale, box.height * scale)
