"""What a face is drawn of: chains of cubic Bézier curves, which every way of drawing knows, and numbers can move."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import cos, sin

from drivers.api.quick import dataclass

Point = tuple[float, float]

ROUND = 0.5523
"""How far the control points of a quarter of an ellipse lie along its sides, for the best fit."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A chain of curves: its first point, then two control points and an end for each. A filled one closes itself.

    x to the right, y down. Colours are ``#rrggbb``, empty for none; lines have round ends. ``opacity`` is 0..1.
    """

    points: tuple[Point, ...]
    fill: str = ""
    line: str = ""
    width: float = 0.0
    opacity: float = 1.0

    def curves(self) -> Iterator[tuple[Point, Point, Point, Point]]:
        """Yield each curve with both its ends."""
        for place in range(0, len(self.points) - 1, 3):
            start, leave, arrive, end = self.points[place : place + 4]
            yield start, leave, arrive, end

    def placed(self, *, scale: float, angle: float, centre: Point, to: Point) -> "Shape":
        """Return it larger by ``scale`` and turned clockwise by ``angle`` (radians) about ``centre``, moved ``to``."""
        along, across = scale * cos(angle), scale * sin(angle)
        moved = (
            (to[0] + along * (x - centre[0]) - across * (y - centre[1]),
             to[1] + across * (x - centre[0]) + along * (y - centre[1]))
            for x, y in self.points
        )  # fmt: skip
        return replace(self, points=tuple(moved), width=self.width * scale)


def chain(*points: Point) -> tuple[Point, ...]:
    """Return straight lines through these points, as curves."""
    found = [points[0]]
    for (x, y), (next_x, next_y) in pairwise(points):
        found += [
            (x + (next_x - x) / 3, y + (next_y - y) / 3),
            (next_x - (next_x - x) / 3, next_y - (next_y - y) / 3),
            (next_x, next_y),
        ]
    return tuple(found)


def ring(left: Point, top: Point, right: Point, bottom: Point) -> tuple[Point, ...]:
    """Return a closed chain that is upright at its left and right point, level at its top and bottom."""

    def level(end: Point, side: Point) -> Point:
        return end[0] + ROUND * (side[0] - end[0]), end[1]

    def upright(side: Point, end: Point) -> Point:
        return side[0], side[1] + ROUND * (end[1] - side[1])

    return (
        left, upright(left, top), level(top, left), top,
        level(top, right), upright(right, top), right,
        upright(right, bottom), level(bottom, right), bottom,
        level(bottom, left), upright(left, bottom), left,
    )  # fmt: skip


def oval(centre: Point, across: float, down: float) -> tuple[Point, ...]:
    """Return an ellipse with these half-axes."""
    x, y = centre
    return ring((x - across, y), (x, y - down), (x + across, y), (x, y + down))


def part(points: tuple[Point, Point, Point, Point], begin: float, end: float) -> tuple[Point, Point, Point, Point]:
    """Return the piece of one curve between two parameters, 0..1 (de Casteljau's construction)."""

    def blend(a: Point, b: Point, share: float) -> Point:
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

    def blossom(*shares: float) -> Point:
        left: tuple[Point, ...] = points
        for share in shares:
            left = tuple(blend(a, b, share) for a, b in pairwise(left))
        return left[0]

    return (
        blossom(begin, begin, begin), blossom(begin, begin, end), blossom(begin, end, end), blossom(end, end, end)
    )  # fmt: skip
