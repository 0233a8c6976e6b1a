"""What fuzzy rules conclude, and how one number is made of several conclusions: single numbers, or fuzzy sets."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import combinations, pairwise
from typing import Protocol

from behaviours.tracking.terms import Membership, corners, listed, memberships, numbers
from drivers.api.quick import dataclass


class Output(Protocol):
    """What a controller asks of its output."""

    @property
    def name(self) -> str:
        """What it is the output of."""
        ...

    @property
    def terms(self) -> Mapping[str, object]:
        """The conclusions that there are, by name."""
        ...

    def combine(self, fired: Iterable[tuple[str, float]]) -> float:
        """Return one number for (conclusion, strength) pairs. Raises ValueError when all strengths are 0."""
        ...


@dataclass(frozen=True, slots=True)
class Singletons:
    """An output whose terms are single numbers: zero-order Sugeno inference (Takagi and Sugeno 1985).

    Raises ValueError for no terms, or one that is not finite.
    """

    name: str
    terms: Mapping[str, float]

    def __post_init__(self) -> None:
        values = [number for term, given in self.terms.items() for number in numbers(f"{self.name}: '{term}'", given)]
        if not values or len(values) != len(self.terms) or not all(map(math.isfinite, values)):
            raise ValueError(f"{self.name}: needs terms with one finite number each, has {listed(values)}")

    def combine(self, fired: Iterable[tuple[str, float]]) -> float:
        """Return the mean of the conclusions weighted by their strengths. Raises ValueError when all are 0."""
        total = weighted = 0.0
        for term, strength in fired:
            total += strength
            weighted += strength * self.terms[term]
        if total == 0:
            raise ValueError(f"{self.name}: no rule fires")
        return weighted / total


@dataclass(frozen=True, slots=True)
class Sets:
    """An output whose terms are fuzzy sets: the inference of Mamdani and Assilian (1975).

    Each set is cut off at the strength of the strongest rule that concludes it; the output is the centroid of their
    union. It is worked out exactly, piece by piece between the corners, not on a grid. What reaches farther than the
    outermost corner is cut off there. Raises ValueError for no terms.
    """

    name: str
    terms: Mapping[str, Membership]
    corners: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.terms:
            raise ValueError(f"{self.name}: needs terms, has none")
        object.__setattr__(self, "corners", corners(self.terms.values()))

    @classmethod
    def from_points(cls, name: str, terms: Mapping[str, float | Sequence[float]]) -> "Sets":
        """Make the sets of their points, or of one peak each (see ``terms.memberships``).

        Then the outermost sets reach as far out as in, so that alone they mean what their peak says. Raises ValueError
        that names the output and the term.
        """
        return cls(name, memberships(name, terms, whole=True))

    def combine(self, fired: Iterable[tuple[str, float]]) -> float:
        """Return the centroid of the union of the sets, each cut off. Raises ValueError when all strengths are 0."""
        cuts: dict[str, float] = {}
        for term, strength in fired:
            if strength > cuts.get(term, 0.0):
                cuts[term] = strength
        if not cuts:
            raise ValueError(f"{self.name}: no rule fires")
        return self._centroid([(self.terms[term], cut) for term, cut in cuts.items()])

    def _centroid(self, shapes: list[tuple[Membership, float]]) -> float:
        area = moment = 0.0
        least, most = self.corners[0], self.corners[-1]
        places = {min(max(at, least), most) for shape in shapes for at in _bends(*shape)}
        for low, high in pairwise(sorted(places)):
            for left, right, at_left, at_right in _union(shapes, low, high):
                width = right - left
                area += width * (at_left + at_right) / 2
                moment += width * (left * (2 * at_left + at_right) + right * (at_left + 2 * at_right)) / 6
        if area == 0:
            raise ValueError(f"{self.name}: no rule fires strongly enough to tell")
        return moment / area


def _bends(term: Membership, cut: float) -> tuple[float, float, float, float]:
    """Return where a set that is cut off begins, is flat from and until, and ends."""
    flat_from = term.start + cut * (term.full - term.start) if term.start > -math.inf else -math.inf
    flat_until = term.end - cut * (term.end - term.until) if term.end < math.inf else math.inf
    return term.start, flat_from, flat_until, term.end


def _union(
    shapes: list[tuple[Membership, float]], low: float, high: float
) -> Iterator[tuple[float, float, float, float]]:
    """Yield (left, right, height at left, height at right) of the union's straight pieces between two bends."""
    # Between two bends each shape is a straight line. It is taken from two places inside, since a shape may jump at a
    # bend, where its edge is upright.
    quarter = (high - low) / 4
    lines: set[tuple[float, float]] = set()  # height at ``low``, and slope
    for term, cut in shapes:
        first, last = min(term(low + quarter), cut), min(term(high - quarter), cut)
        slope = (last - first) / (2 * quarter)
        lines.add((first - slope * quarter, slope))
    crossings = {(h - k) / (t - s) for (h, s), (k, t) in combinations(lines, 2) if s != t}
    inside = sorted(at for at in crossings if 0 < at < high - low)
    for left, right in pairwise((0.0, *inside, high - low)):
        height, slope = max(lines, key=lambda line: line[0] + line[1] * (left + right) / 2)
        yield low + left, low + right, height + slope * left, height + slope * right
