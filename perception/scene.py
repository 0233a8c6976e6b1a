"""Whether a picture shows anything at all: a covered lens and a blank wall have no edges, a room has."""

from typing import cast

import cv2
import numpy as np

from perception.api import Image, Scene
from perception.light import Grey, grey

CELL = 8
"""Pixels of a picture's side that make one cell: their mean knows no noise, and an edge still shows."""

EDGES = 0.01
"""The share of neighbouring cells that may differ by more than the contrast: a few hot pixels are no scene."""


def measure(image: Image | Grey, *, stamp: float) -> Scene:
    """Return what a picture of shape (height, width, 3) or (height, width) shows as a whole.

    The contrast is the 99th percentile of the differences between cells side by side. A smooth shade makes a large
    spread of brightness but no such steps, so a wall that is lit from one side is as uniform as it looks.
    Raises ValueError for what is not a picture.
    """
    cells = grey(_shrunk(image)).astype(np.int16)
    steps = np.concatenate([np.abs(np.diff(cells, axis=axis)).ravel() for axis in (0, 1)])
    if steps.size == 0:
        return Scene(stamp, float(cells.mean()), 0.0)
    at = int((1.0 - EDGES) * (steps.size - 1))
    return Scene(stamp, float(cells.mean()), float(np.partition(steps, at)[at]))


def _shrunk(image: Image | Grey) -> Image:
    """Return one pixel for each cell; a picture that is no picture is left to ``grey`` to refuse."""
    if image.dtype != np.uint8 or image.ndim < 2 or image.size == 0:
        return image
    size = max(1, image.shape[1] // CELL), max(1, image.shape[0] // CELL)
    return cast(Image, cv2.resize(image, size, interpolation=cv2.INTER_AREA))
