"""``switch``: one of several behaviours, chosen by the value of an expression."""

from collections.abc import Callable

from config.faults import one_of
from config.marked import Mapping, Node, Scalar
from missions.language.arguments import default_value
from missions.language.modifiers import outdent, read_expression
from missions.language.notes import Notes
from missions.language.plan import SWITCH, Step

KEYS = ("on", "cases", "default")
FORM = "write switch: {on: answer, cases: {yes: ..., no: ...}, default: ...}"


def read_switch(
    notes: Notes, key: Scalar, value: Node | None, name: str, read_step: Callable[[Notes, Node], Step | None]
) -> Step | None:
    """Read a switch."""
    if not isinstance(value, Mapping):
        notes.fault(key.mark, "'switch' needs 'on' and 'cases'", FORM)
        return None
    for word, _ in value.entries:
        if word.text not in KEYS:
            hint = outdent(word.text, SWITCH) or one_of(word.text, KEYS)
            notes.fault(word.mark, f"'switch' has no key '{word.text}'", hint)
    on, cases, default = (value.get(word) for word in KEYS)
    if not isinstance(on, Scalar):
        notes.fault(key.mark if on is None else on.mark, "'switch' needs 'on', an expression", FORM)
        return None
    chosen = read_expression(notes, "'on'", on, lambda found: found)
    if not isinstance(cases, Mapping) or not cases.entries:
        mark = key.mark if cases is None else cases.mark
        notes.fault(mark, "'switch' needs 'cases', each a value with a behaviour", FORM)
        return None
    children: list[Step] = []
    values: list[object] = []
    for case, node in cases.entries:
        child = read_step(notes, node)
        if child is not None:
            children.append(child)
            values.append(default_value(case))
    otherwise = None if default is None else read_step(notes, default)
    if otherwise is not None:
        children.append(otherwise)
    return Step(
        SWITCH,
        name,
        key.mark,
        notes.source,
        tuple(children),
        arguments={"on": chosen},
        cases=tuple(values),
        written={"on": on.text},
    )
