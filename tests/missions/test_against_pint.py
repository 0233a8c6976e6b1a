"""Expressions against pint: the same formulas give the same quantities, and the same mixtures are refused by both."""

import math
import operator
from collections.abc import Callable
from typing import Any

import pint
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from config.units import BASE_UNITS, UNITS, Quantity, parse_quantity, powers
from missions.language.expressions import ExpressionError, parse
from missions.language.inference import TypeInference
from missions.language.kinds import FLAG, UNSETTLED, kind_of_value

REGISTRY: Any = pint.UnitRegistry(None)
# As pint has them, but for the angle, which is a dimension here. A temperature is a difference of temperatures.
for line in (
    *("m = [length]", "cm = 0.01 m", "mm = 0.001 m", "rad = [angle]", f"deg = {math.pi / 180!r} rad", "s = [time]"),
    *("ms = 0.001 s", "min = 60 s", "h = 3600 s", "Hz = 1 / s", "V = [voltage]", "degC = [temperature]"),
    *("kg = [mass]", "g = 0.001 kg"),
):
    REGISTRY.define(line)

MIXED = object()
"""What a formula is that pint refuses."""

SCOPE: dict[str, object] = {
    "gap": Quantity(2.0, "length"),
    "turned": Quantity(-1.5, "angle"),
    "patience": Quantity(20.0, "duration"),
    "rate": Quantity(0.25, "speed"),
    "n": 3,
    "x": 0.5,
}
KINDS = {name: kind_of_value(value) for name, value in SCOPE.items()}

Formula = tuple[str, Any]
"""A formula as a mission has it, and what pint makes of it."""


def si(value: float, dimension: str) -> Any:
    """Return an SI value as pint has it."""
    unit = REGISTRY.Quantity(1.0)
    for base, power in zip(BASE_UNITS, powers(dimension), strict=True):
        unit = unit * REGISTRY.Quantity(1.0, base) ** power
    return value * unit


def name(word: str) -> Formula:
    value: Any = SCOPE[word]
    return word, si(float(value), value.dimension if isinstance(value, Quantity) else "number")


def literal(parts: tuple[str, str]) -> Formula:
    number, unit = parts
    found = parse_quantity(f"{number} {unit}")
    return f"{number} {unit}".strip(), si(float(number), "number") if found is None else si(found, found.dimension)


def both(text: str, function: Callable[..., Any], *parts: Formula) -> Formula:
    values = [value for _, value in parts]
    try:
        value = MIXED if MIXED in values else function(*values)
    except pint.DimensionalityError:
        value = MIXED
    except ZeroDivisionError:
        value = None
    return text.format(*(text for text, _ in parts)), value


SIGNS: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "//": operator.floordiv,
    "%": operator.mod,
}
KNOWN = sorted({unit for units in UNITS.values() for unit in units} - {"%"})
LEAVES = st.one_of(
    st.sampled_from(sorted(SCOPE)).map(name),
    st.tuples(st.sampled_from(["1", "2", "0.5", "30", "7"]), st.sampled_from(["", "", *KNOWN])).map(literal),
)


def larger(inner: st.SearchStrategy[Formula]) -> st.SearchStrategy[Formula]:
    sound = inner.filter(lambda formula: formula[1] is not None)
    return st.one_of(
        st.tuples(st.sampled_from([*SIGNS, "*", "/"]), sound, sound).map(
            lambda each: both(f"({{}} {each[0]} {{}})", SIGNS[each[0]], *each[1:])
        ),
        st.tuples(st.sampled_from([min, max]), sound, sound).map(
            lambda each: both(f"{each[0].__name__}({{}}, {{}})", each[0], *each[1:])
        ),
        sound.map(lambda each: both("abs({})", abs, each)),
        sound.map(lambda each: both("(-{})", operator.neg, each)),
    )


FORMULAS = st.recursive(LEAVES, larger, max_leaves=6)


def test_units_have_the_factors_of_pint() -> None:
    for dimension, units in UNITS.items():
        for unit, factor in units.items():
            if unit != "%":
                theirs = REGISTRY.Quantity(1.0, unit.replace("^", "**")).to_base_units()
                assert theirs.magnitude == pytest.approx(factor)
                assert theirs.dimensionality == si(1.0, dimension).dimensionality


@given(FORMULAS)
def test_formulas_evaluate_as_in_pint_or_are_refused_by_both(formula: Formula) -> None:
    text, theirs = formula
    assume(theirs is not None)
    mistakes: list[str] = []
    expression = parse(text)
    kind = TypeInference(KINDS, lambda _, message, __: mistakes.append(message)).kind(expression.tree)
    try:
        ours: Any = expression.evaluate(SCOPE)
    except ExpressionError as error:
        assume("out of range" not in str(error) and "zero" not in str(error))
        assert theirs is MIXED, f"{text}: {error}"  # noqa: PT017 - either outcome is right
        assert mistakes
        assert kind == UNSETTLED
        return
    assert theirs is not MIXED, f"{text} is {ours}"
    assert mistakes == []
    assert kind == kind_of_value(ours), "the checker knows what it will be"
    assert float(ours) == pytest.approx(theirs.to_base_units().magnitude, rel=1e-9)
    assert si(1.0, ours.dimension if isinstance(ours, Quantity) else "number").dimensionality == theirs.dimensionality


@given(FORMULAS, FORMULAS)
def test_comparisons_give_the_same_result_as_in_pint(left: Formula, right: Formula) -> None:
    text, theirs = both("{} < {}", operator.lt, left, right)
    assume(None not in (left[1], right[1]))
    mistakes: list[str] = []
    expression = parse(text)
    assert TypeInference(KINDS, lambda _, message, __: mistakes.append(message)).kind(expression.tree) == FLAG
    try:
        ours = expression.evaluate(SCOPE)
    except ExpressionError as error:
        assume("out of range" not in str(error) and "zero" not in str(error))
        assert theirs is MIXED
        assert mistakes
        return
    assert ours == theirs
    assert mistakes == []
