"""Values: texts with expressions in them, and values that wait for a mission to run."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.units import Quantity
from missions.language.expressions import ExpressionError, Value, as_whole_number, format_value, in_si, parse, template

SCOPE: dict[str, object] = {
    "n": 3,
    "x": 2.0,
    "name": "Anna",
    "patience": Quantity(60.0, "duration", "1 min"),
    "ok": True,
    "names": ["Anna", "Ben"],
    "gone": None,
}


def filled(text: str) -> object:
    found = template(text)
    assert found is not None
    return found.evaluate(SCOPE)


@pytest.mark.parametrize("text", ["", "Hello", "$5", "5 $", "{n}", "$ {n}", "it's"])
def test_a_text_without_holes_is_no_template(text: str) -> None:
    assert template(text) is None


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("${n}", 3),
        ("${ n > 2 }", True),
        ("${patience}", SCOPE["patience"]),
        ("${names}", ["Anna", "Ben"]),
        ("${gone}", None),
    ],
)
def test_template_of_one_expression_keeps_its_type(text: str, value: object) -> None:
    found = filled(text)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("Good day, ${name}!", "Good day, Anna!"),
        ("${n}${n}", "33"),
        ("${n} ", "3 "),
        ("${name}'s ${n / 2}", "Anna's 1.5"),
        ("${x} of ${ok} in ${patience}", "2 of yes in 1 min"),
        ("${names}: ${gone}", "Anna, Ben: nothing"),
        ("${'a}b'} ${\"${\"}", "a}b ${"),
        ("${'a' if ok else 'b'}-${not ok}", "a-no"),
        ("line one\n${n}", "line one\n3"),
    ],
)
def test_holes_in_a_text_are_filled_as_a_person_would_write(text: str, value: str) -> None:
    assert filled(text) == value


@pytest.mark.parametrize(
    ("text", "column", "length", "message"),
    [
        ("a ${n", 2, 2, "'${' has no '}'"),
        ("${n} and ${", 9, 2, "'${' has no '}'"),
        ("${ ${n} }", 0, 2, "'${' holds another '${': write the name in it without braces"),
        ("${f + [{at: n}]}", 0, 2, "'${' holds a brace: store the mapping with 'set' first, and write its name here"),
        ("${name's}", 0, 2, "'${' holds a quote that is not closed"),
        ("${{1}}", 0, 2, "'${' holds a brace: store the mapping with 'set' first, and write its name here"),
        ("ab ${}", 5, 1, "an empty expression"),
        ("ab ${  foo(1)}", 7, 3, "'foo' cannot be called; the functions are min, max, abs, round, len, random"),
        ("é ${n} ${n +}", 11, 1, "'n +' is not an expression; something is missing at its end"),
        ("${name._x}", 2, 7, "'_x' is private"),
    ],
)
def test_template_error_has_its_position(text: str, column: int, length: int, message: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        template(text)
    error = caught.value
    assert (error.column, error.length, str(error)) == (column, length, message)


def test_a_text_cannot_be_filled_without_end() -> None:
    scope: dict[str, object] = {"t": "x" * 6000}
    doubled = template("${t} ${t}")
    assert doubled is not None
    with pytest.raises(ExpressionError, match="a text of more than 10,000 characters"):
        doubled.evaluate(scope)


@given(st.text("${}'\"nx ._+", max_size=30))
def test_random_text_is_parsed_or_gives_a_positioned_error(text: str) -> None:
    try:
        found = template(text)
    except ExpressionError as error:
        assert 0 <= (error.column or 0) <= len(text)  # noqa: PT017 - either outcome is right
        return
    assert (found is None) is ("${" not in text)
    for read in () if found is None else found.reads:
        assert text[read.column :].startswith(read.name)


def test_value_is_resolved_and_converted() -> None:
    waiting = Value(template=parse("n * 2"), convert=str)
    assert waiting.resolve({"n": 4}) == "8"
    assert Value(template=parse("n * 2")).resolve({"n": 4}) == 8
    assert Value(7).resolve({}) == 7
    with pytest.raises(ExpressionError, match="'n' is not set"):
        waiting.resolve({})


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "yes"),
        (False, "no"),
        (None, "nothing"),
        (2.0, "2"),
        (1 / 3, "0.3333"),
        (1.50, "1.5"),
        (Quantity(0.5, "length", "50 cm"), "50 cm"),
        (12, "12"),
        ("as it is", "as it is"),
        ([1, True, [2.5]], "1, yes, 2.5"),
        (("a", "b"), "a, b"),
    ],
)
def test_values_are_formatted_for_people(value: object, text: str) -> None:
    assert format_value(value) == text


def test_a_plain_number_is_a_share_and_no_other_quantity() -> None:
    assert in_si(0.5, "share") == 0.5
    assert in_si(Quantity(1.5, "angle", "1.5 rad"), "angle") == 1.5
    for bare in (1.5, 2, math.inf, math.nan, True, None, "1.5"):
        with pytest.raises(ValueError, match="needs an angle such as '30 deg'"):
            in_si(bare, "angle")


@pytest.mark.parametrize(("value", "number"), [(3, 3), (3.0, 3), (4.0, 4), (-2, -2)])
def test_whole_numbers_may_be_written_as_floats(value: object, number: int) -> None:
    found = as_whole_number(value)
    assert found == number
    assert type(found) is int


@pytest.mark.parametrize("value", [2.5, math.inf, -math.inf, math.nan, True, None, "3", [3], Quantity(3.0, "x", "3 s")])
def test_nothing_else_is_a_whole_number(value: object) -> None:
    assert as_whole_number(value) is None
