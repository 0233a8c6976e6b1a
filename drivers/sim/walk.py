"""Going along waypoints: where somebody is at any time, and which way they go."""

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import accumulate, groupby, pairwise
from math import atan2, dist

Place = tuple[float, float]
"""A place (x, y) on the floor, in metres."""


@dataclass(frozen=True, slots=True)
class Walk:
    """From the first of ``stops`` on through the others at ``speed`` m/s, from ``start`` seconds on.

    With ``loop`` back to the first and round again, else the last is where the walk ends.
    """

    stops: tuple[Place, ...]
    speed: float
    start: float = 0.0
    loop: bool = True
    _ends: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        stops = (*self.stops, self.stops[0]) if self.loop else self.stops
        stops = tuple(stop for stop, _ in groupby(stops))  # so that no leg is without length
        lengths = (dist(a, b) for a, b in pairwise(stops))
        object.__setattr__(self, "stops", stops)  # the way to fill in a field of a frozen class
        object.__setattr__(self, "_ends", tuple(accumulate(lengths, initial=0.0)))

    def at(self, time: float) -> Place:
        """Return (x, y) in metres at ``time`` seconds."""
        leg, done = self._leg(time)
        if done == 0.0:
            return self.stops[leg]
        (x0, y0), (x1, y1) = self.stops[leg], self.stops[leg + 1]
        share = done / (self._ends[leg + 1] - self._ends[leg])
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)

    def heading(self, time: float) -> float | None:
        """Return which way it goes (radians about z) at ``time`` seconds; None where the walk leads nowhere.

        Before the start that is the way of the first leg, after the end that of the last.
        """
        if len(self.stops) < 2:
            return None
        leg = min(self._leg(time)[0], len(self.stops) - 2)
        (x0, y0), (x1, y1) = self.stops[leg], self.stops[leg + 1]
        return atan2(y1 - y0, x1 - x0)

    def _leg(self, time: float) -> tuple[int, float]:
        """Return the number of the stop that was passed last, and the metres gone since."""
        total = self._ends[-1]
        walked = (time - self.start) * self.speed
        if walked <= 0.0 or total == 0.0:
            return 0, 0.0
        if self.loop:
            walked %= total
        elif walked >= total:
            return len(self.stops) - 1, 0.0
        leg = bisect_right(self._ends, walked) - 1
        return leg, walked - self._ends[leg]
