"""Fuzzy control: terms in place of numbers, rules between them, and the smooth surface that they make.

A term ("left") holds of a value to a degree, its grade in 0..1. A rule fires as strongly as its conditions hold
together, and the output is the mean of the conclusions weighted by those strengths: zero-order Sugeno inference (Takagi
and Sugeno 1985, with constants for conclusions). Numbers are in the units of the terms; a robot's are SI.
"""

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

Conjunction = Callable[[Iterable[float]], float]
CONJUNCTIONS: Mapping[str, Conjunction] = {"product": math.prod, "min": min}
"""How strongly conditions hold together, from their grades."""

_CONDITION = re.compile(r"(\w+) is (\w+)")
_SENTENCE = re.compile(r"if (\w+ is \w+(?: and \w+ is \w+)*) then (\w+) is (\w+)")


@dataclass(frozen=True, slots=True)
class Membership:
    """A term's grades, a trapezoid: rises from ``start`` to ``full``, is 1 up to ``until``, falls to 0 at ``end``.

    A triangle has ``full`` and ``until`` in one place; a shoulder has its corners to one side at infinity.
    """

    start: float
    full: float
    until: float
    end: float

    @classmethod
    def from_points(cls, points: Sequence[float], who: str = "a term") -> "Membership":
        """Make a shoulder of 2 points (where it begins, where it is full for good), a triangle of 3, a trapezoid of 4.

        Raises ValueError, as ``who``, for another number of points, or points that do not rise or are not finite.
        """
        if len(points) not in (2, 3, 4) or not all(map(math.isfinite, points)):
            raise ValueError(f"{who} needs 2 to 4 finite points, not {_listed(points)}")
        if points[0] == points[-1] or (len(points) > 2 and list(points) != sorted(points)):
            raise ValueError(f"{who} has points that do not rise: {_listed(points)}")
        if len(points) > 2:
            return cls(points[0], points[1], points[-2], points[-1])
        foot, full = points
        return cls(foot, full, math.inf, math.inf) if foot < full else cls(-math.inf, -math.inf, full, foot)

    def __call__(self, value: float) -> float:
        """Return the grade of ``value``, 0..1."""
        if self.full <= value <= self.until:
            return 1.0
        if value <= self.start or value >= self.end:
            return 0.0
        if value < self.full:
            return (value - self.start) / (self.full - self.start)
        return (self.end - value) / (self.end - self.until)


@dataclass(frozen=True, slots=True)
class Variable:
    """An input in words: its terms by name. It reaches from their first corner to their last; others are clamped.

    Raises ValueError for fewer than two terms, or for a value within reach that belongs to none.
    """

    name: str
    terms: Mapping[str, Membership]

    def __post_init__(self) -> None:
        if len(self.terms) < 2:
            raise ValueError(f"{self.name}: needs two terms at least, has {_listed(self.terms)}")
        for value in self.grid(2):
            if not any(self.grades(value).values()):
                raise ValueError(f"{self.name}: no term covers {value:.4g}; let the terms around it overlap")

    @classmethod
    def from_points(cls, name: str, terms: Mapping[str, float | Sequence[float]]) -> "Variable":
        """Make the terms of their points (see ``Membership.from_points``), or all of them of one peak each.

        Between peaks, each term fades as its neighbour grows, so that the grades of a value add up to 1.
        Raises ValueError that names the variable and the term.
        """
        points = {term: _numbers(f"{name}: '{term}'", given) for term, given in terms.items()}
        if all(len(given) == 1 for given in points.values()):
            return cls(name, _partition(name, {term: peak for term, (peak,) in points.items()}))
        return cls(name, {term: Membership.from_points(given, f"{name}: '{term}'") for term, given in points.items()})

    @property
    def corners(self) -> tuple[float, ...]:
        """Where some grade bends, in rising order: between two of them, every grade is a straight line."""
        corners = {at for term in self.terms.values() for at in (term.start, term.full, term.until, term.end)}
        return tuple(sorted(filter(math.isfinite, corners)))

    def grid(self, pieces: int) -> tuple[float, ...]:
        """Return the corners, and ``pieces - 1`` places between each two. What is 0 all over a grid of 2 is 0."""
        between = (low + (high - low) * n / pieces for low, high in pairwise(self.corners) for n in range(pieces))
        return (*between, self.corners[-1])

    def grades(self, value: float) -> dict[str, float]:
        """Return how far ``value`` belongs to each term. Raises ValueError for NaN."""
        held = _clamped(value, self.corners)
        return {term: membership(held) for term, membership in self.terms.items()}

    def described(self, value: float) -> str:
        """Return ``value`` in words, by the term that it belongs to most."""
        grades = self.grades(value)
        return f"{self.name} is {max(grades, key=grades.__getitem__)} ({value:.4g})"


@dataclass(frozen=True, slots=True)
class Rule:
    """If every input in ``conditions`` is the term that stands there, then the output is ``conclusion``."""

    conditions: Mapping[str, str]
    conclusion: str

    def __str__(self) -> str:
        conditions = " and ".join(f"{name} is {term}" for name, term in self.conditions.items())
        return f"if {conditions} then {self.conclusion}"


@dataclass(frozen=True, slots=True)
class Singletons:
    """An output whose terms are single numbers. Raises ValueError for no terms, or one that is not finite.

    A controller asks it for no more than ``name``, ``terms`` and ``combine``, as it could ask one with fuzzy terms.
    """

    name: str
    terms: Mapping[str, float]

    def __post_init__(self) -> None:
        values = [number for term, given in self.terms.items() for number in _numbers(f"{self.name}: '{term}'", given)]
        if not values or len(values) != len(self.terms) or not all(map(math.isfinite, values)):
            raise ValueError(f"{self.name}: needs terms with one finite number each, has {_listed(values)}")

    def combine(self, fired: Iterable[tuple[str, float]]) -> float:
        """Return the mean of (conclusion, strength) pairs. Raises ValueError when all strengths are 0."""
        total = weighted = 0.0
        for term, strength in fired:
            total += strength
            weighted += strength * self.terms[term]
        if total == 0:
            raise ValueError(f"{self.name}: no rule fires")
        return weighted / total


@dataclass(frozen=True, slots=True)
class Controller:
    """Rules from inputs to an output. Raises ValueError for unknown names, and cases decided twice or not at all."""

    name: str
    inputs: tuple[Variable, ...]
    output: Singletons
    rules: tuple[Rule, ...]
    conjunction: Conjunction = math.prod

    def __post_init__(self) -> None:
        faults = [f"{self.name}: rule {n} '{rule}': {what}" for n, rule, what in self._faults()]
        if faults:
            raise ValueError("\n".join(faults))
        for values in product(*(variable.grid(2) for variable in self.inputs)):
            if not any(strength for _, strength in self._fired(values)):
                case = " and ".join(v.described(value) for v, value in zip(self.inputs, values, strict=True))
                raise ValueError(f"{self.name}: no rule fires when {case}")

    @classmethod
    def from_mapping(cls, name: str, mapping: Mapping[str, Any]) -> "Controller":
        """Make a controller of plain values, as a controller file holds them.

        ``inputs`` maps each input to its terms (see ``Variable.from_points``), ``output`` one name to its terms and
        their numbers. ``rules`` lists sentences, "if error is left and rate is steady then turn is slow_left", or is a
        table: its first row, "error / rate", heads the columns with terms of the second input; each further row is a
        term of the first with its conclusions. ``and`` is "product" (unless told otherwise) or "min".
        Raises ValueError that names the controller and what is wrong in it.
        """
        inputs, output, rules = (mapping.get(key, {}) for key in ("inputs", "output", "rules"))
        if not (
            _nested(inputs) and _nested(output) and len(output) == 1 and rules and isinstance(rules, Mapping | Sequence)
        ):
            raise ValueError(f"{name}: needs 'inputs' and one 'output', with their terms, and 'rules'")
        if (joined := str(mapping.get("and", "product"))) not in CONJUNCTIONS:
            raise ValueError(f"{name}: 'and' is one of {_listed(CONJUNCTIONS)}, not '{joined}'")
        try:
            variables = tuple(Variable.from_points(what, terms) for what, terms in inputs.items())
            (conclusion,) = (Singletons(what, terms) for what, terms in output.items())
            found = tuple(_table(rules) if isinstance(rules, Mapping) else _sentences(rules, conclusion.name))
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
        return cls(name, variables, conclusion, found, CONJUNCTIONS[joined])

    def __call__(self, *values: float) -> float:
        """Infer the output from one value for each input, in their order. Raises ValueError for NaN."""
        return self.output.combine(self._fired(values))

    def tabulate(self, pieces: int = 8) -> "Table":
        """Work the surface out beforehand: at every corner, and at ``pieces - 1`` places between each two of them.

        Where the grades of each input add up to 1, "and" is the product and each case has its one rule, the surface is
        multilinear between corners and the table exact. With "min" it is off by some 3 % of the output's range.
        """
        axes = tuple(variable.grid(pieces) for variable in self.inputs)
        return Table(axes, tuple(self(*node) for node in product(*axes)))

    def _fired(self, values: Sequence[float]) -> Iterator[tuple[str, float]]:
        grades = {variable.name: variable.grades(value) for variable, value in zip(self.inputs, values, strict=True)}
        for rule in self.rules:
            yield rule.conclusion, self.conjunction(grades[name][term] for name, term in rule.conditions.items())

    def _faults(self) -> Iterator[tuple[int, Rule, str]]:
        known = {variable.name: variable.terms for variable in self.inputs}
        decided: dict[frozenset[tuple[str, str]], int] = {}
        for number, rule in enumerate(self.rules, 1):
            for name, term in rule.conditions.items():
                if name not in known:
                    yield number, rule, f"unknown input '{name}'; known are: {_listed(known)}"
                elif term not in known[name]:
                    yield number, rule, f"{name} has no term '{term}'; it has {_listed(known[name])}"
            if rule.conclusion not in self.output.terms:
                yield number, rule, f"no conclusion '{rule.conclusion}'; known are: {_listed(self.output.terms)}"
            if (first := decided.setdefault(frozenset(rule.conditions.items()), number)) != number:
                yield number, rule, f"rule {first} decides this case already"


@dataclass(frozen=True, slots=True)
class Table:
    """A surface as ``heights`` over a grid of rising ``axes``, the last varying fastest, interpolated between."""

    axes: tuple[tuple[float, ...], ...]
    heights: tuple[float, ...]

    def __call__(self, *values: float) -> float:
        """Return the height at one value for each input, in their order, clamped. Raises ValueError for NaN."""
        return self._height(values, 0, 0)

    def _height(self, values: Sequence[float], depth: int, row: int) -> float:
        if depth == len(self.axes):
            return self.heights[row]
        axis = self.axes[depth]
        value = _clamped(values[depth], axis)
        cell = min(bisect_right(axis, value), len(axis) - 1) - 1
        share = (value - axis[cell]) / (axis[cell + 1] - axis[cell])
        low, high = (self._height(values, depth + 1, row * len(axis) + at) for at in (cell, cell + 1))
        return low + share * (high - low)


def _nested(node: object) -> bool:
    return isinstance(node, Mapping) and bool(node) and all(isinstance(terms, Mapping) for terms in node.values())


def _numbers(who: str, given: object) -> list[float]:
    items = given if isinstance(given, list | tuple) else [given]
    numbers = [item for item in items if isinstance(item, int | float)]
    if len(numbers) < len(items):
        raise ValueError(f"{who} needs numbers, not {given!r}")
    return numbers


def _partition(name: str, peaks: Mapping[str, float]) -> dict[str, Membership]:
    """Make triangles that reach to their neighbours' peaks; beyond the outer ones, values are clamped."""
    if not all(map(math.isfinite, peaks.values())) or len(set(peaks.values())) < len(peaks):
        raise ValueError(f"{name}: needs finite peaks, no two in one place, not {_listed(peaks.values())}")
    above = dict(pairwise(sorted(peaks.values())))
    below = {high: low for low, high in above.items()}
    return {term: Membership(below.get(at, at), at, at, above.get(at, at)) for term, at in peaks.items()}


def _sentences(sentences: Iterable[str], output: str) -> Iterator[Rule]:
    for number, sentence in enumerate(sentences, 1):
        found = _SENTENCE.fullmatch(" ".join(str(sentence).split()))
        conditions = _CONDITION.findall(found[1]) if found else []
        if found is None or found[2] != output or len(dict(conditions)) < len(conditions):
            form = f"if INPUT is TERM and OTHER_INPUT is TERM then {output} is TERM"
            raise ValueError(f"rule {number} '{sentence}': write it as '{form}'")
        yield Rule(dict(conditions), found[3])


def _table(table: Mapping[str, Sequence[str]]) -> Iterator[Rule]:
    (heading, columns), *rows = table.items()
    down, slash, across = heading.partition(" / ")
    if not slash:
        raise ValueError(f"the first row of the rules needs two inputs, as in 'error / rate', not '{heading}'")
    for term, conclusions in rows:
        if len(conclusions) != len(columns):
            raise ValueError(f"row '{term}' of the rules has {len(conclusions)} columns, '{heading}' {len(columns)}")
        for column, conclusion in zip(columns, conclusions, strict=True):
            yield Rule({down: term, across: column}, conclusion)


def _clamped(value: float, reach: Sequence[float]) -> float:
    if math.isnan(value):
        raise ValueError("a value is not a number (NaN)")
    return min(max(value, reach[0]), reach[-1])


def _listed(items: Iterable[str | float]) -> str:
    return ", ".join(item if isinstance(item, str) else f"{item:.4g}" for item in items) or "none"
