"""Expressions: comparisons, arithmetic and logic over params, variables and the robot's state, and nothing else.

Python's own parser reads them; a walker with a strict allow-list evaluates them. So an expression cannot import, call
anything but the plain functions below, or touch an attribute that starts with an underscore.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

FUNCTIONS: dict[str, Callable[..., object]] = {"min": min, "max": max, "abs": abs, "round": round, "len": len}
"""What an expression may call."""

WORDS = {"true": True, "false": False, "null": None, "none": None}
"""Constants, as YAML writes them."""

MAX_LENGTH = 1000

_BINARY: dict[type[ast.operator], Callable[[Any, Any], object]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], object]] = {
    ast.Not: operator.not_,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], object]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda item, among: item in among,
    ast.NotIn: lambda item, among: item not in among,
}


class ExpressionError(ValueError):
    """An expression that cannot be read or evaluated; ``column`` counts from 0 within it, None where unknown."""

    def __init__(self, message: str, column: int | None = None) -> None:
        super().__init__(message)
        self.column = column


@dataclass(frozen=True, slots=True)
class Expression:
    """A parsed expression."""

    text: str
    tree: ast.expr

    @property
    def names(self) -> tuple[str, ...]:
        """The names that it reads, without members: ``battery`` for ``battery.percent``, in order, each once."""
        called = {id(node.func) for node in ast.walk(self.tree) if isinstance(node, ast.Call)}
        found = (node for node in ast.walk(self.tree) if isinstance(node, ast.Name) and id(node) not in called)
        return tuple(dict.fromkeys(node.id for node in found if node.id not in WORDS))

    def evaluate(self, scope: Mapping[str, object]) -> object:
        """Return its value, with the names of ``scope``. Raises ExpressionError, never anything else."""
        try:
            return _value(self.tree, scope)
        except ExpressionError:
            raise
        except ZeroDivisionError:
            raise ExpressionError(f"'{self.text}' divides by zero") from None
        except (TypeError, ValueError, OverflowError, RecursionError) as error:
            raise ExpressionError(f"'{self.text}': {error}") from None


def parse(text: str) -> Expression:
    """Read an expression. Raises ExpressionError for what is not one, or not allowed."""
    stripped = text.strip()
    if not stripped:
        raise ExpressionError("an empty expression")
    if len(stripped) > MAX_LENGTH:
        raise ExpressionError(f"an expression of more than {MAX_LENGTH} characters")
    try:
        tree = ast.parse(stripped, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        column = error.offset - 1 if isinstance(error, SyntaxError) and error.offset else None
        raise ExpressionError(f"'{stripped}' is not an expression", column) from None
    try:
        _check(tree)
    except RecursionError:
        raise ExpressionError("an expression nested too deep") from None
    return Expression(stripped, tree)


def _check(node: ast.expr) -> None:  # noqa: C901 - one arm for each form that is allowed: that is the allow-list
    """Raise ExpressionError for a form that is not on the list."""
    match node:
        case ast.Constant(value=int() | float() | str() | bool() | None) | ast.Name():
            return
        case ast.BoolOp(values=parts) | ast.List(elts=parts) | ast.Tuple(elts=parts):
            pass
        case ast.UnaryOp(op=op, operand=part) if type(op) in _UNARY:
            parts = [part]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            parts = [left, right]
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in _COMPARE for op in ops):
            parts = [left, *others]
        case ast.IfExp(test=test, body=body, orelse=orelse):
            parts = [test, body, orelse]
        case ast.Attribute(value=value, attr=name):
            if name.startswith("_"):
                raise ExpressionError(f"'{name}' is private", node.col_offset)
            parts = [value]
        case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]):
            if name not in FUNCTIONS:
                known = ", ".join(FUNCTIONS)
                raise ExpressionError(f"'{name}' cannot be called; the functions are {known}", node.col_offset)
        case _:
            raise ExpressionError(f"'{ast.unparse(node)}' is not allowed in an expression", node.col_offset)
    for part in parts:
        _check(part)


def _value(node: ast.expr, scope: Mapping[str, object]) -> Any:  # noqa: C901 - see _check
    match node:
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name):
            return _named(name, scope)
        case ast.BoolOp(op=ast.And(), values=parts):
            return all(_value(part, scope) for part in parts)
        case ast.BoolOp(values=parts):
            return any(_value(part, scope) for part in parts)
        case ast.List(elts=parts) | ast.Tuple(elts=parts):
            return [_value(part, scope) for part in parts]
        case ast.UnaryOp(op=op, operand=part):
            return _UNARY[type(op)](_value(part, scope))
        case ast.BinOp(left=left, op=op, right=right):
            return _combine(op, _value(left, scope), _value(right, scope))
        case ast.Compare(left=left, ops=ops, comparators=others):
            values = [_value(part, scope) for part in (left, *others)]
            return all(_COMPARE[type(op)](a, b) for op, a, b in zip(ops, values, values[1:], strict=False))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return _value(body if _value(test, scope) else orelse, scope)
        case ast.Attribute(value=value, attr=name):
            return _member(_value(value, scope), name)
        case ast.Call(func=ast.Name(id=name), args=parts):
            return FUNCTIONS[name](*[_value(part, scope) for part in parts])
    raise ExpressionError(f"'{ast.unparse(node)}' is not allowed in an expression")


def _named(name: str, scope: Mapping[str, object]) -> object:
    if name in scope:
        return scope[name]
    if name in WORDS:
        return WORDS[name]
    raise ExpressionError(f"'{name}' is not set")


def _combine(op: ast.operator, left: Any, right: Any) -> object:
    """Text adds to text only, and is never multiplied or formatted: a short line cannot fill the memory."""
    if isinstance(left, str) or isinstance(right, str):
        if isinstance(op, ast.Add) and isinstance(left, str) and isinstance(right, str):
            return left + right
        raise ExpressionError(f"cannot calculate with the text {left if isinstance(left, str) else right!r}")
    if isinstance(left, list) or isinstance(right, list):
        raise ExpressionError("cannot calculate with a list")
    return _BINARY[type(op)](left, right)


def _member(owner: object, name: str) -> object:
    if isinstance(owner, Mapping):
        if name in owner:
            return owner[name]
    elif owner is not None and not isinstance(owner, str | int | float | list):
        found = getattr(owner, name, _MISSING)
        if found is not _MISSING and not callable(found):
            return found
    raise ExpressionError(f"'{name}' is not there" + (": nothing is stored yet" if owner is None else ""))


_MISSING = object()
