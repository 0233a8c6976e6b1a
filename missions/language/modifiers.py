"""The modifiers: what may stand beside a behaviour, and what value each takes."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from config.marked import Node, Scalar
from config.units import seen
from missions.language.expressions import ExpressionError, parse
from missions.language.notes import Notes
from missions.language.values import UNREAD, Convert, Value, in_si, whole


@dataclass(frozen=True, slots=True)
class Modifier:
    """One modifier: what its value is ("a duration"), and what it does to the node that it stands beside."""

    takes: str
    help: str
    read: Callable[[Notes, str, Scalar], Value]


def read_modifier(notes: Notes, word: str, node: Node) -> Value:
    """Read the value of the modifier ``word``."""
    modifier = MODIFIERS[word]
    if not isinstance(node, Scalar):
        notes.fault(node.mark, f"'{word}' needs {modifier.takes}")
        return UNREAD
    return modifier.read(notes, word, node)


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


def _one_of(*answers: bool | str) -> Callable[[Notes, str, Scalar], Value]:
    """Return a reader for a modifier that has one value, or one of a few."""

    def read(notes: Notes, word: str, node: Scalar) -> Value:
        if not any(type(node.value) is type(answer) and node.value == answer for answer in answers):
            notes.fault(node.mark, f"'{word}' takes only {MODIFIERS[word].takes}, got {seen(node.value)}")
            return UNREAD
        return Value(node.value)

    return read


NEITHER = ("yes", "no", "on", "off")
"""Words that people write for true and false, which are neither here."""


def _once(notes: Notes, word: str, node: Scalar) -> Value:
    if node.value is True:
        return Value(True)
    if isinstance(node.value, str) and node.text not in NEITHER:
        return read_expression(notes, f"'{word}'", node, lambda found: found)
    notes.fault(node.mark, f"'{word}' takes only {MODIFIERS[word].takes}, got {seen(node.value)}")
    return UNREAD


IF = "asked once, at the start; false skips the node, which counts as success; for 'else' use switch"
ON_RUNNING = "a node that still runs after its tick is halted, and counts as that"
ONCE = "after its first end, keeps answering with that result; with an expression, while its value stays the same"

MODIFIERS = {
    "if": Modifier("an expression", IF, _condition),
    "while": Modifier("an expression", "asked at every tick; once false, the node is halted and fails", _condition),
    "until": Modifier("an expression", "asked at every tick; once true, the node is halted and succeeds", _condition),
    "timeout": Modifier("a duration", "fails, halting the node, when it still runs after that long", _duration),
    "retry": Modifier("a count or forever", "starts again after a failure; the count is of attempts", _count),
    "repeat": Modifier("a count or forever", "starts again after a success; the count is of runs", _count),
    "invert": Modifier("true", "success for failure and failure for success", _one_of(True)),
    "on_failure": Modifier("succeed", "a failure counts as success", _one_of("succeed")),
    "on_success": Modifier("fail", "a success counts as failure", _one_of("fail")),
    "on_running": Modifier("succeed or fail", ON_RUNNING, _one_of("succeed", "fail")),
    "hold": Modifier("a duration", "succeeds once the node has succeeded at every tick for that long", _duration),
    "delay": Modifier("a duration", "waits before the node starts", _duration),
    "cooldown": Modifier("a duration", "fails without starting within that long after its last success", _duration),
    "once": Modifier("true or an expression", ONCE, _once),
}
"""Every modifier by its word."""
