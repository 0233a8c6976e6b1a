"""What the operators and functions of expressions do: arithmetic on numbers, comparisons, lists and joined texts.

Each raises ValueError for what it cannot do. Nothing here can run for long or fill the memory, whatever it is given,
even when a mission feeds a result back at every tick.
"""

import ast
import math
import operator
from collections.abc import Callable
from typing import Any

from config.units import Bare, seen

MAX_TEXT = 10_000
"""Characters of a text that a mission makes: one that doubles at every tick must not fill the memory."""

MAX_NUMBER = 1e15
"""A whole number beyond this is out of range, for the same reason; up to it, floats are whole numbers too."""

BINARY: dict[type[ast.operator], Callable[[Any, Any], object]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
UNARY: dict[type[ast.unaryop], Callable[[Any], object]] = {
    ast.Not: operator.not_,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], object]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda item, among: item in among,
    ast.NotIn: lambda item, among: item not in among,
}


def listing(items: list[Any]) -> list[Any]:
    """Return ``items``, none of which may be a list."""
    if any(isinstance(item, list) for item in items):
        raise ValueError("a list cannot stand in a list")
    return items


def member_at(items: Any, place: Any) -> object:
    """Return a member of a list: 0 is the first, -1 the last."""
    if not isinstance(items, list | tuple):
        raise ValueError(f"only a list has members by number, not {described(items)}")
    if isinstance(place, bool) or not isinstance(place, int):
        raise ValueError(f"the members of a list are counted from 0, in whole numbers, got {described(place)}")
    if not -len(items) <= place < len(items):
        raise ValueError(f"no member {place} in a list of {len(items)}")
    found: object = items[place]
    return found


def compare(op: ast.cmpop, left: Any, right: Any) -> bool:
    """Return whether a comparison is true."""
    try:
        return bool(COMPARE[type(op)](left, right))
    except (TypeError, ValueError):
        raise ValueError(f"cannot compare {described(left)} with {described(right)}") from None


def combine(op: ast.operator, left: Any, right: Any) -> object:
    """Text adds to text only, and is never multiplied or formatted: a short line cannot fill the memory."""
    if isinstance(op, ast.Add) and isinstance(left, str) and isinstance(right, str):
        return short(left + right)
    return calculate(BINARY[type(op)], left, right)


def calculate(function: Callable[..., Any], *numbers: object) -> int | float:
    """Apply arithmetic to numbers, and nothing but numbers. What bare numbers make is bare too."""
    for number in numbers:
        if not isinstance(number, int | float):
            raise ValueError(f"cannot calculate with {described(number)}")
    result: float = function(*numbers)
    if out_of_range(result):
        raise ValueError("a number out of range")
    if isinstance(result, int):
        return result
    return Bare(result) if all(isinstance(number, int | Bare) for number in numbers) else float(result)


def out_of_range(number: float) -> bool:
    """True for infinity, for what is not a number, and for whole numbers beyond MAX_NUMBER."""
    return abs(number) > MAX_NUMBER if isinstance(number, int) else not math.isfinite(number)


def _absolute(number: Any) -> int | float:
    return calculate(abs, number)


def _rounded(number: Any, digits: Any = None) -> int | float:
    if digits is not None and digits not in range(16):
        raise ValueError("round takes 0 to 15 digits")
    return calculate(lambda value: round(value, digits), number)


FUNCTIONS: dict[str, Callable[..., object]] = {"min": min, "max": max, "abs": _absolute, "round": _rounded, "len": len}
"""What an expression may call."""


def short(text: str) -> str:
    """Return ``text``. Raises ValueError where it is longer than MAX_TEXT."""
    if len(text) > MAX_TEXT:
        raise ValueError(f"a text of more than {MAX_TEXT:,} characters")
    return text


def described(value: object) -> str:
    """Say what a value is, for a message."""
    if isinstance(value, str):
        return f"the text {seen(value)}"
    if isinstance(value, int | float):
        return str(value).lower()
    return seen(value) if value is None or isinstance(value, list | tuple | dict) else f"a {type(value).__name__}"
