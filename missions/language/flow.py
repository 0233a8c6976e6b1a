"""Which variables have a value where they are read: what nothing before sets, or not on every way, is a mistake."""

from missions.language.kinds import STATE
from missions.language.nodes import COMPOSITES, FOR_EACH, MISSION, MODIFIERS
from missions.language.notes import Notes
from missions.language.plan import Step
from missions.language.unset import unset_reads
from missions.language.values import Value

AGAIN = frozenset(
    {
        *(word for word, kind in COMPOSITES.items() if kind.at_once or kind.reactive),
        *(word for word, kind in MODIFIERS.items() if kind.repeats or kind.every_tick),
    }
)
"""The kinds below which one part may follow any other: in a later round, or at the same time."""


HINT = "set it before, such as set: {{{0}: null}}, and ask for it here with if: {0} != null"


def check_flow(notes: Notes, tree: Step) -> None:
    """Note every variable that is read where no step that can come before has set it, or not every way to there."""
    before = len(notes.faults)
    _flow(notes, tree, frozenset(notes.params) | (notes.stored - sets(tree)))
    if len(notes.faults) > before:
        return
    for step, name, way in unset_reads(tree, sets(tree) - notes.params.keys() - notes.awaited, sets, notes.params):
        when = f"it is not set where {', '.join(way)}" if way else "it is set only after this"
        notes.fault_at(step, f"'{name}' is read here, but {when}", HINT.format(name))


def sets(step: Step) -> frozenset[str]:
    """Return the variables that a step, or something below it, sets in its own mission."""
    return step.own_names.union(*(sets(child) for child in (() if step.kind == MISSION else step.children)))


def _flow(notes: Notes, step: Step, known: frozenset[str]) -> frozenset[str]:
    """Check ``step``, before which ``known`` can have been set; return what can have been set after it."""
    if step.kind in AGAIN:
        known |= sets(step)
    for value in step.arguments.values():
        _check(notes, step, value, known)
    if step.kind == FOR_EACH:  # its list is asked for before any of its rounds
        known |= sets(step)
    if step.kind == MISSION:
        own = frozenset(step.arguments)
        after = _flow(notes, step.children[0], own)
        for value in step.returns.values():
            _check(notes, step, value, after | own)
        return known | sets(step)
    for child in step.children:
        known = _flow(notes, child, known)
    return known | sets(step)


def _check(notes: Notes, step: Step, value: Value, known: frozenset[str]) -> None:
    if value.template is None:
        return
    for read in value.template.reads:
        if read.name not in known and read.name not in STATE:
            notes.fault_at(step, f"'{read.name}' is read here, but nothing before this sets it")
