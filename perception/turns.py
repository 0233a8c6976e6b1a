"""What a whole picture is searched for, in turn: faces of one range of sizes, upright or leaning."""

from dataclasses import dataclass
from math import inf

from perception.api import Detection


@dataclass(frozen=True, slots=True)
class Search:
    """One search of a whole picture: for faces of a width between two shares of its longer side.

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
