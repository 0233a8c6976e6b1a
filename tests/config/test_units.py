"""Quantities: a number with its unit as people write it."""

import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.units import EXAMPLES, UNITS, Quantity, parse_quantity, quantity_text, quoted_value, si_value, with_article

PAIRS = [(dimension, unit) for dimension, units in UNITS.items() for unit in units]


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        ("30 deg", "angle", math.radians(30)),
        ("30deg", "angle", math.radians(30)),
        ("-0.5 rad", "angle", -0.5),
        ("  2 m ", "length", 2.0),
        ("50 cm", "length", 0.5),
        ("500 ms", "duration", 0.5),
        ("2 min", "duration", 120.0),
        ("1e3 mm", "length", 1.0),
        (".3 m/s", "speed", 0.3),
        ("45 deg/s", "turn rate", math.radians(45)),
        ("0.5 m/s^2", "acceleration", 0.5),
        ("20 Hz", "frequency", 20.0),
        ("20 %", "share", 0.2),
        ("12%", "share", 0.12),
        ("12.6 V", "voltage", 12.6),
    ],
)
def test_quantity_is_parsed_into_si_units(text: str, dimension: str, si: float) -> None:
    assert si_value(text, dimension) == pytest.approx(si)
    found = parse_quantity(text)
    assert found is not None
    assert (found.dimension, found.text) == (dimension, text.strip())


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (30, "needs an angle such as '30 deg': '30' has no unit (units: deg, rad)"),
        (1.5, "needs an angle such as '30 deg': '1.5' has no unit (units: deg, rad)"),
        ("1.5", "needs an angle such as '30 deg': '1.5' has no unit (units: deg, rad)"),
        ("30 dge", "needs an angle such as '30 deg': unknown unit 'dge' (units: deg, rad)"),
        ("30°", "needs an angle such as '30 deg': unknown unit '°' (write '30 deg')"),
        ("30 Deg", "needs an angle such as '30 deg': unknown unit 'Deg' (units: deg, rad)"),
        ("3 m/s²", "needs an angle such as '30 deg': unknown unit 'm/s²' (units: deg, rad)"),
        ("3 m", "needs an angle such as '30 deg', got a length: '3 m'"),
        ("1e999 deg", "needs an angle such as '30 deg': '1e999 deg' is too large"),
        (Quantity(math.inf, "angle", "inf"), "needs an angle such as '30 deg': 'inf' is not finite"),
        ("inf deg", "needs an angle such as '30 deg', got 'inf deg'"),
        ("nan deg", "needs an angle such as '30 deg', got 'nan deg'"),
        ("1_000 deg", "needs an angle such as '30 deg', got '1_000 deg'"),
        ("٣ deg", "needs an angle such as '30 deg', got '٣ deg'"),
        ("wide", "needs an angle such as '30 deg', got 'wide'"),
        ("", "needs an angle such as '30 deg', got ''"),
        (True, "needs an angle such as '30 deg', got 'true'"),
        (None, "needs an angle such as '30 deg', got nothing"),
        ([], "needs an angle such as '30 deg', got a list"),
        ({}, "needs an angle such as '30 deg', got a mapping"),
    ],
)
def test_invalid_quantity_is_refused_with_an_example(value: object, message: str) -> None:
    with pytest.raises(ValueError, match="needs") as caught:
        si_value(value, "angle")
    assert str(caught.value) == message


@pytest.mark.parametrize("text", ["5", "deg", "5 apples", "5 m m", "1e999 m", "1e308 h", "--5 m", "5 m\0", ""])
def test_other_texts_are_no_quantities(text: str) -> None:
    assert parse_quantity(text) is None


def test_every_dimension_has_an_example() -> None:
    assert EXAMPLES.keys() == UNITS.keys()
    for dimension, example in EXAMPLES.items():
        found = parse_quantity(example)
        assert found is not None
        assert found.dimension == dimension


def test_no_unit_belongs_to_two_dimensions() -> None:
    units = [unit for _, unit in PAIRS]
    assert len(units) == len(set(units))


@given(st.sampled_from(list(UNITS)), st.floats(-1e4, 1e4))
def test_quantity_text_round_trips(dimension: str, value: float) -> None:
    factor = next(iter(UNITS[dimension].values()))
    assert si_value(quantity_text(value, dimension), dimension) == pytest.approx(value, rel=1e-5, abs=1e-4 * factor)


@given(st.sampled_from(PAIRS), st.floats(-1e9, 1e9), st.sampled_from(["", " ", "  "]))
def test_every_unit_scales_its_number(pair: tuple[str, str], number: float, blanks: str) -> None:
    dimension, unit = pair
    assert si_value(f"{number!r}{blanks}{unit}", dimension) == pytest.approx(number * UNITS[dimension][unit])


@given(st.text(max_size=40), st.sampled_from(list(UNITS)))
def test_any_text_is_a_finite_quantity_or_refused(text: str, dimension: str) -> None:
    try:
        value = si_value(text, dimension)
    except ValueError as error:
        value, refused = 0.0, str(error)
    else:
        refused = "needs a"
    assert math.isfinite(value)
    assert refused.startswith("needs a")


def test_zero_is_written_without_a_sign() -> None:
    assert quantity_text(-0.0, "length") == "0 m"
    assert quantity_text(-1e-9, "length") == "0 m"
    assert quantity_text(math.pi, "turn rate") == "180 deg/s"


def test_quantity_prints_as_written_and_calculates_in_si() -> None:
    patience = Quantity(60.0, "duration", "1 min")
    assert f"{patience}" == str(patience) == "1 min"
    assert f"{patience:.1f}" == "60.0"
    assert patience * 2 == 120.0
    assert type(patience * 2) is float


def test_a_quantity_survives_pickling() -> None:
    again = pickle.loads(pickle.dumps(Quantity(0.5, "length", "50 cm")))  # noqa: S301 - made in this line
    assert (again, again.dimension, str(again)) == (0.5, "length", "50 cm")


def test_quoted_values_are_short_and_as_in_the_file() -> None:
    assert [quoted_value(value) for value in (None, True, 3, "x", [1], {"a": 1})] == [
        "nothing",
        "'true'",
        "'3'",
        "'x'",
        "a list",
        "a mapping",
    ]
    assert quoted_value("x" * 1000) == f"'{'x' * 60}...'"
    assert (with_article("angle"), with_article("length")) == ("an angle", "a length")
