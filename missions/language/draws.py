"""Check for ``random`` where an expression is evaluated again and again, or where its decimals are of no use."""

import ast
from collections.abc import Iterator

from config.diagnostics import Diagnostic, add_diagnostic
from missions.language.check_context import CheckContext
from missions.language.expressions import Expression, Template, Value, is_draw
from missions.language.inference import CONDITION_KIND
from missions.language.nodes import COMPOSITES, FAILURE, MODIFIERS, REACTIVE_SWITCH, SKIPPED, SUCCESS, SWITCH, WAIT_FOR
from missions.language.operators import RANDOM
from missions.language.plan import Step
from missions.language.takeover import TakeoverAnalysis


def check_draws(context: CheckContext, tree: Step) -> None:
    """Report each ``random`` that has no meaning in its place.

    These are expressions that are evaluated at every tick, or at each start of a node that remembers something, and
    those whose value must be whole, or equal to a case.
    """
    found: dict[Diagnostic, None] = {}  # reports a sub-mission that is used twice once
    for step in tree.walk():
        for name, value in step.arguments.items():
            formula = _formula(value)
            if formula is not None and formula.draws:
                found |= dict.fromkeys(_faults(step, name, value, formula))
    for fault in () if context.has_unreadable_line else found:
        add_diagnostic(context.faults, fault)


def _formula(value: Value) -> Expression | None:
    """Return the expression of a value that is nothing else, with or without ``${...}``; None for other values."""
    template = value.template
    if isinstance(template, Template) and len(template.parts) == 1:
        (part,) = template.parts
        return part if isinstance(part, Expression) else None
    return template if isinstance(template, Expression) else None


def _faults(step: Step, name: str, value: Value, formula: Expression) -> list[Diagnostic]:
    """Return the errors in an argument of ``step`` that draws numbers."""
    if _is_evaluated_at_every_tick(step):
        return _reports(value, formula, "would give another number at every tick")
    if step.kind in ("once", "cooldown"):
        return _reports(value, formula, "would give another number each time the node is about to start")
    if not _has_decimals(formula.tree):
        return []
    rounded = f"round({formula.text})"
    if step.kind == SWITCH and name == "on":
        return _reports(value, formula, "gives a number with decimals, which equals no case", f"write {rounded}")
    if _is_count(step, name):
        message = "gives a number with decimals, and this must be a whole number"
        return _reports(value, formula, message, f"write ${{{rounded}}}")
    return []


def _reports(value: Value, formula: Expression, message: str, hint: str = "", *, before: str = "") -> list[Diagnostic]:
    """Return a diagnostic for each ``random`` in a value.

    Without a ``hint``, the diagnostic says to store the number before, that is, before the node ``before``.
    """
    where = value.location
    if where is None:
        return []
    text = f"{where.label}: '{RANDOM}' {message}"
    found = []
    for call in formula.draws:
        column, length = formula.place(call)
        drawn = formula.text[column - formula.column :][:length]
        store = f'store a number before{before}, such as set: {{number: "${{{drawn}}}"}}, and read that here'
        found.append(Diagnostic(where.source, where.place(column, length), text, hint or store))
    return found


def _is_evaluated_at_every_tick(step: Step) -> bool:
    """Return whether a step evaluates its expression at every tick while it runs."""
    if step.leaf is not None:
        kinds = {argument.kind for argument in step.leaf.arguments.values()}
        return CONDITION_KIND in kinds and not step.leaf.instant
    return step.kind == REACTIVE_SWITCH or (step.kind in MODIFIERS and MODIFIERS[step.kind].every_tick)


def _is_count(step: Step, name: str) -> bool:
    if step.leaf is not None:
        return name in step.leaf.arguments and step.leaf.arguments[name].kind == "count"
    return step.kind == "parallel" or (step.kind in MODIFIERS and MODIFIERS[step.kind].value == "count")


def _has_decimals(node: ast.expr) -> bool:
    """Return whether a part of an expression is almost never a whole number, since ``random`` is a term of it."""
    match node:
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Mod(), left=left, right=right):
            return _has_decimals(left) or _has_decimals(right)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            return _has_decimals(operand)
    return is_draw(node)


# Hints about conditions that are evaluated again at every tick, because a node above starts them again.


def repeated_draw_hints(tree: Step) -> list[Diagnostic]:
    """Return a hint for each ``random`` in a condition that starts again at every tick.

    These are conditions in a reactive composite before its last child, and those under ``wait_for`` and ``hold``.
    """
    found: dict[Diagnostic, None] = {}
    analysis = TakeoverAnalysis()
    for step in tree.walk():
        kind = COMPOSITES.get(step.kind)
        is_reactive = kind is not None and kind.reactive
        for child in step.children[:-1] if is_reactive else step.children if step.kind in (WAIT_FOR, "hold") else ():
            for condition in _evaluated_at_start(analysis, child):
                found |= dict.fromkeys(_repeated_draws(step, condition))
    return list(found)


def _repeated_draws(around: Step, condition: Step) -> Iterator[Diagnostic]:
    for value in condition.arguments.values():
        formula = _formula(value)
        if formula is not None:
            message = f"gives another number at every tick, since '{around.kind}' evaluates it again"
            yield from _reports(value, formula, message, before=f" '{around.kind}'")


def _evaluated_at_start(analysis: TakeoverAnalysis, step: Step) -> Iterator[Step]:
    """Yield the conditions that may be evaluated in the tick in which ``step`` starts."""
    if step.leaf is not None:
        if step.leaf.instant and any(argument.kind == CONDITION_KIND for argument in step.leaf.arguments.values()):
            yield step
        return
    if step.kind in ("if", SWITCH):
        yield step
    if step.kind == "once":
        return
    kind = COMPOSITES.get(step.kind)
    for child in step.children[:1] if step.kind in MODIFIERS else step.children:
        yield from _evaluated_at_start(analysis, child)
        is_passed = bool(analysis.results(child) & {SUCCESS, FAILURE, SKIPPED})
        if kind is not None and kind.order == "in order" and not is_passed:
            return
