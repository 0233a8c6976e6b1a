"""Hangs flat painted sheets in a picture, in true perspective: people, balls, markers."""

from collections.abc import Sequence

import cv2
import numpy as np

from drivers.sim.canvas import Sprite
from drivers.sim.painter import NEAR_PLANE, Painter
from drivers.sim.viewpoint import Floats

_SMALLEST = 16  # pixels of the shorter side of a sheet


def halved(sheet: Sprite) -> tuple[Sprite, ...]:
    """Return a sheet and smaller ones, each half as large as the one before: sampled sparsely, a large one flickers."""
    sizes = [sheet]
    while min(sizes[-1].shape[:2]) >= 2 * _SMALLEST:
        sizes.append(np.asarray(cv2.pyrDown(sizes[-1]), np.uint8))
    return tuple(sizes)


def hang(painter: Painter, sizes: Sequence[Sprite], corner: Floats, across: Floats, down: Floats) -> None:
    """Draw a sheet that hangs in the world.

    ``sizes`` are those of ``halved``. ``corner`` is the place of its top left corner in metres, ``across`` and ``down``
    lead along its edges, one pixel of the first size far.
    """
    middle = corner + across * (sizes[0].shape[1] / 2) + down * (sizes[0].shape[0] / 2)
    away = max(NEAR_PLANE, float(np.linalg.norm(middle - painter.eye)))
    finest = painter.lens.focal * float(np.linalg.norm(across))  # metres from which a pixel of it is one of the picture
    level = int(np.clip(np.log2(away / finest), 0, len(sizes) - 1))
    sheet, step = sizes[level], 2**level
    # Camera coordinates of the sheet's pixel (u, v) are plane @ (u, v, 1).
    plane = painter.turn @ np.stack((across * step, down * step, corner - painter.eye), axis=1)
    rows = _rows_in_front(plane, sheet.shape[1], sheet.shape[0])
    if rows is not None:
        _paste(painter, sheet[rows], painter.lens.matrix() @ plane @ _moved(0.0, float(rows.start)))


def _rows_in_front(plane: Floats, width: int, height: int) -> slice | None:
    """Return the rows of a sheet wholly beyond ``NEAR_PLANE``; None for none. Depth is linear along the sheet."""
    v = np.arange(height)
    depth = plane[2, 2] + plane[2, 1] * v + min(0.0, plane[2, 0] * width)
    seen = np.flatnonzero(depth > NEAR_PLANE)
    return slice(int(seen[0]), int(seen[-1]) + 1) if seen.size > 1 else None


def _paste(painter: Painter, sheet: Sprite, mapping: Floats) -> None:
    """Blend a sheet into the picture under a homography (3, 3) from its pixels to those of the picture."""
    high, wide = sheet.shape[:2]
    corners = mapping @ np.array(((0, wide, wide, 0), (0, 0, high, high), (1, 1, 1, 1)))
    points = corners[:2] / corners[2]
    low = np.maximum(np.floor(points.min(axis=1)).astype(int), 0)
    top = np.minimum(np.ceil(points.max(axis=1)).astype(int) + 1, (painter.lens.width, painter.lens.height))
    if np.any(top <= low):
        return
    size = (int(top[0] - low[0]), int(top[1] - low[1]))
    part = painter.image[low[1] : top[1], low[0] : top[0]]
    drawn = cv2.warpPerspective(sheet, _moved(-float(low[0]), -float(low[1])) @ mapping, size)
    through = cv2.cvtColor(cv2.bitwise_not(cv2.extractChannel(drawn, 3)), cv2.COLOR_GRAY2BGR)
    part[:] = cv2.add(cv2.cvtColor(drawn, cv2.COLOR_BGRA2BGR), cv2.multiply(part, through, scale=1 / 255))


def _moved(x: float, y: float) -> Floats:
    """Return the homography (3, 3) that shifts by (x, y)."""
    return np.array(((1.0, 0.0, x), (0.0, 1.0, y), (0.0, 0.0, 1.0)))
