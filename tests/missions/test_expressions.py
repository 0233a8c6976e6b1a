"""Expressions: what they can say, and that they can do nothing else."""

import keyword
from dataclasses import dataclass

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from config.units import Quantity
from missions.language.expressions import MAX_LENGTH, MAX_NESTING, TOO_DEEP_MESSAGE, ExpressionError, parse
from missions.language.kinds import RESERVED_WORDS
from missions.language.operators import MAX_TEXT

DEEP = (
    "-" * (MAX_LENGTH - 1) + "1",
    "not " * 240 + "true",
    "+".join(["count"] * (MAX_NESTING + 1)),
    "abs(" * 120 + "count" + ")" * 120,
    "x" + "[0]" * 120,
    "thing" + ".seen" * 120,
    "[" * 120 + "]" * 120,
)


@dataclass
class Thing:
    """Something with members, as a robot's state has."""

    seen: bool = True
    percent: float | None = None
    _secret: tuple[str, ...] = ("hidden",)

    def method(self) -> str:
        return "called"

    @property
    def broken(self) -> str:
        raise KeyError("no reply")


class Contrary:
    """Something that cannot be compared, nor asked whether it is true."""

    def __bool__(self) -> bool:
        raise ValueError("neither true nor false")

    def __eq__(self, other: object) -> bool:
        raise TypeError("not comparable")

    __hash__ = None  # type: ignore[assignment]  # as Python does for a class with __eq__


SCOPE: dict[str, object] = {
    "count": 3,
    "share": 0.5,
    "name": "Anna",
    "names": ["Anna", "Ben"],
    "patience": Quantity(60.0, "duration", "60 s"),
    "half": 0.5,
    "thing": Thing(),
    "contrary": Contrary(),
    "place": {"x": 1.5, "_y": 2},
    "nothing": None,
    "pair": (1, 2),
}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3", 7),
        ("7 // 2 + 7 % 4", 6),
        ("-count + +1", -2),
        ("count / 2", 1.5),
        ("1 < count <= 3", True),
        ("not count == 3 or share > 1", False),
        ("true and not false", True),
        ("null == none", True),
        ("nothing == null", True),
        ("name == 'Anna'", True),
        ("'Good day, ' + name", "Good day, Anna"),
        ("name in ['Anna', 'Ben']", True),
        ("name not in names", False),
        ("'x' in place", True),
        ("'nn' in name", True),
        ("'An na' in name", False),
        ("'yes' if thing.seen else 'no'", "yes"),
        ("place.x", 1.5),
        ("patience / 2", 30.0),
        ("patience > 30 s", True),
        ("min(count, 2)", 2),
        ("max([1, 5, count])", 5),
        ("abs(-2.5)", 2.5),
        ("round(2.567, 1)", 2.6),
        ("round(2.4)", 2),
        ("len(names) + len(name)", 6),
        ("names[0]", "Anna"),
        ("names[-1] + names[count - 2]", "BenBen"),
        ("[1, 2][1]", 2),
        ("pair[0]", 1),
        ("  1 +\n  2  ", 3),
        ("1or 2", True),
        (r"'\d' == '\\d'", True),
    ],
)
def test_expression_evaluates_to_its_value(text: str, value: object) -> None:
    found = parse(text).evaluate(SCOPE)
    assert found == value
    assert isinstance(found, bool) is isinstance(value, bool)


def test_and_and_or_short_circuit() -> None:
    assert parse("true or missing").evaluate({}) is True
    assert parse("false and missing").evaluate({}) is False


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "open('x')",
        "eval('1')",
        "print(1)",
        "thing._secret",
        "thing.__class__",
        "thing.\uff3f\uff3fclass\uff3f\uff3f",  # full-width signs, which Python reads as plain underscores
        "place._y",
        "name.upper()",
        "name.format(thing)",
        "thing.method()",
        "len(x=1)",
        "len(*names)",
        "[*names]",
        "names[0:1]",
        "names[0, 1]",
        "{1: 2}",
        "{1, 2}",
        "[x for x in names]",
        "(x for x in names)",
        "lambda: 1",
        "(x := 1)",
        "f'{thing._secret}'",
        "f'{count}'",
        "2 ** 9",
        "1 << 9",
        "1 | 2",
        "~1",
        "1j",
        "b'x'",
        "...",
        "await name",
        "yield 1",
        "count is 3",
        "'x' @ 'y'",
        "9" * 30,
        "1e999",
    ],
)
def test_disallowed_syntax_is_refused_by_the_parser(text: str) -> None:
    with pytest.raises(ExpressionError):
        parse(text)


@pytest.mark.parametrize("text", ["name.upper", "names.append", "pair.count", "count.real", "share.hex", "nothing.x"])
def test_values_of_python_have_no_members(text: str) -> None:
    with pytest.raises(ExpressionError, match="is not there"):
        parse(text).evaluate(SCOPE)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("thing.sen", "'sen' is not there; did you mean 'seen'?"),
        ("thing.method", "'method' is not there; known are: broken, percent, seen"),
        ("place.long", "'long' is not there; known are: x"),
        ("name.upper", "'upper' is not there"),
        ("nothing.x", "'x' is not there: nothing is stored yet"),
    ],
)
def test_missing_member_lists_the_existing_ones(text: str, message: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text).evaluate(SCOPE)
    assert str(caught.value) == message


@pytest.mark.parametrize("text", ["thing.method", "thing.missing", "place.missing"])
def test_methods_and_missing_members_are_refused(text: str) -> None:
    with pytest.raises(ExpressionError, match="is not there"):
        parse(text).evaluate(SCOPE)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "an empty expression"),
        ("  ", "an empty expression"),
        ("1 +", "'1 +' is not an expression; something is missing at its end"),
        ("1 2", "'1 2' is not an expression"),
        ("count = 3", "'count = 3' is not an expression; compare with '=='"),
        ("a && b", "'a && b' is not an expression; write 'and' for '&&'"),
        (
            "a > 1 ? 2 : 3",
            "'a > 1 ? 2 : 3' is not an expression; write 'A if CONDITION else B' for 'CONDITION ? A : B'",
        ),
        ("a || b", "'a || b' is not an expression; write 'or' for '||'"),
        ("!a", "'!a' is not an expression; write 'not' for '!'"),
        ("${a} > ${b}", "'${a} > ${b}' is not an expression; write it without '${' and '}'"),
        ("import os", "'import os' is not an expression"),
        ("a\0b", "'a\0b' is not an expression"),
        ("\ud800", "'\ud800' is not an expression"),
        ("sum(names)", "'sum' cannot be called; the functions are min, max, abs, round, len, random"),
        ("thing._x", "'_x' is private"),
        ("x" * (MAX_LENGTH + 1), f"an expression of more than {MAX_LENGTH} characters"),
        *((text, TOO_DEEP_MESSAGE) for text in DEEP),
    ],
)
def test_unparsable_expression_gives_a_reason(text: str, message: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("missing", "'missing' is not set"),
        ("1 / 0", "'1 / 0' divides by zero"),
        ("count % 0", "'count % 0' divides by zero"),
        ("name * 3", "'name * 3': cannot calculate with the text 'Anna'"),
        ("name % 3", "'name % 3': cannot calculate with the text 'Anna'"),
        ("name + 3", "'name + 3': cannot calculate with the text 'Anna'"),
        ("names - names", "'names - names': cannot calculate with a list"),
        ("pair * 9", "'pair * 9': cannot calculate with a list"),
        ("-name", "'-name': cannot calculate with the text 'Anna'"),
        ("nothing + 1", "'nothing + 1': cannot calculate with nothing"),
        ("thing + 1", "'thing + 1': cannot calculate with a Thing"),
        ("thing.percent < 20", "'thing.percent < 20': cannot compare nothing with 20"),
        ("name < true", "'name < true': cannot compare the text 'Anna' with true"),
        ("1 in 2", "'1 in 2': cannot compare 1 with 2"),
        ("contrary == 1", "'contrary == 1': cannot compare a Contrary with 1"),
        ("not contrary", "'not contrary': neither true nor false"),
        ("[names]", "'[names]': a list cannot contain a list"),
        ("round(1, 0 - 99999)", "'round(1, 0 - 99999)': round takes 0 to 15 digits"),
        ("round(1.5, 2 m)", "'round(1.5, 2 m)': round takes 0 to 15 digits"),
        ("round(1.5, 'x')", "'round(1.5, 'x')': round takes 0 to 15 digits"),
        ("abs(name)", "'abs(name)': cannot calculate with the text 'Anna'"),
        ("1e300 * 1e300", "'1e300 * 1e300': a number out of range"),
        ("999999999 * 999999999", "'999999999 * 999999999': a number out of range"),
        ("thing.broken", "'broken' cannot be read: 'no reply'"),
        ("names[2]", "'names[2]': index 2 out of range (length 2)"),
        ("names[-3]", "'names[-3]': index -3 out of range (length 2)"),
        ("names[0.5]", "'names[0.5]': list indexes are whole numbers from 0, got 0.5"),
        ("names[true]", "'names[true]': list indexes are whole numbers from 0, got true"),
        ("name[0]", "'name[0]': only lists have numbered members, not the text 'Anna'"),
        ("place['x']", "'place['x']': only lists have numbered members, not a mapping"),
    ],
)
def test_failed_evaluation_gives_a_reason(text: str, message: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text).evaluate(SCOPE)
    assert str(caught.value) == message


@pytest.mark.parametrize("text", ["len(1)", "max([])", "min()", "max(1, name)", "abs()", "len(1, 2)"])
def test_wrong_function_call_is_an_expression_error(text: str) -> None:
    with pytest.raises(ExpressionError):
        parse(text).evaluate(SCOPE)


def fed_back(text: str, value: object) -> object:
    """Give an expression its own result as ``n`` until it fails; return the last one."""
    expression = parse(text)
    for _ in range(100):
        try:
            value = expression.evaluate({"n": value})
        except ExpressionError:
            return value
    pytest.fail(f"{text} goes on for ever")


def test_an_integer_cannot_grow_without_end() -> None:
    value = fed_back("n * n", 10)
    with pytest.raises(ExpressionError, match="a number out of range"):
        parse("n * n").evaluate({"n": value})


def test_a_text_cannot_grow_without_end() -> None:
    value = fed_back("n + n", "ha")
    assert isinstance(value, str)
    assert MAX_TEXT / 2 < len(value) <= MAX_TEXT
    with pytest.raises(ExpressionError, match="a text of more than 10,000 characters"):
        parse("n + n").evaluate({"n": value})


def test_a_list_cannot_grow_without_end() -> None:
    with pytest.raises(ExpressionError, match="a list cannot contain a list"):
        parse("[n, n]").evaluate({"n": fed_back("[n, n]", 1)})


@pytest.mark.parametrize("text", ["2 * 1.5", "half", "-half", "half / 2", "abs(-half)", "round(2.345, 1)", "7 / 2"])
def test_numbers_without_units_stay_numbers(text: str) -> None:
    assert type(parse(text).evaluate(SCOPE)) is float


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("patience * 2", "120 s"),
        ("patience * half", "30 s"),
        ("-patience", "-60 s"),
        ("patience + 1 min", "120 s"),
        ("3 m / patience", "0.05 m/s"),
        ("1 / patience * 60", "1 Hz"),
        ("2 m * 3 m", "6 m^2"),
        ("90 deg / 2 s / 1 s", "45 deg/s^2"),
        ("1 rad * 3 m", "3 m rad"),
        ("10 m / (2 s * 1 s * 1 s)", "5 m/s^3"),
        ("1 / (2 s * 1 s)", "0.5 1/s^2"),
        ("round(1.234 rad)", "71 deg"),
        ("round(1.26 m, 1)", "1.3 m"),
        ("max(1 m, 120 cm)", "120 cm"),
        ("min([3 s, patience])", "3 s"),
        ("abs(0 m - 2 m)", "2 m"),
        ("7 s % 4 s", "3 s"),
        ("1.5m + .5 m+1e1 cm", "2.1 m"),
        ("20 % + 30 %", "50 %"),
    ],
)
def test_calculation_with_quantities_gives_a_quantity(text: str, shown: str) -> None:
    found = parse(text).evaluate(SCOPE)
    assert isinstance(found, Quantity)
    assert str(found) == shown


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("patience / 1 min", 1.0),
        ("7 m // 2 m", 3.0),
        ("20 % * 5", 1.0),
        ("20 % + 1", 1.2),
        ("20 % 3", 2),
        ("7%4", 3),
        ("1 m > 20 cm", True),
        ("180 deg > 3 rad", True),
        ("'5 m' + \" 3 s\"", "5 m 3 s"),
        ("2 min == 120 s and 20 % < 0.3", True),
        ("len([1 m, 2 m])", 2),
    ],
)
def test_quantities_compare_and_divide_to_plain_values(text: str, value: object) -> None:
    found = parse(text).evaluate(SCOPE)
    assert found == pytest.approx(value)
    assert not isinstance(found, Quantity)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("patience + 1", "cannot add a duration and a number"),
        ("1 - patience", "cannot calculate the difference of a number and a duration"),
        ("1 m % patience", "cannot calculate the remainder of a length and a duration"),
        ("1 m // 2", "cannot calculate the whole quotient of a length and a number"),
        ("patience > 30", "cannot compare a duration and a number"),
        ("1 m == 1 s", "cannot compare a length and a duration"),
        ("max(1 m, 2)", "cannot compare a length and a number"),
        ("min([1 m * 1 m, 2 m])", "cannot compare a quantity in m^2 and a length"),
        ("1 m + 'a'", "cannot calculate with the text 'a'"),
        ("1 m < 'a'", "cannot compare 1 m with the text 'a'"),
        ("[1][1 m]", "list indexes are whole numbers from 0, got 1 m"),
    ],
)
def test_incompatible_dimensions_are_named(text: str, message: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text).evaluate(SCOPE)
    assert str(caught.value) == f"'{text}': {message}"


def test_the_power_of_a_dimension_cannot_grow_without_end() -> None:
    with pytest.raises(ExpressionError, match="a dimension out of range"):
        parse("n * n").evaluate({"n": fed_back("n * n", Quantity(1.0, "length"))})


def test_quantities_do_not_shift_columns() -> None:
    expression = parse("é * 1.5 m/s > 2 min and x", 3)
    assert [(read.name, read.column) for read in expression.reads] == [("é", 3), ("x", 27)]
    with pytest.raises(ExpressionError) as caught:
        parse("1 m/s + foo(2 s)")
    assert caught.value.column == 8


def test_expression_reports_its_reads_with_columns() -> None:
    expression = parse("  größe > 1 and battery.percent.x < größe + len('a') and true", 10)
    assert expression.names == ("größe", "battery")
    assert [(read.dotted, read.column, read.length) for read in expression.reads] == [
        ("größe", 12, 5),
        ("battery.percent", 26, 15),
        ("größe", 46, 5),
    ]


@pytest.mark.parametrize(
    ("text", "piece"),
    [
        ("count + foo(1)", "foo"),
        ("  é + x._y + 1", "x._y"),
        ("1 + [2][0:1]", "[2][0:1]"),
        ("'é' and (lambda: 1)", "lambda: 1"),
    ],
)
def test_expression_error_has_a_column(text: str, piece: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert caught.value.column is not None
    assert text[caught.value.column :][: caught.value.length] == piece


SIGNS = [
    *"()[]{}.,:+-*/%<>=!'\"_ \n\\@&|^~0123456789abcé",
    *["and ", "or ", "not ", " in ", " if ", " else ", "lambda ", "==", "//", "**", "${"],
    *["true", "null", "min(", "max(", "len(", "round(", "abs("],
    *SCOPE,
    *[".x", ".seen", "._secret", ".__class__", ".broken", "contrary", "1e9", "9999999999"],
]


def reads_or_says_why(text: str) -> None:
    try:
        expression = parse(text)
    except ExpressionError as error:
        assert error.column is None or 0 <= error.column <= len(text)  # noqa: PT017 - either outcome is right
        return
    for read in expression.reads:
        assert 0 <= read.column < read.column + read.length <= len(text)
    try:
        value = expression.evaluate(SCOPE)
    except ExpressionError:
        return
    assert value is not Thing._secret
    assert not callable(value)


@given(st.text(st.characters(exclude_categories=()), max_size=60))
@example("(" * 400)
@example("[" * 400 + "]" * 400)
@example("-" * 900 + "1")
@example("not " * 200 + "1")
@example("1" + "+1" * 400)
@example("1" + "<1" * 400)
@example("thing" + ".x" * 400)
def test_no_text_does_more_than_be_refused(text: str) -> None:
    reads_or_says_why(text)


@given(st.lists(st.sampled_from(SIGNS), max_size=12).map("".join))
def test_no_heap_of_signs_reaches_anything_private_or_raises(text: str) -> None:
    reads_or_says_why(text)


NUMBERS = st.sampled_from(
    ["1", "0", "2.5", "count", "share", "patience", "half", "name", "nothing", "names", "contrary"]
)
FORMULAS = st.recursive(
    NUMBERS,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "//", "%", "<", "==", "in", "and", "or"]), inner).map(
            lambda parts: f"({parts[0]} {parts[1]} {parts[2]})"
        ),
        st.tuples(st.sampled_from(["min", "max", "round", "abs", "len"]), inner, inner).map(
            lambda parts: f"{parts[0]}({parts[1]}, {parts[2]})"
        ),
        inner.map(lambda part: f"-{part}"),
        inner.map(lambda part: f"(not {part})"),
        st.tuples(inner, inner).map(lambda parts: f"[{parts[0]}, {parts[1]}]"),
    ),
    max_leaves=12,
)


@given(FORMULAS)
def test_every_well_formed_formula_has_a_value_or_a_reason(text: str) -> None:
    reads_or_says_why(text)


@pytest.mark.parametrize("word", sorted(set(keyword.kwlist) - RESERVED_WORDS))
def test_python_keyword_may_be_a_name(word: str) -> None:
    found = parse(f"'from {word}: ' + {word} + é.{word} + \"{word}\"")
    assert [(read.dotted, found.text[read.column :][: read.length]) for read in found.reads] == [
        (word, word),
        (f"é.{word}", f"é.{word}"),
    ]
    assert found.evaluate({word: "Ben", "é": {word: "Anna"}}) == f"from {word}: BenAnna{word}"
