"""Getting a picture ready to be searched: grey, evenly lit, and no larger than need be."""

from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Image

Grey = npt.NDArray[np.uint8]
"""A picture without colour: shape (height, width), dtype uint8."""


def check(image: Image | Grey) -> None:
    """Raise ValueError for what is not a picture, in colour or grey, of 8 bits a channel."""
    if image.dtype != np.uint8 or image.size == 0:
        raise ValueError(f"picture: expected 8 bits a channel and at least one pixel, got {image.dtype} {image.shape}")
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        raise ValueError(f"picture: expected (height, width, 3) or (height, width), got {image.shape}")


def grey(image: Image | Grey) -> Grey:
    """Return ``image`` without its colours; a grey one as it is. Raises ValueError for anything else."""
    check(image)
    return image if image.ndim == 2 else cast(Grey, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def even_out(picture: Grey, *, tiles: int) -> Grey:
    """Spread the contrast tile by tile (CLAHE), so that faces are found in the dark and against a window.

    ``tiles`` is their number along each side. Where it is dark, the Haar cascade finds next to nothing without this.
    """
    return cast(Grey, cv2.createCLAHE(clipLimit=2.0, tileGridSize=(tiles, tiles)).apply(picture))


def resized(picture: Grey, scale: float) -> Grey:
    """Return the picture ``scale`` times as large: averaged when it shrinks to less than half, else interpolated."""
    if scale == 1.0:
        return picture
    how = cv2.INTER_AREA if scale < 0.5 else cv2.INTER_LINEAR
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    return cast(Grey, cv2.resize(picture, size, interpolation=how))


def window(shape: tuple[int, ...], box: Box, grow: float) -> tuple[slice, slice]:
    """Return the (rows, columns) of a picture of ``shape`` that show ``box`` grown ``grow`` times about its middle."""
    x, y = box.centre
    across, down = box.width * grow / 2, box.height * grow / 2
    return _span(y - down, y + down, shape[0]), _span(x - across, x + across, shape[1])


def _span(start: float, stop: float, size: int) -> slice:
    """Cut start..stop to 0..size; empty when nothing is left."""
    first = min(max(int(start), 0), size)
    return slice(first, max(min(round(stop), size), first))
