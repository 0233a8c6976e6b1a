"""Following a patch of the picture from one frame to the next by sparse optical flow."""

from math import log2
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Image
from perception.light import Grey, grey, resized, window

Floats = npt.NDArray[np.float32]
Points = Floats
"""Places in a picture: shape (n, 1, 2), dtype float32, x then y in pixels."""

REACH = 2.4  # how much of the picture is looked at, in widths of the box: it may move by 0.7 of one from frame to frame
REACH_PIXELS = 40  # or by these, where that is more: a head that pans at 60 degrees/s moves the picture by 32 in 50 ms
PATCH = 32  # pixels to which a larger box is shrunk: what it costs does not grow with the face
CORNERS = 20
INNER = 0.8  # of the box is looked at for corners
WINDOW = (9, 9)  # pixels around a corner that are compared
ENOUGH = 6  # points that must be followed for the result to count
RETURN = 1.0  # pixels by which a point may miss its start when it is followed back


def carry(before: Image | Grey, after: Image | Grey, box: Box) -> Box | None:
    """Return where the patch in ``box`` of ``before`` is in ``after``; None when it can't be followed.

    Corners on the inner part of the box are followed with pyramidal Lucas-Kanade, forth and back; those that do not
    return to their start are dropped, the median of the rest moves the box, the change of their spread scales it.
    """
    if before.shape != after.shape or box.width <= 0:
        return None
    rows, columns = window(before.shape, box, max(REACH, 1.0 + 2 * REACH_PIXELS / box.width))
    if before[rows, columns].size == 0:
        return None
    scale = min(1.0, PATCH / box.width)
    old, new = (_shrunk(grey(picture[rows, columns]), scale) for picture in (before, after))
    inner = Box((box.x - columns.start) * scale, (box.y - rows.start) * scale, box.width * scale, box.height * scale)
    start = _corners(old, inner)
    if start is None:
        return None
    pairs = _followed(old, new, start)
    if pairs is None:
        return None
    return _moved(box, *pairs, scale, before.shape)


def _shrunk(picture: Grey, scale: float) -> Grey:
    """Return a picture ``scale`` times as large: halved first, as other averages take five times as long.

    Up to a pixel of the result is missing at the right and the bottom.
    """
    part = 2 ** int(-log2(scale))
    height, width = (side // part for side in picture.shape[:2])
    if part > 1 and min(height, width) > 0:
        even = picture[: height * part, : width * part]
        picture, scale = cast(Grey, cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)), scale * part
    return resized(picture, scale)


def _corners(picture: Grey, box: Box) -> Points | None:
    """Points worth following on the inner part of the box, away from the background at its edges."""
    rows, columns = window(picture.shape, box, INNER)
    if picture[rows, columns].size == 0:
        return None
    # OpenCV says None for no corner at all, which its type stubs leave out.
    found = cast(Points | None, cv2.goodFeaturesToTrack(picture[rows, columns], CORNERS, 0.02, 3))
    return None if found is None else found + np.array((columns.start, rows.start), np.float32)


def _followed(old: Grey, new: Grey, start: Points) -> tuple[Points, Points] | None:
    """The points that were followed forth and back, before and after, each of shape (n, 2)."""
    there, seen, _ = cv2.calcOpticalFlowPyrLK(old, new, start, start.copy(), winSize=WINDOW, maxLevel=3)
    back, seen_back, _ = cv2.calcOpticalFlowPyrLK(new, old, there, there.copy(), winSize=WINDOW, maxLevel=3)
    missed_by = np.hypot(*(back - start).reshape(-1, 2).T)
    good = (seen.ravel() == 1) & (seen_back.ravel() == 1) & (missed_by < RETURN)
    if np.count_nonzero(good) < ENOUGH:
        return None
    return cast(Points, start.reshape(-1, 2)[good]), cast(Points, there.reshape(-1, 2)[good])


def _moved(box: Box, start: Points, there: Points, scale: float, shape: tuple[int, ...]) -> Box | None:
    """Move and scale the box as the points did; None when it has left the picture."""
    middle, middle_there = _median(start), _median(there)
    spread = float(_median(np.hypot(*(start - middle).T)))
    spread_there = float(_median(np.hypot(*(there - middle_there).T)))
    growth = min(max(spread_there / max(spread, 1.0), 0.9), 1.1)
    shift_x, shift_y = _median(there - start) / scale
    x, y = box.centre[0] + float(shift_x), box.centre[1] + float(shift_y)
    if not (0 <= x < shape[1] and 0 <= y < shape[0]):
        return None
    width, height = box.width * growth, box.height * growth
    return Box(x - width / 2, y - height / 2, width, height)


def _median(values: Floats) -> Floats:
    """Return the (upper) median along the first axis; numpy's own takes ten times as long for so few."""
    return cast(Floats, np.sort(values, axis=0)[len(values) // 2])
