"""The words of a walk: spots on the floor, a manner of walking, and a moment of its pattern."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin
from typing import Literal

from drivers.legs.body import Side
from drivers.legs.pendulum import Point


@dataclass(frozen=True, slots=True)
class Spot:
    """A place on the floor with a heading, in the frame in which the walk began."""

    x: float
    y: float
    heading: float

    def beside(self, ahead: float, left: float, turn: float = 0.0) -> "Spot":
        """Return the spot so far ahead and to the left of it, turned so far."""
        c, s = cos(self.heading), sin(self.heading)
        return Spot(self.x + ahead * c - left * s, self.y + ahead * s + left * c, self.heading + turn)

    def seen(self, other: "Spot") -> "Spot":
        """Return another spot as it is from this one."""
        c, s = cos(self.heading), sin(self.heading)
        dx, dy = other.x - self.x, other.y - self.y
        return Spot(c * dx + s * dy, c * dy - s * dx, other.heading - self.heading)

    @property
    def point(self) -> Point:
        """Without the heading."""
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class Manner:
    """How it walks: StrideKeys with what follows from the body. Lengths in metres, ``step`` in seconds."""

    step: float
    double_support: float
    rise: float
    feet: float
    inset: float
    longest: float
    widest: float
    most_turn: float
    com_height: float
    length: float
    width: float


@dataclass(frozen=True, slots=True)
class Pattern:
    """A moment of a walk, on the floor of its frame.

    ``feet`` are the middles of the soles (x, y, z, heading); ``centre`` is where the centre of mass is and ``pressure``
    the point of pressure, with its ``margin`` to the edge of the support (m). ``pose`` is where the robot is without
    its sway, going at ``speed`` (ahead m/s, left m/s, turn rad/s).
    """

    time: float
    support: Literal["left", "right", "both"]
    feet: Mapping[Side, tuple[float, float, float, float]]
    centre: Point
    heading: float
    pressure: Point
    margin: float
    pose: Spot
    speed: tuple[float, float, float]
