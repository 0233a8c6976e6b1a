"""Which shape a spot of one colour has, judged by its outline."""

from dataclasses import dataclass
from math import pi, sqrt

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import BALL, BOX, Box

Contour = npt.NDArray[np.int32]
"""The outline of a spot: shape (points, 1, 2), dtype int32, x and y in pixels."""

SOLID = 0.88
"""The least share of its convex hull that a spot fills: what is looked for has no bays."""

ROUND = 0.81
"""The least share of the smallest circle around it that a ball fills. A square fills 0.64 of it, a disc all of it, or
0.85 where it is ten pixels wide; a cube seen from far above, 0.83: that may be taken for a ball."""

SQUARE = 0.79
"""The least share of the smallest rectangle around it that a box fills, seen from wherever. A disc fills 0.785, but is
round first."""

MAX_ELONGATION = 4.0
"""The most times that a thing is as long as it is wide."""

TURNED = 1.2
"""A box looks wider than its front when it is turned: by 1 to 1.41 times for a square one, this in the middle."""


@dataclass(frozen=True, slots=True)
class Outline:
    """A spot's outline: the upright ``box`` around it, its ``shape``, and ``width`` in pixels as a measure of its size.

    The width is the diameter of a ball, and for a box that of its front as far as that can be told.
    """

    box: Box
    shape: str
    width: float


def outline(contour: Contour) -> Outline | None:
    """Judge the outline of a spot; None where it is neither a ball nor a box.

    A contour goes through the middles of the outermost pixels: half a pixel is added on each side.
    """
    x, y, across, down = cv2.boundingRect(contour)
    hull = np.asarray(cv2.convexHull(contour), np.int32)
    area, hull_area = _filled(contour), _filled(hull)
    _, radius = cv2.minEnclosingCircle(hull)
    (_, _), (one, other), _ = cv2.minAreaRect(hull)
    short, long = sorted((one + 1.0, other + 1.0))
    if area < SOLID * hull_area or long > MAX_ELONGATION * short:
        return None
    box = Box(float(x), float(y), float(across), float(down))
    if area >= ROUND * pi * (radius + 0.5) ** 2:
        return Outline(box, BALL, 2 * sqrt(area / pi))
    if area >= SQUARE * short * long:
        return Outline(box, BOX, across / TURNED)
    return None


def _filled(contour: Contour) -> float:
    """Return how many pixels are on and within an outline (Pick: area within the middles, half the rim, and one)."""
    return cv2.contourArea(contour) + cv2.arcLength(contour, closed=True) / 2 + 1
