"""Searches of a whole picture, in turn, and which pictures show what was searched before.

A search is for faces of one range of sizes, upright or leaning. A camera that stands in an empty room sees the same for
hours.
"""

from math import inf

import numpy as np
import numpy.typing as npt

from drivers.api.quick import dataclass
from perception.api import Detection, Image
from perception.light import Grey, cells


@dataclass(frozen=True, slots=True)
class Search:
    """A search of a whole picture: for faces of a width between two shares of its longer side.

    ``roll`` is by how much they lean to the right, in radians.
    """

    smallest: float = 0.0
    largest: float = inf
    roll: float = 0.0

    def fits(self, face: Detection, side: int) -> bool:
        """Say whether this search would find ``face`` in a picture whose longer side has so many pixels."""
        return self.smallest * side <= face.box.width <= self.largest * side and face.roll == self.roll


ANY = Search()
"""Whatever face the detector finds."""


DIFFERENT = 3.0
"""Grey levels by which a spot must differ: five times the noise that a webcam leaves in the mean of a spot."""

FEW = 4
"""Spots that may differ: the smallest face that is found covers a dozen."""

AGAIN = 4
"""Searches in a row that may be left out: what changes too little to be noticed is searched then."""


class Still:
    """Remembers the picture of the newest search of each kind. For one thread at a time."""

    def __init__(self) -> None:
        self._searched: dict[Search, npt.NDArray[np.float32]] = {}
        self._left_out: dict[Search, int] = {}

    def same(self, image: Image | Grey, search: Search) -> bool:
        """Say whether such a search of ``image`` can be left out; if not, it is the one that is remembered."""
        now, before = spots(image), self._searched.get(search)
        if before is not None and self._left_out[search] < AGAIN and alike(before, now):
            self._left_out[search] += 1
            return True
        self._searched[search], self._left_out[search] = now, 0
        return False


def alike(before: npt.NDArray[np.float32], now: npt.NDArray[np.float32]) -> bool:
    """Say whether the spots of two pictures, of whatever sizes, show the same."""
    return before.shape == now.shape and bool(np.count_nonzero(np.abs(now - before) > DIFFERENT) <= FEW)


def spots(image: Image | Grey) -> npt.NDArray[np.float32]:
    """Return the mean brightness of each spot of a picture; its shape is (height, width) in spots."""
    return cells(image).astype(np.float32)
