"""Fuzzy terms and inputs, and outputs that combine conclusions by Sugeno's or Mamdani's method.

A value belongs to a term to a degree from 0 to 1: a bearing can be "left" to 0.7. Numbers are in the units of the
terms; a robot's are SI.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import combinations, pairwise
from typing import Protocol

from drivers.api.fast_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Membership:
    """Grade function of a term: rises from ``start`` to ``full``, is 1 up to ``until``, falls to 0 at ``end``.

    A triangle has ``full`` equal to ``until``; a shoulder has its outer corners at infinity.
    """

    start: float
    full: float
    until: float
    end: float

    @classmethod
    def from_points(cls, points: Sequence[float], owner: str = "a term") -> "Membership":
        """Create a shoulder from 2 points (foot, full from here on), a triangle from 3, a trapezoid from 4.

        Raises ValueError that begins with ``owner`` for another number of points, and for points that do not rise or
        are not finite.
        """
        if len(points) not in (2, 3, 4) or not all(map(math.isfinite, points)):
            raise ValueError(f"{owner} needs 2 to 4 finite points, not {list_text(points)}")
        if points[0] == points[-1] or (len(points) > 2 and list(points) != sorted(points)):
            raise ValueError(f"{owner} has points that do not rise: {list_text(points)}")
        if len(points) > 2:
            return cls(points[0], points[1], points[-2], points[-1])
        foot, full = points
        return cls(foot, full, math.inf, math.inf) if foot < full else cls(-math.inf, -math.inf, full, foot)

    def __call__(self, value: float) -> float:
        if self.full <= value <= self.until:
            return 1.0
        if value <= self.start or value >= self.end:
            return 0.0
        if value < self.full:
            return (value - self.start) / (self.full - self.start)
        return (self.end - value) / (self.end - self.until)


@dataclass(frozen=True, slots=True)
class FuzzyVariable:
    """Input quantity with its terms by name. Values are clamped to the range of the corners.

    ``corners`` are the values at which some grade bends, in rising order; grades are linear in between. Raises
    ValueError for fewer than two terms, and for a value in range that belongs to no term.
    """

    name: str
    terms: Mapping[str, Membership]
    corners: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", corners(self.terms.values()))
        if len(self.terms) < 2:
            raise ValueError(f"{self.name}: needs two terms at least, has {list_text(self.terms)}")
        for value in self.grid(2):
            if not any(self.grades(value).values()):
                raise ValueError(f"{self.name}: no term covers {value:.4g}; let the terms around it overlap")

    @classmethod
    def from_points(cls, name: str, terms: Mapping[str, float | Sequence[float]]) -> "FuzzyVariable":
        """Create the terms from their points (see ``Membership.from_points``), or from one peak each.

        Between peaks, each term fades as its neighbour grows, so the grades add up to 1. Raises ValueError that names
        the variable and the term.
        """
        return cls(name, memberships(name, terms))

    @property
    def is_partition(self) -> bool:
        """True if the grades of every value add up to 1."""
        return all(math.isclose(sum(self.grades(value).values()), 1.0) for value in self.grid(2))

    def grid(self, pieces: int) -> tuple[float, ...]:
        """Return the corners, and ``pieces - 1`` evenly spaced points between each two.

        Grades are linear between corners, so with 2 pieces a grade that is 0 at all points is 0 everywhere.
        """
        between = (low + (high - low) * n / pieces for low, high in pairwise(self.corners) for n in range(pieces))
        return (*between, self.corners[-1])

    def grades(self, value: float) -> dict[str, float]:
        """Return the grade of ``value`` for each term. Raises ValueError for NaN."""
        if math.isnan(value):
            raise ValueError("a value is not a number (NaN)")
        held = min(max(value, self.corners[0]), self.corners[-1])
        return {term: membership(held) for term, membership in self.terms.items()}

    def describe(self, value: float) -> str:
        """Return ``value`` as text, with the name of the term to which it belongs most."""
        grades = self.grades(value)
        return f"{self.name} is {max(grades, key=grades.__getitem__)} ({value:.4g})"


def corners(terms: Iterable[Membership]) -> tuple[float, ...]:
    """Return the finite corners of the terms in rising order."""
    found = {at for term in terms for at in (term.start, term.full, term.until, term.end)}
    return tuple(sorted(filter(math.isfinite, found)))


def as_numbers(owner: str, value: object) -> list[float]:
    """Return ``value``, a number or a list of numbers, as a list.

    Raises ValueError, beginning with ``owner``, for any other value.
    """
    items = value if isinstance(value, list | tuple) else [value]
    found = [item for item in items if isinstance(item, int | float)]
    if len(found) < len(items):
        raise ValueError(f"{owner} needs numbers, not {value!r}")
    return found


def list_text(items: Iterable[str | float]) -> str:
    """Return words or numbers as a comma-separated text."""
    return ", ".join(item if isinstance(item, str) else f"{item:.4g}" for item in items) or "none"


def memberships(
    name: str, terms: Mapping[str, float | Sequence[float]], *, whole: bool = False
) -> dict[str, Membership]:
    """Create terms from their points, or from one peak each: triangles between the neighbouring peaks.

    The outermost triangles end at their peaks; with ``whole`` they are symmetric about them. Raises ValueError that
    names the variable ``name`` and the term.
    """
    points = {term: as_numbers(f"{name}: '{term}'", values) for term, values in terms.items()}
    if not all(len(values) == 1 for values in points.values()):
        return {term: Membership.from_points(values, f"{name}: '{term}'") for term, values in points.items()}
    peaks = {term: peak for term, (peak,) in points.items()}
    if not all(map(math.isfinite, peaks.values())) or len(set(peaks.values())) < len(peaks):
        raise ValueError(f"{name}: needs finite peaks, no two in one place, not {list_text(peaks.values())}")
    above = dict(pairwise(sorted(peaks.values())))
    below = {high: low for low, high in above.items()}
    outermost = {at: 2 * at - above.get(at, below.get(at, at)) for at in peaks.values()} if whole else {}
    return {
        term: Membership(below.get(at, outermost.get(at, at)), at, at, above.get(at, outermost.get(at, at)))
        for term, at in peaks.items()
    }


class OutputVariable(Protocol):
    """Output variable of a controller."""

    @property
    def name(self) -> str:
        """Name of the controller's output."""
        ...

    @property
    def terms(self) -> Mapping[str, object]:
        """Possible conclusions of the controller's rules, by name."""
        ...

    def combine(self, strengths: Iterable[tuple[str, float]]) -> float:
        """Return one number for (conclusion, strength) pairs. Raises ValueError if all strengths are 0."""
        ...


@dataclass(frozen=True, slots=True)
class Singletons:
    """Output variable whose terms are single numbers: zero-order Sugeno inference (Takagi and Sugeno 1985).

    Raises ValueError for no terms, and for a term that is not finite.
    """

    name: str
    terms: Mapping[str, float]

    def __post_init__(self) -> None:
        values = [
            number for term, given in self.terms.items() for number in as_numbers(f"{self.name}: '{term}'", given)
        ]
        if not values or len(values) != len(self.terms) or not all(map(math.isfinite, values)):
            raise ValueError(f"{self.name}: needs terms with one finite number each, has {list_text(values)}")

    def combine(self, strengths: Iterable[tuple[str, float]]) -> float:
        """Return the mean of the conclusions weighted by their strengths. Raises ValueError if all strengths are 0."""
        total = weighted = 0.0
        for term, strength in strengths:
            total += strength
            weighted += strength * self.terms[term]
        if total == 0:
            raise ValueError(f"{self.name}: no rule fires")
        return weighted / total


@dataclass(frozen=True, slots=True)
class FuzzySets:
    """Output whose terms are fuzzy sets: the inference of Mamdani and Assilian (1975).

    Each set is cut off at the strength of the strongest rule that concludes it; the output is the centroid of their
    union, computed exactly between the corners, not on a grid. Sets are clipped to the outermost corners. Raises
    ValueError for no terms.
    """

    name: str
    terms: Mapping[str, Membership]
    corners: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.terms:
            raise ValueError(f"{self.name}: needs terms, has none")
        object.__setattr__(self, "corners", corners(self.terms.values()))

    @classmethod
    def from_points(cls, name: str, terms: Mapping[str, float | Sequence[float]]) -> "FuzzySets":
        """Create the sets from their points, or from one peak each (see ``terms.memberships``).

        With peaks, the outermost sets are symmetric, so that alone they yield their peak. Raises ValueError that names
        the output and the term.
        """
        return cls(name, memberships(name, terms, whole=True))

    def combine(self, strengths: Iterable[tuple[str, float]]) -> float:
        """Return the centroid of the union of the cut sets. Raises ValueError if all strengths are 0."""
        cuts: dict[str, float] = {}
        for term, strength in strengths:
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
    """Return the four corners of the trapezoid that remains of a fuzzy set when it is cut off at the grade ``cut``."""
    flat_from = term.start + cut * (term.full - term.start) if term.start > -math.inf else -math.inf
    flat_until = term.end - cut * (term.end - term.until) if term.end < math.inf else math.inf
    return term.start, flat_from, flat_until, term.end


def _union(
    shapes: list[tuple[Membership, float]], low: float, high: float
) -> Iterator[tuple[float, float, float, float]]:
    """Yield the straight pieces of the outline of a union of fuzzy sets between two bends, ``low`` and ``high``.

    ``shapes`` are pairs of a set and the grade at which it is cut off. A piece is (left, right, height at left, height
    at right).
    """
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
