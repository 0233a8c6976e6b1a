"""The people in a simulated world: who they are, and where they stand or walk at any time."""

from dataclasses import dataclass
from itertools import pairwise
from math import dist, hypot, isfinite
from typing import Literal

from drivers.errors import BadRequest
from drivers.sim.looks import LOOKS


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody who stands at (x, y), or walks from there along a path.

    ``look`` names one of the drawn people in ``drivers.sim.looks.LOOKS``; ``height`` is that of the eyes above the
    floor, in metres. ``facing`` is an angle about z in radians, or ``camera``: always turned to whoever looks.
    From ``start`` seconds on the person walks through the waypoints of ``path`` (x, y in metres) at ``speed`` m/s;
    with ``loop`` back to (x, y) and round again, else the last waypoint is where the walk ends.
    Raises BadRequest for an unknown look, a height outside 0.8..2.1 m, a speed that is not above zero.
    """

    name: str
    look: str = "anna"
    x: float = 1.5
    y: float = 0.0
    height: float = 1.6
    facing: float | Literal["camera"] = "camera"
    path: tuple[tuple[float, float], ...] = ()
    speed: float = 0.5
    start: float = 0.0
    loop: bool = True

    def __post_init__(self) -> None:
        if self.look not in LOOKS:
            raise BadRequest(f"{self.name}: no look named '{self.look}'", hint="looks: " + ", ".join(LOOKS))
        if not 0.8 <= self.height <= 2.1:
            raise BadRequest(f"{self.name}: eyes at {self.height} m: must be within 0.8..2.1 m")
        if not (isfinite(self.speed) and self.speed > 0):
            raise BadRequest(f"{self.name}: walks at {self.speed} m/s: must be above 0 m/s")
        numbers = (self.x, self.y, self.start, *(value for point in self.path for value in point))
        if not all(map(isfinite, numbers)):
            raise BadRequest(f"{self.name}: place, path or start is not finite: {numbers}")

    def place(self, time: float) -> tuple[float, float]:
        """Return (x, y) in metres at ``time`` seconds."""
        here = (self.x, self.y)
        stops = (here, *self.path, here) if self.loop else (here, *self.path)
        legs = [(a, b, dist(a, b)) for a, b in pairwise(stops)]
        total = sum(length for _, _, length in legs)
        walked = max(0.0, time - self.start) * self.speed
        if total == 0.0 or walked == 0.0:
            return here
        if self.loop:
            walked %= total
        for a, b, length in legs:
            if walked < length:
                share = walked / length
                return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
            walked -= length
        return stops[-1]


@dataclass(frozen=True, slots=True)
class Presence:
    """Where one person is at one time: ``x``, ``y`` in metres."""

    person: Person
    x: float
    y: float

    def distance(self, x: float, y: float) -> float:
        """Return the metres along the floor from (x, y)."""
        return hypot(self.x - x, self.y - y)
