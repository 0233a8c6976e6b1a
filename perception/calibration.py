"""What a camera's lens is like, from pictures of a chessboard.

After Zhang, "A flexible new technique for camera calibration" (2000), as OpenCV does it, for square pixels.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, hypot

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Image
from perception.image_preparation import GreyImage, to_grey

Corners = npt.NDArray[np.float32]
"""The inner corners of the board in one picture, row by row: shape (n, 1, 2), dtype float32, x then y in pixels."""

MIN_VIEWS = 8
"""Views of the board that a calibration needs."""

MIN_VIEW_DISTANCE = 0.015
"""How far the corners of two views lie apart in the mean, as a share of the longer side: a tilt alone is not more."""


@dataclass(frozen=True, slots=True)
class Chessboard:
    """A chessboard: its inner corners ``across`` and ``down``, and the side of a square in metres.

    Raises ValueError for fewer than three corners a side, or a square without a side.
    """

    across: int
    down: int
    square: float

    def __post_init__(self) -> None:
        if min(self.across, self.down) < 3:
            raise ValueError(f"a board of {self.across}x{self.down} inner corners: 3 at least are needed each way")
        if not self.square > 0:
            raise ValueError(f"a board with squares of {self.square} m: they must be above 0 m")

    def points(self) -> Corners:
        """Return its corners in metres on the plane z = 0: shape (n, 3), dtype float32."""
        places = [(x * self.square, y * self.square, 0.0) for y in range(self.down) for x in range(self.across)]
        return np.array(places, np.float32)


@dataclass(frozen=True, slots=True)
class LensCalibration:
    """A lens as ``perception.geometry.Pinhole`` has it, and how it was found.

    ``error`` is by how far the board's corners miss it, RMS in pixels, ``views`` the number of pictures, ``nearest``
    and ``farthest`` the distance of the board in them, in metres.
    """

    field_of_view: float
    centre: tuple[float, float]
    distortion: tuple[float, ...]
    error: float
    views: int
    nearest: float
    farthest: float


def find_board(image: Image | GreyImage, board: Chessboard) -> Corners | None:
    """Return the inner corners of the board in a picture; None unless all of them are there."""
    found, corners = cv2.findChessboardCornersSB(to_grey(image), (board.across, board.down))
    return np.asarray(corners, np.float32).reshape(-1, 1, 2) if found else None


class BoardViews:
    """Gathers views of a board that differ from one another: a hundred pictures of one view teach no more than one."""

    def __init__(self, board: Chessboard) -> None:
        self.board = board
        self.corners: list[Corners] = []
        self.size = (0, 0)

    def add(self, image: Image | GreyImage) -> bool:
        """Take in a picture; True when it shows the board as none before.

        Raises ValueError for a picture of another size than those before.
        """
        size = image.shape[1], image.shape[0]
        if self.corners and size != self.size:
            raise ValueError(
                f"calibration: pictures of {size[0]}x{size[1]} after some of {self.size[0]}x{self.size[1]}"
            )
        found = find_board(image, self.board)
        if found is None or any(
            self._corner_distance(found, other) < MIN_VIEW_DISTANCE * max(size) for other in self.corners
        ):
            return False
        self.size = size
        self.corners.append(found)
        return True

    def _corner_distance(self, some: Corners, others: Corners) -> float:
        """Return the mean distance in pixels; of a board that may look the same upside down, the smaller one."""
        return min(float(np.linalg.norm(some - turned, axis=2).mean()) for turned in (others, others[::-1]))


def calibrate(views: BoardViews) -> LensCalibration:
    """Return the lens that explains the views best. Raises ValueError for fewer than ``MIN_VIEWS`` of them."""
    if len(views.corners) < MIN_VIEWS:
        raise ValueError(f"calibration: {len(views.corners)} different views of the board, {MIN_VIEWS} are needed")
    return _solve(views.corners, views.board, views.size)


def _solve(corners: Sequence[Corners], board: Chessboard, size: tuple[int, int]) -> LensCalibration:
    width, height = size
    guess = np.array(((width, 0, (width - 1) / 2), (0, width, (height - 1) / 2), (0, 0, 1)), np.float64)
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_ASPECT_RATIO  # both focal lengths alike
    error, matrix, bent, _, places = cv2.calibrateCamera(
        [board.points()] * len(corners), corners, size, guess, np.zeros(5), flags=flags
    )
    ranges = [hypot(*(float(value) for value in np.ravel(place))) for place in places]
    # OpenCV counts from the middle of the first pixel, boxes from its edge: half a pixel.
    centre = (float(matrix[0, 2]) + 0.5) / width, (float(matrix[1, 2]) + 0.5) / height
    return LensCalibration(
        field_of_view=2 * atan(width / 2 / float(matrix[0, 0])),
        centre=centre,
        distortion=tuple(float(value) for value in np.ravel(bent)[:5]),
        error=float(error),
        views=len(corners),
        nearest=min(ranges),
        farthest=max(ranges),
    )
