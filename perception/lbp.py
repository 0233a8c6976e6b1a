"""Local binary patterns: what a face is made of, spot by spot, whatever the light.

Each pixel is written as eight bits: which of its neighbours are at least as bright. Those patterns that go over from
dark to bright at most twice around the pixel are edges, corners and spots; all others count as one. How often each
occurs in each of 5 x 5 cells describes the face (Ahonen, Hadid, Pietikäinen: Face description with local binary
patterns, 2006). Square roots make the distance between two of them that of Hellinger.

The patterns are coarse: finer ones are of pores and lashes, which a face of 40 pixels does not show, and say how far
away somebody is rather than who it is.
"""

from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from perception.light import Grey, even_out

Vector = npt.NDArray[np.float32]
"""A description: shape (LENGTH,), float32, of length 1."""

SMOOTH = 4.0
"""Pixels of a crop by which it is smoothed (sigma): a face of 40 pixels is then described as one of 100 is."""

FAR = 5
"""Pixels from a pixel to the neighbours with which it is compared."""

CELLS = 5
PATTERNS = 59  # 58 that go over at most twice, and all others
LENGTH = CELLS * CELLS * PATTERNS

_AROUND = ((-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1))


def describe(crop: Grey) -> Vector:
    """Return the description of a face: (LENGTH,), float32, of length 1."""
    smooth = cv2.GaussianBlur(even_out(crop, tiles=2), (0, 0), SMOOTH)
    height, width = smooth.shape[0] - 2 * FAR, smooth.shape[1] - 2 * FAR
    middle = smooth[FAR:-FAR, FAR:-FAR]
    code = np.zeros((height, width), np.uint8)
    for bit, (down, right) in enumerate(_AROUND):
        top, left = FAR * (1 + down), FAR * (1 + right)
        neighbour = smooth[top : top + height, left : left + width]
        code |= (neighbour >= middle).view(np.uint8) << bit
    counts = np.bincount((_cells(height, width) + _patterns()[code]).ravel(), minlength=LENGTH)
    shares = counts.reshape(CELLS * CELLS, PATTERNS).astype(np.float32)
    shares /= shares.sum(axis=1, keepdims=True)
    return np.asarray(np.sqrt(shares).ravel() / CELLS, np.float32)


@cache
def _cells(height: int, width: int) -> npt.NDArray[np.int64]:
    """Return where in a description the cell of each pixel begins: (height, width)."""
    rows, columns = np.arange(height) * CELLS // height, np.arange(width) * CELLS // width
    return (rows[:, None] * CELLS + columns[None]) * PATTERNS


@cache
def _patterns() -> npt.NDArray[np.int64]:
    """Return the number 0..58 of the pattern that each of the 256 codes is."""
    bits = (np.arange(256)[:, None] >> np.arange(8)) & 1
    uniform = (bits != np.roll(bits, 1, axis=1)).sum(axis=1) <= 2
    return np.where(uniform, np.cumsum(uniform) - 1, PATTERNS - 1)
