"""``switch`` and ``reactive_switch``: one of several behaviours, chosen by the value of an expression.

The cases must be what the expression can make.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

from config.faults import Diagnostic, one_of
from config.marked import Mapping, Node, Scalar
from config.units import NUMBER, seen
from missions.language.arguments import default_value
from missions.language.expressions import shown
from missions.language.inference import kind_made
from missions.language.kinds import FLAG, TEXT, Kind, is_size, joined, kind_of_value, told
from missions.language.modifiers import outdent, read_expression
from missions.language.notes import Notes
from missions.language.plan import Step

MEANT = {"yes": "true", "on": "true", "no": "false", "off": "false"}
"""What people write for true and false."""


def misfit_cases(step: Step, kind: Kind) -> Iterator[Diagnostic]:
    """Yield the mistakes in the cases of a switch whose expression is of a kind: those that it never is."""
    for case, mark in zip(step.cases, step.case_marks, strict=True):
        if not _can_be(case, kind):
            word = str(case).lower() if isinstance(case, bool) else shown(case)
            yield Diagnostic(step.source, mark, f"'on' is {told(kind)}, and never {seen(word)}", _cure(word, kind))


def case_key(value: object) -> tuple[str, str]:
    """Return the kind of a value and its text: two cases with one key are one case, and a value takes that of its key.

    A number is itself however it is written (``1``, ``1.0``, ``01``), also as a text; true is neither 1 nor ``yes``.
    """
    if isinstance(value, str) and _NUMBER.fullmatch(value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return type(value).__name__, shown(value)
    dimension = getattr(value, "dimension", "share")  # a plain number is a share, as 20 % is 0.2
    return dimension, f"{float(value) + 0.0:.12g}"  # -0 is 0


_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


def _repeated(step: Step, written: Sequence[Scalar]) -> Iterator[Diagnostic]:
    """Yield the mistakes of cases that stand there before, written otherwise; the same text has been noted."""
    first: dict[tuple[str, str], Scalar] = {}
    for case, key in zip(step.cases, written, strict=True):
        before = first.setdefault(case_key(case), key)
        if before.text != key.text:
            message = (
                f"the case {seen(key.text)} is the case {seen(before.text)} again (first at line {before.mark.line})"
            )
            yield Diagnostic(step.source, key.mark, message)


def _can_be(case: object, kind: Kind) -> bool:
    """Say whether a case can be what is of a kind: a switch takes "3" for the number and for the text."""
    if case is None or not (kind in (FLAG, TEXT) or is_size(kind)):
        return True
    if kind == FLAG or isinstance(case, bool):
        return kind == FLAG and isinstance(case, bool)
    if kind == TEXT:
        return True
    if isinstance(case, str) and joined(kind, NUMBER) is not None:
        with suppress(ValueError):
            case = float(case)
    return is_size(kind_of_value(case)) and joined(kind, kind_of_value(case)) is not None


def _cure(word: str, kind: Kind) -> str:
    if kind != FLAG:
        return ""
    meant = MEANT.get(word.lower())
    return f"write {meant}: for {word}:" if meant else "the cases can be true: and false:"


KEYS = ("on", "cases", "default")
FORM = "write {}: {{on: face.count, cases: {{1: ..., 2: ...}}, default: ...}}"


def read_switch(
    notes: Notes, key: Scalar, value: Node | None, name: str, read_step: Callable[[Notes, Node], Step]
) -> Step | None:
    """Read a switch of either kind."""
    word, form = key.text, FORM.format(key.text)
    if not isinstance(value, Mapping):
        notes.fault(key.mark, f"'{word}' needs 'on' and 'cases'", form)
        return None
    strange = [name_of for name_of, _ in value.entries if name_of.text not in KEYS]
    for name_of in strange:
        hint = outdent(name_of.text, word) or one_of(name_of.text, KEYS)
        notes.fault(name_of.mark, f"'{word}' has no key '{name_of.text}'", hint)
    on, cases, default = (value.get(each) for each in KEYS)
    if strange and (on is None or cases is None):
        return None  # one of them is likely to be meant by the strange one: that is one mistake
    if not isinstance(on, Scalar):
        notes.fault(key.mark if on is None else on.mark, f"'{word}' needs 'on', an expression", form)
        return None
    chosen = read_expression(notes, "'on'", on, lambda found: found)
    if not isinstance(cases, Mapping) or not cases.entries:
        mark = key.mark if cases is None else cases.mark
        notes.fault(mark, f"'{word}' needs 'cases', each a value with a behaviour", form)
        return None
    branches = [node for _, node in cases.entries] + ([] if default is None else [default])
    step = Step(
        word,
        name,
        key.mark,
        notes.source,
        tuple(read_step(notes, node) for node in branches),
        arguments={"on": chosen},
        cases=tuple(default_value(case) for case, _ in cases.entries),
        case_marks=tuple(case.mark for case, _ in cases.entries),
        written={"on": on.text},
    )
    repeated = _repeated(step, [case for case, _ in cases.entries])
    for fault in (*misfit_cases(step, kind_made(chosen, notes.known_kinds(chosen))), *repeated):
        notes.fault(fault.mark, fault.message, fault.suggestion)
    return step
