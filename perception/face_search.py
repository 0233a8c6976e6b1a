"""Searches of a whole picture, in turn, and which pictures show what was searched before.

A search is for faces of one range of sizes, upright or leaning. A camera that stands in an empty room sees the same for
hours.
"""

from math import inf

import numpy as np
import numpy.typing as npt

from drivers.api.fast_dataclass import dataclass
from perception.api import Detection, Image
from perception.image_preparation import GreyImage, cell_means


@dataclass(frozen=True, slots=True)
class FaceSearch:
    """A search of a whole picture: for faces of a width between two shares of its longer side.

    ``roll`` is by how much they lean to the right, in radians.
    """

    smallest: float = 0.0
    largest: float = inf
    roll: float = 0.0

    def fits(self, face: Detection, side: int) -> bool:
        """Say whether this search would find ``face`` in a picture whose longer side has so many pixels."""
        return self.smallest * side <= face.box.width <= self.largest * side and face.roll == self.roll


ANY_FACE = FaceSearch()
"""Whatever face the detector finds."""


MIN_CELL_DIFFERENCE = 3.0
"""Grey levels by which a spot must differ: five times the noise that a webcam leaves in the mean of a spot."""

MAX_CHANGED_CELLS = 4
"""Spots that may differ: the smallest face that is found covers a dozen."""

MAX_SKIPPED_SEARCHES = 4
"""Searches in a row that may be left out: what changes too little to be noticed is searched then."""


class StillPictureDetector:
    """Remembers the picture of the newest search of each kind. For one thread at a time."""

    def __init__(self) -> None:
        self._searched_pictures: dict[FaceSearch, npt.NDArray[np.float32]] = {}
        self._skipped_searches: dict[FaceSearch, int] = {}

    def can_skip(self, image: Image | GreyImage, search: FaceSearch) -> bool:
        """Say whether such a search of ``image`` can be left out; if not, it is the one that is remembered."""
        now, before = cell_brightness(image), self._searched_pictures.get(search)
        if before is not None and self._skipped_searches[search] < MAX_SKIPPED_SEARCHES and are_alike(before, now):
            self._skipped_searches[search] += 1
            return True
        self._searched_pictures[search], self._skipped_searches[search] = now, 0
        return False


def are_alike(before: npt.NDArray[np.float32], now: npt.NDArray[np.float32]) -> bool:
    """Say whether the spots of two pictures, of whatever sizes, show the same."""
    return before.shape == now.shape and bool(
        np.count_nonzero(np.abs(now - before) > MIN_CELL_DIFFERENCE) <= MAX_CHANGED_CELLS
    )


def cell_brightness(image: Image | GreyImage) -> npt.NDArray[np.float32]:
    """Return the mean brightness of each spot of a picture; its shape is (height, width) in spots."""
    return cell_means(image).astype(np.float32)
