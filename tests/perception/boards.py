"""A chessboard before a lens that is known."""

from functools import cache
from math import radians

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Image
from perception.calibration import Chessboard
from perception.geometry import Pinhole

BOARD = Chessboard(9, 6, 0.025)
LENS = Pinhole(640, 480, radians(58), (0.515, 0.48), (0.08, -0.2, 0.001, -0.0015, 0.0))
POSES = [
    (turn, place)
    for turn in ((0.0, 0.0, 0.0), (0.5, 0.1, 0.1), (-0.45, 0.2, -0.1), (0.1, 0.55, 0.2), (0.0, -0.5, 0.0))
    for place in ((0.0, 0.0, 0.38), (0.06, -0.04, 0.5), (-0.07, 0.03, 0.45))
]
"""Turns (rad, Rodrigues) and places (m, camera axes) of the board's middle."""


@cache
def rays() -> npt.NDArray[np.float64]:
    """The direction of each pixel's ray in camera axes: shape (480 * 640, 3)."""
    focal, (x, y) = LENS.focal, LENS.centre
    matrix = np.array(((focal, 0, x * 640 - 0.5), (0, focal, y * 480 - 0.5), (0, 0, 1)))
    across, down = np.meshgrid(np.arange(640.0), np.arange(480.0))
    pixels = np.stack((across, down), axis=-1).reshape(-1, 1, 2)
    straight = cv2.undistortPoints(pixels, matrix, np.array(LENS.distortion)).reshape(-1, 2)
    return np.concatenate((straight, np.ones((len(straight), 1))), axis=1)


def drawn(turn: tuple[float, float, float], place: tuple[float, float, float], *, noise: float = 2.0) -> Image:
    """The board as ``LENS`` shows it: each pixel looked up where its ray meets the board."""
    rotation, _ = cv2.Rodrigues(np.array(turn))
    turned = rays() @ rotation  # in the axes of the board
    origin = -np.array(place) @ rotation
    met = origin + turned * (-origin[2] / turned[:, 2])[:, None]
    at = met[:, :2] / BOARD.square + (BOARD.across / 2, BOARD.down / 2) + 0.5
    inside = ((at >= 0) & (at < (BOARD.across + 1, BOARD.down + 1))).all(axis=1)
    black = inside & (np.floor(at).sum(axis=1) % 2 == 0)
    grey = np.where(black, 30.0, 200.0).reshape(480, 640)
    blurred = cv2.GaussianBlur(grey, (0, 0), 0.7) + np.random.default_rng(1).normal(0, noise, grey.shape)
    picture = np.clip(blurred, 0, 255).astype(np.uint8)
    return np.repeat(picture[:, :, None], 3, axis=2)
