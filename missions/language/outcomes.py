"""How a step can end: so that what is never reached, and a modifier that cannot matter, are seen before a run."""

from collections.abc import Callable

from missions.language.counts import decision
from missions.language.for_each import Members
from missions.language.notes import Notes
from missions.language.plan import (
    FAILURE_COUNT,
    FOR_EACH,
    MISSION,
    SUCCESS_COUNT,
    SWITCHES,
    UNKNOWN,
    WAIT_FOR_ALL,
    Step,
)
from missions.language.values import UNREAD

Ends = frozenset[str]
SUCCESS, FAILURE = "success", "failure"
BOTH: Ends = frozenset({SUCCESS, FAILURE})

LETS_THROUGH = frozenset(
    {"timeout", "retry", "repeat", "on_failure", "on_running", "while", "until", "hold", "delay", "cooldown", "once"}
)
"""The modifiers that succeed where what they stand around does."""


def check_outcomes(notes: Notes, tree: Step) -> None:
    """Note the steps that are never reached, and the modifiers that cannot matter."""
    for step in tree.walk():
        if step.kind in ("sequence", "reactive_sequence"):
            _unreached(notes, step, SUCCESS, "succeeds")
        elif step.kind in ("selector", "reactive_selector"):
            _unreached(notes, step, FAILURE, "fails")
            _no_else(notes, step)
        elif step.kind == "parallel":
            _counted(notes, step)
        elif len(step.children) == 1:
            _pointless(notes, step, step.children[0])


def _unreached(notes: Notes, step: Step, passes: str, verb: str) -> None:
    for child, after in zip(step.children, step.children[1:], strict=False):
        if passes not in ends(child):
            what = f"'{child.name}' (line {_inner(child).mark.line}) never {verb}"
            notes.fault_at(_inner(after), f"'{after.name}' is never reached: {what}")
            return


def _counted(notes: Notes, step: Step) -> None:
    """Note a count that a parallel cannot come to, and a wait for all that is over at once, or never."""
    settings = {word: value.constant for word, value in step.arguments.items() if value.template is None}
    if len(settings) < len(step.arguments):
        return
    below = [ends(child) for child in step.children]
    succeed, fail = (sum(end in each for each in below) for end in (SUCCESS, FAILURE))
    decided = decision(len(below), settings)
    of = f"of its {len(below)} children"
    if SUCCESS_COUNT in settings and succeed < decided.successes:
        notes.fault_at(
            step, f"'{SUCCESS_COUNT}: {decided.successes}' is never reached: only {succeed} {of} can succeed"
        )
    if isinstance(settings.get(FAILURE_COUNT), int) and fail < decided.failures:
        notes.fault_at(step, f"'{FAILURE_COUNT}: {decided.failures}' cannot matter: only {fail} {of} can fail")
    endless = next((child for child, each in zip(step.children, below, strict=True) if not each), None)
    if decided.waits and endless is not None:
        what = f"'{endless.name}' (line {_inner(endless).mark.line}) never does"
        notes.fault_at(step, f"with '{WAIT_FOR_ALL}' it ends when all have, and {what}")
    elif decided.waits and not fail and decided.successes == len(below):
        notes.fault_at(step, f"'{WAIT_FOR_ALL}' cannot matter: none {of} can fail, so all are waited for anyway")


def _no_else(notes: Notes, step: Step) -> None:
    """Note an ``if`` after which others wait for a failure: where it is false, none of them has its turn."""
    for child in map(_behind, step.children[:-1]):
        if child.kind == "if":
            notes.fault_at(
                child,
                f"'if' is no 'else' in a {step.kind}: what is skipped counts as success, and the others are not tried",
                "write switch: {on: ..., cases: {true: ...}, default: ...}, or put 'if' beside the last of them",
            )


def _behind(step: Step) -> Step:
    """Return the first step within that can turn a success into something else, or a failure into a success."""
    while step.kind in LETS_THROUGH:
        step = step.children[0]
    return step


def _pointless(notes: Notes, step: Step, child: Step) -> None:
    """Note a modifier whose occasion never comes."""
    never = {
        "retry": (FAILURE, "never fails"),
        "on_failure": (FAILURE, "never fails"),
        "repeat": (SUCCESS, "never succeeds"),
        "hold": (SUCCESS, "never succeeds"),
        "cooldown": (SUCCESS, "never succeeds"),
        "on_success": (SUCCESS, "never succeeds"),
    }
    leaf = child.leaf
    if step.arguments.get("value") is UNREAD:
        return
    if step.kind in ("timeout", "on_running") and leaf is not None and leaf.instant:
        notes.fault_at(step, f"'{step.kind}' cannot matter here: '{child.kind}' ends at once")
    elif step.kind in never and never[step.kind][0] not in ends(child):
        said = f"'{step.kind}' cannot matter here: '{child.name}' {never[step.kind][1]}"
        notes.fault_at(step, said, _order(step, child, never[step.kind][0]))
    elif step.kind == "timeout":
        _too_late(notes, step, child)


def _order(step: Step, child: Step, end: str) -> str:
    """Say so where only the order of two modifiers keeps an end of the behaviour from the outer one, ``step``."""
    while child.leaf is None and "value" in child.arguments:
        (below,) = child.children
        if end in ends(below):
            return f"the order is the cause: write '{step.kind}' above '{child.kind}' (line {child.mark.line})"
        child = below
    return ""


def _too_late(notes: Notes, step: Step, child: Step) -> None:
    """Note a ``delay`` that goes on for longer than the ``timeout`` that is written below it."""
    limit = step.arguments["value"].constant
    while child.leaf is None and "value" in child.arguments:
        wait = child.arguments["value"].constant
        if child.kind == "delay" and isinstance(wait, float) and isinstance(limit, float) and wait >= limit:
            what = f"the 'delay' of {child.text} goes on for longer than the 'timeout' of {step.text} around it"
            hint = f"the order is the cause: write 'timeout' above 'delay' (line {child.mark.line})"
            notes.fault_at(_inner(child), f"'{child.name}' is never reached: {what}", hint)
        child = child.children[0]


def _inner(step: Step) -> Step:
    """Return the behaviour itself inside its modifiers: where a person looks for it."""
    while len(step.children) == 1 and step.leaf is None and step.kind != MISSION and "value" in step.arguments:
        step = step.children[0]
    return step


def ends(step: Step) -> Ends:
    """Return how a step can end; empty for one that never does. A step that stands alone may always be halted."""
    if step.leaf is not None:
        return step.leaf.ends
    below = [ends(child) for child in step.children]
    if step.kind == UNKNOWN:
        return BOTH
    rule = _RULES.get(step.kind)
    return below[0] if rule is None else rule(step, below)


def _all_or_one(below: list[Ends], all_end: str, one_ends: str) -> Ends:
    """Return the ends of a composite that needs all of its children for one result, and any one for the other."""
    found = set()
    for each in below:
        if one_ends in each:
            found.add(one_ends)
        if all_end not in each:
            return frozenset(found)
    return frozenset(found | {all_end})


def _forever(step: Step) -> bool:
    value = step.arguments["value"]
    return value.template is None and value.constant is None


def _after_success(step: Step, below: list[Ends]) -> Ends:
    return _all_or_one(below, SUCCESS, FAILURE) if step.children else BOTH


def _after_failure(step: Step, below: list[Ends]) -> Ends:
    return _all_or_one(below, FAILURE, SUCCESS) if step.children else BOTH


def _parallel(step: Step, below: list[Ends]) -> Ends:
    """Return the ends of a parallel, from how many of its children can succeed, fail, and end at all."""
    if not step.children or any(value.template is not None for value in step.arguments.values()):
        return BOTH
    succeed, fail = (sum(end in each for each in below) for end in (SUCCESS, FAILURE))
    decided = decision(len(below), {word: value.constant for word, value in step.arguments.items()})
    if decided.waits and not all(below):
        return frozenset()
    found = {SUCCESS: succeed >= decided.successes, FAILURE: fail >= decided.failures}
    return frozenset(end for end, possible in found.items() if possible)


def _each(step: Step, below: list[Ends]) -> Ends:
    """Return the ends of a for_each: where its list may be empty, it can succeed whatever its child does."""
    members = step.arguments["in"].constant
    count = members.count if isinstance(members, Members) else None
    return frozenset({SUCCESS}) if count == 0 else below[0] if count else below[0] | {SUCCESS}


def _any(step: Step, below: list[Ends]) -> Ends:
    chosen_from_all = step.kind == "race" or len(below) > len(step.cases)
    return frozenset().union(*below) | (frozenset() if chosen_from_all else {FAILURE})


_RULES: dict[str, Callable[[Step, list[Ends]], Ends]] = {
    "sequence": _after_success,
    "reactive_sequence": _after_success,
    "random_sequence": _after_success,
    "parallel": _parallel,
    "selector": _after_failure,
    "reactive_selector": _after_failure,
    "random_selector": _after_failure,
    "race": _any,
    **dict.fromkeys(SWITCHES, _any),
    "invert": lambda _, below: frozenset({SUCCESS: FAILURE, FAILURE: SUCCESS}[end] for end in below[0]),
    "on_failure": lambda _, below: frozenset({SUCCESS}) if below[0] else below[0],
    "on_success": lambda _, below: frozenset({FAILURE}) if below[0] else below[0],
    "on_running": lambda step, below: below[0] | {SUCCESS if step.text == "succeed" else FAILURE},
    "repeat": lambda step, below: below[0] - {SUCCESS} if _forever(step) else below[0],
    "retry": lambda step, below: below[0] - {FAILURE} if _forever(step) else below[0],
    FOR_EACH: _each,
    "hold": lambda _, below: below[0] - {FAILURE},
    "timeout": lambda _, below: below[0] | {FAILURE},
    "while": lambda _, below: below[0] | {FAILURE},
    "cooldown": lambda _, below: below[0] | {FAILURE},
    "until": lambda _, below: below[0] | {SUCCESS},
    "if": lambda _, below: below[0] | {SUCCESS},
}
"""How each kind can end, from how its children can; a kind that is not here ends as its one child does."""
