"""The values of modifiers, read by their types."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

from config.marked import Node, Scalar
from config.units import seen
from missions.language.expressions import UNREAD, Convert, ExpressionError, Value, in_si, parse, whole
from missions.language.nodes import MODIFIERS
from missions.language.notes import Notes


def read_modifier(notes: Notes, word: str, node: Node) -> Value:
    """Read the value of the modifier ``word``."""
    modifier = MODIFIERS[word]
    if not isinstance(node, Scalar):
        notes.fault(node.mark, f"'{word}' needs {modifier.takes}")
        return UNREAD
    return _READERS[modifier.value](notes, word, node)


def outdent(word: str, behaviour: str) -> str:
    """Say what to do with a modifier that stands among the arguments of a behaviour; nothing for any other word."""
    return f"outdent it, to stand beside '{behaviour}'" if word in {*MODIFIERS, "as", "name"} else ""


def _duration(notes: Notes, word: str, node: Scalar) -> Value:
    def positive(value: object) -> float:
        seconds = in_si(value, "duration")
        if seconds <= 0:
            raise ValueError("must be longer than 0 s")
        return seconds

    return notes.value(
        node if node.value is None else replace(node, value=node.text), f"'{word}'", positive, "duration"
    )


def _count(notes: Notes, word: str, node: Scalar) -> Value:
    def count(value: object) -> int | None:
        if value == "forever":
            return None
        number = whole(value)
        if number is None or number < 1:
            raise ValueError(f"needs a count of 1 or more, or forever, got {seen(value)}")
        return number

    return notes.value(node, f"'{word}'", count, "count")


def _condition(notes: Notes, word: str, node: Scalar) -> Value:
    return read_expression(notes, f"'{word}'", node, bool)


def read_expression(notes: Notes, what: str, node: Scalar, convert: Convert) -> Value:
    """Read an expression that is asked later; ``what`` begins the message of a fault."""
    # Both `if: count < 3` and `if: ${count < 3}` are what people write.
    hole = re.fullmatch(r"\s*\$\{(.*)\}\s*", node.text, re.DOTALL)
    try:
        expression = parse(hole[1], hole.start(1)) if hole else parse(node.text)
    except ExpressionError as error:
        notes.wrong_expression(node, error, what)
        return UNREAD
    return notes.computed(node, expression, what, convert)


def _constant(notes: Notes, word: str, node: Scalar) -> Value:
    constants = MODIFIERS[word].constants
    if not any(type(node.value) is type(each) and node.value == each for each in constants):
        notes.fault(node.mark, f"'{word}' takes only {MODIFIERS[word].takes}, got {seen(node.value)}")
        return UNREAD
    return Value(node.value)


NEITHER = ("yes", "no", "on", "off")
"""Words that people write for true and false, which are neither here."""


def _once(notes: Notes, word: str, node: Scalar) -> Value:
    if node.value is True:
        return Value(True)
    if isinstance(node.value, str) and node.text not in NEITHER:
        return read_expression(notes, f"'{word}'", node, lambda found: found)
    notes.fault(node.mark, f"'{word}' takes only {MODIFIERS[word].takes}, got {seen(node.value)}")
    return UNREAD


_READERS: Mapping[str, Callable[[Notes, str, Scalar], Value]] = {
    "condition": _condition,
    "constant": _constant,
    "count": _count,
    "duration": _duration,
    "expression": _once,
}
"""How the value of a modifier is read, by its type."""
