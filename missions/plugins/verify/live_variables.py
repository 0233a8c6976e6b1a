"""Live variables: variables that a run may still read before it stores them again.

This is the backward data-flow analysis of compilers on a tree: each node gets the variables that are live after its
success and after its failure, and returns the variables that are live before it. A variable that is not live has no
effect: states that differ only in it have the same future.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import NamedTuple

from missions.language.expressions import Value
from missions.language.nodes import (
    COMPOSITES,
    FAILURE,
    FINALLY,
    FOR_EACH,
    MISSION,
    MODIFIERS,
    RESTART,
    RETRY,
    SKIPPED,
    SUCCESS,
    SWITCHES,
    WAIT_FOR,
    CompositeKind,
)
from missions.language.plan import Step, composite_kind
from missions.plugins.verify.abstract_values import NondetValue
from missions.plugins.verify.stand_ins import SetStandIn

Names = frozenset[str]
NO_NAMES: Names = frozenset()


class LiveAfter(NamedTuple):
    """Variables that may still be read after each end of a node: success, failure, or skipped."""

    success: Names
    failure: Names
    skipped: Names = NO_NAMES


PASSIVE_MODIFIERS = frozenset(
    word for word, kind in MODIFIERS.items() if kind.value != "duration" and not kind.repeats and not kind.every_tick
)
"""Modifiers that run only with their child and do not act on it.

The variables that are live while such a modifier runs are those of its child.
"""


class LiveVariables(NamedTuple):
    """Variables that a run may still read, by node key: ``running`` while the node runs, ``before`` before it starts.

    Only variables of the node's own mission are included. While a parent runs, its next steps and its running children
    may read variables; the entry of the parent has only those of its next steps.
    """

    running: Mapping[str, Names]
    before: Mapping[str, Names]


def live_variables(tree: Step) -> LiveVariables:
    """Return the variables of a mission that a run may still read, for each node of ``tree``.

    The steps of ``tree`` must be abstract (see missions.plugins.verify.model), since a stand-in reads fewer variables
    than its leaf.
    """
    analysis = LivenessAnalysis()
    while analysis.has_grown:
        analysis.has_grown = False
        analysis.live_before(tree, "1", LiveAfter(NO_NAMES, NO_NAMES))
    return LiveVariables(analysis.running, analysis.before)


class LivenessAnalysis:
    """Liveness analysis of a mission's tree: its passes are repeated until no pass adds a live variable."""

    def __init__(self) -> None:
        self.running: dict[str, Names] = {}
        self.has_grown = True
        self.before: dict[str, Names] = {}

    def live_before(self, step: Step, key: str, live_after: LiveAfter) -> Names:
        """Return the variables that a run may still read when ``step`` starts.

        The variables that are live during the step, and during the steps below it, are stored in ``running``, and the
        returned ones in ``before``.
        """
        children = tuple(
            partial(self.live_before, child, f"{key}.{place}") for place, child in enumerate(step.children, start=1)
        )
        reads = names_read(step.arguments.values())
        again = self.before.get(key, NO_NAMES)
        found, running = NO_NAMES, NO_NAMES
        if step.leaf is not None:
            found = running = reads | (live_after.success - _stored_names(step)) | live_after.failure
        elif step.kind == WAIT_FOR:
            found = running = children[0](live_after._replace(failure=again))
        elif step.kind == MISSION:
            results = names_read(step.returns.values())
            children[0](LiveAfter(results, results, results))
            running = (live_after.success - _stored_names(step)) | live_after.failure | live_after.skipped
            found = reads | running
        elif step.kind == FOR_EACH:
            ended = live_after.success | live_after.failure | live_after.skipped
            after = LiveAfter(ended | again, ended, ended | again)
            found = running = reads | ended | (children[0](after) - frozenset(step.binds))
        elif step.kind in SWITCHES:
            found = reads.union(live_after.failure, *(child(live_after) for child in children))
            running = found if SWITCHES[step.kind].reactive else NO_NAMES
        elif step.kind == FINALLY:
            # It may start at any time while the child runs, and may be halted: then it has stored nothing.
            ended = live_after.success | live_after.failure
            running = children[1](LiveAfter(ended, ended, ended)) | ended
            found = running | children[0](LiveAfter(running, running, live_after.skipped))
        elif step.kind == RETRY and len(children) > 1:
            recovery = children[1](LiveAfter(again, again, again))
            after = live_after._replace(failure=live_after.failure | recovery | again)
            found = running = reads | recovery | children[0](after) | live_after.failure
        elif step.kind in MODIFIERS:
            found = reads | _before_modifier(step.kind, children[0], live_after, again)
            running = NO_NAMES if step.kind in PASSIVE_MODIFIERS else found
        else:
            # In a counting parallel, any end of a child may precede either end of the parallel.
            ended = live_after.success | live_after.failure
            ends = (
                LiveAfter(ended, ended, live_after.skipped)
                if step.kind == "parallel" and step.arguments
                else live_after
            )
            kind = composite_kind(step) or COMPOSITES[step.kind]
            found = reads | _before_composite(kind, children, ends, again)
            running = found if kind.reactive else NO_NAMES
        self.running[key] = running
        self.has_grown = self.has_grown or found != again
        self.before[key] = found
        return found


Child = Callable[[LiveAfter], Names]
"""Analysis of a child: returns the variables live before it, given those live after its ends."""


def names_read(values: Iterable[Value]) -> Names:
    """Return the names of the variables that ``values`` read when they are computed or checked."""
    computed = (value for value in values if not (isinstance(value, NondetValue) and value.never_computed))
    return frozenset(read.name for value in computed if value.template is not None for read in value.template.reads)


def _stored_names(step: Step) -> Names:
    """Return the variables that a success of ``step`` always stores in its own mission."""
    if step.output_variable is not None:
        return frozenset((step.output_variable,))
    if step.kind == MISSION:
        return frozenset(step.returns)
    return frozenset(step.arguments) if step.leaf is not None and issubclass(step.leaf, SetStandIn) else NO_NAMES


def _before_modifier(word: str, child: Child, live_after: LiveAfter, again: Names) -> Names:
    kind = MODIFIERS[word]
    known = {SUCCESS: live_after.success, FAILURE: live_after.failure, RESTART: again}
    success, failure = (NO_NAMES.union(*(known[way] for way in ways)) for ways in (kind.success, kind.failure))
    ends_early = SUCCESS in kind.early_ends or kind.remembers  # it can succeed without an end of its child
    skips = SKIPPED in kind.early_ends
    return child(LiveAfter(success, failure, live_after.skipped)).union(
        live_after.failure,
        live_after.success if ends_early else NO_NAMES,
        live_after.skipped if skips else NO_NAMES,
    )


def _before_composite(kind: CompositeKind, children: tuple[Child, ...], live_after: LiveAfter, again: Names) -> Names:
    if kind.at_once:
        # A variable that a child stores before reading it is not live for that child, despite writes of others.
        around = live_after.success | live_after.failure | live_after.skipped
        return NO_NAMES.union(*(child(live_after._replace(skipped=around)) for child in children))
    if kind.reactive or kind.order == "in any order":  # any child may follow any other
        ends = live_after.success | live_after.failure | live_after.skipped | again
        return ends.union(*(child(LiveAfter(ends, ends, ends)) for child in children))
    before = live_after.success if kind.passes == SUCCESS else live_after.failure
    around = before | live_after.skipped
    for child in reversed(children):
        after = (before, live_after.failure) if kind.passes == SUCCESS else (live_after.success, before)
        before = around = child(LiveAfter(*after, around))
    return before
