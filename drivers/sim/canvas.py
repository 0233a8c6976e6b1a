"""A transparent sheet to paint soft shapes on, one pixel to the millimetre.

Coordinates are millimetres from the point between the eyes of whoever is painted, x to the right, y down.
"""

from collections.abc import Sequence
from math import ceil, floor

import cv2
import numpy as np
import numpy.typing as npt

from drivers.sim.room import Colour

Points = Sequence[tuple[float, float]] | npt.NDArray[np.float64]
Sprite = npt.NDArray[np.uint8]
"""A painted sheet: shape (height, width, 4), dtype uint8; blue, green, red already multiplied by the opacity."""

_SHIFT = 4  # bits of sub-pixel accuracy in OpenCV's drawing functions


def oval(x: float, y: float, across: float, down: float) -> npt.NDArray[np.float64]:
    """Return the outline (48, 2) of an upright ellipse about (x, y) with these half-axes."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    return np.stack((x + across * np.cos(angle), y + down * np.sin(angle)), axis=1)


def mirrored(points: Points) -> npt.NDArray[np.float64]:
    """Return a symmetrical outline: ``points`` down the right side, then their mirror image up the left side."""
    right = np.asarray(points, dtype=np.float64)
    return np.concatenate((right, right[::-1] * (-1.0, 1.0)))


class Canvas:
    """A sheet from (left, top) to (right, bottom). Everything painted hides what was there before it."""

    def __init__(self, left: int, top: int, right: int, bottom: int) -> None:
        self._left = left
        self._top = top
        self._sheet = np.zeros((bottom - top, right - left, 4), np.float32)  # 0..255, multiplied by the opacity

    def fill(self, points: Points, colour: Colour, *, soft: float = 0.6, strength: float = 1.0) -> None:
        """Paint an opaque shape; ``soft`` is the blur of its edge in millimetres."""
        area, mask = self._mask(points, soft, None)
        self._sheet[area] += mask * strength * (_paint(colour) - self._sheet[area])

    def shade(self, points: Points, colour: Colour, *, soft: float, strength: float) -> None:
        """Tint what is painted already inside a shape, without covering anything new."""
        area, mask = self._mask(points, soft, None)
        self._tint(area, mask * strength, colour)

    def stroke(self, points: Points, colour: Colour, width: float, *, soft: float = 0.6, strength: float = 1.0) -> None:
        """Draw a line through ``points`` on what is painted already; ``width`` in millimetres."""
        area, mask = self._mask(points, soft, width)
        self._tint(area, mask * strength, colour)

    def sprite(self) -> Sprite:
        """Return the sheet, its colours multiplied by its opacity."""
        return np.clip(np.rint(self._sheet), 0, 255).astype(np.uint8)

    def _tint(self, area: tuple[slice, slice], mask: npt.NDArray[np.float32], colour: Colour) -> None:
        opacity = self._sheet[area][..., 3:] / 255.0
        self._sheet[area] += mask * (opacity * _paint(colour) - self._sheet[area])

    def _mask(
        self, points: Points, soft: float, width: float | None
    ) -> tuple[tuple[slice, slice], npt.NDArray[np.float32]]:
        """Return the part of the sheet that a shape touches, and how much (0..1, shape (h, w, 1)) each pixel is in."""
        outline = np.asarray(points, dtype=np.float64) - (self._left, self._top)
        reach = 3.0 * soft + (width or 0.0) + 2.0
        height, breadth = self._sheet.shape[:2]
        low, high = outline.min(axis=0) - reach, outline.max(axis=0) + reach
        x0, y0 = max(0, floor(low[0])), max(0, floor(low[1]))
        x1, y1 = max(x0 + 1, min(breadth, ceil(high[0]))), max(y0 + 1, min(height, ceil(high[1])))
        mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
        fixed = np.rint((outline - (x0, y0)) * 2**_SHIFT).astype(np.int32)
        if width is None:
            cv2.fillPoly(mask, [fixed], 255, cv2.LINE_AA, _SHIFT)
        else:
            cv2.polylines(mask, [fixed], False, 255, max(1, round(width)), cv2.LINE_AA, _SHIFT)
        blurred = cv2.GaussianBlur(mask.astype(np.float32) / 255.0, (0, 0), soft)
        return (slice(y0, y1), slice(x0, x1)), np.asarray(blurred, np.float32)[..., None]


def _paint(colour: Colour) -> npt.NDArray[np.float32]:
    """Return a colour as an opaque pixel: blue, green, red, opacity."""
    return np.array((*colour[::-1], 255), np.float32)
