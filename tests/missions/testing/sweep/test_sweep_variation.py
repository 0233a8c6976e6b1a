"""Tests of what varies: reading it, and drawing from it."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.units import si_value
from missions.plugins.testing.sweep.variation import ValueList, ValueRange, Variation, read_values

finite = st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    ("text", "kind", "values"),
    [
        ("0.6..3", "length", ValueRange(0.6, 3.0)),
        ("0.6 m..3 m", "length", ValueRange(0.6, 3.0)),
        ("60 cm .. 3 m", "length", ValueRange(0.6, 3.0)),
        ("0.6..3 m", "length", ValueRange(0.6, 3.0)),
        ("5..100 %", "share", ValueRange(5.0, 100.0)),
        ("0.2..1", "share", ValueRange(20.0, 100.0)),
        ("-30..30 deg", "angle", ValueRange(-30.0, 30.0)),
        ("50 %", "share", ValueList((50.0,))),
        ("1,2.5 , 3 m", "length", ValueList((1.0, 2.5, 3.0))),
        ("0..20", "number", ValueRange(0.0, 20.0)),
        ("1..3", "count", ValueRange(1, 3)),
        ("1,4", "count", ValueList((1, 4))),
        ("Hello,Good morning", "text", ValueList(("Hello", "Good morning"))),
        ("../a,b", "text", ValueList(("../a", "b"))),
    ],
)
def test_values_are_a_range_or_a_list_and_a_unit_may_stand_once(
    text: str, kind: str, values: ValueRange | ValueList
) -> None:
    assert read_values(text, kind)[1] == values


def test_values_are_stored_in_readable_units() -> None:
    units = {kind: read_values("1", kind)[0] for kind in ("length", "share", "duration", "speed", "number", "count")}
    assert units == {"length": "m", "share": "%", "duration": "s", "speed": "m/s", "number": "", "count": ""}
    assert read_values("1 rad", "angle") == ("deg", ValueList((57.295779513,)))


@pytest.mark.parametrize(
    ("text", "kind", "what"),
    [
        ("3..0.6", "length", "begins above its end: '3..0.6'"),
        ("1 s", "length", "needs values such as '0.5 m', got '1 s'"),
        ("-30..30", "angle", "needs values such as '30 deg', got '-30'"),
        ("a..b", "length", "needs values such as '0.5 m', got 'a'"),
        ("..", "length", "needs values such as '0.5 m', got ''"),
        ("1..2 m", "number", "needs a number without a unit, got '1 m'"),
        ("1.5..2", "count", "needs a whole number, got '1.5'"),
        ("-1", "count", "needs a whole number, got '-1'"),
        ("a,,b", "text", "has an empty value in its list"),
        ("1e999", "number", "needs a number without a unit, got '1e999'"),
    ],
)
def test_invalid_value_is_refused_with_the_expected_form(text: str, kind: str, what: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(what)}$"):
        read_values(text, kind)


@given(st.tuples(finite, finite).map(sorted), st.integers(0, 10_000))
def test_draw_is_within_its_range_and_reproducible(ends: list[float], seed: int) -> None:
    low, high = (round(end, 4) for end in ends)
    variation = Variation("person.distance", "m", ValueRange(low, high))
    drawn = variation.draw(seed)
    assert isinstance(drawn, float)
    assert low <= drawn <= high
    assert variation.draw(seed) == drawn
    # As a file has it, it is what was drawn.
    assert si_value(variation.text(drawn), "length") == drawn


@given(st.integers(0, 20), st.integers(0, 20))
def test_integer_draws_are_integers_and_cover_the_range(low: int, more: int) -> None:
    variation = Variation("people", "", ValueRange(low, low + more))
    drawn = {variation.draw(seed) for seed in range(60 * (more + 1))}
    assert all(type(each) is int for each in drawn)
    assert {low, low + more} <= drawn <= set(range(low, low + more + 1))


def test_draws_are_spread_evenly_and_of_two_quantities_independently() -> None:
    far, light = (Variation(name, "", ValueRange(0.0, 1.0)) for name in ("far", "light"))
    drawn = [(float(far.draw(seed)), float(light.draw(seed))) for seed in range(2000)]
    for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
        share = sum((a >= 0.5, b >= 0.5) == corner for a, b in drawn) / len(drawn)
        assert 0.2 < share < 0.3


def test_draws_are_stable_across_versions() -> None:
    variation = Variation("person.distance", "m", ValueRange(0.6, 3.0))
    assert [variation.draw(seed) for seed in range(3)] == [1.5799, 1.5607, 2.8107]


def test_variation_with_one_value_is_single() -> None:
    assert Variation("light", "%", ValueList((50.0, 50.0))).is_single
    assert Variation("light", "%", ValueRange(50.0, 50.0)).is_single
    assert not Variation("light", "%", ValueList((50.0, 60.0))).is_single
