"""Definite assignment: variables that are not set on every path to where they are read.

It works as in compilers, but over a behaviour tree. For each result of a node (success, failure, skipped), it computes
the variables that may be unset then, each with a shortest path on which it is unset. Unknown cases are left to
``mission verify``: reads behind a condition on a variable, reads whose failure is caught, and variables of concurrent
nodes.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from behaviours.basics import Check, Fail, Log, Set, Succeed, WaitUntil
from drivers.api.fast_dataclass import dataclass
from missions.language.check_context import CheckContext
from missions.language.expressions import Value
from missions.language.for_each import ListMembers
from missions.language.kinds import STATE_KINDS
from missions.language.nodes import (
    AT_ONCE,
    COMPOSITES,
    FAILURE,
    FAILURE_NAME,
    FINALLY,
    FOR_EACH,
    MISSION,
    MODIFIERS,
    SKIPPED,
    SUCCESS,
    SWITCHES,
    TIME_LIMITS,
    WAIT_FOR,
    WEIGHTS,
    Ends,
)
from missions.language.outcomes import VERBS, early_ends
from missions.language.outcomes import possible_ends as ends_of
from missions.language.parallel_counts import (
    ALL_CHILDREN,
    FAILURE_COUNT,
    SUCCESS_COUNT,
    decide_parallel,
    parallel_ends,
)
from missions.language.plan import UNREAD_KIND, PlaceholderLeaf, Step, composite_kind
from missions.language.read_analysis import always_read_names, may_fail, nonzero_variables

# Sets of variables that may be unset at a place of the tree, each with the events that lead to it.


class PathEvent(NamedTuple):
    """Last event of a path through the tree, such as the failure of a step; ``text`` describes it.

    ``previous`` are the events before it, ``length`` is the number of all events.
    """

    text: str
    previous: "EventPath"
    length: int


EventPath = PathEvent | None
"""Events of a path through the tree on which a variable is not set; None for the start of the tree."""


class UnsetVariables(NamedTuple):
    """Variables that may be unset at a place in the tree: one bit each in ``bits``.

    ``paths`` are the shortest paths to this place that leave a variable unset, for some of the variables. Every step
    has such a value, so bits are used: sets of all variables would take quadratic time.
    """

    bits: int
    paths: Mapping[str, EventPath]


NOTHING_UNSET = UnsetVariables(0, {})


class UnsetAfter(NamedTuple):
    """Variables that may be unset after a step: after its success, after its failure, and after it was skipped.

    Each is None if the step cannot end that way.
    """

    success: UnsetVariables | None
    failure: UnsetVariables | None
    skipped: UnsetVariables | None = None


def add_event(event: str, unset: UnsetVariables | None) -> UnsetVariables | None:
    """Return ``unset`` with ``event``, such as the failure of a step, appended to each of its paths.

    None, for a place that is never reached, is returned as None.
    """
    if unset is None or not unset.paths:
        return unset
    ways = {name: PathEvent(event, way, 1 if way is None else way.length + 1) for name, way in unset.paths.items()}
    return UnsetVariables(unset.bits, ways)


def merge_unset(alternatives: Iterable[UnsetVariables | None]) -> UnsetVariables | None:
    """Return the variables that are unset on at least one of several paths, each with the shortest path.

    None stands for a path that is never taken; return None if all paths are.
    """
    bits: int | None = None
    found: dict[str, EventPath] = {}
    for unset in alternatives:
        if unset is None:
            continue
        bits = unset.bits if bits is None else bits | unset.bits
        for name, way in unset.paths.items():
            if name not in found or _length(way) < _length(found[name]):
                found[name] = way
    return None if bits is None else UnsetVariables(bits, found)


def _length(way: EventPath) -> int:
    return 0 if way is None else way.length


CONDITION_KINDS = frozenset(
    {*SWITCHES, Check.tag, WaitUntil.tag, *(word for word, kind in MODIFIERS.items() if kind.value == "condition")}
)
"""Kinds of nodes that evaluate a condition."""

MAX_TRACED_READS = 100
"""Maximum number of unset reads whose paths are traced: as many as errors are reported (``MAX_DIAGNOSTICS``)."""


@dataclass(frozen=True, slots=True)
class StepContext:
    """Place of a step in the tree, as far as the check of its reads needs it.

    Variables in ``assumed_bits`` count as set. ``is_failure_caught`` is true if a step above handles a failure. A step
    that ``is_guarded`` stands behind a condition on a variable, so it may never run with a variable unset. ``nonzero``
    are variables that are never 0, so a division by them cannot fail.
    """

    assumed_bits: int = 0
    is_failure_caught: bool = False
    is_guarded: bool = False
    nonzero: frozenset[str] = frozenset()


class UnsetRead(NamedTuple):
    """A read of the variable ``name`` by ``step``, and a path to the step on which it is unset."""

    step: Step
    name: str
    path: EventPath

    @property
    def events(self) -> Sequence[str]:
        """Events of the path to the read, such as the failure of a step, in order."""
        found, way = list[str](), self.path
        while way is not None:
            found.append(way.text)
            way = way.previous
        return found[::-1]


def find_unset_reads(tree: Step, names: Iterable[str], params: Mapping[str, object]) -> list[UnsetRead]:
    """Return the reads of variables in ``tree`` that are not set on every path to the read.

    ``names`` are the variables that are not set when the tree starts, ``params`` the known values of params. Each read
    comes with such a path. If there are more than ``MAX_TRACED_READS`` reads, later ones are left out unless they read
    one of the same variables.
    """
    here = StepContext(nonzero=nonzero_variables(tree, params))
    names = tuple(names)
    found = _UnsetAnalysis().read(tree, names, here)  # without the trace first: most missions have no such reading
    return _UnsetAnalysis({each.name for each in found[:MAX_TRACED_READS]}).read(tree, names, here) if found else []


class _UnsetAnalysis:
    """Traverses a tree once, and collects the ``reads`` of unset variables.

    Only reads of the variables in ``traced`` get their paths.
    """

    def __init__(self, traced: Collection[str] = frozenset()) -> None:
        self.reads: list[UnsetRead] = []
        self._traced = traced
        self._bits: dict[str, int] = {}

    def read(self, tree: Step, names: Iterable[str], here: StepContext) -> list[UnsetRead]:
        """Return the reads of unset variables in a tree at whose start ``names`` are unset."""
        self.follow(tree, self._initially_unset(names), here)
        return [each for each in self.reads if each.name in self._traced] if self._traced else self.reads

    def follow(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        """Return the variables that may be unset after ``step``, given those before it."""
        for value in step.arguments.values():
            self._check_read(step, value, unset, here)
        if step.leaf is not None:
            return self._follow_leaf(step, unset, here)
        if step.kind == MISSION:
            return self._follow_mission(step, unset, here)
        if step.kind in SWITCHES:
            return self.follow_switch(step, unset, here)
        if step.kind == FOR_EACH:
            return self.follow_for_each(step, unset, here)
        if step.kind == WAIT_FOR:
            after = self.follow(step.children[0], unset, replace(here, is_failure_caught=True))
            return after._replace(failure=None)
        if step.kind in MODIFIERS or step.kind == UNREAD_KIND:
            return self._follow_modifier(step, unset, here)
        kind = composite_kind(step)
        passes = "" if kind is None else kind.passes
        if kind is not None and kind.order == "in order":
            return self.follow_in_order(step, unset, here, passes=passes)
        return self.follow_at_once(step, unset, here)

    def _bits_of(self, names: Iterable[str]) -> int:
        """Return an integer in which the bits of the variables ``names`` are set.

        Each name has the same bit in the whole analysis.
        """
        found = 0
        for name in names:
            found |= self._bits.setdefault(name, 1 << len(self._bits))
        return found

    def _initially_unset(self, names: Iterable[str]) -> UnsetVariables:
        names = tuple(names)
        return UnsetVariables(self._bits_of(names), dict.fromkeys(name for name in names if name in self._traced))

    def _with_set(self, names: Collection[str], unset: UnsetVariables) -> UnsetVariables:
        """Return ``unset`` without the variables ``names``, which a step has set."""
        if not names:
            return unset
        ways = {name: way for name, way in unset.paths.items() if name not in names}
        return UnsetVariables(unset.bits & ~self._bits_of(names), ways)

    def _with_bit(self, names: Iterable[str], bits: int) -> list[str]:
        """Return those of ``names`` whose bit is set in ``bits``."""
        return [name for name in names if bits & self._bits_of((name,))]

    def _check_read(self, step: Step, value: Value, unset: UnsetVariables, here: StepContext) -> None:
        if here.is_failure_caught or here.is_guarded:
            return
        for name in self._with_bit(sorted(always_read_names(value)), unset.bits & ~here.assumed_bits):
            self.reads.append(UnsetRead(step, name, unset.paths.get(name)))

    def _follow_leaf(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        known = self._with_set(step.direct_variables, unset)
        if step.leaf is PlaceholderLeaf:
            return UnsetAfter(known, NOTHING_UNSET)  # its failures are unknown
        ends = {FAILURE} if step.leaf is Fail else set(ends_of(step))
        if step.leaf in (Log, Set, Succeed) and not self._may_fail(step, unset, here):
            ends.discard(FAILURE)
        return UnsetAfter(
            known if SUCCESS in ends else None,
            add_event(f"{_step_label(step)} fails", unset) if FAILURE in ends else None,
        )

    def _may_fail(self, step: Step, unset: UnsetVariables, here: StepContext) -> bool:
        for value in step.arguments.values():
            reads = () if value.template is None else value.template.reads
            if may_fail(value, self._with_bit((read.name for read in reads), unset.bits), here.nonzero):
                return True
        return False

    def _follow_mission(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        (tree,) = step.children
        held = nonzero_variables(tree, {name: value.constant for name, value in step.arguments.items()})
        inner = replace(here, assumed_bits=0, nonzero=held)
        after = self.follow(tree, self._initially_unset(tree.variables - step.arguments.keys()), inner)
        for value in step.returns.values():
            self._check_read(step, value, after.success or NOTHING_UNSET, here)
        lacking = 0 if after.failure is None else after.failure.bits
        lost = [name for name, value in step.returns.items() if self._with_bit(always_read_names(value), lacking)]
        remaining = step.direct_variables.difference(
            lost if step.output_variable is None else [step.output_variable] if lost else []
        )
        return UnsetAfter(
            None if after.success is None else self._with_set(step.direct_variables, unset),
            None
            if after.failure is None
            else add_event(f"{_step_label(step)} fails", self._with_set(remaining, unset)),
            None if after.skipped is None else add_event(f"{_step_label(step)} is skipped", unset),
        )

    # --- composites -----------------------------------------------------------------------------------------------

    def follow_in_order(self, step: Step, unset: UnsetVariables, here: StepContext, *, passes: str) -> UnsetAfter:
        """Return the variables that may be unset after a composite that runs its children one after another.

        ``passes`` is the result of a child after which the next child runs: success in a sequence, failure in a
        selector.
        """
        stops: list[UnsetVariables | None] = []
        passed: UnsetVariables | None = None  # on the paths on which a child has had the end ``passes``
        skipped: UnsetVariables | None = unset  # on the paths on which all children so far were skipped
        for child in step.children:
            now = merge_unset((passed, skipped))
            if now is None:
                break
            after = self.follow(
                child, now, replace(here, is_failure_caught=here.is_failure_caught or catches_failure(step, child))
            )
            onward, stopped, around = after if passes == SUCCESS else (after.failure, after.success, after.skipped)
            stops.append(stopped)
            passed = merge_unset((onward, None if passed is None else around))
            skipped = None if skipped is None else around
            if stopped is not None and _has_variable_condition(child):
                here = replace(here, is_guarded=True)  # the condition has been checked
        stops_merged = merge_unset(stops)
        ends = (passed, stops_merged) if passes == SUCCESS else (stops_merged, passed)
        return UnsetAfter(*ends, skipped)

    def follow_at_once(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        """Return the variables that may be unset after a composite whose children run concurrently or in any order."""
        if WEIGHTS in step.arguments:  # a child of weight 0 never runs
            weights = step.arguments[WEIGHTS].constant
            if isinstance(weights, tuple) and len(weights) == len(step.children):
                running = (child for child, weight in zip(step.children, weights, strict=True) if weight)
                step = replace(step, children=tuple(running))
        found = []
        once = twice = 0
        for child in step.children:
            own_bits = self._bits_of(child.variables)
            once, twice = once | own_bits, twice | (once & own_bits)
        for child in step.children:
            sibling_bits = twice | (once & ~self._bits_of(child.variables))  # variables that other children set
            inner = replace(
                here,
                is_failure_caught=here.is_failure_caught or catches_failure(step, child),
                assumed_bits=here.assumed_bits | sibling_bits,
            )
            found.append(self.follow(child, unset, inner))
        if step.kind == "race":
            found = [
                after._replace(success=add_event(f"{_step_label(child)} ends first", after.success))
                for child, after in zip(step.children, found, strict=True)
            ]
        success, failure, skipped = (self._end_at_once(step, unset, found, end) for end in _ENDS)
        if _has_computed_argument(step):  # a value of a wrong type fails at the start
            failure = merge_unset((failure, add_event(f"{_step_label(step)} fails", unset)))
        return UnsetAfter(success, failure, skipped)

    def _end_at_once(
        self, step: Step, unset: UnsetVariables, found: Sequence[UnsetAfter], end: str
    ) -> UnsetVariables | None:
        """Return the variables that may be unset after such a composite if its result is ``end``.

        ``found`` has the variables that may be unset after each child. A variable may be unset if those children that
        leave it unset can give this result.
        """
        counts = _decisive_counts(step, end)
        possible = [_ends_with(after, -1) for after in found]
        total = Counter(possible)
        if end not in parallel_ends(len(found), total, counts):
            return None
        setters: dict[str, list[int]] = {name: [] for name in self._with_bit(step.variables, unset.bits)}
        for place, child in enumerate(step.children):
            for name in child.variables & setters.keys():
                setters[name].append(place)
        at_once = [_set_at_once(child) if step.kind in AT_ONCE else frozenset[str]() for child in step.children]
        bits = unset.bits
        for name, places in setters.items():
            bit = self._bits_of((name,))
            # Where a child sets it in its first tick, only the children before it can have ended without it.
            last = next((place for place in places if name in at_once[place]), len(found))
            ends = total.copy() if last == len(found) else Counter(possible[:last])
            for place in places:
                if place < last:
                    ends[possible[place]] -= 1
                    ends[_ends_with(found[place], bit)] += 1
            if end not in parallel_ends(len(found), ends, counts):
                bits &= ~bit
        merged = merge_unset(getattr(after, end) for after in found) or NOTHING_UNSET
        around = PathEvent(f"{_step_label(step)} {VERBS.get(end, end)} without it", None, 1)
        return UnsetVariables(
            bits,
            {
                name: merged.paths.get(name) or (around if name in step.variables else path)
                for name, path in unset.paths.items()
                if bits & self._bits_of((name,))
            },
        )

    def follow_switch(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        """Return the variables that may be unset after a switch."""
        here = replace(here, is_guarded=here.is_guarded or _has_variable_condition(step))
        cases = [f"{_step_label(step)} takes the case '{_case_label(case)}'" for case in step.cases]
        found = [
            UnsetAfter(*(add_event(case, end) for end in child))
            for case, child in zip(
                [*cases, f"{_step_label(step)} takes the default"],
                (self.follow(child, unset, here) for child in step.children),
                strict=False,
            )
        ]
        none = (
            []
            if len(step.children) > len(step.cases)
            else [add_event(f"{_step_label(step)} has no case for it", unset)]
        )
        return UnsetAfter(
            merge_unset(each.success for each in found),
            merge_unset([*(each.failure for each in found), *none]),
            merge_unset(each.skipped for each in found),
        )

    def follow_for_each(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        """Return the variables that may be unset after a for_each: after its child has run once, or not at all.

        The child does not run if the list is empty.
        """
        after = self.follow(step.children[0], self._with_set(step.binds, unset), here)
        among = step.arguments["in"].constant
        has_member = isinstance(among, ListMembers) and among.count
        empty = None if has_member else add_event(f"{_step_label(step)} has no member", unset)
        success = merge_unset((after.success, empty, None if after.success is None else after.skipped))
        return UnsetAfter(success, after.failure, after.skipped)

    # --- modifiers ------------------------------------------------------------------------------------------------

    def _follow_modifier(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        if step.kind == UNREAD_KIND:  # it may change or prevent ends, so later nodes report no error
            self.follow(step.children[0], unset, replace(here, is_guarded=True, is_failure_caught=True))
            return UnsetAfter(NOTHING_UNSET, NOTHING_UNSET)
        if step.kind == FINALLY:
            return self._follow_finally(step, unset, here)
        kind = MODIFIERS[step.kind]
        guarded = here.is_guarded or (bool(kind.early_end_text) and _has_variable_condition(step))
        caught = here.is_failure_caught or catches_failure(step, step.children[0])
        value = step.arguments["value"]
        known = value.template is None
        if step.kind == "if" and known and not value.constant:
            return UnsetAfter(None, None, add_event(_early_end_event(step), unset))
        after = self.follow(step.children[0], unset, replace(here, is_guarded=guarded, is_failure_caught=caught))
        if after.failure is not None:
            for recovery in step.children[1:]:
                self.follow(recovery, after.failure, here)
        endless = known and value.constant is None
        ways = [
            (None if endless and kind.without_limit(end) else each, onward)
            for end, onward, each in ((SUCCESS, kind.success, after.success), (FAILURE, kind.failure, after.failure))
        ]
        ways.append((after.skipped, frozenset({SKIPPED})))
        before = self._with_set(_set_at_once(step.children[0]), unset) if step.kind in TIME_LIMITS else unset
        cut = add_event(_early_end_event(step), before) if kind.early_end_text else after.success
        always = kind.value == "condition" and known and bool(value.constant) == (step.kind != "until")
        cut_to = frozenset[str]() if always else early_ends(step)
        return UnsetAfter(
            *(
                merge_unset([*(each for each, onward in ways if end in onward), *([cut] if end in cut_to else ())])
                for end in (SUCCESS, FAILURE, SKIPPED)
            )
        )

    def _follow_finally(self, step: Step, unset: UnsetVariables, here: StepContext) -> UnsetAfter:
        """Follow a node and its ``finally``, which may start at any time during the node, and may be halted."""
        child, cleanup = step.children
        after = self.follow(child, unset, here)
        during = add_event(f"{_step_label(child)} is halted", unset) or unset
        self.follow(cleanup, during, replace(here, is_failure_caught=False))
        if not cleanup.variables:
            return after
        if cleanup.leaf is Set and not self._may_fail(cleanup, during, here):
            return UnsetAfter(*(end and self._with_set(cleanup.variables, end) for end in after))
        cut = f"'{FINALLY}' (line {step.mark.line}) does not succeed"
        return UnsetAfter(add_event(cut, after.success), add_event(cut, after.failure), after.skipped)


def _early_end_event(step: Step) -> str:
    return f"'{step.kind}' (line {step.mark.line}) {MODIFIERS[step.kind].early_end_text}"


def catches_failure(step: Step, child: Step) -> bool:
    """Return True if ``step`` need not fail when ``child`` fails, as it tries another child or ends differently."""
    if step.kind in MODIFIERS:
        return FAILURE not in MODIFIERS[step.kind].failure
    if step.kind == WAIT_FOR:
        return True
    kind = composite_kind(step)
    if kind is None:
        return False
    if kind.passes == FAILURE:
        return kind.order != "in order" or child is not step.children[-1]
    if step.kind != "parallel":
        return False
    counts = _decisive_counts(step, SUCCESS)
    return decide_parallel(len(step.children), counts).failures > 1


_ENDS = UnsetAfter._fields


def _ends_with(after: UnsetAfter, bits: int) -> Ends:
    """Return the results after which one of the variables of ``bits`` may be unset; -1 for all results of a step."""
    return frozenset(
        end for end, unset in zip(_ENDS, after, strict=True) if unset is not None and (bits == -1 or unset.bits & bits)
    )


def _decisive_counts(step: Step, end: str) -> Mapping[str, object]:
    """Return the counts of a parallel to which the rule of another composite without an order corresponds.

    A count that is computed has the value with which most children can be missed when the result is ``end``.
    """
    if step.kind == "race":
        return {SUCCESS_COUNT: 1}
    if step.kind != "parallel":
        kind = composite_kind(step)
        if kind is None or kind.passes != FAILURE:
            return {}
        # A computed weight may be 0, and then the failure of the other children is the end.
        return {SUCCESS_COUNT: 1, FAILURE_COUNT: 1 if _has_computed_argument(step) else ALL_CHILDREN}
    fewest = {SUCCESS_COUNT: 1, FAILURE_COUNT: ALL_CHILDREN}
    if end == FAILURE:
        fewest = {SUCCESS_COUNT: ALL_CHILDREN, FAILURE_COUNT: 1}
    return {word: value.constant if value.template is None else fewest[word] for word, value in step.arguments.items()}


def _has_computed_argument(step: Step) -> bool:
    return any(value.template is not None for value in step.arguments.values())


def _ticks_at_once(step: Step) -> bool:
    """Return whether a step is a modifier that ticks its child as soon as it is ticked itself."""
    kind = MODIFIERS.get(step.kind)
    return kind is not None and kind.child_ticks != "sometimes"


def _set_at_once(step: Step) -> frozenset[str]:
    """Return variables that a step certainly sets in its first tick."""
    if step.leaf is not None or _has_computed_argument(step):
        return step.direct_variables if step.leaf is Set and not _has_computed_argument(step) else frozenset()
    if step.kind in AT_ONCE or step.kind in TIME_LIMITS or _ticks_at_once(step):
        return _set_at_once(step.children[0])
    found = frozenset[str]()
    for child in step.children if step.kind == "sequence" else ():
        found |= _set_at_once(child)
        if child.leaf is not Set or _has_computed_argument(child):
            break
    return found


def _step_label(step: Step) -> str:
    return f"'{step.name}' (line {step.mark.line})"


def _case_label(case: object) -> str:
    return str(case).lower() if isinstance(case, bool) else str(case)


def _has_variable_condition(step: Step) -> bool:
    """Return whether a condition in ``step`` reads a variable, and not only the robot's state."""
    conditions = (each for each in step.walk() if each.kind in CONDITION_KINDS)
    values = (value.template for each in conditions for value in each.arguments.values())
    return any(read.name not in STATE_KINDS for template in values if template is not None for read in template.reads)


# Finds variables that are read before they are set, at all or on some path.

REPEATING_KINDS = frozenset(
    {
        *(word for word, kind in COMPOSITES.items() if kind.at_once or kind.reactive),
        *(word for word, kind in MODIFIERS.items() if kind.repeats or kind.every_tick),
        WAIT_FOR,
    }
)
"""Kinds of nodes below which any step may run after any other: when the children run again, or at the same time."""


MAX_SHOWN_EVENTS = 10
"""Maximum events of a path in a message."""

UNSET_HINT = "set it before, such as set: {{{0}: null}}, and test it here with if: {0} != null"


def check_assignments(context: CheckContext, tree: Step) -> None:
    """Report each variable that is read although no earlier step has set it, or not on every path."""
    before = len(context.faults)
    _check_order(context, tree, {*context.params, *context.missing_params, *(context.variables - tree.variables)})
    if len(context.faults) > before:
        return
    for each in find_unset_reads(tree, tree.variables - context.params.keys() - context.missing_params, context.params):
        when = f"it is not set where {_format_events(each.events)}" if each.path else "it is set only after this"
        context.fault_at(each.step, f"'{each.name}' is read here, but {when}", UNSET_HINT.format(each.name))


def _format_events(events: Sequence[str]) -> str:
    """Return the events of a path as text, at most ``MAX_SHOWN_EVENTS`` of them."""
    more = len(events) - MAX_SHOWN_EVENTS
    return ", ".join([*events[:MAX_SHOWN_EVENTS], *([f"and {more} more things happen"] if more > 0 else [])])


def _check_order(context: CheckContext, step: Step, known: set[str]) -> None:
    """Check the variables that ``step`` reads; ``known`` are those that can be set before it.

    The variables that ``step`` can set are added to ``known``.
    """
    if step.kind in REPEATING_KINDS:
        known |= step.variables
    for value in step.arguments.values():
        _check(context, step, value, known)
    if step.kind == FOR_EACH:  # the list is evaluated before the first round
        known |= step.variables
    if step.kind == MISSION:
        argument_names = set(step.arguments)
        _check_order(context, step.children[0], argument_names)
        for value in step.returns.values():
            _check(context, step, value, argument_names)
    else:
        for child in step.children:
            _check_order(context, child, known)
    known |= step.direct_variables


def _check(context: CheckContext, step: Step, value: Value, known: set[str]) -> None:
    if value.template is None:
        return
    for read in value.template.reads:
        if read.name not in known and read.name not in STATE_KINDS and read.name != FAILURE_NAME:
            context.fault_at(step, f"'{read.name}' is read here, but nothing before this sets it")
