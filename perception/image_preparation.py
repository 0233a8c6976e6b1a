"""Preparation of pictures for detection: grey, evenly lit, and small."""

from typing import TypeVar, cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Image

GreyImage = npt.NDArray[np.uint8]
"""A grey picture: shape (height, width), dtype uint8."""

Picture = TypeVar("Picture", Image, GreyImage)

CELL_PIXELS = 8
"""Pixels per side of a cell of a picture, whose mean has little noise but still shows edges."""


DARK_LEVEL, TARGET_LEVEL, BLACK_LEVEL = 64.0, 200.0, 10.0
"""Grey levels of the brightest parts: limit of a dark picture, target when brightening, and smallest divisor."""


def check_image(image: Image | GreyImage) -> None:
    """Raise ValueError unless ``image`` is a colour or grey picture of 8 bits per channel."""
    if image.dtype != np.uint8 or image.size == 0:
        raise ValueError(f"picture: expected 8 bits a channel and at least one pixel, got {image.dtype} {image.shape}")
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        raise ValueError(f"picture: expected (height, width, 3) or (height, width), got {image.shape}")


def to_grey(image: Image | GreyImage) -> GreyImage:
    """Return a grey picture; a grey one unchanged. Raises ValueError for an invalid picture."""
    check_image(image)
    return image if image.ndim == 2 else cast(GreyImage, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def is_dark(picture: Image | GreyImage) -> bool:
    """Return whether ``brighten`` changes the picture."""
    return _brightest_level(picture) < DARK_LEVEL


def _brightest_level(picture: Image | GreyImage) -> float:
    """Return the 98th percentile of the grey levels."""
    levels = np.sort(picture[:: max(1, picture.shape[0] // 32), :: max(1, picture.shape[1] // 32)], axis=None)
    # The 98th percentile, for which numpy's own function would load its masked arrays as a run starts.
    return float(np.interp(0.98 * (levels.size - 1), np.arange(levels.size), levels))


def brighten(picture: Picture) -> Picture:
    """Return a dark picture brightened to the usual level and smoothed, because its noise grows too; others unchanged.

    Smoothing averages a few pixels. It is done after brightening, since the averages would otherwise be rounded to grey
    levels that are too coarse: at 8 % of the light, the whole contrast is five grey levels.
    """
    brightest = _brightest_level(picture)
    if brightest >= DARK_LEVEL:
        return picture
    return cast(
        Picture,
        cv2.GaussianBlur(cv2.convertScaleAbs(picture, alpha=TARGET_LEVEL / max(brightest, BLACK_LEVEL)), (0, 0), 1.0),
    )


def equalise(picture: GreyImage, *, tiles: int, limit: float = 2.0) -> GreyImage:
    """Return a picture with equalised contrast, tile by tile (CLAHE): shows faces in the dark and against a window.

    ``tiles`` is their number along each side; a smaller ``limit`` amplifies flat areas less. Without this, the Haar
    cascade finds almost nothing in the dark.
    """
    return cast(GreyImage, cv2.createCLAHE(clipLimit=limit, tileGridSize=(tiles, tiles)).apply(picture))


def resize(picture: GreyImage, scale: float) -> GreyImage:
    """Return the picture scaled by ``scale``: averaged if it shrinks to less than half, else interpolated."""
    if scale == 1.0:
        return picture
    how = cv2.INTER_AREA if scale < 0.5 else cv2.INTER_LINEAR
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    return cast(GreyImage, cv2.resize(picture, size, interpolation=how))


def shrink_to(image: Image | GreyImage, width: int, height: int) -> GreyImage:
    """Return a grey picture of ``width`` by ``height``; each pixel is the mean of the source pixels.

    While both sides are even and at least twice the wanted size, the picture is halved; this takes a third of the time
    of one large step. Raises ValueError for an invalid picture.
    """
    picture = to_grey(image)
    while (shape := picture.shape)[1] >= 2 * width and shape[0] >= 2 * height and shape[0] % 2 == shape[1] % 2 == 0:
        picture = cast(GreyImage, cv2.resize(picture, (shape[1] // 2, shape[0] // 2), interpolation=cv2.INTER_AREA))
    if picture.shape == (height, width):
        return picture
    return cast(GreyImage, cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))


def cell_means(image: Image | GreyImage) -> GreyImage:
    """Return the mean of each cell of ``CELL_PIXELS`` x ``CELL_PIXELS``; shape (height, width) in cells.

    Raises ValueError for an invalid picture.
    """
    check_image(image)
    return shrink_to(image, max(1, image.shape[1] // CELL_PIXELS), max(1, image.shape[0] // CELL_PIXELS))


def window_slices(shape: tuple[int, ...], box: Box, grow: float) -> tuple[slice, slice]:
    """Return the (rows, columns) of a picture of ``shape`` for ``box``, grown ``grow`` times about its middle."""
    x, y = box.centre
    across, down = box.width * grow / 2, box.height * grow / 2
    return _clip_slice(y - down, y + down, shape[0]), _clip_slice(x - across, x + across, shape[1])


def _clip_slice(start: float, stop: float, size: int) -> slice:
    """Return the slice start..stop clipped to 0..size; it may be empty."""
    first = min(max(int(start), 0), size)
    return slice(first, max(min(round(stop), size), first))
