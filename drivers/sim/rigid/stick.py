"""A body as a figure of lines, from its right and from the front: for films of gaits, and of physics without OpenGL."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Image

Floats = npt.NDArray[np.float64]

AROUND, FLOOR, MARKS, INK = (242, 248, 250), (150, 150, 150), (190, 190, 190), (64, 60, 60)
"""Colours: blue, green, red."""

LEFT, RIGHT, MIDDLE = (180, 96, 38), (44, 90, 214), (120, 120, 120)
"""Those of the left half of a body, of its right half, and of what lies between."""

MIDST = 0.01
"""Metres from its middle within which a line belongs to neither half."""

MARKED = 0.1
"""Metres from mark to mark on the floor."""

ROOM = 1.3
"""Times its height that a picture is high."""

FLOOR_AT = 0.88
"""Where in the height of a picture the floor is."""

SHIFT = 4
"""Bits of sub-pixel accuracy in OpenCV's drawing functions."""

FARTHEST = 1e4
"""Pixels beyond which nothing is drawn: OpenCV counts them in 32 bits."""


class Stroke(NamedTuple):
    """A line from ``begin`` to ``end`` (m): x ahead, y left, z up from the floor. ``radius`` is half its width."""

    begin: Floats
    end: Floats
    radius: float


def stick_figure(
    strokes: Sequence[Stroke], size: tuple[int, int], *, height: float, gone: float = 0.0, told: str = ""
) -> Image:
    """Return a picture of ``size`` (width, height): from its right at the left, from the front at the right.

    ``height`` is that of the body (m), ``gone`` how far it has walked, by which the marks on the floor lie back;
    ``told`` stands below.
    """
    width = size[0] // 2
    image: Image = np.full((size[1], size[0], 3), AROUND, np.uint8)
    scale = size[1] * FLOOR_AT / (ROOM * height)
    panes = ((0, 0, 1, -1, "from its right"), (width, 1, 0, 1, "from the front"))
    for left, across, along, way, title in panes:
        pane = image[:, left : left + width]
        _floor(pane, scale, gone if across == 0 else 0.0)
        for stroke in sorted(strokes, key=lambda each: way * float(each.begin[along] + each.end[along])):
            _draw(pane, stroke, across, scale)
        cv2.putText(pane, title, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.45, INK, 1, cv2.LINE_AA)
    cv2.putText(image, told, (8, size[1] - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.45, INK, 1, cv2.LINE_AA)
    return image


def _floor(pane: Image, scale: float, gone: float) -> None:
    height, width = pane.shape[:2]
    level = round(FLOOR_AT * height)
    cv2.line(pane, (0, level), (width, level), FLOOR, 1, cv2.LINE_AA)
    reach = width / 2 / scale
    for number in range(int((gone - reach) // MARKED), int((gone + reach) // MARKED) + 2):
        x = round(width / 2 + scale * (number * MARKED - gone))
        cv2.line(pane, (x, level), (x, level + 8), MARKS, 2, cv2.LINE_AA)


def _draw(pane: Image, stroke: Stroke, across: int, scale: float) -> None:
    height, width = pane.shape[:2]
    middle = float(stroke.begin[1] + stroke.end[1]) / 2
    colour = MIDDLE if abs(middle) < MIDST else LEFT if middle > 0 else RIGHT
    ends = [
        (width / 2 + scale * float(each[across]), FLOOR_AT * height - scale * float(each[2]))
        for each in (stroke.begin, stroke.end)
    ]
    if not np.isfinite(ends).all() or np.abs(ends).max() > FARTHEST:
        return
    begin, end = ((round(x * 2**SHIFT), round(y * 2**SHIFT)) for x, y in ends)
    thick = max(2, min(round(2 * scale * stroke.radius), 200))
    cv2.line(pane, begin, end, tuple(round(0.7 * part) for part in colour), thick + 2, cv2.LINE_AA, SHIFT)
    cv2.line(pane, begin, end, colour, thick, cv2.LINE_AA, SHIFT)
