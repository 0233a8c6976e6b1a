"""Where a base has been, and what of the floor it has not seen yet."""

import math

from drivers.api import Pose2D

CELL = 0.25
"""Metres from one side of a cell to the other."""


class Visited:
    """A grid of cells on the floor, in the frame of the odometry, that the middle of a base has come to."""

    def __init__(self) -> None:
        self._cells: set[tuple[int, int]] = set()

    def __len__(self) -> int:
        return len(self._cells)

    def visit(self, pose: Pose2D) -> None:
        """Take in where the base is."""
        self._cells.add(_cell(pose.x, pose.y))

    def unvisited(self, pose: Pose2D, heading: float, length: float) -> float:
        """Return the share 0..1 of the next ``length`` metres in a ``heading`` that lies in new cells."""
        steps = int(length / CELL)
        c, s = CELL * math.cos(heading), CELL * math.sin(heading)
        new = sum(_cell(pose.x + k * c, pose.y + k * s) not in self._cells for k in range(1, steps + 1))
        return new / steps if steps else 0.0


def _cell(x: float, y: float) -> tuple[int, int]:
    return math.floor(x / CELL), math.floor(y / CELL)
