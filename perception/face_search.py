"""Searches of a whole picture for faces, and detection of unchanged pictures that need no search.

A search is for faces of one range of sizes, upright or leaning. A camera at rest in an empty room shows the same
picture for hours.
"""

from math import inf

import numpy as np
import numpy.typing as npt

from drivers.api.fast_dataclass import dataclass
from perception.api import Detection, Image
from perception.image_preparation import GreyImage, cell_means


@dataclass(frozen=True, slots=True)
class FaceSearch:
    """A search of a whole picture for faces whose width is between two shares of the picture's longer side.

    ``roll`` is the angle by which they lean to the right, in radians.
    """

    smallest: float = 0.0
    largest: float = inf
    roll: float = 0.0

    def fits(self, face: Detection, side: int) -> bool:
        """Return whether this search would find ``face`` in a picture whose longer side is ``side`` pixels."""
        return self.smallest * side <= face.box.width <= self.largest * side and face.roll == self.roll


ANY_FACE = FaceSearch()
"""Search for all faces that the detector can find."""


MIN_CELL_DIFFERENCE = 3.0
"""Smallest difference in grey levels between a cell in two pictures that counts as a change.

It is five times the noise of a webcam in the mean of a cell.
"""

MAX_CHANGED_CELLS = 4
"""Largest number of changed cells in a picture that counts as unchanged; the smallest detectable face covers twelve."""

MAX_SKIPPED_SEARCHES = 4
"""Largest number of consecutive searches that are skipped because the picture seems unchanged.

The next search then runs in any case, so that small changes are found, too.
"""


class StillPictureDetector:
    """Tells whether a picture is unchanged since a search, so that the search can be skipped. For one thread."""

    def __init__(self) -> None:
        self._searched_pictures: dict[FaceSearch, npt.NDArray[np.float32]] = {}
        self._skipped_searches: dict[FaceSearch, int] = {}

    def can_skip(self, image: Image | GreyImage, search: FaceSearch) -> bool:
        """Return whether this search of ``image`` may be skipped; if not, store the picture as searched."""
        now, before = cell_brightness(image), self._searched_pictures.get(search)
        if before is not None and self._skipped_searches[search] < MAX_SKIPPED_SEARCHES and are_alike(before, now):
            self._skipped_searches[search] += 1
            return True
        self._searched_pictures[search], self._skipped_searches[search] = now, 0
        return False


def are_alike(before: npt.NDArray[np.float32], now: npt.NDArray[np.float32]) -> bool:
    """Return whether two pictures show the same scene, both given as the mean brightness of their cells."""
    return before.shape == now.shape and bool(
        np.count_nonzero(np.abs(now - before) > MIN_CELL_DIFFERENCE) <= MAX_CHANGED_CELLS
    )


def cell_brightness(image: Image | GreyImage) -> npt.NDArray[np.float32]:
    """Return the mean brightness of each cell of a picture; shape (height, width) in cells."""
    return cell_means(image).astype(np.float32)
