"""``switch`` and ``reactive_switch``: one of several behaviours, selected by the value of an expression.

The cases must be possible values of the expression.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

from config.diagnostics import Diagnostic, suggest_from
from config.units import NUMBER, quoted_value
from config.yaml_nodes import Mapping, Node, Scalar
from missions.language.check_context import CheckContext
from missions.language.expressions import format_value
from missions.language.inference import kind_of_result
from missions.language.kinds import FLAG, TEXT, Kind, describe_kind, is_numeric, join_kinds, kind_of_value
from missions.language.lists import default_value
from missions.language.modifiers import outdent_hint, read_expression
from missions.language.plan import Step

YES_NO_MEANINGS = {"yes": "true", "on": "true", "no": "false", "off": "false"}
"""Words in the cases of a switch that may mean true or false, each with that meaning."""


def impossible_cases(step: Step, kind: Kind) -> Iterator[Diagnostic]:
    """Yield an error for each case of a switch that no value of this kind (static type) of its expression equals."""
    for case, mark in zip(step.cases, step.case_marks, strict=True):
        if not _can_be(case, kind):
            word = str(case).lower() if isinstance(case, bool) else format_value(case)
            yield Diagnostic(
                step.source,
                mark,
                f"'on' is {describe_kind(kind)} and never equals {quoted_value(word)}",
                _case_hint(word, kind),
            )


def case_key(value: object) -> tuple[str, str]:
    """Return a key by which a switch compares a value with its cases: equal keys mean that they match.

    A number has one key in all notations (``1``, ``1.0``, ``01``), also as a text. ``true`` matches neither 1 nor
    ``yes``.
    """
    if isinstance(value, str) and _NUMBER.fullmatch(value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return type(value).__name__, format_value(value)
    dimension = getattr(value, "dimension", "share")  # a plain number is a share: 0.2 equals 20 %
    return dimension, f"{float(value) + 0.0:.12g}"  # turns -0 into 0


_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


def _repeated_cases(step: Step, written: Sequence[Scalar]) -> Iterator[Diagnostic]:
    """Yield an error for each case that equals an earlier one in another notation, such as ``1`` and ``1.0``.

    Cases with the same text have been reported as repeated keys.
    """
    first: dict[tuple[str, str], Scalar] = {}
    for case, key in zip(step.cases, written, strict=True):
        before = first.setdefault(case_key(case), key)
        if before.text != key.text:
            message = (
                f"the case {quoted_value(key.text)} repeats the case {quoted_value(before.text)} "
                f"(first at line {before.mark.line})"
            )
            yield Diagnostic(step.source, key.mark, message)


def _can_be(case: object, kind: Kind) -> bool:
    """Return whether a case can equal a value of this kind (static type); the case "3" equals a number and a text."""
    if case is None or not (kind in (FLAG, TEXT) or is_numeric(kind)):
        return True
    if kind == FLAG or isinstance(case, bool):
        return kind == FLAG and isinstance(case, bool)
    if kind == TEXT:
        return True
    if isinstance(case, str) and join_kinds(kind, NUMBER) is not None:
        with suppress(ValueError):
            case = float(case)
    return is_numeric(kind_of_value(case)) and join_kinds(kind, kind_of_value(case)) is not None


def _case_hint(word: str, kind: Kind) -> str:
    if kind != FLAG:
        return ""
    meaning = YES_NO_MEANINGS.get(word.lower())
    return f"write {meaning}: for {word}:" if meaning else "the cases can be true: and false:"


SWITCH_KEYS = ("on", "cases", "default")
SWITCH_EXAMPLE = "write {}: {{on: face.count, cases: {{1: ..., 2: ...}}, default: ...}}"


def read_switch(
    context: CheckContext, key: Scalar, value: Node | None, name: str, read_step: Callable[[CheckContext, Node], Step]
) -> Step | None:
    """Return the step of a ``switch`` or ``reactive_switch``; None if it has errors."""
    word, form = key.text, SWITCH_EXAMPLE.format(key.text)
    if not isinstance(value, Mapping):
        context.fault(key.mark, f"'{word}' needs 'on' and 'cases'", form)
        return None
    strange = [name_of for name_of, _ in value.entries if name_of.text not in SWITCH_KEYS]
    for name_of in strange:
        hint = outdent_hint(name_of.text, word) or suggest_from(name_of.text, SWITCH_KEYS)
        context.fault(name_of.mark, f"'{word}' has no key '{name_of.text}'", hint)
    on, cases, default = (value.get(each) for each in SWITCH_KEYS)
    if strange and (on is None or cases is None):
        return None  # the unknown key is probably a misspelling of the missing one: report one error, not two
    if not isinstance(on, Scalar):
        context.fault(key.mark if on is None else on.mark, f"'{word}' needs 'on', an expression", form)
        return None
    chosen = read_expression(context, "'on'", on, lambda found: found)
    if not isinstance(cases, Mapping) or not cases.entries:
        mark = key.mark if cases is None else cases.mark
        context.fault(mark, f"'{word}' needs 'cases', each a value with a behaviour", form)
        return None
    branches = [node for _, node in cases.entries] + ([] if default is None else [default])
    step = Step(
        word,
        name,
        key.mark,
        context.source,
        tuple(read_step(context, node) for node in branches),
        arguments={"on": chosen},
        cases=tuple(default_value(case) for case, _ in cases.entries),
        case_marks=tuple(case.mark for case, _ in cases.entries),
        arguments_as_written={"on": on.text},
    )
    repeated = _repeated_cases(step, [case for case, _ in cases.entries])
    for fault in (*impossible_cases(step, kind_of_result(chosen, context.param_kinds_of(chosen))), *repeated):
        context.fault(fault.mark, fault.message, fault.suggestion)
    return step
