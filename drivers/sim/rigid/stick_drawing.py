"""Stick figure of a body, from its right and from the front, for films of gaits and of physics without OpenGL."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Image

Floats = npt.NDArray[np.float64]

BACKGROUND, FLOOR, MARKS, INK = (242, 248, 250), (150, 150, 150), (190, 190, 190), (64, 60, 60)
"""Colours: blue, green, red."""

LEFT, RIGHT, MIDDLE = (180, 96, 38), (44, 90, 214), (120, 120, 120)
"""Colours of the left half of a body, the right half, and the middle."""

MIDDLE_HALF_WIDTH = 0.01
"""Largest distance in metres from the middle plane of the body at which a line is drawn in the colour ``MIDDLE``."""

MARK_SPACING = 0.1
"""Metres between two marks on the floor."""

PICTURE_HEIGHT_FACTOR = 1.3
"""Height of a picture, in heights of the body."""

FLOOR_HEIGHT_SHARE = 0.88
"""Position of the floor, as a share of the picture's height from the top."""

SUBPIXEL_BITS = 4
"""Bits of sub-pixel accuracy in OpenCV's drawing functions."""

MAX_PIXEL = 1e4
"""Largest pixel coordinate that is drawn: OpenCV's are 32 bits."""


class Stroke(NamedTuple):
    """A line from ``begin`` to ``end`` (m): x ahead, y left, z up from the floor. ``radius`` is half its width."""

    begin: Floats
    end: Floats
    radius: float


def draw_stick_figure(
    strokes: Sequence[Stroke], size: tuple[int, int], *, height: float, walked: float = 0.0, caption: str = ""
) -> Image:
    """Return a picture of ``size`` (width, height): left half seen from the right side, right half from the front.

    ``height`` is that of the body (m). ``walked`` is the distance so far (m), by which the marks on the floor are
    shifted. ``caption`` is written below.
    """
    width = size[0] // 2
    image: Image = np.full((size[1], size[0], 3), BACKGROUND, np.uint8)
    scale = size[1] * FLOOR_HEIGHT_SHARE / (PICTURE_HEIGHT_FACTOR * height)
    panes = ((0, 0, 1, -1, "from its right"), (width, 1, 0, 1, "from the front"))
    for left, across, along, way, title in panes:
        pane = image[:, left : left + width]
        _draw_floor(pane, scale, walked if across == 0 else 0.0)
        for stroke in sorted(strokes, key=lambda each: way * float(each.begin[along] + each.end[along])):
            _draw_stroke(pane, stroke, across, scale)
        cv2.putText(pane, title, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.45, INK, 1, cv2.LINE_AA)
    cv2.putText(image, caption, (8, size[1] - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.45, INK, 1, cv2.LINE_AA)
    return image


def _draw_floor(pane: Image, scale: float, walked: float) -> None:
    height, width = pane.shape[:2]
    level = round(FLOOR_HEIGHT_SHARE * height)
    cv2.line(pane, (0, level), (width, level), FLOOR, 1, cv2.LINE_AA)
    reach = width / 2 / scale
    for number in range(int((walked - reach) // MARK_SPACING), int((walked + reach) // MARK_SPACING) + 2):
        x = round(width / 2 + scale * (number * MARK_SPACING - walked))
        cv2.line(pane, (x, level), (x, level + 8), MARKS, 2, cv2.LINE_AA)


def _draw_stroke(pane: Image, stroke: Stroke, across: int, scale: float) -> None:
    height, width = pane.shape[:2]
    middle = float(stroke.begin[1] + stroke.end[1]) / 2
    colour = MIDDLE if abs(middle) < MIDDLE_HALF_WIDTH else LEFT if middle > 0 else RIGHT
    ends = [
        (width / 2 + scale * float(each[across]), FLOOR_HEIGHT_SHARE * height - scale * float(each[2]))
        for each in (stroke.begin, stroke.end)
    ]
    if not np.isfinite(ends).all() or np.abs(ends).max() > MAX_PIXEL:
        return
    begin, end = ((round(x * 2**SUBPIXEL_BITS), round(y * 2**SUBPIXEL_BITS)) for x, y in ends)
    thick = max(2, min(round(2 * scale * stroke.radius), 200))
    cv2.line(pane, begin, end, tuple(round(0.7 * part) for part in colour), thick + 2, cv2.LINE_AA, SUBPIXEL_BITS)
    cv2.line(pane, begin, end, colour, thick, cv2.LINE_AA, SUBPIXEL_BITS)
