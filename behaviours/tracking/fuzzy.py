"""Fuzzy control: rules on fuzzy terms, and their tabulated control surface.

A rule fires with the strength of the conjunction of its conditions; the output combines the conclusions by Sugeno's or
Mamdani's method (see ``terms``). The surface is a grid with linear interpolation, fast enough for any loop.
"""

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from math import isnan, prod
from typing import Any

from behaviours.tracking.terms import FuzzySets, FuzzyVariable, OutputVariable, Singletons, list_text
from drivers.api.fast_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class LookupTable:
    """Table of a function: its values ``heights`` on a grid, with linear interpolation between the grid points.

    ``axes`` are the rising coordinates of the grid; the last axis varies fastest in ``heights``. Raises ValueError for
    an axis with fewer than two points, or a wrong number of heights.
    """

    axes: tuple[tuple[float, ...], ...]
    heights: tuple[float, ...]

    def __post_init__(self) -> None:
        sizes = [len(axis) for axis in self.axes]
        if not sizes or min(sizes) < 2 or prod(sizes) != len(self.heights):
            raise ValueError(f"a table over a grid of {' x '.join(map(str, sizes))} cannot have {len(self.heights)}")

    def __call__(self, *values: float) -> float:
        """Return the interpolated value at one coordinate per axis, clamped to the grid. Raises ValueError for NaN."""
        if len(values) == 2 == len(self.axes):  # what the loop asks for, again and again
            return self._plane(*values)
        if len(values) != len(self.axes):
            raise TypeError(f"a table over {len(self.axes)} axes cannot be read at {len(values)} values")
        return self._height(values, 0, 0)

    def _plane(self, down: float, across: float) -> float:
        """Return the interpolated value at (``down``, ``across``) of a table with two axes, written out for speed.

        Values beyond the grid are clamped to it.
        """
        rows, columns = self.axes
        heights, width = self.heights, len(columns)
        row = bisect_right(rows, down, 1, len(rows) - 1) - 1
        column = bisect_right(columns, across, 1, width - 1) - 1
        start = rows[row]
        part = (down - start) / (rows[row + 1] - start)
        if not 0.0 <= part <= 1.0:
            part = _clamp_share(part)
        start = columns[column]
        share = (across - start) / (columns[column + 1] - start)
        if not 0.0 <= share <= 1.0:
            share = _clamp_share(share)
        corner = row * width + column
        low, high = heights[corner], heights[corner + width]
        low += share * (heights[corner + 1] - low)
        high += share * (heights[corner + width + 1] - high)
        return low + part * (high - low)

    def _height(self, values: Sequence[float], depth: int, row: int) -> float:
        if depth == len(self.axes):
            return self.heights[row]
        axis = self.axes[depth]
        cell = bisect_right(axis, values[depth], 1, len(axis) - 1) - 1
        share = _clamp_share((values[depth] - axis[cell]) / (axis[cell + 1] - axis[cell]))
        low, high = (self._height(values, depth + 1, row * len(axis) + at) for at in (cell, cell + 1))
        return low + share * (high - low)


def _clamp_share(share: float) -> float:
    """Return ``share`` clamped to 0..1. Raises ValueError for NaN."""
    if isnan(share):
        raise ValueError("a value is not a number (NaN)")
    return min(max(share, 0.0), 1.0)


Conjunction = Callable[[Iterable[float]], float]
CONJUNCTIONS: Mapping[str, Conjunction] = {"product": math.prod, "min": min}
"""Functions that combine the grades of a rule's conditions ("and"), by name."""

METHODS: Mapping[str, tuple[Callable[[str, Any], OutputVariable], str]] = {
    "sugeno": (Singletons, "product"),
    "mamdani": (FuzzySets.from_points, "min"),
}
"""Constructor of the output and default conjunction of each inference method."""

TABLE_PIECES = 8
"""Default number of cells of a lookup table between two neighbouring corners of an input's terms."""

_CONDITION = re.compile(r"(\w+) is (\w+)")
_SENTENCE = re.compile(r"if (\w+ is \w+(?: and \w+ is \w+)*) then (\w+) is (\w+)")


@dataclass(frozen=True, slots=True)
class Rule:
    """Rule of a controller, such as "if error is left and rate is steady then slow_left".

    ``conditions`` maps the names of inputs to their terms; ``conclusion`` is a term of the output.
    """

    conditions: Mapping[str, str]
    conclusion: str

    def __str__(self) -> str:
        conditions = " and ".join(f"{name} is {term}" for name, term in self.conditions.items())
        return f"if {conditions} then {self.conclusion}"


@dataclass(frozen=True, slots=True)
class Controller:
    """Fuzzy controller: rules from inputs to an output.

    Raises ValueError for unknown names, for two rules with the same conditions, and for input values without a rule.
    """

    name: str
    inputs: tuple[FuzzyVariable, ...]
    output: OutputVariable
    rules: tuple[Rule, ...]
    conjunction: Conjunction = math.prod

    def __post_init__(self) -> None:
        errors = [f"{self.name}: rule {n} '{rule}': {error}" for n, rule, error in self._faults()]
        if errors:
            raise ValueError("\n".join(errors))
        if self.multilinear:
            return  # each case has its rule, and at any value some term of each input holds
        for values in product(*(variable.grid(2) for variable in self.inputs)):
            if not any(strength for _, strength in self.firing_strengths(values)):
                case = " and ".join(v.describe(value) for v, value in zip(self.inputs, values, strict=True))
                raise ValueError(f"{self.name}: no rule fires when {case}")

    @classmethod
    def from_mapping(cls, name: str, mapping: Mapping[str, Any]) -> "Controller":
        """Create a controller from the plain values of a controller file.

        ``inputs`` maps each input to its terms (see ``FuzzyVariable.from_points``). ``output`` maps one name to its
        terms: numbers for the ``method`` "sugeno" (the default), points (see ``FuzzySets.from_points``) for "mamdani".
        ``rules`` lists sentences, "if error is left and rate is steady then turn is slow_left", or is a table. The
        first row of a table, "error / rate", heads the columns with terms of the second input; each further row is a
        term of the first input with its conclusions. ``and`` is "product" or "min"; the default depends on the method.
        Raises ValueError that names the controller and the error.
        """
        inputs, output, rules = (mapping.get(key, {}) for key in ("inputs", "output", "rules"))
        if not (
            _nested(inputs) and _nested(output) and len(output) == 1 and rules and isinstance(rules, Mapping | Sequence)
        ):
            raise ValueError(f"{name}: needs 'inputs' and one 'output', with their terms, and 'rules'")
        if unknown := mapping.keys() - {"inputs", "output", "rules", "and", "method"}:
            raise ValueError(f"{name}: has no '{min(unknown)}'; known are: inputs, output, rules, and, method")
        if (method := str(mapping.get("method", "sugeno"))) not in METHODS:
            raise ValueError(f"{name}: 'method' is one of {list_text(METHODS)}, not '{method}'")
        make, usual = METHODS[method]
        if (joined := str(mapping.get("and", usual))) not in CONJUNCTIONS:
            raise ValueError(f"{name}: 'and' is one of {list_text(CONJUNCTIONS)}, not '{joined}'")
        try:
            variables = tuple(FuzzyVariable.from_points(variable, terms) for variable, terms in inputs.items())
            (conclusion,) = (make(variable, terms) for variable, terms in output.items())
            found = tuple(_table(rules) if isinstance(rules, Mapping) else _sentences(rules, conclusion.name))
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
        return cls(name, variables, conclusion, found, CONJUNCTIONS[joined])

    def __call__(self, *values: float) -> float:
        """Return the output for one value per input, in the order of ``inputs``. Raises ValueError for NaN."""
        return self.output.combine(self.firing_strengths(values))

    @property
    def multilinear(self) -> bool:
        """True if the output is linear in each input between the corners of the terms, so that a table is exact.

        That holds for Sugeno's method if the grades of each input add up to 1, "and" is the product, and each
        combination of terms has its own rule.
        """
        whole = all(len(rule.conditions) == len(self.inputs) for rule in self.rules)
        cases = math.prod(len(variable.terms) for variable in self.inputs)
        smooth = isinstance(self.output, Singletons) and self.conjunction is math.prod
        return smooth and whole and len(self.rules) == cases and all(variable.is_partition for variable in self.inputs)

    def tabulate(self, pieces: int | None = None) -> LookupTable:
        """Return the controller's output as a table, with ``pieces`` cells between two corners of an input's terms.

        The default is 1 if the output is multilinear, else ``TABLE_PIECES``; the table is then off by up to 3 % of the
        output's range.
        """
        if pieces is None:
            pieces = 1 if self.multilinear else TABLE_PIECES
        axes = tuple(variable.grid(pieces) for variable in self.inputs)
        return LookupTable(axes, tuple(self(*node) for node in product(*axes)))

    def firing_strengths(self, values: Sequence[float]) -> Iterator[tuple[str, float]]:
        """Yield the conclusion of each rule and its strength (0..1) for the input ``values``."""
        grades = {variable.name: variable.grades(value) for variable, value in zip(self.inputs, values, strict=True)}
        for rule in self.rules:
            yield rule.conclusion, self.conjunction(grades[name][term] for name, term in rule.conditions.items())

    def _faults(self) -> Iterator[tuple[int, Rule, str]]:
        known = {variable.name: variable.terms for variable in self.inputs}
        decided: dict[frozenset[tuple[str, str]], int] = {}
        for number, rule in enumerate(self.rules, 1):
            for name, term in rule.conditions.items():
                if name not in known:
                    yield number, rule, f"unknown input '{name}'; known are: {list_text(known)}"
                elif term not in known[name]:
                    yield number, rule, f"{name} has no term '{term}'; it has {list_text(known[name])}"
            if rule.conclusion not in self.output.terms:
                yield number, rule, f"no conclusion '{rule.conclusion}'; known are: {list_text(self.output.terms)}"
            if (first := decided.setdefault(frozenset(rule.conditions.items()), number)) != number:
                yield number, rule, f"rule {first} decides this case already"


def _nested(node: object) -> bool:
    return isinstance(node, Mapping) and bool(node) and all(isinstance(terms, Mapping) for terms in node.values())


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


# The rules to follow by: what a controller file holds, each part worked out to a surface that is quick to read.
#
# A PD controller, the textbook's answer, is among them to compare the fuzzy ones with.

PD_KEYS = ("p", "d", "most")


@dataclass(frozen=True, slots=True)
class ProportionalDerivative:
    """PD controller: ``p`` (1/s) times the error (radians) plus ``d`` times its rate, limited to ``most`` (rad/s)."""

    p: float
    d: float
    most: float = math.inf

    @classmethod
    def from_mapping(cls, name: str, mapping: Mapping[str, object]) -> "ProportionalDerivative":
        """Create the controller from plain SI values: ``p``, ``d`` and optionally ``most``.

        Raises ValueError that begins with ``name`` for a negative or missing value, and for other keys.
        """
        if unknown := mapping.keys() - set(PD_KEYS):
            raise ValueError(f"{name}: a PD controller has no '{min(unknown)}'; known are: {', '.join(PD_KEYS)}")
        found: dict[str, float] = {}
        for key, value in mapping.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
                raise ValueError(f"{name}: '{key}' needs a number of 0 or more, not {value!r}")
            found[key] = float(value)
        if missing := {"p", "d"} - found.keys():
            raise ValueError(f"{name}: a PD controller needs '{min(missing)}'")
        return cls(**found)

    def __call__(self, error: float, rate: float) -> float:
        """Return the turn rate for an error and its rate. Raises ValueError for NaN."""
        output = self.p * error + self.d * rate
        if math.isnan(output):
            raise ValueError("a value is not a number (NaN)")
        return min(max(output, -self.most), self.most)


ERROR, RATE, PAN, EDGE = "error", "rate", "pan", "edge"

INPUTS: Mapping[str, tuple[str, ...]] = {
    "pan": (ERROR, RATE, EDGE),
    "tilt": (ERROR, RATE),
    "base": (PAN, ERROR, RATE, EDGE),
    "turn": (ERROR, RATE, EDGE),
}
"""Names of the possible inputs of each rule base, by name of the rule base."""


@dataclass(frozen=True, slots=True)
class ControlLaw:
    """Control law: takes inputs by name, passes the ``inputs`` in this order to ``surface``, and returns its output."""

    inputs: tuple[str, ...]
    surface: Callable[..., float]

    def __call__(self, known: Mapping[str, float]) -> float:
        """Return the output for inputs by name. Raises ValueError for NaN, KeyError for a missing input."""
        return self.surface(*[known[name] for name in self.inputs])


@dataclass(frozen=True, slots=True)
class RuleBases:
    """Rule bases of a controller; all outputs are rates in rad/s.

    ``pan`` and ``tilt`` turn the head's aim. ``base`` turns the base of a robot with a head, ``turn`` that of a robot
    with the camera on the base. An axis with None stands still.

    With ``predict``, ``error`` (radians) is the angle from the aim to the predicted position of the target when the
    command takes effect, and ``rate`` (rad/s) is the target's own, seen from the base. Without it, both come from the
    newest picture: the offset from the camera's axis, and its change from picture to picture. ``pan`` (radians) is the
    angle of the head; ``edge`` is the left edge of a face's box in pixels.
    """

    pan: ControlLaw | None = None
    tilt: ControlLaw | None = None
    base: ControlLaw | None = None
    turn: ControlLaw | None = None
    predict: bool = True

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "RuleBases":
        """Create the rule bases from the values of a controller file, in SI units without unit names.

        The keys of ``mapping`` are ``pan``, ``tilt``, ``base`` and ``turn``, each with a rule base, and ``predict``, a
        flag. A rule base is fuzzy (see ``Controller.from_mapping``), or ``{p, d, most}`` for a PD controller: two gains
        and the maximum rate. Raises ValueError for an invalid rule base, an unknown key or input, and if there is
        neither ``pan`` nor ``turn``.
        """
        rest = dict(mapping)
        predict = rest.pop("predict", True)
        if not isinstance(predict, bool):
            raise ValueError(f"'predict' needs true or false, not {predict!r}")
        if unknown := rest.keys() - INPUTS.keys():
            raise ValueError(f"'{min(unknown)}' is none of the rule bases {', '.join(INPUTS)}, nor 'predict'")
        if not rest.keys() & {"pan", "turn"}:
            raise ValueError("needs 'pan' to turn a head by, or 'turn' to turn a base by, or both")
        return cls(**{name: _law(name, found) for name, found in rest.items()}, predict=predict)


def controllers(mapping: Mapping[str, Any]) -> dict[str, Controller]:
    """Return the fuzzy rule bases in the values of a controller file, by name. Raises as ``RuleBases`` does."""
    return {
        name: Controller.from_mapping(name, found)
        for name, found in mapping.items()
        if isinstance(found, Mapping) and "inputs" in found
    }


def _law(name: str, found: object) -> ControlLaw:
    mapping = found if isinstance(found, Mapping) else {}
    if "p" in mapping:
        law = ControlLaw((ERROR, RATE), ProportionalDerivative.from_mapping(name, mapping))
    else:
        controller = Controller.from_mapping(name, mapping)
        law = ControlLaw(tuple(variable.name for variable in controller.inputs), controller.tabulate())
    if unknown := [each for each in law.inputs if each not in INPUTS[name]]:
        raise ValueError(f"{name}: there is no input '{unknown[0]}' for it; there are {', '.join(INPUTS[name])}")
    return law
