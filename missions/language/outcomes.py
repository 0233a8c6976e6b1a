"""Possible results (success, failure, skipped) of steps, to report unreachable steps and modifiers without effect."""

from collections import Counter
from collections.abc import Sequence
from functools import partial

from config.diagnostics import Diagnostic
from missions.language.check_context import CheckContext
from missions.language.expressions import INVALID_VALUE, Value
from missions.language.for_each import ListMembers
from missions.language.kinds import STATE_KINDS
from missions.language.nodes import (
    BOTH_ENDS,
    COMPOSITES,
    FAILURE,
    FINALLY,
    FOR_EACH,
    MISSION,
    MODIFIERS,
    RECOVER,
    RESTART,
    RETRY,
    SKIPPED,
    SUCCESS,
    SWITCHES,
    TIME_LIMITS,
    WAIT_FOR,
    Ends,
)
from missions.language.parallel_counts import FAILURE_COUNT, SUCCESS_COUNT, WAIT_FOR_ALL, decide_parallel, parallel_ends
from missions.language.plan import UNREAD_KIND, Step, composite_kind
from missions.language.read_analysis import may_fail

VERBS = {SUCCESS: "succeeds", FAILURE: "fails"}


def check_outcomes(context: CheckContext, tree: Step) -> None:
    """Report steps that are never reached, and modifiers without effect."""
    for step in tree.walk():
        kind = composite_kind(step)
        if kind is not None and kind.order == "in order":
            _check_unreached(context, step, kind.passes)
        elif step.kind == "parallel":
            _check_counts(context, step)
        elif step.kind in MODIFIERS:
            _check_pointless(context, step, step.children[0])
        elif step.kind == WAIT_FOR:
            _check_wait(context, step, step.children[0])


def _check_wait(context: CheckContext, step: Step, child: Step) -> None:
    """Report a ``wait_for`` around a child that never fails or never succeeds."""
    ends = ends_with_faults(child)
    if FAILURE not in ends:
        context.fault_at(step, f"'{WAIT_FOR}' has no effect here: '{child.name}' never fails")
    elif ends.isdisjoint({SUCCESS, SKIPPED}):
        context.fault_at(step, f"'{WAIT_FOR}' is never over: '{child.name}' never succeeds")


def _check_unreached(context: CheckContext, step: Step, passes: str) -> None:
    for child, after in zip(step.children, step.children[1:], strict=False):
        if ends_with_faults(child).isdisjoint({passes, SKIPPED}):
            what = f"'{child.name}' (line {innermost_step(child).mark.line}) never {VERBS[passes]}"
            context.fault_at(innermost_step(after), f"'{after.name}' is never reached: {what}")
            return


def _check_counts(context: CheckContext, step: Step) -> None:
    """Report counts of a parallel (``success_count``, ``failure_count``) that its children cannot reach.

    Also report a ``wait_for_all`` that has no effect, or never ends.
    """
    settings = {word: value.constant for word, value in step.arguments.items() if value.template is None}
    if len(settings) < len(step.arguments):
        return
    below = [ends_with_faults(child) for child in step.children]
    succeed, fail = (sum(end in each for each in below) for end in (SUCCESS, FAILURE))
    decided = decide_parallel(len(below), settings)
    of = f"of its {len(below)} children"
    if SUCCESS_COUNT in settings and succeed < decided.successes:
        context.fault_at(
            step, f"'{SUCCESS_COUNT}: {decided.successes}' is never reached: only {succeed} {of} can succeed"
        )
    if isinstance(settings.get(FAILURE_COUNT), int) and not fail:
        context.fault_at(step, f"'{FAILURE_COUNT}: {decided.failures}' has no effect: none {of} can fail")
    endless = next((child for child, each in zip(step.children, below, strict=True) if not each), None)
    if decided.waits_for_all and endless is not None:
        what = f"'{endless.name}' (line {innermost_step(endless).mark.line}) never does"
        context.fault_at(step, f"with '{WAIT_FOR_ALL}' it ends when all have, and {what}")
    elif decided.waits_for_all and not fail and decided.successes == len(below):
        context.fault_at(step, f"'{WAIT_FOR_ALL}' has no effect: none {of} can fail, so all are waited for anyway")


def _check_pointless(context: CheckContext, step: Step, child: Step) -> None:
    """Report the modifier ``step`` as without effect if its child never has the result that it reacts to.

    For example, ``retry`` reacts to a failure.
    """
    occasion, leaf = MODIFIERS[step.kind].relevant_end, child.leaf
    if step.arguments["value"] is INVALID_VALUE:
        return
    if (
        leaf is not None
        and leaf.instant
        and (step.kind == "on_running" or (step.kind == "timeout" and not child.direct_needs))
    ):
        context.fault_at(step, f"'{step.kind}' has no effect here: '{child.kind}' ends at once")
    elif occasion and occasion not in ends_with_faults(child):
        message = f"'{step.kind}' has no effect here: '{child.name}' never {VERBS[occasion]}"
        context.fault_at(step, message, _order_hint(step, child, occasion))
    elif step.kind in TIME_LIMITS:
        _check_times(context, step, child)
    elif step.kind == RETRY and len(step.children) > 1 and step.arguments["value"] == Value(1):
        recovery = innermost_step(step.children[1])
        context.fault_at(recovery, f"'{RECOVER}' never runs: no attempt follows the first of '{RETRY}: 1'")


def _order_hint(step: Step, child: Step, end: str) -> str:
    """Return a hint to exchange two modifiers, if the inner one prevents the result ``end`` that ``step`` reacts to.

    Empty if that is not the cause.
    """
    while child.leaf is None and "value" in child.arguments:
        below = child.children[0]
        if end in ends_with_faults(below):
            return f"the order is the cause: write '{step.kind}' above '{child.kind}' (line {child.mark.line})"
        child = below
    return ""


def _check_times(context: CheckContext, step: Step, child: Step) -> None:
    """Report a ``delay`` that is longer than the ``timeout`` or ``for`` around it, and a limit without effect.

    ``step`` is the outer one of two limits. It has no effect if a shorter one inside ends the node first.
    """
    limit = step.arguments["value"].constant
    limits_all = True  # a limit inside bounds the whole time of ``step``
    while child.leaf is None and "value" in child.arguments and isinstance(limit, float):
        own = child.arguments["value"].constant
        outer, inner = f"the '{step.kind}' of {step.text}", f"the '{child.kind}' of {child.text}"
        if child.kind == "delay" and isinstance(own, float) and own >= limit:
            what = f"{inner} is longer than {outer} around it"
            hint = f"the order is the cause: write '{step.kind}' above 'delay' (line {child.mark.line})"
            context.fault_at(innermost_step(child), f"'{child.name}' is never reached: {what}", hint)
        elif child.kind in TIME_LIMITS and isinstance(own, float):
            if own >= limit:
                context.fault_at(child, f"'{child.kind}' has no effect here: {outer} around it is over first")
            elif limits_all:
                context.fault_at(step, f"'{step.kind}' has no effect here: {inner} inside it is over first")
        limits_all = limits_all and child.kind not in LENGTHENING_MODIFIERS
        child = child.children[0]


LENGTHENING_MODIFIERS = frozenset({"delay", "hold", RETRY, "repeat", FINALLY})
"""Modifiers that can run for longer than their child."""


def innermost_step(step: Step) -> Step:
    """Return the behaviour inside the modifiers of ``step``; errors are shown at its line."""
    while step.children and step.leaf is None and step.kind != MISSION and "value" in step.arguments:
        step = step.children[0]
    return step


def possible_ends(step: Step, *, with_faults: bool = False) -> Ends:
    """Return the results (success, failure, skipped) with which a step can end; empty if it never ends.

    Any step can also be halted. With ``with_faults``, the results include failures by silent sensors, and by values
    that cannot be calculated in a run.
    """
    if step.leaf is not None:
        ends = step.leaf.ends
    else:
        ends = _parent_ends(step, [possible_ends(child, with_faults=with_faults) for child in step.children])
    return ends | {FAILURE} if with_faults and FAILURE not in ends and _can_fail_by_fault(step) else ends


ends_with_faults = partial(possible_ends, with_faults=True)


def _can_fail_by_fault(step: Step) -> bool:
    """Return whether a step can fail because a sensor stays silent, or because a value of it cannot be calculated.

    Failures that its children pass on are left out. A reactive composite and ``wait_for`` fail when anything in them
    has waited for a sensor for too long.
    """
    kind = COMPOSITES.get(step.kind)
    if step.kind == WAIT_FOR or (kind is not None and kind.reactive):
        return bool(step.needs)
    return any(
        value.convert not in (None, bool)
        or may_fail(value, (), ())
        or any(read.name in STATE_KINDS for read in value.template.reads)
        for value in (*step.arguments.values(), *step.returns.values())
        if value.template is not None
    )


def _parent_ends(step: Step, below: list[Ends]) -> Ends:
    """Return the possible results of a step with children; ``below`` are the possible results of each child."""
    if step.kind == UNREAD_KIND:
        return BOTH_ENDS
    if step.kind in MODIFIERS:
        return _modifier_ends(step, below)
    if step.kind in SWITCHES:
        return frozenset().union(*below) | (frozenset() if len(below) > len(step.cases) else {FAILURE})
    if step.kind == FOR_EACH:
        return _for_each_ends(step, below[0])
    if step.kind == WAIT_FOR:
        return below[0] - {FAILURE}
    return below[0] if step.kind == MISSION else _composite_ends(step, below)


def early_ends(step: Step) -> Ends:
    """Return the results (success, failure, skipped) that a modifier can have before its child has ended."""
    status = {"succeed": SUCCESS, "fail": FAILURE}.get(step.text)
    cut = MODIFIERS[step.kind].early_ends
    return cut if status is None or step.kind != "on_running" else cut & {status}


def _modifier_ends(step: Step, below: list[Ends]) -> Ends:
    kind = MODIFIERS[step.kind]
    ways = {SUCCESS: kind.success, FAILURE: kind.failure, SKIPPED: frozenset({SKIPPED})}
    passed = (ways[end] - {RESTART} for end in below[0] if not (kind.without_limit(end) and _forever(step)))
    ends = early_ends(step).union(*passed)
    endless_recovery = step.kind == RETRY and len(below) > 1 and not below[1]
    return ends - {FAILURE} if endless_recovery else ends


def _composite_ends(step: Step, below: list[Ends]) -> Ends:
    if not step.children:
        return BOTH_ENDS
    if step.kind == "parallel":
        return _parallel_ends(step, below)
    passes = COMPOSITES[step.kind].passes
    if not passes:
        return frozenset().union(*below) - {SKIPPED} | _skipped_with_all(below)
    return _all_or_one(below, passes, FAILURE if passes == SUCCESS else SUCCESS)


def _all_or_one(below: list[Ends], all_end: str, one_ends: str) -> Ends:
    """Return the possible results of a composite that ends with ``all_end`` if all its children do.

    It ends with ``one_ends`` as soon as one child does. ``below`` are the possible results of each child. Skipped
    children do not count.
    """
    found = set()
    for each in below:
        if one_ends in each:
            found.add(one_ends)
        if each.isdisjoint({all_end, SKIPPED}):
            return frozenset(found)
    if any(all_end in each for each in below):
        found.add(all_end)
    return frozenset(found) | _skipped_with_all(below)


def _skipped_with_all(below: list[Ends]) -> Ends:
    """Return the result SKIPPED if all children can have it, or else no result."""
    return frozenset({SKIPPED}) if all(SKIPPED in each for each in below) else frozenset()


def _forever(step: Step) -> bool:
    value = step.arguments["value"]
    return value.template is None and value.constant is None


def _parallel_ends(step: Step, below: list[Ends]) -> Ends:
    """Return the possible results of a parallel, from those of its children and the counts beside it."""
    if any(value.template is not None for value in step.arguments.values()):
        return BOTH_ENDS | _skipped_with_all(below)
    settings = {word: value.constant for word, value in step.arguments.items()}
    return parallel_ends(len(below), Counter(below), settings)


def _for_each_ends(step: Step, below: Ends) -> Ends:
    """Return the possible results of a for_each, of which ``below`` are those of its child.

    With an empty list it always succeeds.
    """
    members = step.arguments["in"].constant
    count = members.count if isinstance(members, ListMembers) else None
    return frozenset({SUCCESS}) if count == 0 else below if count else below | {SUCCESS}


# Hints about guards that behave differently from how they look.
#
# An action in the place of a condition of a reactive composite halts the children after it at every tick. A ``once``
# around a guard remembers the failure, so nothing starts later either.

INSTANT_ACTIONS = frozenset(
    {"succeed", "fail", "pretend", "led", "sound", "publish", "face", "show", "log", "set", "notify"}
)
"""Leaves that are not conditions, and end at once."""

WAIT_UNTIL = "wait_until"

CONDITIONAL_MODIFIERS = frozenset({"if", "while", "until", "cooldown", "once"})
"""Modifiers with which a node is not always ticked."""

GUARD_MODIFIERS = frozenset({"while", "until"})
"""Modifiers with a condition that can end a node before it starts.

``if`` is not among them, since ``once`` does not store that a node was skipped.
"""

RUNNING_MODIFIERS = frozenset({"hold", "delay", "retry", "repeat"})
"""Modifiers that can be running while their child is not."""


def actions_as_guards(tree: Step) -> list[Diagnostic]:
    """Return hints about reactive composites in which a child takes time although it runs again at every tick.

    Only the last child of a reactive composite is meant to take time.
    """
    found = []
    for step in tree.walk():
        kind = COMPOSITES.get(step.kind)
        if kind is not None and kind.reactive:
            found += [
                _guard_hint(step, child, cause)
                for child in step.children[:-1]
                if (cause := _find_running(child)) is not None
            ]
    return found


def _guard_hint(around: Step, child: Step, cause: Step) -> Diagnostic:
    place = innermost_step(child)
    what = f"'{cause.kind}' in it" if innermost_step(cause) is not place else f"'{cause.kind}'"
    if cause.kind == WAIT_UNTIL or (cause.kind == WAIT_FOR and _find_running(cause.children[0]) is None):
        again = ", and starts them again after that" if COMPOSITES[around.kind].passes == SUCCESS else ""
        message = f"while {what} waits, the {around.kind} halts the children after it{again}"
        instead = "use 'check'" if cause.kind == WAIT_UNTIL else f"leave out '{WAIT_FOR}'"
        return Diagnostic(
            place.source, place.mark, message, f"{instead} to fail at once, or wait before the {around.kind}"
        )
    return Diagnostic(
        place.source,
        place.mark,
        f"{what} runs whenever the {around.kind} ticks it, and halts the children after it: an action used as a guard",
        "add a condition: as the first child of a sequence, or by 'if' or 'while'",
    )


def _find_running(step: Step) -> Step | None:
    """Return a step that takes time whenever ``step`` is ticked, whatever its conditions; None if there is none."""
    if step.leaf is not None:
        return None if step.leaf.instant or step.kind in INSTANT_ACTIONS else step
    if step.kind in CONDITIONAL_MODIFIERS or step.kind in SWITCHES or not step.children:
        return None
    if step.kind == "on_running":
        return _find_acting(step.children[0])
    if step.kind in RUNNING_MODIFIERS or step.kind == WAIT_FOR:
        return step
    if step.kind == FINALLY:
        return next((cause for child in step.children if (cause := _find_running(child)) is not None), None)
    kind = COMPOSITES.get(step.kind)
    if step.kind in MODIFIERS or kind is None:
        return _find_running(step.children[0])
    if kind.passes == SUCCESS and kind.order == "in order":
        return _first_that_decides(step.children)
    return next((cause for child in step.children if (cause := _find_running(child)) is not None), None)


def _find_acting(step: Step) -> Step | None:
    """Return a leaf that drives or takes time to act whenever ``step`` is ticked; None if there is none.

    Such a leaf halts the children after it before it starts, even if it has only one tick.
    """
    cause = _find_running(step)
    while cause is not None and cause.leaf is None:
        cause = _find_running(cause.children[0])
    return cause if cause is not None and cause.leaf is not None and (cause.leaf.drives or cause.leaf.acts) else None


def _first_that_decides(children: Sequence[Step]) -> Step | None:
    """Return the step that takes time in the first child of a sequence that contains one.

    None if no child takes time, or if a child before it may fail or not end.
    """
    for child in children:
        cause = _find_running(child)
        if cause is not None or possible_ends(child) - {SKIPPED} != {SUCCESS}:
            return cause
    return None


def find_once_guards(tree: Step) -> list[Diagnostic]:
    """Return a hint for each ``once`` that also stores the result of a guard."""
    found = []
    for step in tree.walk():
        guard = _first_guard(step.children[0]) if step.kind == "once" else None
        if guard is not None:
            message = f"'once' also remembers that '{guard.kind}' (line {guard.mark.line}) prevented the start"
            hint = _once_hint(step, guard)
            found.append(Diagnostic(step.source, step.mark, f"{message}, and does not evaluate it again", hint))
    return found


def _once_hint(once: Step, guard: Step) -> str:
    """Return a hint how to put ``once`` around the action only, and not around the guard."""
    child = once.children[0]
    while child is not guard and child.kind in MODIFIERS:
        child = child.children[0]
    if child is not guard:
        return f"put 'once' beside what follows '{guard.kind}', not around both"
    if guard.kind in MODIFIERS:
        return f"write 'once' above '{guard.kind}'"
    if guard.kind in SWITCHES:
        return "put 'once' beside the behaviour of each case"
    return f"begin a sequence with '{guard.kind}', and put 'once' beside what follows it"


def _first_guard(step: Step) -> Step | None:
    """Return the condition in ``step`` that can end it before an action starts; None if there is none."""
    if step.leaf is not None:
        asks = step.leaf.instant and FAILURE in possible_ends(step) and step.kind not in INSTANT_ACTIONS
        return step if asks else None
    if step.kind in GUARD_MODIFIERS:
        return step if step.arguments["value"].template is not None else _first_guard(step.children[0])
    if step.kind in SWITCHES:
        return None if len(step.children) > len(step.cases) else step
    if step.kind in MODIFIERS or step.kind == MISSION:
        return None if _endless(step) else _first_guard(step.children[0])
    kind = COMPOSITES.get(step.kind)
    if kind is None:
        return None
    guards = [_first_guard(child) for child in step.children]
    if kind.passes == FAILURE:
        return guards[0] if all(guards) else None
    if kind.at_once:
        return next(filter(None, guards), None)
    for child, guard in zip(step.children, guards, strict=True):
        if guard is not None or not ends_at_once(child):
            return guard
    return None


def _endless(step: Step) -> bool:
    return step.kind in MODIFIERS and MODIFIERS[step.kind].value == "count" and step.arguments["value"] == Value(None)


def ends_at_once(step: Step) -> bool:
    """Return whether a step is a leaf that never runs for longer than a tick."""
    return step.leaf is not None and (step.leaf.instant or step.kind in INSTANT_ACTIONS)
