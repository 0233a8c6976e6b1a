"""Whether the cases of a switch can be what its expression makes."""

from collections.abc import Iterator
from contextlib import suppress

from config.dimensions import NUMBER
from config.faults import Diagnostic
from config.units import seen
from missions.language.kinds import FLAG, TEXT, Kind, is_size, joined, kind_of_value, told
from missions.language.plan import Step
from missions.language.values import shown

MEANT = {"yes": "true", "on": "true", "no": "false", "off": "false"}
"""What people write for true and false."""


def misfit_cases(step: Step, kind: Kind) -> Iterator[Diagnostic]:
    """Yield the mistakes in the cases of a switch whose expression is of a kind: those that it never is."""
    for case, mark in zip(step.cases, step.case_marks, strict=True):
        if not _can_be(case, kind):
            word = str(case).lower() if isinstance(case, bool) else shown(case)
            yield Diagnostic(step.source, mark, f"'on' is {told(kind)}, and never {seen(word)}", _cure(word, kind))


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
