"""Measurement of whole pictures: brightness, contrast, and the motion sense.

A covered lens and a blank wall have no edges, a room has. Motion is the change that remains after compensating the
motion of the head.
"""

from dataclasses import replace
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Frame, Image, Scene
from perception.image_preparation import GreyImage, cell_means, shrink_to, to_grey

COMPARE_WIDTH = 160
"""Pixels of width at which pictures are compared: little noise is left, and a hand is still visible."""

MAX_SHIFT = 0.25
"""Largest shift between two pictures, as a share of the picture; with a larger shift, too little of them overlaps."""

MIN_CORRELATION_PEAK = 0.2
"""Smallest peak (0..1) of the correlation for a valid shift; a cut to another scene has about 0.05."""

MIN_DIFFERENCE = 14.0
"""Smallest difference in grey levels (of 255) between two pictures at which a spot counts as changed."""

_NEIGHBOURHOOD = np.ones((3, 3), np.uint8)


class MotionSense:
    """Measures a scene and its motion: a ``perception.senses.SceneSense``.

    A turning camera shifts the whole picture. Phase correlation finds the shift, the previous picture is moved by it,
    and the overlap is compared. A pixel has changed if it is brighter, or darker, than all pixels of the previous
    picture around that place. The sides of a picture shift more than its middle, but that difference is mostly ignored
    in this way: 0.2 % of the picture counts as changed for a head that turns at 10 degrees/s, and 1 % at 60, as for a
    person who walks by. Without a valid shift, as in a fast turn, no motion is reported.
    """

    def __init__(self) -> None:
        self._previous: GreyImage | None = None

    def measure(self, frame: Frame) -> Scene:
        """Return the scene of the next frame with its ``motion``; 0 for the first one."""
        picture = shrink(frame.image)
        before, self._previous = self._previous, picture
        same_size = before is not None and before.shape == picture.shape
        motion = changed_share(before, picture) if before is not None and same_size else 0.0
        return replace(measure_scene(frame.image, stamp=frame.stamp), motion=motion)


def changed_share(before: GreyImage, after: GreyImage) -> float:
    """Return the share 0..1 of ``after`` that differs from ``before``, apart from a common shift and the light.

    Both have the same shape (height, width).
    """
    moved = find_shift(before, after)
    return 0.0 if moved is None else _differing_share(before, after, moved)


def find_shift(before: GreyImage, after: GreyImage) -> tuple[float, float] | None:
    """Return the shift of ``after`` against ``before`` to the right and down, in pixels; None if it is unclear."""
    height, width = after.shape
    window = cv2.createHanningWindow((width, height), cv2.CV_32F)
    (right, down), peak = cv2.phaseCorrelate(before.astype(np.float32), after.astype(np.float32), window)
    if peak < MIN_CORRELATION_PEAK or abs(right) > MAX_SHIFT * width or abs(down) > MAX_SHIFT * height:
        return None
    return right, down


def _translate(picture: GreyImage, shift: tuple[float, float]) -> GreyImage:
    """Return a picture shifted to the right and down, with black borders."""
    right, down = shift
    height, width = picture.shape
    move = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
    return cast(GreyImage, cv2.warpAffine(picture, move, (width, height)))


def _differing_share(before: GreyImage, after: GreyImage, shift: tuple[float, float]) -> float:
    """Return the share of the overlap of two pictures that differs, after shifting ``before``."""
    height, width = after.shape
    margin_x, margin_y = int(abs(shift[0])) + 2, int(abs(shift[1])) + 2
    both = (slice(margin_y, height - margin_y), slice(margin_x, width - margin_x))
    then, now = np.asarray(_translate(before, shift)[both], np.float32), np.asarray(after[both], np.float32)
    if now.size == 0:
        return 0.0
    then = np.clip(then * _exposure_ratio(then, now), 0, 255)
    lowest, highest = cv2.erode(then, _NEIGHBOURHOOD), cv2.dilate(then, _NEIGHBOURHOOD)
    return float(np.mean((now < lowest - MIN_DIFFERENCE) | (now > highest + MIN_DIFFERENCE)))


def _exposure_ratio(then: npt.NDArray[np.float32], now: npt.NDArray[np.float32]) -> float:
    """Return the ratio of brightness of two pictures, as the median of the ratios of their pixels."""
    return float(np.median((now + 1.0) / (then + 1.0)))


def shrink(image: Image) -> GreyImage:
    """Return a grey picture shrunk to ``COMPARE_WIDTH`` pixels across."""
    height, width = image.shape[:2]
    if width <= COMPARE_WIDTH:
        return to_grey(image)
    return shrink_to(image, COMPARE_WIDTH, max(1, round(height * COMPARE_WIDTH / width)))


EDGE_SHARE = 0.01
"""Share of pairs of neighbouring cells whose difference may exceed the reported contrast.

A few hot pixels of the sensor thus have no effect on the contrast.
"""


def measure_scene(image: Image | GreyImage, *, stamp: float) -> Scene:
    """Return the scene of a picture of shape (height, width, 3) or (height, width), without motion.

    The contrast is the 99th percentile of the differences between neighbouring cells. A smooth gradient has a large
    spread of brightness but no such steps, so a wall that is lit from one side counts as uniform. Raises ValueError for
    an invalid picture.
    """
    means = cell_means(image).astype(np.int16)
    steps = np.concatenate([np.abs(np.diff(means, axis=axis)).ravel() for axis in (0, 1)])
    if steps.size == 0:
        return Scene(stamp, float(means.mean()), 0.0)
    at = int((1.0 - EDGE_SHARE) * (steps.size - 1))
    return Scene(stamp, float(means.mean()), float(np.partition(steps, at)[at]))
