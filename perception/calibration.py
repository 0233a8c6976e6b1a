"""Calibration of a camera's lens from pictures of a chessboard.

After Zhang, "A flexible new technique for camera calibration" (2000), as in OpenCV, for square pixels.
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
"""Inner corners of a chessboard in one picture, row by row: shape (n, 1, 2), dtype float32, x then y in pixels."""

MIN_VIEWS = 8
"""Smallest number of views of the chessboard for a calibration."""

MIN_VIEW_DISTANCE = 0.015
"""Smallest mean distance of the corners in two different views of the board, as a share of the picture's longer side.
"""


@dataclass(frozen=True, slots=True)
class Chessboard:
    """A chessboard: number of inner corners ``across`` and ``down``, and the side of a square in metres.

    Raises ValueError for fewer than three corners per direction, or if the side is not above 0.
    """

    across: int
    down: int
    square: float

    def __post_init__(self) -> None:
        if min(self.across, self.down) < 3:
            raise ValueError(f"a board of {self.across}x{self.down} inner corners: at least 3 per direction are needed")
        if not self.square > 0:
            raise ValueError(f"a board with squares of {self.square} m: they must be above 0 m")

    def points(self) -> Corners:
        """Return the inner corners of the board in metres on the plane z = 0: shape (n, 3), dtype float32."""
        places = [(x * self.square, y * self.square, 0.0) for y in range(self.down) for x in range(self.across)]
        return np.array(places, np.float32)


@dataclass(frozen=True, slots=True)
class LensCalibration:
    """Lens parameters as in ``perception.geometry.Pinhole``, and quality of the calibration.

    ``error`` is the reprojection error of the corners, RMS in pixels; ``views`` is the number of pictures; ``nearest``
    and ``farthest`` are the distances of the board in them, in metres.
    """

    field_of_view: float
    centre: tuple[float, float]
    distortion: tuple[float, ...]
    error: float
    views: int
    nearest: float
    farthest: float


def find_board(image: Image | GreyImage, board: Chessboard) -> Corners | None:
    """Return the inner corners of the board in a picture; None unless all of them are visible."""
    found, corners = cv2.findChessboardCornersSB(to_grey(image), (board.across, board.down))
    return np.asarray(corners, np.float32).reshape(-1, 1, 2) if found else None


class BoardViews:
    """Collects views of a board that differ from each other, because similar views add no information."""

    def __init__(self, board: Chessboard) -> None:
        self.board = board
        self.corners: list[Corners] = []
        self.size = (0, 0)

    def add(self, image: Image | GreyImage) -> bool:
        """Add a picture; return whether it shows the board in a new view.

        Raises ValueError for a picture of a different size.
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
        """Return the mean distance in pixels between the corners of two views of the board.

        A board that looks the same upside down may have its corners in reverse order. The distance is therefore
        computed in both orders, and the smaller one is returned.
        """
        return min(float(np.linalg.norm(some - turned, axis=2).mean()) for turned in (others, others[::-1]))


def calibrate(views: BoardViews) -> LensCalibration:
    """Return the lens that fits the views best. Raises ValueError for fewer than ``MIN_VIEWS`` views."""
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
