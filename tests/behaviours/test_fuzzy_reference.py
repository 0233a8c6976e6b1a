"""Our inference against scikit-fuzzy's, on random rule bases."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from behaviours.tracking.fuzzy import CONJUNCTIONS, Controller, Rule
from behaviours.tracking.terms import FuzzySets, FuzzyVariable, Membership, Singletons

pytestmark = pytest.mark.filterwarnings("ignore:Passing more than 2 positional arguments:DeprecationWarning")

UNIVERSE = np.linspace(0.0, 1000.0, 1001)
"""All corners are whole numbers, so scikit-fuzzy's terms, which are sampled, are exact too."""

Case = tuple[dict[str, dict[str, list[float]]], dict[str, list[float]], list[tuple[dict[str, str], str]], list[float]]
"""The terms of the inputs and of the output as trapezoids, the rules, and a value for each input."""


@st.composite
def trapezoids(draw: st.DrawFn, prefix: str) -> dict[str, list[float]]:
    """Two to five terms that overlap and cover the universe."""
    count = draw(st.integers(2, 5))
    inner = 2 * count - 2
    corners = sorted(draw(st.lists(st.integers(1, 99), min_size=inner, max_size=inner, unique=True)))
    places = [0.0, 0.0, *(10.0 * corner for corner in corners), 1000.0, 1000.0]
    return {f"{prefix}{n}": [*places[2 * n : 2 * n + 4]] for n in range(count)}


@st.composite
def cases(draw: st.DrawFn) -> Case:
    inputs = {name: draw(trapezoids(name)) for name in "ab"[: draw(st.integers(1, 2))]}
    output = draw(trapezoids("o"))
    conditions: list[dict[str, str]] = [{}]
    for name, terms in inputs.items():
        conditions = [known | {name: term} for known in conditions for term in terms]
    rules = [(each, draw(st.sampled_from(sorted(output)))) for each in conditions]
    values = [draw(st.floats(0.0, 1000.0)) for _ in inputs]
    return inputs, output, rules, values


def ours(case: Case, conjunction: Any, output: Any) -> float:
    inputs, _, rules, values = case
    variables = tuple(
        FuzzyVariable(name, {term: Membership.from_points(points) for term, points in terms.items()})
        for name, terms in inputs.items()
    )
    found = Controller("any", variables, output, tuple(Rule(*rule) for rule in rules), conjunction)
    return found(*values)


def reference() -> tuple[Any, Any]:
    """Return scikit-fuzzy and its ``control``: it brings Matplotlib's windows along, so only who needs it loads it."""
    return import_module("skfuzzy"), import_module("skfuzzy.control")


def theirs(case: Case) -> float:
    skfuzzy, control = reference()
    inputs, output, rules, values = case
    causes = {name: control.Antecedent(UNIVERSE, name) for name in inputs}
    for name, terms in inputs.items():
        for term, points in terms.items():
            causes[name][term] = skfuzzy.trapmf(UNIVERSE, points)
    effect = control.Consequent(UNIVERSE, "out", defuzzify_method="centroid")
    for term, points in output.items():
        effect[term] = skfuzzy.trapmf(UNIVERSE, points)
    written = []
    for conditions, conclusion in rules:
        first, *others = [causes[name][term] for name, term in conditions.items()]
        for other in others:
            first &= other
        written.append(control.Rule(first, effect[conclusion]))
    simulation = control.ControlSystemSimulation(control.ControlSystem(written), cache=False)
    for name, value in zip(inputs, values, strict=True):
        simulation.input[name] = value
    simulation.compute()
    return float(simulation.output["out"])


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cases())
def test_mamdani_with_centroid_is_scikit_fuzzys_within_two_thousandths_of_the_range(case: Case) -> None:
    terms = {term: Membership.from_points(points) for term, points in case[1].items()}
    assert ours(case, min, FuzzySets("out", terms)) == pytest.approx(theirs(case), abs=2e-3 * 1000.0)


@settings(max_examples=100, deadline=None)
@given(cases(), st.sampled_from(["min", "product"]))
def test_sugeno_is_the_mean_weighted_by_scikit_fuzzys_grades(case: Case, joined: str) -> None:
    skfuzzy, _ = reference()
    inputs, output, rules, values = case
    heights = {term: points[1] - 500.0 for term, points in output.items()}
    join = np.min if joined == "min" else np.prod
    grades = {
        (name, term): float(skfuzzy.trapmf(np.array([value]), points)[0])
        for (name, terms), value in zip(inputs.items(), values, strict=True)
        for term, points in terms.items()
    }
    weights = [float(join([grades[condition] for condition in conditions.items()])) for conditions, _ in rules]
    expected = float(np.average([heights[conclusion] for _, conclusion in rules], weights=weights))
    conjunction = CONJUNCTIONS[joined]
    assert ours(case, conjunction, Singletons("out", heights)) == pytest.approx(expected, abs=1e-9)


def test_reference_check_detects_a_different_inference() -> None:
    case: Case = (
        {"a": {"a0": [0, 0, 200, 800], "a1": [200, 800, 1000, 1000]}},
        {"o0": [0, 0, 100, 300], "o1": [100, 300, 1000, 1000]},
        [({"a": "a0"}, "o0"), ({"a": "a1"}, "o1")],
        [500.0],
    )
    terms = {term: Membership.from_points(points) for term, points in case[1].items()}
    assert ours(case, min, FuzzySets("out", terms)) == pytest.approx(theirs(case), abs=1.0)
    assert ours(case, min, Singletons("out", {"o0": 100.0, "o1": 650.0})) != pytest.approx(theirs(case), abs=20.0)
