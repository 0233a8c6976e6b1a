"""Which variables have a value where they are read: what nothing before sets, or not on every way, is a mistake."""

from collections.abc import Sequence

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


MAX_EVENTS = 10
"""Events of a way that a message lists."""

HINT = "set it before, such as set: {{{0}: null}}, and ask for it here with if: {0} != null"


def check_flow(notes: Notes, tree: Step) -> None:
    """Note every variable that is read where no step that can come before has set it, or not every way to there."""
    before = len(notes.faults)
    _flow(notes, tree, set(notes.params) | (notes.stored - tree.names))
    if len(notes.faults) > before:
        return
    for each in unset_reads(tree, tree.names - notes.params.keys() - notes.awaited, notes.params):
        when = f"it is not set where {_told(each.events)}" if each.way else "it is set only after this"
        notes.fault_at(each.step, f"'{each.name}' is read here, but {when}", HINT.format(each.name))


def _told(events: Sequence[str]) -> str:
    """Return the events of a way for people: the first ones of many."""
    more = len(events) - MAX_EVENTS
    return ", ".join([*events[:MAX_EVENTS], *([f"and {more} more things happen"] if more > 0 else [])])


def _flow(notes: Notes, step: Step, known: set[str]) -> None:
    """Check ``step``, before which ``known`` can have been set; add to that what can have been set after it."""
    if step.kind in AGAIN:
        known |= step.names
    for value in step.arguments.values():
        _check(notes, step, value, known)
    if step.kind == FOR_EACH:  # its list is asked for before any of its rounds
        known |= step.names
    if step.kind == MISSION:
        own = set(step.arguments)
        _flow(notes, step.children[0], own)
        for value in step.returns.values():
            _check(notes, step, value, own)
    else:
        for child in step.children:
            _flow(notes, child, known)
    known |= step.own_names


def _check(notes: Notes, step: Step, value: Value, known: set[str]) -> None:
    if value.template is None:
        return
    for read in value.template.reads:
        if read.name not in known and read.name not in STATE:
            notes.fault_at(step, f"'{read.name}' is read here, but nothing before this sets it")
