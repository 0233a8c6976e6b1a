"""Check for ``random`` in expressions that are evaluated at every tick, where its value would change all the time."""

from config.diagnostics import Diagnostic, add_diagnostic
from missions.language.check_context import CheckContext
from missions.language.expressions import Expression
from missions.language.inference import CONDITION_KIND
from missions.language.nodes import MODIFIERS, REACTIVE_SWITCH
from missions.language.operators import RANDOM
from missions.language.plan import Step

HINT = f'store a number before, such as set: {{chance: "${{{RANDOM}(0, 1)}}"}}, and read that here'


def check_draws(context: CheckContext, tree: Step) -> None:
    """Report each ``random`` in an expression that is evaluated at every tick."""
    found: dict[Diagnostic, None] = {}  # reports a sub-mission that is used twice once
    for step in tree.walk():
        for value in step.arguments.values() if _is_evaluated_at_every_tick(step) else ():
            formula, where = value.template, value.location
            if isinstance(formula, Expression) and where is not None:
                message = f"{where.label}: '{RANDOM}' would give another number at every tick"
                places = (where.place(*formula.place(call)) for call in formula.draws)
                found |= dict.fromkeys(Diagnostic(where.source, place, message, HINT) for place in places)
    for fault in () if context.has_unreadable_line else found:
        add_diagnostic(context.faults, fault)


def _is_evaluated_at_every_tick(step: Step) -> bool:
    """Return whether a step evaluates its expression at every tick while it runs."""
    if step.leaf is not None:
        kinds = {argument.kind for argument in step.leaf.arguments.values()}
        return CONDITION_KIND in kinds and not step.leaf.instant
    return step.kind == REACTIVE_SWITCH or (step.kind in MODIFIERS and MODIFIERS[step.kind].every_tick)
