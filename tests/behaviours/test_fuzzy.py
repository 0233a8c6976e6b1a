"""Fuzzy terms, rules and surfaces: what they infer, what the tables keep of it, and what is refused."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.tracking.fuzzy import Controller, LookupTable, Rule
from behaviours.tracking.terms import FuzzySets, FuzzyVariable, Membership, Singletons

ERROR = {"right": -10.0, "centred": 0.0, "left": 20.0}
RATE = {"rightward": -5.0, "leftward": 5.0}
PAN = {"back": -1.0, "stay": 0.0, "on": 1.0, "rush": 4.0}
TABLE = {
    "error / rate": ["rightward", "leftward"],
    "right": ["back", "back"],
    "centred": ["back", "on"],
    "left": ["on", "rush"],
}

values = st.floats(-50, 50)


def mapping(**changes: Any) -> dict[str, Any]:
    return {"inputs": {"error": ERROR, "rate": RATE}, "output": {"pan": PAN}, "rules": TABLE} | changes


def controller(**changes: Any) -> Controller:
    return Controller.from_mapping("pan", mapping(**changes))


# --- terms ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "grades"),
    [
        ([0, 10, 20], {-1: 0, 0: 0, 5: 0.5, 10: 1, 15: 0.5, 20: 0, 21: 0}),
        ([0, 10, 20, 40], {0: 0, 5: 0.5, 10: 1, 20: 1, 30: 0.5, 40: 0}),
        ([0, 10], {-1: 0, 0: 0, 5: 0.5, 10: 1, 1e9: 1}),
        ([0, -10], {1: 0, 0: 0, -5: 0.5, -10: 1, -1e9: 1}),
        ([0, 0, 10], {-1: 0, 0: 1, 5: 0.5, 10: 0}),
        ([0, 10, 10], {0: 0, 5: 0.5, 10: 1, 11: 0}),
    ],
    ids=["triangle", "trapezoid", "rising shoulder", "falling shoulder", "steep front", "steep end"],
)
def test_membership_has_the_shape_of_its_points(points: Sequence[float], grades: Mapping[float, float]) -> None:
    membership = Membership.from_points(points)
    assert {value: membership(value) for value in grades} == grades


@given(st.lists(values, min_size=2, max_size=7, unique=True), values)
def test_the_grades_of_terms_with_one_peak_each_add_up_to_one(peaks: list[float], value: float) -> None:
    variable = FuzzyVariable.from_points("x", {f"t{n}": peak for n, peak in enumerate(peaks)})
    grades = variable.grades(value)
    assert sum(grades.values()) == pytest.approx(1.0)
    assert all(0.0 <= grade <= 1.0 for grade in grades.values())
    assert all(variable.grades(peak)[f"t{n}"] == 1.0 for n, peak in enumerate(peaks))


def test_a_peak_may_stand_in_a_list_of_one() -> None:
    assert FuzzyVariable.from_points("x", {"low": [0.0], "high": [1.0]}) == FuzzyVariable.from_points(
        "x", {"low": 0, "high": 1}
    )


def test_values_out_of_reach_are_clamped() -> None:
    variable = FuzzyVariable.from_points("x", {"low": [0, 5, 10], "high": [5, 10, 10]} | {"edge": [0, 0, 5]})
    assert variable.grades(-100) == variable.grades(0)
    assert variable.grades(math.inf) == variable.grades(10)


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ({}, "error: needs two terms at least, has none"),
        ({"left": 1.0}, "error: needs two terms at least, has left"),
        ({"left": 1.0, "right": 1.0}, "error: needs finite peaks, no two in one place, not 1, 1"),
        ({"left": 1.0, "right": math.nan}, "error: needs finite peaks"),
        ({"left": [], "right": [0, 1]}, "error: 'left' needs 2 to 4 finite points, not none"),
        ({"left": 1.0, "right": [0, 1]}, "error: 'left' needs 2 to 4 finite points, not 1"),
        ({"left": [1, 2, 3, 4, 5], "right": [0, 1]}, "'left' needs 2 to 4 finite points, not 1, 2, 3, 4, 5"),
        ({"left": [0, math.inf], "right": [0, 1]}, "error: 'left' needs 2 to 4 finite points, not 0, inf"),
        ({"left": [0, 2, 1], "right": [0, 1]}, "error: 'left' has points that do not rise: 0, 2, 1"),
        ({"left": [1, 1], "right": [0, 1]}, "error: 'left' has points that do not rise: 1, 1"),
        ({"left": [1, 1, 1], "right": [0, 1]}, "error: 'left' has points that do not rise: 1, 1, 1"),
        ({"left": [0, 0, 1], "right": [2, 3, 3]}, "error: no term covers 1; let the terms around it overlap"),
        ({"left": [0, 0, 1], "right": [1, 2, 2]}, "error: no term covers 1;"),
        ({"left": [0, 1, 2], "right": [1, 2, 2]}, "error: no term covers 0;"),
    ],
)
def test_invalid_fuzzy_terms_are_refused_by_name(terms: Mapping[str, float | Sequence[float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        FuzzyVariable.from_points("error", terms)


# --- inference --------------------------------------------------------------------------------------------------------


def test_single_rule_decides_at_the_peaks_of_its_terms() -> None:
    surface = controller()
    for row, error in ERROR.items():
        for column, rate in RATE.items():
            conclusion = TABLE[row][TABLE["error / rate"].index(column)]
            assert surface(error, rate) == PAN[conclusion]


def test_between_peaks_conclusions_are_weighed() -> None:
    # error 5: centred 0.75, left 0.25; rate 0: half each. (-1 + 1) * 0.75 / 2 + (1 + 4) * 0.25 / 2
    assert controller()(5.0, 0.0) == pytest.approx(0.625)


def test_with_min_the_weights_are_other() -> None:
    # min(0.75, 0.5) = 0.5 twice, min(0.25, 0.5) = 0.25 twice: ((-1 + 1) * 0.5 + (1 + 4) * 0.25) / 1.5
    assert controller(**{"and": "min"})(5.0, 0.0) == pytest.approx(1.25 / 1.5)


def test_a_rule_may_leave_an_input_open() -> None:
    surface = controller(
        rules=[
            "if error is right then pan is back",
            "if error is left  then pan is on",
            "if error is centred and rate is rightward then pan is back",
            "if rate is leftward and error is centred then pan is on",
        ]
    )
    assert surface(-10.0, 0.0) == -1.0
    assert surface(0.0, 0.0) == 0.0


def test_rule_sentences_equal_a_rule_table() -> None:
    sentences = [
        f"if error is {row} and rate is {column} then pan is {conclusion}"
        for row in ERROR
        for column, conclusion in zip(RATE, TABLE[row], strict=True)
    ]
    assert controller(rules=sentences) == controller()


@given(values, values)
def test_fuzzy_output_lies_between_its_conclusions(error: float, rate: float) -> None:
    assert PAN["back"] <= controller()(error, rate) <= PAN["rush"]


def test_no_number_is_not_an_input() -> None:
    surface = controller()
    with pytest.raises(ValueError, match="not a number"):
        surface(math.nan, 0.0)
    with pytest.raises(ValueError, match="not a number"):
        surface.tabulate()(0.0, math.nan)


# --- Mamdani's method -------------------------------------------------------------------------------------------------


SETS = FuzzySets(
    "speed", {"back": Membership(-2, -1, -1, 0), "stay": Membership(-1, 0, 1, 2), "on": Membership(1, 2, 2, 3)}
)


@pytest.mark.parametrize(
    ("fired", "centroid"),
    [
        ([("stay", 1.0)], 0.5),
        ([("stay", 0.3)], 0.5),
        ([("back", 0.5)], -1.0),
        ([("back", 0.5), ("back", 0.2), ("on", 0.0)], -1.0),
        # A triangle of area 1 about -1 and a trapezoid of area 2 about 0.5, less the triangle of area 1/4 about -0.5
        # that they share: (-1 + 1 + 0.125) / 2.75.
        ([("back", 1.0), ("stay", 1.0)], 0.125 / 2.75),
    ],
)
def test_mamdani_returns_the_centroid(fired: list[tuple[str, float]], centroid: float) -> None:
    assert SETS.combine(fired) == pytest.approx(centroid)


def test_mamdani_joins_conditions_by_the_least_and_conclusions_of_two_rules_by_the_greatest() -> None:
    surface = controller(method="mamdani")
    # error 5: centred 0.75, left 0.25; rate 0: half each. "on" follows from (centred, leftward): 0.5, and from
    # (left, rightward): 0.25.
    output = surface.output
    assert surface(5.0, 0.0) == output.combine([("back", 0.5), ("on", 0.5), ("rush", 0.25)])


def test_evenly_spaced_sets_return_their_peaks() -> None:
    sets = FuzzySets.from_points("pan", {"back": -2.0, "stay": 0.0, "on": 2.0})
    assert [sets.combine([(term, 0.7)]) for term in sets.terms] == pytest.approx([-2.0, 0.0, 2.0])
    shoulder = FuzzySets.from_points("pan", {"stay": [0.0, 1.0, 2.0], "on": [1.0, 2.0]})
    assert shoulder.combine([("on", 1.0)]) == pytest.approx(1.0 + 2 / 3)


def test_combine_raises_if_no_rule_fires() -> None:
    for output in (SETS, Singletons("pan", PAN)):
        with pytest.raises(ValueError, match="no rule fires"):
            output.combine([(next(iter(output.terms)), 0.0)])


@given(values, values)
def test_mamdani_output_stays_within_its_sets(error: float, rate: float) -> None:
    assert PAN["back"] - 1e-9 <= controller(method="mamdani")(error, rate) <= PAN["rush"] + 1e-9


# --- tables -----------------------------------------------------------------------------------------------------------


@st.composite
def partitioned(draw: st.DrawFn) -> Controller:
    """A controller of one to three inputs in single peaks, with a rule for every case."""
    inputs: list[FuzzyVariable] = []
    cases: list[dict[str, str]] = [{}]
    for name in "abc"[: draw(st.integers(1, 3))]:
        peaks = draw(st.lists(st.integers(-40, 40), min_size=2, max_size=4, unique=True))
        terms = {f"{name}{n}": float(peak) for n, peak in enumerate(peaks)}
        inputs.append(FuzzyVariable.from_points(name, terms))
        cases = [case | {name: term} for case in cases for term in terms]
    heights = draw(st.lists(st.floats(-9, 9), min_size=len(cases), max_size=len(cases)))
    output = Singletons("out", {f"o{n}": height for n, height in enumerate(heights)})
    return Controller("any", tuple(inputs), output, tuple(Rule(case, f"o{n}") for n, case in enumerate(cases)))


@given(partitioned(), st.tuples(values, values, values), st.integers(1, 3))
def test_on_single_peaks_with_the_product_a_table_of_the_corners_is_exact(
    surface: Controller, at: tuple[float, float, float], pieces: int
) -> None:
    place = at[: len(surface.inputs)]
    assert surface.tabulate(pieces)(*place) == pytest.approx(surface(*place), abs=1e-9)


def test_multilinear_surface_needs_no_finer_table() -> None:
    surface = controller()
    assert surface.multilinear
    assert surface.tabulate() == surface.tabulate(1)
    for other in (controller(method="mamdani"), controller(**{"and": "min"})):
        assert not other.multilinear
        assert other.tabulate() == other.tabulate(8)


@given(st.tuples(values, values))
def test_two_axes_are_read_as_three_are(at: tuple[float, float]) -> None:
    flat = controller().tabulate()
    deep = LookupTable((*flat.axes, (0.0, 1.0)), tuple(height for height in flat.heights for _ in range(2)))
    assert flat(*at) == pytest.approx(deep(*at, 0.5))
    assert flat(-math.inf, math.inf) == flat(-1e6, 1e6)


def test_invalid_lookup_table_is_refused() -> None:
    for axes, heights in (((), ()), (((0.0,),), (1.0,)), (((0.0, 1.0),), (1.0,))):
        with pytest.raises(ValueError, match="cannot have"):
            LookupTable(axes, heights)
    with pytest.raises(TypeError, match="2 axes cannot be read at 1"):
        controller().tabulate()(1.0)


def test_with_min_a_table_comes_close_and_a_finer_one_closer() -> None:
    surface = controller(**{"and": "min"})
    places = [(error / 7, rate / 7) for error in range(-70, 141) for rate in range(-35, 36)]
    coarse, usual, fine = (
        max(abs(table(*place) - surface(*place)) for place in places) for table in map(surface.tabulate, (2, 8, 32))
    )
    assert fine < usual < coarse
    # 4 % of the way from the lowest conclusion to the highest.
    assert usual < 0.04 * (PAN["rush"] - PAN["back"])


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inputs": {}}, "pan: needs 'inputs' and one 'output', with their terms, and 'rules'"),
        ({"inputs": ["error"]}, "pan: needs 'inputs' and"),
        ({"inputs": {"error": "far"}}, "pan: needs 'inputs' and"),
        ({"output": {"pan": PAN, "tilt": PAN}}, "one 'output', with"),
        ({"output": {"pan": 3.0}}, "one 'output', with"),
        ({"rules": []}, "and 'rules'"),
        ({"rules": 7}, "and 'rules'"),
        (
            {"inputs": {"error": ERROR | {"left": "20 dg"}, "rate": RATE}},
            "pan: error: 'left' needs numbers, not '20 dg'",
        ),
        ({"output": {"pan": PAN | {"on": "fast"}}}, "pan: pan: 'on' needs numbers, not 'fast'"),
        (
            {"output": {"pan": PAN | {"on": [1.0, 2.0]}}},
            "pan: pan: needs terms with one finite number each, has -1, 0, 1",
        ),
        ({"rules": [{"if": "error is left"}]}, "pan: rule 1 .*: write it as"),
        ({"and": "or"}, "pan: 'and' is one of product, min, not 'or'"),
        ({"method": "magic"}, "pan: 'method' is one of sugeno, mamdani, not 'magic'"),
        ({"methd": "mamdani"}, "pan: has no 'methd'; known are: inputs, output, rules, and, method"),
        ({"method": "mamdani", "output": {"pan": {}}}, "pan: pan: needs terms, has none"),
        ({"output": {"pan": {}}}, "pan: pan: needs terms with one finite number each, has none"),
        (
            {"output": {"pan": PAN | {"on": math.inf}}},
            "pan: pan: needs terms with one finite number each, has -1, 0, inf, 4",
        ),
        ({"inputs": {"error": {"left": 1.0}, "rate": RATE}}, "pan: error: needs two terms at least, has left"),
        ({"rules": ["error is left so pan is on"]}, "rule 1 'error is left so pan is on': write it as 'if INPUT is"),
        ({"rules": ["if error is left then tilt is on"]}, "then pan is TERM'"),
        ({"rules": ["if error is left and error is right then pan is on"]}, "rule 1 .*: write it as"),
        ({"rules": {"error": ["on"], "left": ["on"]}}, "needs two inputs, as in 'error / rate', not 'error'"),
        ({"rules": TABLE | {"left": ["on"]}}, "row 'left' of the rules has 1 columns, 'error / rate' 2"),
        ({"rules": ["if error is left then pan is on"]}, r"pan: no rule fires when error is right \(-10\) and rate is"),
        (
            {"rules": {key: row for key, row in TABLE.items() if key != "centred"}},
            r"pan: no rule fires when error is centred \(0\) and rate is rightward \(-5\)",
        ),
    ],
)
def test_invalid_controller_is_refused_with_a_reason(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        controller(**changes)
    assert str(caught.value).startswith("pan: ")


def test_all_faulty_rules_are_named_at_once() -> None:
    sentences = [
        "if error is lft then pan is on",
        "if eror is left then pan is on",
        "if error is left then pan is onn",
        "if error is right and rate is leftward then pan is on",
        "if rate is leftward and error is right then pan is stay",
    ]
    with pytest.raises(ValueError, match="rule") as caught:
        controller(rules=sentences)
    assert str(caught.value).splitlines() == [
        "pan: rule 1 'if error is lft then on': error has no term 'lft'; it has right, centred, left",
        "pan: rule 2 'if eror is left then on': unknown input 'eror'; known are: error, rate",
        "pan: rule 3 'if error is left then onn': no conclusion 'onn'; known are: back, stay, on, rush",
        "pan: rule 5 'if rate is leftward and error is right then stay': rule 4 decides this case already",
    ]
