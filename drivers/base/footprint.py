"""Outline of a base on the floor, and its clearance to points along a path."""

from collections.abc import Sequence
from math import hypot
from typing import Protocol

import numpy as np
import numpy.typing as npt

from drivers.api.fast_dataclass import dataclass
from drivers.api.steering import Footprint

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PathPoses:
    """Poses of a base along a path: arrays ``x``, ``y`` (metres) and ``heading`` (radians) of shape (k,).

    They are relative to the current pose of the base.
    """

    x: Floats
    y: Floats
    heading: Floats


class BaseOutline(Protocol):
    """Outline of a base on the floor, in metres about the middle of the base.

    ``radius`` is the radius of the circle that encloses it. ``round`` is True if the outline is a circle.
    """

    radius: float
    round: bool
    rim: Floats
    """Points on the outline, in metres: shape (m, 2)."""

    def clearance(self, x: Floats, y: Floats, path: PathPoses) -> Floats:
        """Return the distances in metres of the n points ``x``, ``y`` from the outline at the k poses of ``path``.

        The result has the shape (n, k), and is negative for a point inside the outline.
        """
        ...


class RoundOutline:
    """Outline of a round base."""

    round = True

    def __init__(self, radius: float) -> None:
        self.radius = radius
        angles = np.arange(24) * (np.pi / 12)
        self.rim: Floats = radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)

    def clearance(self, x: Floats, y: Floats, path: PathPoses) -> Floats:
        """Return the distances of n points from the circle at the k poses of ``path``: shape (n, k).

        They are negative inside the circle.
        """
        ahead, aside = x[:, None] - path.x, y[:, None] - path.y
        distances: Floats = np.sqrt(ahead * ahead + aside * aside) - self.radius
        return distances


class PolygonOutline:
    """Outline of a base as the convex hull of ``corners`` (metres).

    Raises ValueError if the hull does not enclose the middle of the base.
    """

    round = False

    def __init__(self, corners: Sequence[tuple[float, float]]) -> None:
        hull = np.array(_hull(corners), dtype=np.float64)
        if len(hull) < 3:
            raise ValueError("footprint: three corners at least, not on one line")
        edges = np.roll(hull, -1, axis=0) - hull
        outward = np.stack((edges[:, 1], -edges[:, 0]), axis=1) / np.linalg.norm(edges, axis=1)[:, None]
        self._normals: Floats = outward
        self._offsets: Floats = (outward * hull).sum(axis=1)
        if not (self._offsets > 0.0).all():
            raise ValueError("footprint: the middle of the base, between its wheels, must be inside of the corners")
        self.radius = float(np.linalg.norm(hull, axis=1).max())
        shares = (np.arange(8) / 8)[:, None, None]
        self.rim: Floats = (hull + shares * edges).reshape(-1, 2)

    def clearance(self, x: Floats, y: Floats, path: PathPoses) -> Floats:
        """Return the distances of n points from the polygon at the k poses of ``path``: shape (n, k).

        They are negative inside the polygon. The distance of a point that is nearest to a corner is underestimated.
        """
        ahead, aside = x[:, None] - path.x, y[:, None] - path.y
        cos, sin = np.cos(path.heading), np.sin(path.heading)
        nearest: Floats = np.full(ahead.shape, -np.inf)
        for (nx, ny), offset in zip(self._normals.tolist(), self._offsets.tolist(), strict=True):
            np.maximum(nearest, (nx * cos - ny * sin) * ahead + (nx * sin + ny * cos) * aside - offset, out=nearest)
        return nearest


def outline_of(footprint: Footprint) -> BaseOutline:
    """Return the outline for a footprint of a robot file. Raises ValueError for invalid corners."""
    return PolygonOutline(footprint) if isinstance(footprint, tuple) else RoundOutline(footprint)


def radius_of(footprint: Footprint) -> float:
    """Return the radius in metres of the circle that encloses a footprint."""
    return max(hypot(*corner) for corner in footprint) if isinstance(footprint, tuple) else footprint


def _hull(corners: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the convex hull of points, anticlockwise (monotone chain)."""
    ordered = sorted(set(corners))

    def chain(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        found: list[tuple[float, float]] = []
        for x, y in points:
            while len(found) >= 2:
                (ax, ay), (bx, by) = found[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 1e-9:
                    break
                found.pop()
            found.append((x, y))
        return found[:-1]

    return chain(ordered) + chain(ordered[::-1])
