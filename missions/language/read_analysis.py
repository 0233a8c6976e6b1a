"""Static analysis of expressions: names that are always read, and evaluations that may fail."""

import ast
from collections.abc import Collection, Iterator, Mapping

from missions.language.expressions import Expression, Template, Value, is_draw
from missions.language.for_each import steps_in_scope
from missions.language.kinds import CONSTANTS, STATE_KINDS
from missions.language.plan import Step


def always_read_names(value: Value) -> frozenset[str]:
    """Return the names that each evaluation of ``value`` reads.

    Names behind ``and``, ``or`` or ``if`` may be skipped, so they are not included.
    """
    formula = value.template
    if formula is None:
        return frozenset()
    return frozenset(name for tree in _trees(formula) for name in _names(tree))


def nonzero_variables(tree: Step, params: Mapping[str, object]) -> frozenset[str]:
    """Return the variables of a mission that can only hold numbers other than 0.

    ``params`` are the known values of params.
    """
    held = {name: [value] for name, value in params.items()}
    for step in steps_in_scope(tree):
        for name in step.direct_variables:
            value = step.arguments.get(name) if step.leaf is not None and step.leaf.open_ended else None
            held.setdefault(name, []).append(None if value is None else value.constant)
    return frozenset(name for name, values in held.items() if all(isinstance(v, int | float) and v for v in values))


def may_fail(value: Value, unset: Collection[str], nonzero: Collection[str]) -> bool:
    """Return True if the evaluation of ``value`` can fail in a run because a name is unset or a divisor is 0.

    ``unset`` are names that may have no value; ``nonzero`` are names that are never 0. Mixed dimensions are not
    counted, as other checks report them.
    """
    formula = value.template
    if formula is None:
        return False
    return any(read.name in unset for read in formula.reads) or not all(
        _always_has_value(tree, nonzero) for tree in _trees(formula)
    )


def _always_has_value(node: ast.expr, nonzero: Collection[str]) -> bool:
    """Return whether an expression always has a value if all names in it have one.

    It may not if it reads a member, calls a function, or divides by a number that may be zero.
    """
    match node:
        case ast.Name() | ast.Constant():
            return True
        case ast.BinOp(op=ast.Div() | ast.FloorDiv() | ast.Mod(), right=right):
            is_nonzero = isinstance(right, ast.Name) and right.id in nonzero
            if not is_nonzero and not (isinstance(right, ast.Constant) and right.value):
                return False
        case ast.Attribute(value=ast.Name(id=part)) if part in STATE_KINDS:
            return True
        case ast.Call(args=[ast.Constant(), ast.Constant()]) if is_draw(node):
            return True
        case ast.Attribute() | ast.Subscript() | ast.Call():
            return False
    below = (part for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr))
    return all(_always_has_value(part, nonzero) for part in below)


def _trees(formula: Template | Expression) -> list[ast.expr]:
    parts = (formula,) if isinstance(formula, Expression) else formula.parts
    return [part.tree for part in parts if isinstance(part, Expression)]


def _names(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Name(id=name):
            if name not in CONSTANTS:
                yield name
        case ast.BoolOp(values=[first, *_]) | ast.IfExp(test=first):
            yield from _names(first)
        case ast.Call(args=parts):
            for part in parts:
                yield from _names(part)
        case _:
            for below in ast.iter_child_nodes(node):
                if isinstance(below, ast.expr):
                    yield from _names(below)
