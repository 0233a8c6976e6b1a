"""Guards that do otherwise than they look: hints of `mission check`.

An action that stands where a reactive composite asks a question at every tick halts what stands behind it. A ``once``
around a guard remembers that it let nothing start.
"""

from collections.abc import Sequence

from config.faults import Diagnostic
from missions.language.nodes import COMPOSITES, FAILURE, MISSION, MODIFIERS, SUCCESS, SWITCHES
from missions.language.outcomes import ends, innermost
from missions.language.plan import Step
from missions.language.values import Value

ENDS_AT_ONCE = frozenset(
    {"succeed", "fail", "pretend", "led", "sound", "publish", "face", "show", "log", "set", "notify"}
)
"""Leaves that are no conditions, and need no time either."""

ASKS_FIRST = frozenset({"if", "while", "until", "cooldown", "once", "on_running"})
"""Modifiers with which a node runs only for a reason of its own, or not for longer than a tick."""

GUARDS = frozenset({"if", "while", "until"})
"""Modifiers that may end a node before it starts, for what they ask."""

RUNS_ITSELF = frozenset({"hold", "delay", "retry", "repeat"})
"""Modifiers that run by themselves, whatever they stand beside."""


def actions_as_guards(tree: Step) -> list[Diagnostic]:
    """Return a hint for each child before the last of a reactive composite that runs whenever it is asked."""
    found = []
    for step in tree.walk():
        kind = COMPOSITES.get(step.kind)
        if kind is not None and kind.reactive:
            found += [_hint(step, child, cause) for child in step.children[:-1] if (cause := _runs(child)) is not None]
    return found


def _hint(around: Step, child: Step, cause: Step) -> Diagnostic:
    place = innermost(child)
    what = f"'{cause.kind}' in it" if innermost(cause) is not place else f"'{cause.kind}'"
    return Diagnostic(
        place.source,
        place.mark,
        f"{what} runs whenever the {around.kind} asks it, and halts what stands behind it: an action used as a guard",
        "let a condition decide: as the first of a sequence, or by 'if' or 'while'",
    )


def _runs(step: Step) -> Step | None:
    """Return what runs each time that ``step`` is asked, though no condition has said so; None where nothing does."""
    if step.leaf is not None:
        return None if step.leaf.instant or step.kind in ENDS_AT_ONCE else step
    if step.kind in ASKS_FIRST or step.kind in SWITCHES or not step.children:
        return None
    if step.kind in RUNS_ITSELF:
        return step
    kind = COMPOSITES.get(step.kind)
    if step.kind in MODIFIERS or kind is None:
        return _runs(step.children[0])
    if kind.passes == SUCCESS and kind.order == "in order":
        return _first_that_decides(step.children)
    return next((cause for child in step.children if (cause := _runs(child)) is not None), None)


def _first_that_decides(children: Sequence[Step]) -> Step | None:
    """Return the cause in the first child of a sequence that does not simply succeed."""
    for child in children:
        cause = _runs(child)
        if cause is not None or ends(child) != {SUCCESS}:
            return cause
    return None


def guards_kept(tree: Step) -> list[Diagnostic]:
    """Return a hint for each ``once`` that also remembers the answer of a guard, which kept its node from starting."""
    found = []
    for step in tree.walk():
        guard = _first_guard(step.children[0]) if step.kind == "once" else None
        if guard is not None:
            said = f"'once' also remembers that '{guard.kind}' (line {guard.mark.line}) let nothing start"
            hint = _instead(step, guard)
            found.append(Diagnostic(step.source, step.mark, f"{said}, and does not ask it again", hint))
    return found


def _instead(once: Step, guard: Step) -> str:
    """Say how only what was done is done once."""
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
    """Return what is asked before anything is done in ``step``, and may end it then; None where nothing does."""
    if step.leaf is not None:
        asks = step.leaf.instant and FAILURE in ends(step) and step.kind not in ENDS_AT_ONCE
        return step if asks else None
    if step.kind in GUARDS:
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
        if guard is not None or not _ends_at_once(child):
            return guard
    return None


def _endless(step: Step) -> bool:
    return step.kind in MODIFIERS and MODIFIERS[step.kind].value == "count" and step.arguments["value"] == Value(None)


def _ends_at_once(step: Step) -> bool:
    return step.leaf is not None and (step.leaf.instant or step.kind in ENDS_AT_ONCE)
