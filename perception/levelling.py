"""Small pictures whose columns all span the same angle, so that a turn of the camera only shifts them sideways."""

from functools import lru_cache
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Image
from perception.geometry import Pinhole
from perception.image_preparation import GreyImage
from perception.scene_motion import shrink


def level_columns(image: Image, camera: Pinhole) -> GreyImage:
    """Return a small grey picture in which each column spans the same angle.

    In such a picture, a turn of the camera shifts everything by the same number of columns. In an ordinary picture, the
    sides have more pixels per degree than the middle.
    """
    picture = shrink(image)
    return cast(GreyImage, cv2.remap(picture, *_columns(camera, *picture.shape), cv2.INTER_LINEAR))


@lru_cache(maxsize=4)
def _columns(camera: Pinhole, height: int, width: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return the source position (x, y) of each pixel of a levelled picture; two arrays of shape (height, width)."""
    angles = (0.5 - (np.arange(width) + 0.5) / width) * camera.field_of_view
    across = np.array([camera.angles_to_pixel(float(angle), 0.0)[0] for angle in angles]) * width / camera.width - 0.5
    down = np.arange(height, dtype=np.float32)[:, None]
    return np.tile(across.astype(np.float32), (height, 1)), np.tile(down, (1, width))
