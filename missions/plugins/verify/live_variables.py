"""Live variables: which of them a run may still read before something stores them anew.

The backward data-flow analysis of compilers, over a tree: what follows on a node is known by how it ends, so each node
is given what is live after its success and after its failure, and says what is live before it. A variable that is not
live decides nothing any more, whatever its value: states that differ in it alone have the same future.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import NamedTuple

from missions.language.expressions import Value
from missions.language.nodes import (
    COMPOSITES,
    FAILURE,
    FOR_EACH,
    MISSION,
    MODIFIERS,
    RESTART,
    SUCCESS,
    SWITCHES,
    CompositeKind,
)
from missions.language.plan import Step
from missions.plugins.verify.abstract_values import NondetValue
from missions.plugins.verify.stand_ins import SetStandIn

Names = frozenset[str]
NO_NAMES: Names = frozenset()


class LiveAfter(NamedTuple):
    """What is live after each end of a node."""

    success: Names
    failure: Names


PASSIVE_MODIFIERS = frozenset(
    word for word, kind in MODIFIERS.items() if kind.value != "duration" and not kind.repeats and not kind.every_tick
)
"""Modifiers that run only while their child does, and leave it alone: what is live then, the child knows."""


def live_while_running(tree: Step) -> Mapping[str, Names]:
    """Return for each node, by its key, the variables of its own mission that are live while it runs.

    Those of a parent are the ones that it may lead to itself; its children that run say the rest. ``tree`` has the
    steps of stand-ins (see missions.plugins.verify.model), since what a stand-in does not read is not read.
    """
    analysis = LivenessAnalysis()
    while analysis.has_grown:
        analysis.has_grown = False
        analysis.live_before(tree, "1", LiveAfter(NO_NAMES, NO_NAMES))
    return analysis.running


class LivenessAnalysis:
    """One pass over the tree after another, until none ``has_grown`` what the one before found to be live before a node."""

    def __init__(self) -> None:
        self.running: dict[str, Names] = {}
        self.has_grown = True
        self._known: dict[str, Names] = {}

    def live_before(self, step: Step, key: str, live_after: LiveAfter) -> Names:
        """Return what is live before ``step`` starts, and note what is while it and those below it run."""
        children = tuple(
            partial(self.live_before, child, f"{key}.{place}") for place, child in enumerate(step.children, start=1)
        )
        reads = names_read(step.arguments.values())
        again = self._known.get(key, NO_NAMES)
        found, running = NO_NAMES, NO_NAMES
        if step.leaf is not None:
            found = running = reads | (live_after.success - _stored_names(step)) | live_after.failure
        elif step.kind == MISSION:
            results = names_read(step.returns.values())
            children[0](LiveAfter(results, results))
            running = (live_after.success - _stored_names(step)) | live_after.failure
            found = reads | running
        elif step.kind == FOR_EACH:
            ended = live_after.success | live_after.failure
            found = running = reads | ended | (children[0](LiveAfter(ended | again, ended)) - frozenset(step.binds))
        elif step.kind in SWITCHES:
            found = reads.union(live_after.failure, *(child(live_after) for child in children))
            running = found if SWITCHES[step.kind].reactive else NO_NAMES
        elif step.kind in MODIFIERS:
            found = reads | _before_modifier(step.kind, children[0], live_after, again)
            running = NO_NAMES if step.kind in PASSIVE_MODIFIERS else found
        else:
            # Where a parallel counts, any end of a child may go before either end of the parallel.
            ends = LiveAfter(*(live_after.success | live_after.failure,) * 2) if step.arguments else live_after
            kind = COMPOSITES[step.kind]
            found = reads | _before_composite(kind, children, ends, again)
            running = found if kind.reactive else NO_NAMES
        self.running[key] = running
        self.has_grown = self.has_grown or found != again
        self._known[key] = found
        return found


Child = Callable[[LiveAfter], Names]
"""A child as its parent sees it: what is live before it, from what is live after its ends."""


def names_read(values: Iterable[Value]) -> Names:
    """Return the variables that computing these values reads, if it were only to fail."""
    asked = (value for value in values if not (isinstance(value, NondetValue) and value.never_computed))
    return frozenset(read.name for value in asked if value.template is not None for read in value.template.reads)


def _stored_names(step: Step) -> Names:
    """Return what a success of ``step`` surely stores in its own mission."""
    if step.output_variable is not None:
        return frozenset((step.output_variable,))
    if step.kind == MISSION:
        return frozenset(step.returns)
    return frozenset(step.arguments) if step.leaf is not None and issubclass(step.leaf, SetStandIn) else NO_NAMES


def _before_modifier(word: str, child: Child, live_after: LiveAfter, again: Names) -> Names:
    kind = MODIFIERS[word]
    known = {SUCCESS: live_after.success, FAILURE: live_after.failure, RESTART: again}
    success, failure = (NO_NAMES.union(*(known[way] for way in ways)) for ways in (kind.success, kind.failure))
    skips = SUCCESS in kind.early_ends or kind.remembers  # it can succeed while its child runs, or without it
    return child(LiveAfter(success, failure)).union(live_after.failure, live_after.success if skips else NO_NAMES)


def _before_composite(kind: CompositeKind, children: tuple[Child, ...], live_after: LiveAfter, again: Names) -> Names:
    if kind.at_once:
        # What one child stores before it reads it is not live for its sake, whoever else stores it in between.
        return NO_NAMES.union(*(child(live_after) for child in children))
    if kind.reactive or kind.order == "in any order":  # each may follow on each
        ends = live_after.success | live_after.failure | again
        return ends.union(*(child(LiveAfter(ends, ends)) for child in children))
    before = live_after.success if kind.passes == SUCCESS else live_after.failure
    for child in reversed(children):
        before = child(
            LiveAfter(before, live_after.failure) if kind.passes == SUCCESS else LiveAfter(live_after.success, before)
        )
    return before
