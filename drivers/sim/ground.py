"""What a base that drives about feels of the world: what it bumps into, where the floor ends, where its dock is."""

from collections.abc import Sequence
from typing import Protocol

from drivers.sim.block import Point3
from drivers.sim.dock import Dock


class Ground(Protocol):
    """Where a base drives. Metres and radians, in the world's frame."""

    @property
    def dock(self) -> Dock | None:
        """The dock that the base may charge at; None where there is none."""
        ...

    def touched(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        """Return the directions (radians about z) in which a disc at (x, y) touches or overlaps something solid."""
        ...

    def has_floor(self, x: float, y: float) -> bool:
        """Say whether there is floor at (x, y): a cliff sensor looks at such a spot."""
        ...

    def visible(self, eye: Point3, point: Point3, time: float) -> bool:
        """Say whether nothing is between two places: the dock is heard only then."""
        ...


class OpenFloor:
    """A ``Ground`` without end, and with nothing on it."""

    @property
    def dock(self) -> Dock | None:
        """None."""
        return None

    def touched(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        """Return nothing."""
        del x, y, radius, time
        return ()

    def has_floor(self, x: float, y: float) -> bool:
        """Say that there is."""
        del x, y
        return True

    def visible(self, eye: Point3, point: Point3, time: float) -> bool:
        """Say that nothing is."""
        del eye, point, time
        return True
