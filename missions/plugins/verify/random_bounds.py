"""Bounds of random numbers: the truth values that a condition with ``random`` can have."""

import ast
import math
from collections.abc import Mapping

from missions.language.expressions import is_draw

Bounds = tuple[float, float]

EVERY_NUMBER: Bounds = (-math.inf, math.inf)
BOTH = frozenset({True, False})


def truth_values(node: ast.expr, scope: Mapping[str, object]) -> frozenset[bool]:
    """Return the truth values that a condition can have, given the known variables in ``scope``.

    It may contain a truth value that no evaluation has, but never lacks one that an evaluation has.
    """
    match node:
        case ast.Constant(value=bool() as value):
            return frozenset({value})
        case ast.UnaryOp(op=ast.Not(), operand=part):
            return frozenset(not value for value in truth_values(part, scope))
        case ast.BoolOp(op=op, values=parts):
            found = [truth_values(part, scope) for part in parts]
            decisive, other = (True, False) if isinstance(op, ast.Or) else (False, True)
            may_decide = any(decisive in each for each in found)
            may_pass = all(other in each for each in found)
            return frozenset([decisive] * may_decide + [other] * may_pass)
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return _comparison_values(op, _bounds(left, scope), _bounds(right, scope))
    return BOTH


def _comparison_values(op: ast.cmpop, left: Bounds, right: Bounds) -> frozenset[bool]:
    match op:
        case ast.Lt():
            can_be = left[0] < right[1], left[1] >= right[0]
        case ast.LtE():
            can_be = left[0] <= right[1], left[1] > right[0]
        case ast.Gt():
            can_be = left[1] > right[0], left[0] <= right[1]
        case ast.GtE():
            can_be = left[1] >= right[0], left[0] < right[1]
        case _:
            return BOTH
    return frozenset(value for value, can in zip((True, False), can_be, strict=True) if can)


def _bounds(node: ast.expr, scope: Mapping[str, object]) -> Bounds:
    """Return the lowest and the highest value that the number expression ``node`` can have."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value), float(value)
        case ast.Name(id=name):
            known = scope.get(name)
            return (float(known), float(known)) if isinstance(known, int | float) else EVERY_NUMBER
        case ast.Call(args=[low, high]) if is_draw(node):
            return _bounds(low, scope)[0], _bounds(high, scope)[1]
        case ast.UnaryOp(op=ast.USub(), operand=part):
            least, most = _bounds(part, scope)
            return -most, -least
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() as op, right=right):
            return _combined_bounds(op, _bounds(left, scope), _bounds(right, scope))
    return EVERY_NUMBER


def _combined_bounds(op: ast.operator, left: Bounds, right: Bounds) -> Bounds:
    if isinstance(op, ast.Add):
        return left[0] + right[0], left[1] + right[1]
    if isinstance(op, ast.Sub):
        return left[0] - right[1], left[1] - right[0]
    products = [one * other for one in left for other in right]
    return EVERY_NUMBER if any(map(math.isnan, products)) else (min(products), max(products))
