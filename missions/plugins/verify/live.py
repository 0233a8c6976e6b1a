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
    AGAIN,
    COMPOSITES,
    FAILURE,
    FOR_EACH,
    MISSION,
    MODIFIERS,
    SUCCESS,
    SWITCHES,
    CompositeKind,
)
from missions.language.plan import Step
from missions.plugins.verify.guesses import Guess
from missions.plugins.verify.mocks import SetStandIn

Names = frozenset[str]
NONE: Names = frozenset()


class Onward(NamedTuple):
    """What is live after each end of a node."""

    success: Names
    failure: Names


RESUMES = frozenset(
    word for word, kind in MODIFIERS.items() if kind.value != "duration" and not kind.repeats and not kind.every_tick
)
"""Modifiers that run only while their child does, and leave it alone: what is live then, the child knows."""


def live_while_running(tree: Step) -> Mapping[str, Names]:
    """Return for each node, by its key, the variables of its own mission that are live while it runs.

    Those of a parent are the ones that it may lead to itself; its children that run say the rest. ``tree`` has the
    steps of stand-ins (see missions.plugins.verify.model), since what a stand-in does not read is not read.
    """
    analysis = Analysis()
    while analysis.grows:
        analysis.grows = False
        analysis.before(tree, "1", Onward(NONE, NONE))
    return analysis.running


class Analysis:
    """One pass over the tree after another, until none ``grows`` what the one before found to be live before a node."""

    def __init__(self) -> None:
        self.running: dict[str, Names] = {}
        self.grows = True
        self._known: dict[str, Names] = {}

    def before(self, step: Step, key: str, onward: Onward) -> Names:
        """Return what is live before ``step`` starts, and note what is while it and those below it run."""
        children = tuple(
            partial(self.before, child, f"{key}.{place}") for place, child in enumerate(step.children, start=1)
        )
        reads = names_read(step.arguments.values())
        again = self._known.get(key, NONE)
        found, running = NONE, NONE
        if step.leaf is not None:
            found = running = reads | (onward.success - _stored(step)) | onward.failure
        elif step.kind == MISSION:
            results = names_read(step.returns.values())
            children[0](Onward(results, results))
            running = (onward.success - _stored(step)) | onward.failure
            found = reads | running
        elif step.kind == FOR_EACH:
            ended = onward.success | onward.failure
            found = running = reads | ended | (children[0](Onward(ended | again, ended)) - frozenset(step.binds))
        elif step.kind in SWITCHES:
            found = reads.union(onward.failure, *(child(onward) for child in children))
            running = found if SWITCHES[step.kind].reactive else NONE
        elif step.kind in MODIFIERS:
            found = reads | _modifier(step.kind, children[0], onward, again)
            running = NONE if step.kind in RESUMES else found
        else:
            # Where a parallel counts, any end of a child may go before either end of the parallel.
            ends = Onward(*(onward.success | onward.failure,) * 2) if step.arguments else onward
            kind = COMPOSITES[step.kind]
            found = reads | _composite(kind, children, ends, again)
            running = found if kind.reactive else NONE
        self.running[key] = running
        self.grows = self.grows or found != again
        self._known[key] = found
        return found


Child = Callable[[Onward], Names]
"""A child as its parent sees it: what is live before it, from what is live after its ends."""


def names_read(values: Iterable[Value]) -> Names:
    """Return the variables that computing these values reads, if it were only to fail."""
    asked = (value for value in values if not (isinstance(value, Guess) and value.blind))
    return frozenset(read.name for value in asked if value.template is not None for read in value.template.reads)


def _stored(step: Step) -> Names:
    """Return what a success of ``step`` surely stores in its own mission."""
    if step.keep_as is not None:
        return frozenset((step.keep_as,))
    if step.kind == MISSION:
        return frozenset(step.returns)
    return frozenset(step.arguments) if step.leaf is not None and issubclass(step.leaf, SetStandIn) else NONE


def _modifier(word: str, child: Child, onward: Onward, again: Names) -> Names:
    kind = MODIFIERS[word]
    known = {SUCCESS: onward.success, FAILURE: onward.failure, AGAIN: again}
    success, failure = (NONE.union(*(known[way] for way in ways)) for ways in (kind.success, kind.failure))
    skips = SUCCESS in kind.cut or kind.remembers  # it can succeed while its child runs, or without it
    return child(Onward(success, failure)).union(onward.failure, onward.success if skips else NONE)


def _composite(kind: CompositeKind, children: tuple[Child, ...], onward: Onward, again: Names) -> Names:
    if kind.at_once:
        # What one child stores before it reads it is not live for its sake, whoever else stores it in between.
        return NONE.union(*(child(onward) for child in children))
    if kind.reactive or kind.order == "in any order":  # each may follow on each
        ends = onward.success | onward.failure | again
        return ends.union(*(child(Onward(ends, ends)) for child in children))
    before = onward.success if kind.passes == SUCCESS else onward.failure
    for child in reversed(children):
        before = child(Onward(before, onward.failure) if kind.passes == SUCCESS else Onward(onward.success, before))
    return before
