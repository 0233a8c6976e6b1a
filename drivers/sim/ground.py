"""What a base that drives about feels of the world: what it bumps into, where the floor ends, where its dock is."""

from collections.abc import Sequence
from typing import Protocol

from drivers.sim.block import Point3
from drivers.sim.things import Dock

# The backup limit of a Create 3, which has no cliff sensors at its back: it backs only over floor that it has seen.

ALLOWANCE = 0.12
"""Metres that it backs before it has driven forwards: 10 cm and braking, as a user of a TurtleBot 4 reports."""

RELEASE = 0.05
"""Metres that it has to drive forwards before it backs again. The vendor says "for a while": an assumption."""


class BackupLimit:
    """Backs ``allowance`` metres (one of at least 0), and no farther than it has driven forwards since.

    ``reached`` is True from when the base refuses to back until it has driven ``RELEASE`` forwards.
    """

    def __init__(self, allowance: float = ALLOWANCE) -> None:
        self.reached = False
        self._left = allowance

    def roll(self, way: float) -> None:
        """Take in how far the wheels have rolled since the last call, in metres, backwards negative."""
        self._left = max(self._left + way, 0.0)
        if self._left <= 0.0 and way < 0.0:
            self.reached = True
        elif self._left >= RELEASE:
            self.reached = False

    def lift(self) -> None:
        """Take in that the base hangs in the air: that reaches the limit."""
        self._left, self.reached = 0.0, True


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
