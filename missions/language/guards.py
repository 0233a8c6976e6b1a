"""Actions that stand where a reactive composite asks a question at every tick: they halt what stands behind them."""

from collections.abc import Sequence

from config.faults import Diagnostic
from missions.language.nodes import COMPOSITES, MODIFIERS, SUCCESS, SWITCHES
from missions.language.outcomes import ends, innermost
from missions.language.plan import Step

ENDS_AT_ONCE = frozenset({"succeed", "fail", "pretend", "led", "sound", "publish", "face", "show"})
"""Leaves that are no conditions, and need no time either."""

ASKS_FIRST = frozenset({"if", "while", "until", "cooldown", "once", "on_running"})
"""Modifiers with which a node runs only for a reason of its own, or not for longer than a tick."""

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
