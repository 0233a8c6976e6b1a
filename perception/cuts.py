"""Parts of a picture as a face detector wants them: grey, evenly lit, scaled, and turned until a head is upright."""

from dataclasses import dataclass
from math import degrees
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Detection, Image
from perception.light import Grey, even_out, grey, lightened, resized, window


@dataclass(frozen=True, slots=True)
class Cut:
    """A part of a picture: what is ``shown`` of it, and where that comes from.

    It is ``scale`` times as large; its corner is at ``left``, ``top`` of the picture. Where ``roll`` (radians) is not
    0, it was turned to the left by that, and ``back`` (shape (2, 3)) takes places in ``shown`` to those before.
    """

    shown: Grey
    scale: float
    left: float = 0.0
    top: float = 0.0
    roll: float = 0.0
    back: npt.NDArray[np.float64] | None = None

    def placed(self, box: Box, score: float) -> Detection:
        """Take what was found in ``shown`` to the picture; a square that was turned stays upright about its middle."""
        x, y = box.centre if self.back is None else (self.back @ (*box.centre, 1.0)).tolist()
        width, height = box.width / self.scale, box.height / self.scale
        corner = self.left + x / self.scale - width / 2, self.top + y / self.scale - height / 2
        return Detection(Box(*corner, width, height), score, self.roll)


def whole(image: Image | Grey, scale: float, roll: float = 0.0) -> Cut:
    """Return a whole picture ``scale`` times as large. Raises ValueError for what is not a picture.

    Its contrast is spread by half as much as around a face: a cascade then takes two thirds of the time, and finds 59
    faces where it found 60.
    """
    return _turned(Cut(even_out(resized(lightened(grey(image)), scale), tiles=8, limit=1.0), scale), roll)


def around(image: Image | Grey, box: Box, grow: float, pixels: float, roll: float = 0.0) -> Cut | None:
    """Return what is about ``box``, ``grow`` times as large as it, so scaled that the box is ``pixels`` wide.

    None where nothing of the picture is there. Raises ValueError for what is not a picture.
    """
    rows, columns = window(image.shape, box, grow)
    if box.width <= 0 or image[rows, columns].size == 0:
        return None
    scale = pixels / box.width
    shown = even_out(resized(lightened(grey(image[rows, columns])), scale), tiles=2)
    return _turned(Cut(shown, scale, columns.start, rows.start), roll)


def _turned(cut: Cut, roll: float) -> Cut:
    """Turn a cut to the left by ``roll``; its corners fall away: to keep them costs as much again."""
    if roll == 0.0:
        return cut
    height, width = cut.shown.shape
    move = cv2.getRotationMatrix2D((width / 2, height / 2), degrees(roll), 1.0)
    shown = cast(Grey, cv2.warpAffine(cut.shown, move, (width, height)))
    back = np.asarray(cv2.invertAffineTransform(move), np.float64)
    return Cut(shown, cut.scale, cut.left, cut.top, roll, back)
