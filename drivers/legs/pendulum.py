"""The linear inverted pendulum in closed form: how a body sways over the point that it stands on.

At a constant height z the centre of mass c is pushed away from the point of pressure p: ``c'' = (g / z) (c - p)``. Its
divergent part, the capture point ``xi = c + c' / w`` with ``w = sqrt(g / z)``, runs from p: ``xi' = w (xi - p)``; c
follows xi by itself. So a walk is planned backwards: from where xi is to be in the end to where it has to be now.
"""

from collections.abc import Sequence
from math import cosh, exp, hypot, sinh, sqrt

GRAVITY = 9.81

Point = tuple[float, float]


def rate(height: float) -> float:
    """Return w (1/s) of a centre of mass at a height (m)."""
    return sqrt(GRAVITY / height)


def standing(end: Point, p: Point, w: float, seconds: float) -> Point:
    """Return where xi is ``seconds`` before it is at ``end``, with the pressure at ``p`` all the time."""
    decay = exp(-w * seconds)
    return p[0] + (end[0] - p[0]) * decay, p[1] + (end[1] - p[1]) * decay


def shifting(end: Point, p0: Point, p1: Point, w: float, seconds: float, left: float) -> Point:
    """Return where xi is ``left`` seconds before it is at ``end``, while p goes from p0 to p1 in ``seconds``."""
    decay, done = exp(-w * left), 1.0 - left / seconds
    slope = (p1[0] - p0[0]) / seconds / w, (p1[1] - p0[1]) / seconds / w
    x = p0[0] + (p1[0] - p0[0]) * done + slope[0] + (end[0] - p1[0] - slope[0]) * decay
    y = p0[1] + (p1[1] - p0[1]) * done + slope[1] + (end[1] - p1[1] - slope[1]) * decay
    return x, y


def swayed(c: Point, xi: Point, p: Point, w: float, dt: float) -> tuple[Point, Point]:
    """Return c and xi after ``dt`` seconds over a pressure at ``p``: the exact solution."""
    grow, fade = exp(w * dt), exp(-w * dt)
    after = p[0] + (xi[0] - p[0]) * grow, p[1] + (xi[1] - p[1]) * grow
    # c - p = (xi - p) / 2 e^wt + (c - p - (xi - p) / 2) e^-wt
    x, y = ((xi[axis] - p[axis]) / 2 for axis in (0, 1))
    there = (
        p[0] + x * grow + (c[0] - p[0] - x) * fade,
        p[1] + y * grow + (c[1] - p[1] - y) * fade,
    )
    return there, after


def swaying(w: float, step: float, double_support: float) -> float:
    """Return the share of its way that c sways in steps of so many seconds while p goes from side to side.

    p stands still but for the share in double support: where it moves c follows a sinh, where it stands a cosh.
    """
    half = w * step * double_support / 2
    return 1.0 - sinh(half) / (half * cosh(w * step / 2))


Edge = tuple[float, float, float]
"""The line of points with ``nx x + ny y = d``, with its normal outwards."""


def edges(points: Sequence[Point]) -> list[Edge]:
    """Return the edges of the convex hull of some points (Andrew's monotone chain)."""
    ordered = sorted(set(points))

    def chain(these: Sequence[Point]) -> list[Point]:
        found: list[Point] = []
        for x, y in these:
            while len(found) > 1 and _turn(found[-2], found[-1], (x, y)) <= 0:
                found.pop()
            found.append((x, y))
        return found[:-1]

    hull = chain(ordered) + chain(ordered[::-1])
    lines = []
    for (ax, ay), (bx, by) in zip(hull, hull[1:] + hull[:1], strict=True):
        long = hypot(bx - ax, by - ay)
        nx, ny = (by - ay) / long, (ax - bx) / long
        lines.append((nx, ny, nx * ax + ny * ay))
    return lines


def margin(support: Sequence[Edge], p: Point) -> float:
    """Return how far (m) a point is within a support polygon; below 0 outside of it."""
    return min(d - nx * p[0] - ny * p[1] for nx, ny, d in support)


def within(support: Sequence[Edge], inside: Point, p: Point, keep: float) -> Point:
    """Return ``p``, or the farthest point towards it from ``inside`` that is ``keep`` metres inside of the polygon."""
    share = 1.0
    for nx, ny, d in support:
        here = d - keep - nx * inside[0] - ny * inside[1]
        way = nx * (p[0] - inside[0]) + ny * (p[1] - inside[1])
        if way > here:
            share = min(share, max(0.0, here) / way)
    return inside[0] + share * (p[0] - inside[0]), inside[1] + share * (p[1] - inside[1])


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
