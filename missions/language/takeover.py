"""Takeover: which leaves halt the running child of a reactive composite before they start.

A reactive composite ticks the children before its running child again. Such an earlier child, a *branch*, declines as
long as its conditions prevent it; otherwise it takes over, and the running child is halted. A leaf that claims an
actuator, or takes time to act, halts the running child before it starts. A leaf that acts at once, such as ``led``,
does so if its branch cannot decline any more in that tick, that is, if no condition follows. Before a condition it acts
without a halt, because a branch that declines would otherwise halt the running child at every tick.

The analysis follows the results of a tick from a leaf up to the reactive composite. It assumes that a leaf that acts
does not fail.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic
from drivers.api.fast_dataclass import dataclass
from missions.language.nodes import (
    BOTH_ENDS,
    COMPOSITES,
    FAILURE,
    FINALLY,
    FOR_EACH,
    MODIFIERS,
    RESTART,
    RETRY,
    SKIPPED,
    SUCCESS,
    SWITCHES,
    TIME_LIMITS,
    WAIT_FOR,
    CompositeKind,
)
from missions.language.outcomes import early_ends, ends_at_once, innermost_step
from missions.language.plan import Step, composite_kind

RUNNING = "running"
STARTED = "started"
"""Result of a node in which a leaf starts that halts the running child itself, because it drives or takes time."""

Results = frozenset[str]
"""Results of a node in one tick: success, failure, skipped, RUNNING, or STARTED."""

FIXED_RESULTS = {"succeed": SUCCESS, "fail": FAILURE}


def find_takeovers(tree: Step) -> Mapping[str, frozenset[str]]:
    """Return the keys of the leaves that act, with the keys of the reactive composites in which they take over.

    Keys are those of nodes, such as "1.2". The running child of these composites is halted before the leaf starts.
    Leaves that drive are left out, since they take over in each composite.
    """
    found: defaultdict[str, set[str]] = defaultdict(set)
    analysis = TakeoverAnalysis()
    for key, step in reactive_composites(tree):
        for leaf in analysis.acting_leaves(step, key):
            if leaf.takes_over:
                found[leaf.key].add(key)
    return {key: frozenset(composites) for key, composites in found.items()}


def early_action_hints(tree: Step) -> list[Diagnostic]:
    """Return a hint for each leaf that acts at every tick, before a condition that keeps its branch from taking over.

    ``set`` is left out: it may compute a value for the condition.
    """
    analysis = TakeoverAnalysis()
    return [
        _early_action_hint(step, leaf.step, innermost_step(leaf.condition))
        for key, step in reactive_composites(tree)
        for leaf in analysis.acting_leaves(step, key)
        if leaf.condition is not None and not leaf.takes_over and leaf.step.kind != "set"
    ]


def _early_action_hint(around: Step, leaf: Step, condition: Step) -> Diagnostic:
    what = f"'{condition.name}' (line {condition.mark.line})"
    return Diagnostic(
        leaf.source,
        leaf.mark,
        f"'{leaf.kind}' may act at every tick while a later child of the {around.kind} runs: {what} follows it, "
        "and can prevent that this child takes over",
        f"write '{leaf.kind}' after {what}",
    )


def reactive_composites(tree: Step) -> Iterator[tuple[str, Step]]:
    """Yield the reactive composites of a tree, with the keys of their nodes."""
    waiting = [("1", tree)]
    while waiting:
        key, step = waiting.pop()
        kind = COMPOSITES.get(step.kind)
        if kind is not None and kind.reactive:
            yield key, step
        waiting += [(f"{key}.{place}", child) for place, child in enumerate(step.children, start=1)]


@dataclass(frozen=True, slots=True)
class ActingLeaf:
    """A leaf that acts at once, in a child of a reactive composite.

    ``takes_over`` is false if the child may still decline after the leaf; ``condition`` is then the next step by which
    it may do so, if there is one.
    """

    key: str
    step: Step
    condition: Step | None
    takes_over: bool


class TakeoverAnalysis:
    """Analysis of the reactive composites of one tree; it keeps the results of each step."""

    def __init__(self) -> None:
        self._results: dict[int, Results] = {}
        self._results_from: dict[int, list[Results]] = {}
        self._counts: dict[int, Counter[str]] = {}

    def acting_leaves(self, composite: Step, key: str) -> Iterator[ActingLeaf]:
        """Yield the leaves that act at once in the children of a reactive composite, except in the last child."""
        declining = frozenset({COMPOSITES[composite.kind].passes, SKIPPED})
        for place, child in enumerate(composite.children[:-1], start=1):
            yield from self._leaves_below(child, f"{key}.{place}", declining, None)

    def _leaves_below(self, step: Step, key: str, declining: Results, condition: Step | None) -> Iterator[ActingLeaf]:
        """Yield the leaves that act at once in ``step``.

        ``declining`` are the results of ``step`` after which the reactive composite may go on with its next child, and
        ``condition`` is the step that can decline after ``step``.
        """
        if step.leaf is not None:
            if step.leaf.acts and not step.leaf.drives:
                results = _results_of_leaf(step, step.leaf) | {RUNNING}  # it runs while it waits for the halt
                yield ActingLeaf(key, step, condition, takes_over=declining.isdisjoint(results))
            return
        conditions = self._next_conditions(step, declining)
        for place, child in enumerate(step.children):
            above = {result: self._results_after(step, place, result) for result in (*BOTH_ENDS, SKIPPED, RUNNING)}
            below = frozenset(result for result, results in above.items() if results & declining)
            following = conditions[place] or condition
            if place > 0 and step.kind in MODIFIERS:  # recover and finally run at the end of the branch
                following = None
            yield from self._leaves_below(child, f"{key}.{place + 1}", below, following)

    def _next_conditions(self, step: Step, declining: Results) -> list[Step | None]:
        """Return for each child of a step the first child after it whose result can end the step, so that it declines.

        None if there is none, or if the children do not follow one another.
        """
        kind = composite_kind(step)
        found: list[Step | None] = [None] * len(step.children)
        if kind is not None and kind.order == "in order":
            ends = declining - {kind.passes, SKIPPED}
            for place in range(len(step.children) - 1, 0, -1):
                child = step.children[place]
                found[place - 1] = child if self.results(child) & ends else found[place]
        return found

    def results(self, step: Step) -> Results:
        """Return the possible results of a step in the tick in which it starts."""
        if id(step) not in self._results:
            self._results[id(step)] = self._compute_results(step)
        return self._results[id(step)]

    def _compute_results(self, step: Step) -> Results:
        if step.leaf is not None:
            return _results_of_leaf(step, step.leaf)
        below = [self.results(child) for child in step.children]
        if step.kind in MODIFIERS:
            early = frozenset() if step.kind in TIME_LIMITS or step.kind == "on_running" else early_ends(step)
            waits = {RUNNING} if step.kind in ("delay", FINALLY) else frozenset()
            remembered = BOTH_ENDS if step.kind == "once" else frozenset()
            return early.union(remembered, waits, *(self._results_after(step, 0, result) for result in below[0]))
        if step.kind in SWITCHES:
            return frozenset({FAILURE}).union(*below)
        kind = composite_kind(step)
        if kind is None:
            early = frozenset({SUCCESS}) if step.kind == FOR_EACH else frozenset()
            return early.union(*(self._results_after(step, 0, result) for result in below[0]))
        if kind.order == "in order":
            return self._in_order(step, kind)[0]
        return frozenset({RUNNING}).union(*below)

    def _results_after(self, step: Step, place: int, result: str) -> Results:
        """Return the possible results of a step in a tick in which child ``place`` has ``result``."""
        if step.kind in MODIFIERS:
            return _results_of_modifier(step, place, result)
        kind = composite_kind(step)
        if kind is not None:
            return self._results_after_child(step, kind, place, result)
        if (step.kind == FOR_EACH and result in (SUCCESS, SKIPPED)) or (step.kind == WAIT_FOR and result == FAILURE):
            return frozenset({result, RUNNING}) - ({FAILURE} if step.kind == WAIT_FOR else frozenset())
        return frozenset({result})

    def _results_after_child(self, step: Step, kind: CompositeKind, place: int, result: str) -> Results:
        if kind.order == "in order":
            is_over = result not in (kind.passes, SKIPPED)
            return frozenset({result}) if is_over else _followed_by(result, self._in_order(step, kind)[place + 1])
        if id(step) not in self._counts:
            self._counts[id(step)] = Counter(result for child in step.children for result in self.results(child))
        own = self.results(step.children[place])
        around = frozenset(each for each, count in self._counts[id(step)].items() if count > (each in own))
        if not kind.at_once:
            return frozenset({result}) | (around if result in (kind.passes, SKIPPED) else frozenset())
        return (frozenset({result, RUNNING}) | around) - (frozenset() if result == SKIPPED else {SKIPPED})

    def _in_order(self, step: Step, kind: CompositeKind) -> list[Results]:
        """Return the possible results of the children from each place on, as if they were a composite of their own.

        The last entry is that of no children: SKIPPED.
        """
        if id(step) not in self._results_from:
            found = [frozenset({SKIPPED})]
            for child in reversed(step.children):
                own, onward = self.results(child), {kind.passes, SKIPPED}
                found.append((own - onward).union(*(_followed_by(result, found[-1]) for result in own & onward)))
            self._results_from[id(step)] = found[::-1]
        return self._results_from[id(step)]


def _followed_by(result: str, others: Results) -> Results:
    """Return the possible results of children of which the first has ``result``; ``others`` are those of the rest."""
    return (others - {SKIPPED}) | {result} if SKIPPED in others else others


def _results_of_leaf(step: Step, leaf: type[Leaf]) -> Results:
    """Return the possible results of the leaf of a step in the tick in which it starts."""
    if step.kind in FIXED_RESULTS:
        return frozenset({FIXED_RESULTS[step.kind]})
    if leaf.drives or (leaf.acts and not ends_at_once(step)):
        return frozenset({STARTED})
    return frozenset({SUCCESS}) if leaf.acts else leaf.ends | {RUNNING}


def _results_of_modifier(step: Step, place: int, result: str) -> Results:
    """Return the possible results of a modifier in a tick in which its child ``place`` has ``result``."""
    kind = MODIFIERS[step.kind]
    if place > 0:  # recover and finally
        return frozenset({RUNNING}) if step.kind == RETRY else BOTH_ENDS | {RUNNING}
    if result == RUNNING and step.kind == "on_running":
        return early_ends(step) | {RUNNING}
    ways = {SUCCESS: kind.success, FAILURE: kind.failure}.get(result, frozenset({result}))
    return frozenset(RUNNING if way == RESTART else way for way in ways)
