"""Following a patch of the picture from one frame to the next by sparse optical flow."""

from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box
from perception.light import Grey, resized, window

Points = npt.NDArray[np.float32]
"""Places in a picture: shape (n, 1, 2), dtype float32, x then y in pixels."""

REACH = 3.0  # how much of the picture is looked at, in widths of the box: it may move by one width a frame
PATCH = 48  # pixels to which a larger box is shrunk: what it costs does not grow with the face
CORNERS = 40
ENOUGH = 6  # points that must be followed for the result to count
RETURN = 1.0  # pixels by which a point may miss its start when it is followed back


def carry(before: Grey, after: Grey, box: Box) -> Box | None:
    """Return where the patch in ``box`` of ``before`` is in ``after``; None when it can't be followed.

    Corners on the inner part of the box are followed with pyramidal Lucas-Kanade, forth and back; those that do not
    return to their start are dropped, the median of the rest moves the box, the change of their spread scales it.
    """
    if before.shape != after.shape:
        return None
    rows, columns = window(before.shape, box, REACH)
    if before[rows, columns].size == 0:
        return None
    scale = min(1.0, PATCH / box.width)
    old, new = resized(before[rows, columns], scale), resized(after[rows, columns], scale)
    inner = Box((box.x - columns.start) * scale, (box.y - rows.start) * scale, box.width * scale, box.height * scale)
    start = _corners(old, inner)
    if start is None:
        return None
    pairs = _followed(old, new, start)
    if pairs is None:
        return None
    return _moved(box, *pairs, scale, before.shape)


def _corners(picture: Grey, box: Box) -> Points | None:
    """Points worth following on the inner part of the box, away from the background at its edges."""
    mask = np.zeros_like(picture)
    mask[window(picture.shape, box, 0.7)] = 255
    # OpenCV says None for no corner at all, which its type stubs leave out.
    return cast(Points | None, cv2.goodFeaturesToTrack(picture, CORNERS, 0.02, 3, mask=mask))


def _followed(old: Grey, new: Grey, start: Points) -> tuple[Points, Points] | None:
    """The points that were followed forth and back, before and after, each of shape (n, 2)."""
    size, levels = (15, 15), 3
    there, seen, _ = cv2.calcOpticalFlowPyrLK(old, new, start, start.copy(), winSize=size, maxLevel=levels)
    back, seen_back, _ = cv2.calcOpticalFlowPyrLK(new, old, there, there.copy(), winSize=size, maxLevel=levels)
    missed_by = np.linalg.norm((back - start).reshape(-1, 2), axis=1)
    good = (seen.ravel() == 1) & (seen_back.ravel() == 1) & (missed_by < RETURN)
    if np.count_nonzero(good) < ENOUGH:
        return None
    return cast(Points, start.reshape(-1, 2)[good]), cast(Points, there.reshape(-1, 2)[good])


def _moved(box: Box, start: Points, there: Points, scale: float, shape: tuple[int, ...]) -> Box | None:
    """Move and scale the box as the points did; None when it has left the picture."""
    middle, middle_there = np.median(start, axis=0), np.median(there, axis=0)
    spread = np.median(np.linalg.norm(start - middle, axis=1))
    spread_there = np.median(np.linalg.norm(there - middle_there, axis=1))
    growth = float(np.clip(spread_there / max(spread, 1.0), 0.9, 1.1))
    shift_x, shift_y = np.median(there - start, axis=0) / scale
    x, y = box.centre[0] + float(shift_x), box.centre[1] + float(shift_y)
    if not (0 <= x < shape[1] and 0 <= y < shape[0]):
        return None
    width, height = box.width * growth, box.height * growth
    return Box(x - width / 2, y - height / 2, width, height)
