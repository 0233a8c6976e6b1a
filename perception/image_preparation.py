"""Getting a picture ready to be searched: grey, evenly lit, and no larger than need be."""

from typing import TypeVar, cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Image

GreyImage = npt.NDArray[np.uint8]
"""A picture without colour: shape (height, width), dtype uint8."""

Picture = TypeVar("Picture", Image, GreyImage)

CELL_PIXELS = 8
"""Pixels of a picture's side that make one cell: their mean knows little noise, and an edge still shows."""


DARK_LEVEL, TARGET_LEVEL, BLACK_LEVEL = 64.0, 200.0, 10.0
"""Grey levels of its brightest parts: a picture that is dark, what it is brought to, and what counts as black."""


def check_image(image: Image | GreyImage) -> None:
    """Raise ValueError for what is not a picture, in colour or grey, of 8 bits a channel."""
    if image.dtype != np.uint8 or image.size == 0:
        raise ValueError(f"picture: expected 8 bits a channel and at least one pixel, got {image.dtype} {image.shape}")
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        raise ValueError(f"picture: expected (height, width, 3) or (height, width), got {image.shape}")


def to_grey(image: Image | GreyImage) -> GreyImage:
    """Return ``image`` without its colours; a grey one as it is. Raises ValueError for anything else."""
    check_image(image)
    return image if image.ndim == 2 else cast(GreyImage, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def is_dark(picture: Image | GreyImage) -> bool:
    """Say whether ``brighten`` brightens it."""
    return _brightest_level(picture) < DARK_LEVEL


def _brightest_level(picture: Image | GreyImage) -> float:
    """Return the grey level of its brightest parts."""
    levels = np.sort(picture[:: max(1, picture.shape[0] // 32), :: max(1, picture.shape[1] // 32)], axis=None)
    # The 98th percentile, for which numpy's own function would load its masked arrays as a run starts.
    return float(np.interp(0.98 * (levels.size - 1), np.arange(levels.size), levels))


def brighten(picture: Picture) -> Picture:
    """Return a dark picture as bright as others, smoothed a little, as its noise grows too; any other as it is.

    The brightness spreads before it is smoothed, so that the mean of some pixels is finer than a grey level: what is
    seen in 8 % of the light is five levels deep, and the noise two.
    """
    brightest = _brightest_level(picture)
    if brightest >= DARK_LEVEL:
        return picture
    return cast(
        Picture,
        cv2.GaussianBlur(cv2.convertScaleAbs(picture, alpha=TARGET_LEVEL / max(brightest, BLACK_LEVEL)), (0, 0), 1.0),
    )


def equalise(picture: GreyImage, *, tiles: int, limit: float = 2.0) -> GreyImage:
    """Spread the contrast tile by tile (CLAHE), so that faces are found in the dark and against a window.

    ``tiles`` is their number along each side; what is flat keeps to ``limit``, the more the less. Where it is dark, the
    Haar cascade finds next to nothing without this.
    """
    return cast(GreyImage, cv2.createCLAHE(clipLimit=limit, tileGridSize=(tiles, tiles)).apply(picture))


def resize(picture: GreyImage, scale: float) -> GreyImage:
    """Return the picture ``scale`` times as large: averaged when it shrinks to less than half, else interpolated."""
    if scale == 1.0:
        return picture
    how = cv2.INTER_AREA if scale < 0.5 else cv2.INTER_LINEAR
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    return cast(GreyImage, cv2.resize(picture, size, interpolation=how))


def shrink_to(image: Image | GreyImage, width: int, height: int) -> GreyImage:
    """Return a picture shrunk to ``width`` by ``height`` in grey levels, each pixel the mean of those it stands for.

    Halved as often as that is exact, which costs a third of one step. Raises ValueError for what is not a picture.
    """
    picture = to_grey(image)
    while (shape := picture.shape)[1] >= 2 * width and shape[0] >= 2 * height and shape[0] % 2 == shape[1] % 2 == 0:
        picture = cast(GreyImage, cv2.resize(picture, (shape[1] // 2, shape[0] // 2), interpolation=cv2.INTER_AREA))
    if picture.shape == (height, width):
        return picture
    return cast(GreyImage, cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))


def cell_means(image: Image | GreyImage) -> GreyImage:
    """Return one pixel for each cell of ``CELL_PIXELS`` x ``CELL_PIXELS``, their mean; shape (height, width) in cells.

    Raises ValueError for what is not a picture.
    """
    check_image(image)
    return shrink_to(image, max(1, image.shape[1] // CELL_PIXELS), max(1, image.shape[0] // CELL_PIXELS))


def window_slices(shape: tuple[int, ...], box: Box, grow: float) -> tuple[slice, slice]:
    """Return the (rows, columns) of a picture of ``shape`` that show ``box`` grown ``grow`` times about its middle."""
    x, y = box.centre
    across, down = box.width * grow / 2, box.height * grow / 2
    return _clip_slice(y - down, y + down, shape[0]), _clip_slice(x - across, x + across, shape[1])


def _clip_slice(start: float, stop: float, size: int) -> slice:
    """Cut start..stop to 0..size; empty when nothing is left."""
    first = min(max(int(start), 0), size)
    return slice(first, max(min(round(stop), size), first))
