"""Stands a flat painted figure upright in a picture, in true perspective."""

from dataclasses import dataclass
from math import hypot

import cv2
import numpy as np

from drivers.api import Image
from drivers.sim.canvas import Sprite
from drivers.sim.figure import CROWN, HALF_WIDTH, MILLIMETRE
from drivers.sim.viewpoint import Floats, Pinhole, Viewpoint

NEAR = 0.1
"""Metres in front of the lens within which nothing is drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A painted person in several sizes, each half as large as the one before."""

    sizes: tuple[Sprite, ...]

    @classmethod
    def of(cls, sprite: Sprite) -> "Figure":
        """Prepare the smaller sizes: sampling a large sheet sparsely would make it flicker."""
        sizes = [sprite]
        while min(sizes[-1].shape[:2]) > 64:
            sizes.append(np.asarray(cv2.pyrDown(sizes[-1]), np.uint8))
        return cls(tuple(sizes))


def stand(
    image: Image, figure: Figure, place: tuple[float, float], height: float, view: Viewpoint, lens: Pinhole
) -> None:
    """Draw ``figure`` into ``image`` at ``place`` (x, y in metres), its eyes ``height`` metres above the floor."""
    away = np.array((place[0] - view.x, place[1] - view.y))
    distance = hypot(*away)
    if distance < NEAR:
        return
    # The figure is upright and turned to the camera: its own right is this horizontal unit vector.
    across = np.array((away[1], -away[0], 0.0)) / distance
    level = int(np.clip(np.log2(max(distance, NEAR) / (lens.focal * MILLIMETRE)), 0, len(figure.sizes) - 1))
    sheet = figure.sizes[level]
    step = MILLIMETRE * 2**level
    corner = np.array((*place, height + CROWN * MILLIMETRE)) - across * (HALF_WIDTH * MILLIMETRE)
    turn = view.rotation()
    # Camera coordinates of the sheet's pixel (u, v) are plane @ (u, v, 1).
    plane = np.stack((turn @ across * step, turn @ (0.0, 0.0, -step), turn @ (corner - view.place())), axis=1)
    rows = _rows_in_front(plane, sheet.shape[1], sheet.shape[0])
    if rows is not None:
        _paste(image, sheet[rows], lens.matrix() @ plane @ _moved(0.0, float(rows.start)))


def _rows_in_front(plane: Floats, width: int, height: int) -> slice | None:
    """Return the rows of a sheet that lie wholly beyond ``NEAR``; None for none. Depth is linear along the sheet."""
    v = np.arange(height)
    depth = plane[2, 2] + plane[2, 1] * v + min(0.0, plane[2, 0] * width)
    seen = np.flatnonzero(depth > NEAR)
    return slice(int(seen[0]), int(seen[-1]) + 1) if seen.size > 1 else None


def _paste(image: Image, sheet: Sprite, mapping: Floats) -> None:
    """Blend a sheet into the picture under a homography (3, 3) from its pixels to those of the picture."""
    high, wide = sheet.shape[:2]
    corners = mapping @ np.array(((0, wide, wide, 0), (0, 0, high, high), (1, 1, 1, 1)))
    points = corners[:2] / corners[2]
    low = np.maximum(np.floor(points.min(axis=1)).astype(int), 0)
    top = np.minimum(np.ceil(points.max(axis=1)).astype(int) + 1, (image.shape[1], image.shape[0]))
    if np.any(top <= low):
        return
    size = (int(top[0] - low[0]), int(top[1] - low[1]))
    part = image[low[1] : top[1], low[0] : top[0]]
    drawn = cv2.warpPerspective(sheet, _moved(-float(low[0]), -float(low[1])) @ mapping, size)
    through = cv2.cvtColor(cv2.bitwise_not(cv2.extractChannel(drawn, 3)), cv2.COLOR_GRAY2BGR)
    part[:] = cv2.add(cv2.cvtColor(drawn, cv2.COLOR_BGRA2BGR), cv2.multiply(part, through, scale=1 / 255))


def _moved(x: float, y: float) -> Floats:
    """Return the homography (3, 3) that shifts by (x, y)."""
    return np.array(((1.0, 0.0, x), (0.0, 1.0, y), (0.0, 0.0, 1.0)))
