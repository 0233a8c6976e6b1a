"""Whether a picture shows anything at all: a covered lens and a blank wall have no edges, a room has."""

import numpy as np

from perception.api import Image, Scene
from perception.light import Grey, cells

EDGES = 0.01
"""The share of neighbouring cells that may differ by more than the contrast: a few hot pixels are no scene."""


def measure(image: Image | Grey, *, stamp: float) -> Scene:
    """Return what a picture of shape (height, width, 3) or (height, width) shows as a whole.

    The contrast is the 99th percentile of the differences between cells side by side. A smooth shade makes a large
    spread of brightness but no such steps, so a wall that is lit from one side is as uniform as it looks.
    Raises ValueError for what is not a picture.
    """
    means = cells(image).astype(np.int16)
    steps = np.concatenate([np.abs(np.diff(means, axis=axis)).ravel() for axis in (0, 1)])
    if steps.size == 0:
        return Scene(stamp, float(means.mean()), 0.0)
    at = int((1.0 - EDGES) * (steps.size - 1))
    return Scene(stamp, float(means.mean()), float(np.partition(steps, at)[at]))
