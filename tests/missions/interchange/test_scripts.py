"""Scripts of BehaviorTree.CPP become expressions of missions with the same value."""

from collections.abc import Mapping

import pytest

from missions.language.expressions import parse
from missions.plugins.interchange.scripts import ScriptError, as_condition, negate, parse_script


def condition(text: str, kinds: Mapping[str, str | None] | None = None) -> str:
    formula = parse_script(text, kinds=kinds).condition
    assert formula is not None
    return formula.text


@pytest.mark.parametrize(
    ("script", "expression"),
    [
        ("a && b", "a and b"),
        ("!a || b", "(not a) or b"),
        ("a == 1 && b != 'x'", "a == 1 and b != 'x'"),
        ("1 < a < 9", "1 < a < 9"),
        ("(a + 1) * -2", "(a + 1) * -2"),
        ("a - (b - c)", "a - (b - c)"),
        ("a - b - c", "a - b - c"),
        ("a ? 1 : 2", "1 if a else 2"),
        ("0x10 == a", "16 == a"),
        ('a == "it\'s"', 'a == "it\'s"'),
        ("1.50 <= a", "1.5 <= a"),
    ],
)
def test_operators_are_translated(script: str, expression: str) -> None:
    assert condition(script) == expression
    parse(condition(script))


def test_and_binds_as_tightly_as_or() -> None:
    assert condition("a || b && c") == "(a or b) and c"
    scope = {"a": True, "b": False, "c": False}
    assert parse(condition("a || b && c")).evaluate(scope) is False  # as in BehaviorTree.CPP 4


def test_assignments_are_read_in_order() -> None:
    script = parse_script("n := 0; n += 2; who = n > 1 ? 'all' : 'one'")
    assert [(each.entry, each.formula.text) for each in script.assignments] == [
        ("n", "0"),
        ("n", "n + 2"),
        ("who", "'all' if n > 1 else 'one'"),
    ]
    assert script.reads == ()
    assert parse_script("n += m").reads == ("n", "m")


def test_flags_and_numbers_are_compared_as_one_kind() -> None:
    assert condition("open == true", {"open": "flag"}) == "open"
    assert condition("open == 0", {"open": "flag"}) == "not open"
    assert condition("count == true", {"count": "number"}) == "count == 1"
    assert condition("count == '5'", {"count": "number"}) == "count == 5"
    assert condition("unknown == true", {}) == "not not unknown"
    assert condition("unknown == false", {}) == condition("unknown != true", {}) == "not unknown"
    assert condition("word == 5", {"word": "text"}) == "word == '5'"


def test_conditions_are_negated_and_made_boolean() -> None:
    formula = parse_script("a < 3").condition
    assert formula is not None
    assert negate(formula).text == "a >= 3"
    assert negate(negate(formula)).text == "a < 3"
    number = parse_script("a").condition
    assert number is not None
    assert as_condition(number).text == "not not a"


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("a & 1", "bit operator"),
        ("~a", "bit operator"),
        ("a %% 2", "unexpected '%'"),
        ("(a", "is missing"),
        ("(a := 1) == 1", "inside an expression"),
        ("a b", "unexpected 'b'"),
        ("a ==", "missing at its end"),
        ("(" * 100 + "a", "nested too deeply"),
        ("-" * 100 + "a", "nested too deeply"),
        ("a" * 6000, "characters"),
    ],
)
def test_other_scripts_are_refused(script: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        parse_script(script)
