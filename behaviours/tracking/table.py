"""Surfaces worked out beforehand: a grid of heights with straight lines between, quick enough for any loop."""

from bisect import bisect_right
from collections.abc import Sequence
from math import isnan, prod

from drivers.api.quick import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """A surface as ``heights`` over a grid of rising ``axes``, the last varying fastest, interpolated between.

    Raises ValueError for an axis of fewer than two places, or another number of heights than the grid has nodes.
    """

    axes: tuple[tuple[float, ...], ...]
    heights: tuple[float, ...]

    def __post_init__(self) -> None:
        sizes = [len(axis) for axis in self.axes]
        if not sizes or min(sizes) < 2 or prod(sizes) != len(self.heights):
            raise ValueError(f"a table over a grid of {' x '.join(map(str, sizes))} cannot have {len(self.heights)}")

    def __call__(self, *values: float) -> float:
        """Return the height at one value for each axis, in their order, clamped. Raises ValueError for NaN."""
        if len(values) == 2 == len(self.axes):  # what the loop asks for, again and again
            return self._plane(*values)
        if len(values) != len(self.axes):
            raise TypeError(f"a table over {len(self.axes)} axes cannot be read at {len(values)} values")
        return self._height(values, 0, 0)

    def _plane(self, down: float, across: float) -> float:
        """The same for two axes, written out: with bounds for ``bisect``, the outer cells take what lies beyond."""
        rows, columns = self.axes
        heights, width = self.heights, len(columns)
        row = bisect_right(rows, down, 1, len(rows) - 1) - 1
        column = bisect_right(columns, across, 1, width - 1) - 1
        start = rows[row]
        part = (down - start) / (rows[row + 1] - start)
        if not 0.0 <= part <= 1.0:
            part = _bounded(part)
        start = columns[column]
        share = (across - start) / (columns[column + 1] - start)
        if not 0.0 <= share <= 1.0:
            share = _bounded(share)
        corner = row * width + column
        low, high = heights[corner], heights[corner + width]
        low += share * (heights[corner + 1] - low)
        high += share * (heights[corner + width + 1] - high)
        return low + part * (high - low)

    def _height(self, values: Sequence[float], depth: int, row: int) -> float:
        if depth == len(self.axes):
            return self.heights[row]
        axis = self.axes[depth]
        cell = bisect_right(axis, values[depth], 1, len(axis) - 1) - 1
        share = _bounded((values[depth] - axis[cell]) / (axis[cell + 1] - axis[cell]))
        low, high = (self._height(values, depth + 1, row * len(axis) + at) for at in (cell, cell + 1))
        return low + share * (high - low)


def _bounded(share: float) -> float:
    """Return the nearest of 0..1. Raises ValueError for NaN."""
    if isnan(share):
        raise ValueError("a value is not a number (NaN)")
    return min(max(share, 0.0), 1.0)
