"""What a base that drives about feels of the world: what it bumps into, and where the floor ends."""

from collections.abc import Sequence
from typing import Protocol


class Ground(Protocol):
    """Where a base drives. Metres and radians, in the world's frame."""

    def touched(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        """Return the directions (radians about z) in which a disc at (x, y) touches or overlaps something solid."""
        ...

    def has_floor(self, x: float, y: float) -> bool:
        """Say whether there is floor at (x, y): a cliff sensor looks at such a spot."""
        ...


class OpenFloor:
    """A ``Ground`` without end, and with nothing on it."""

    def touched(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        """Return nothing."""
        del x, y, radius, time
        return ()

    def has_floor(self, x: float, y: float) -> bool:
        """Say that there is."""
        del x, y
        return True
