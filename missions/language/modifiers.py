"""Parsing of the values of modifiers."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

from config.units import quoted_value
from config.yaml_nodes import Mapping as Entries
from config.yaml_nodes import Node, Scalar
from missions.language.check_context import CheckContext, hole_hint
from missions.language.expressions import INVALID_VALUE, Convert, ExpressionError, Value, as_whole_number, in_si, parse
from missions.language.inference import CONDITION_KIND
from missions.language.nodes import HALT_LIMIT, MODIFIERS
from missions.language.param_hints import counted


def read_modifier(context: CheckContext, word: str, node: Node) -> Value:
    """Return the value of the modifier ``word`` from its node."""
    modifier = MODIFIERS[word]
    if not isinstance(node, Scalar):
        names = [*node.keys()] if isinstance(node, Entries) else []
        hint = hole_hint(f"{{{names[0]}}}") if len(names) == 1 else ""
        context.fault(node.mark, f"'{word}' needs {modifier.takes}", hint)
        return INVALID_VALUE
    return _READERS[modifier.value](context, word, node)


MAX_HALT_LIMIT = 10.0
"""Maximum seconds of a ``finally``: a halt must not take longer, since other nodes wait for it."""


def read_halt_limit(context: CheckContext, node: Node) -> Value:
    """Return the time limit of a ``finally`` from the value of ``halt_limit``, which must be a constant duration."""

    def limited(value: object) -> float:
        seconds = in_si(value, "duration")
        if not 0 < seconds <= MAX_HALT_LIMIT:
            raise ValueError(f"must be longer than 0 s, and at most {MAX_HALT_LIMIT:g} s, got {quoted_value(value)}")
        return seconds

    if not isinstance(node, Scalar) or "${" in node.text:
        context.fault(
            node.mark, f"'{HALT_LIMIT}' needs a duration such as '2 s'", "it must be known before the mission runs"
        )
        return INVALID_VALUE
    return context.convert_constant(node, node.text, f"'{HALT_LIMIT}'", limited)


def outdent_hint(key: str, behaviour: str) -> str:
    """Return a hint if ``key``, among the arguments of ``behaviour``, is a modifier that must stand beside it.

    Empty for other keys.
    """
    return f"outdent it, to stand beside '{behaviour}'" if key in {*MODIFIERS, "as", "name"} else ""


def _duration(context: CheckContext, word: str, node: Scalar) -> Value:
    def positive(value: object) -> float:
        seconds = in_si(value, "duration")
        if seconds <= 0:
            raise ValueError("must be longer than 0 s")
        return seconds

    return context.read_value(
        node if node.value is None else replace(node, value=node.text), f"'{word}'", positive, "duration"
    )


def _count(context: CheckContext, word: str, node: Scalar) -> Value:
    def count(value: object) -> int | None:
        if value == "forever":
            return None
        number = as_whole_number(value)
        if number is None or number < 1:
            number_alone = counted(value) if isinstance(value, str) else ""
            hint = f": write {number_alone}" if number_alone else ""
            raise ValueError(f"needs a count of 1 or more, or forever, got {quoted_value(value)}{hint}")
        return number

    return context.read_value(node, f"'{word}'", count, "count")


def _condition(context: CheckContext, word: str, node: Scalar) -> Value:
    return read_condition(context, f"'{word}'", node)


def read_condition(context: CheckContext, label: str, node: Scalar) -> Value:
    """Read an expression that must be true or false; ``label`` begins an error message."""
    return read_expression(context, label, node, bool, CONDITION_KIND)


def read_expression(context: CheckContext, label: str, node: Scalar, convert: Convert, kind: str = "") -> Value:
    """Read an expression of the given ``kind`` that is evaluated later; ``label`` begins an error message."""
    # People write both `if: count < 3` and `if: ${count < 3}`.
    hole = re.fullmatch(r"\s*\$\{(.*)\}\s*", node.text, re.DOTALL)
    try:
        expression = parse(hole[1], hole.start(1)) if hole else parse(node.text)
    except ExpressionError as error:
        context.expression_fault(node, error, label)
        return INVALID_VALUE
    return context.read_formula(node, expression, label, convert, kind)


def _constant(context: CheckContext, word: str, node: Scalar) -> Value:
    constants = MODIFIERS[word].constants
    if not any(type(node.value) is type(each) and node.value == each for each in constants):
        context.fault(node.mark, f"'{word}' takes only {MODIFIERS[word].takes}, got {quoted_value(node.value)}")
        return INVALID_VALUE
    return Value(node.value)


YES_NO_WORDS = ("yes", "no", "on", "off")
"""Words that YAML 1.1 reads as true or false; modifiers accept only ``true`` and ``false``."""


def _once(context: CheckContext, word: str, node: Scalar) -> Value:
    if node.value is True:
        return Value(True)
    if isinstance(node.value, str) and node.text not in YES_NO_WORDS:
        return read_expression(context, f"'{word}'", node, lambda found: found)
    context.fault(node.mark, f"'{word}' takes only {MODIFIERS[word].takes}, got {quoted_value(node.value)}")
    return INVALID_VALUE


_READERS: Mapping[str, Callable[[CheckContext, str, Scalar], Value]] = {
    "condition": _condition,
    "constant": _constant,
    "count": _count,
    "duration": _duration,
    "expression": _once,
}
"""Functions that read the value of a modifier, by the value's type."""
