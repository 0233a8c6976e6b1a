"""Upright solid shapes of the world and their geometry, in plain floats.

The three queries are the distance to a place on the floor, the distance along a ray, and whether a line of sight is
blocked. A base makes the first one at every step, so it may take a microsecond or two. Metres, radians, world frame.
"""

from dataclasses import dataclass, field
from math import cos, hypot, inf, sin, sqrt
from typing import Protocol

Point3 = tuple[float, float, float]
"""A point (x, y, z) in metres."""


class Solid(Protocol):
    """A shape from ``bottom`` up to ``top`` that blocks motion and sight."""

    @property
    def x(self) -> float:
        """Centre of the shape in x."""
        ...

    @property
    def y(self) -> float:
        """Centre of the shape in y."""
        ...

    @property
    def bottom(self) -> float:
        """Height of the shape's lower side above the floor."""
        ...

    @property
    def top(self) -> float:
        """Height of the shape's upper side above the floor."""
        ...

    @property
    def bounding_radius(self) -> float:
        """Largest distance of the shape's footprint from its centre."""
        ...

    def nearest_offset(self, x: float, y: float) -> tuple[float, float]:
        """Return the vector from (x, y) to the nearest point of the shape's footprint; (0, 0) from inside."""
        ...

    def intersect_ray(self, x: float, y: float, dx: float, dy: float) -> float:
        """Return the distance from (x, y) to the shape in multiples of (dx, dy): infinity for a miss, 0 from inside."""
        ...

    def blocks_sight(self, eye: Point3, point: Point3) -> bool:
        """Return whether the line from ``eye`` to ``point`` intersects the solid."""
        ...


@dataclass(frozen=True, slots=True)
class UprightBox:
    """An upright box with its centre at (x, y) and its ``length`` along ``heading``."""

    x: float
    y: float
    length: float
    width: float
    heading: float = 0.0
    bottom: float = 0.0
    top: float = inf
    cos: float = field(init=False, repr=False, compare=False)
    sin: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cos", cos(self.heading))  # the way to fill in a field of a frozen class
        object.__setattr__(self, "sin", sin(self.heading))

    @property
    def bounding_radius(self) -> float:
        return hypot(self.length, self.width) / 2

    def corners(self) -> tuple[tuple[float, float], ...]:
        """Return the corners (x, y) of the footprint, anticlockwise from the front right."""
        a, b = self.length / 2, self.width / 2
        return tuple(
            (self.x + u * self.cos - v * self.sin, self.y + u * self.sin + v * self.cos)
            for u, v in ((a, -b), (a, b), (-a, b), (-a, -b))
        )

    def to_local(self, x: float, y: float) -> tuple[float, float]:
        """Return a place in the axes of the box: along its length, and to its left."""
        dx, dy = x - self.x, y - self.y
        return dx * self.cos + dy * self.sin, dy * self.cos - dx * self.sin

    def nearest_offset(self, x: float, y: float) -> tuple[float, float]:
        u, v = self.to_local(x, y)
        a, b = self.length / 2, self.width / 2
        du = a - u if u > a else -a - u if u < -a else 0.0
        dv = b - v if v > b else -b - v if v < -b else 0.0
        return du * self.cos - dv * self.sin, du * self.sin + dv * self.cos

    def intersect_ray(self, x: float, y: float, dx: float, dy: float) -> float:
        enter, leave = self._line_interval(x, y, dx, dy)
        return max(0.0, enter) if enter <= leave and leave >= 0 else inf

    def blocks_sight(self, eye: Point3, point: Point3) -> bool:
        enter, leave = self._line_interval(eye[0], eye[1], point[0] - eye[0], point[1] - eye[1])
        return _overlaps(eye[2], point[2], self.bottom, self.top, max(0.0, enter), min(1.0, leave))

    def _line_interval(self, x: float, y: float, dx: float, dy: float) -> tuple[float, float]:
        """Return the interval of the line from (x, y) inside the box, in multiples of (dx, dy).

        If no part is inside, the first bound exceeds the second.

        Each pair of sides cuts an interval out of the line; the intersection of both is inside (Kay and Kajiya, 1986).
        """
        u, v = self.to_local(x, y)
        enter, leave = -inf, inf
        for start, step, half in (
            (u, dx * self.cos + dy * self.sin, self.length / 2),
            (v, dy * self.cos - dx * self.sin, self.width / 2),
        ):
            if abs(step) > 1e-12:
                first, second = (-half - start) / step, (half - start) / step
                enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
            elif abs(start) > half:
                return inf, -inf
        return enter, leave


@dataclass(frozen=True, slots=True)
class UprightCylinder:
    """An upright cylinder with its axis at (x, y), such as a person or a ball."""

    x: float
    y: float
    radius: float
    bottom: float = 0.0
    top: float = inf

    @property
    def bounding_radius(self) -> float:
        return self.radius

    def nearest_offset(self, x: float, y: float) -> tuple[float, float]:
        dx, dy = self.x - x, self.y - y
        away = hypot(dx, dy)
        share = 1 - self.radius / away if away > self.radius else 0.0
        return dx * share, dy * share

    def intersect_ray(self, x: float, y: float, dx: float, dy: float) -> float:
        enter, leave = self._line_interval(x, y, dx, dy)
        return max(0.0, enter) if enter <= leave and leave >= 0 else inf

    def blocks_sight(self, eye: Point3, point: Point3) -> bool:
        enter, leave = self._line_interval(eye[0], eye[1], point[0] - eye[0], point[1] - eye[1])
        return _overlaps(eye[2], point[2], self.bottom, self.top, max(0.0, enter), min(1.0, leave))

    def _line_interval(self, x: float, y: float, dx: float, dy: float) -> tuple[float, float]:
        """Return the interval of the line from (x, y) inside the cylinder, as ``UprightBox._line_interval``."""
        ex, ey = x - self.x, y - self.y
        a, b, c = dx * dx + dy * dy, ex * dx + ey * dy, ex * ex + ey * ey - self.radius * self.radius
        if a < 1e-18:
            return (-inf, inf) if c <= 0 else (inf, -inf)
        inside = b * b - a * c
        if inside < 0:
            return inf, -inf
        root = sqrt(inside)
        return (-b - root) / a, (-b + root) / a


def _overlaps(start: float, end: float, low: float, high: float, enter: float, leave: float) -> bool:
    """Return whether a part of a line is between the heights ``low`` and ``high``.

    The line goes from height ``start`` to height ``end``; the part begins at the share ``enter`` (0..1) of the line,
    and ends at ``leave``.
    """
    if enter >= leave:
        return False
    first, last = start + enter * (end - start), start + leave * (end - start)
    return max(first, last) > low and min(first, last) < high
