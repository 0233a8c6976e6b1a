"""``switch`` and ``reactive_switch``: one of several behaviours, chosen by the value of an expression."""

from collections.abc import Callable

from config.faults import one_of
from config.marked import Mapping, Node, Scalar
from missions.language.arguments import default_value
from missions.language.cases import misfit_cases
from missions.language.inference import kind_made
from missions.language.modifiers import outdent, read_expression
from missions.language.notes import Notes
from missions.language.plan import Step

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
    for fault in misfit_cases(step, kind_made(chosen, notes.known_kinds)):
        notes.fault(fault.mark, fault.message, fault.suggestion)
    return step
