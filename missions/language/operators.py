"""Operators and functions of expressions: arithmetic, comparisons, lists and texts.

Each raises ValueError for invalid operands. Time and memory are bounded, even if a mission feeds a result back at every
tick.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping
from random import Random
from typing import Any

from config.units import NUMBER, DimensionError, Quantity, common_dimension, factor_of, product, quoted_value, quotient

MAX_TEXT = 10_000
"""Maximum characters of a text that a mission makes; a text that doubles at every tick must not fill the memory."""

MAX_NUMBER = 1e15
"""Maximum integer in an expression, so that it cannot grow at every tick; up to it, floats are exact."""

MAX_MEMBERS = 1000
"""Maximum members of a list that a mission makes; a list that grows in each round must not fill memory or records."""

MAX_LIST_TEXT = 10 * MAX_TEXT
"""Maximum characters of all texts in a list that a mission makes."""

BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {
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


def make_list(items: list[Any]) -> list[Any]:
    """Return ``items``, the members of a list that a mission makes. Raises ValueError if it is too large or too deep.

    Its members are plain values, results of leaves, and mappings of these.
    """
    if len(items) > MAX_MEMBERS:
        raise ValueError(f"a list of more than {MAX_MEMBERS:,} members")
    length = 0
    for item in items:
        for value in item.values() if isinstance(item, Mapping) else (item,):
            if isinstance(value, list | Mapping):
                raise ValueError("a list cannot contain a list")
            length += len(value) if isinstance(value, str) else 0
    if length > MAX_LIST_TEXT:
        raise ValueError(f"a list with texts of more than {MAX_LIST_TEXT:,} characters")
    return items


MAX_DATA_VALUES = 10_000
"""Maximum number of values in a list or mapping that a mission makes, including nested lists and mappings."""

MAX_DATA_DEPTH = 10
"""Maximum depth of nested lists and mappings that a mission makes."""


def check_data_size(data: object) -> object:
    """Return nested lists and mappings unchanged. Raises ValueError if they are too large or nested too deeply.

    Without this limit, a mission could double a mapping at every tick, by setting it to a mapping that contains it
    twice.
    """
    waiting, count, length = [(data, 1)], 0, 0
    while waiting:
        value, depth = waiting.pop()
        count += 1
        length += len(value) if isinstance(value, str) else 0
        if isinstance(value, Mapping | list):
            if depth > MAX_DATA_DEPTH:
                raise ValueError(f"more than {MAX_DATA_DEPTH} lists and mappings inside one another")
            waiting += [(each, depth + 1) for each in (value.values() if isinstance(value, Mapping) else value)]
        if count + len(waiting) > MAX_DATA_VALUES:
            raise ValueError(f"more than {MAX_DATA_VALUES:,} values")
        if length > MAX_LIST_TEXT:
            raise ValueError(f"texts of more than {MAX_LIST_TEXT:,} characters")
    return data


def _join_lists(left: list[Any], right: list[Any]) -> list[Any]:
    """Return the members of two lists as one list; both have members of one dimension."""
    for item in right if left else ():
        if _is_number(left[0]) and _is_number(item):
            try:
                common_dimension(dimension_of(left[0]), dimension_of(item))
            except DimensionError as error:
                raise ValueError(f"the members of a list must have one type: {error}") from None
    return make_list([*left, *right])


def member_at(items: Any, place: Any) -> object:
    """Return the member of a list at index ``place``: 0 is the first, -1 the last. Raises ValueError."""
    if not isinstance(items, list | tuple):
        raise ValueError(f"only lists have numbered members, not {describe_value(items)}")
    if isinstance(place, bool) or not isinstance(place, int):
        raise ValueError(f"list indexes are whole numbers from 0, got {describe_value(place)}")
    if not -len(items) <= place < len(items):
        raise ValueError(f"index {place} out of range (length {len(items)})")
    found: object = items[place]
    return found


def compare(op: ast.cmpop, left: Any, right: Any) -> bool:
    """Return the result of a comparison of two values. Raises ValueError for different dimensions."""
    if (type(left) is Quantity or type(right) is Quantity) and _is_number(left) and _is_number(right):
        try:
            common_dimension(dimension_of(left), dimension_of(right))
        except DimensionError as error:
            raise ValueError(f"cannot compare {error}") from None
    try:
        return bool(COMPARE[type(op)](left, right))
    except (TypeError, ValueError):
        raise ValueError(f"cannot compare {describe_value(left)} with {describe_value(right)}") from None


def combine(op: ast.operator, left: Any, right: Any) -> object:
    """Return the result of a binary operator.

    Texts and lists can only be added, so that a short line cannot fill the memory.
    """
    if isinstance(op, ast.Add) and isinstance(left, str) and isinstance(right, str):
        return check_text_length(left + right)
    if isinstance(op, ast.Add) and isinstance(left, list | tuple) and isinstance(right, list | tuple):
        return _join_lists(list(left), list(right))
    dimension = combined_dimension(type(op), dimension_of(left), dimension_of(right))
    return make_quantity(BINARY[type(op)](left, right), dimension)


def apply_sign(op: ast.unaryop, number: Any) -> object:
    """Return a number after the unary operator ``op``: plus or minus."""
    dimension = dimension_of(number)
    return make_quantity(UNARY[type(op)](number), dimension)


def combined_dimension(op: type[ast.operator], one: str, other: str) -> str:
    """Return the dimension of the result of an operator. Raises ValueError for incompatible dimensions."""
    if op is ast.Mult:
        return product(one, other)
    if op is ast.Div:
        return quotient(one, other)
    try:
        found = common_dimension(one, other)
    except DimensionError as error:
        raise ValueError(f"{_CANNOT[op]} {error}") from None
    return NUMBER if op is ast.FloorDiv else found


_CANNOT: dict[type[ast.operator], str] = {
    ast.Add: "cannot add",
    ast.Sub: "cannot calculate the difference of",
    ast.FloorDiv: "cannot calculate the whole quotient of",
    ast.Mod: "cannot calculate the remainder of",
}


def dimension_of(number: object) -> str:
    """Return the dimension of a number. Raises ValueError for any other value."""
    if type(number) is Quantity:
        return number.dimension
    if not isinstance(number, int | float):
        raise ValueError(f"cannot calculate with {describe_value(number)}")
    return NUMBER


def make_quantity(number: float, dimension: str) -> int | float:
    """Return a number with its dimension. Raises ValueError if it is out of range."""
    if out_of_range(number):
        raise ValueError("a number out of range")
    if dimension != NUMBER:
        return Quantity(number, dimension)
    return number if isinstance(number, int) else float(number)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)


def out_of_range(number: float) -> bool:
    """Return True for infinity, NaN, and integers beyond MAX_NUMBER."""
    return abs(number) > MAX_NUMBER if isinstance(number, int) else not math.isfinite(number)


def _absolute_value(number: Any) -> int | float:
    dimension = dimension_of(number)
    return make_quantity(abs(number), dimension)


def _round(number: Any, digits: Any = None) -> int | float:
    """Round a number to ``digits`` digits; a quantity is rounded in its display unit, such as degrees."""
    if digits is not None and (not isinstance(digits, int) or digits not in range(16)):
        raise ValueError("round takes 0 to 15 digits")
    dimension = dimension_of(number)
    factor = factor_of(dimension)
    return make_quantity(round(number / factor, digits) * factor if factor != 1 else round(number, digits), dimension)


def _minimum(*items: Any) -> object:
    return _choose(min, items)


def _maximum(*items: Any) -> object:
    return _choose(max, items)


def _choose(choose: Callable[..., object], items: tuple[Any, ...]) -> object:
    """Return the minimum or maximum of several values, or of a list; all of one dimension."""
    among = items[0] if len(items) == 1 else items
    sizes = [dimension_of(item) for item in among if _is_number(item)] if isinstance(among, list | tuple) else []
    for other in sizes[1:]:
        try:
            common_dimension(sizes[0], other)
        except DimensionError as error:
            raise ValueError(f"cannot compare {error}") from None
    return choose(*items)


RANDOM = "random"
"""Function that draws a number, and name under which a scope has the source of random numbers of the run."""


def _draw(source: Random, low: Any, high: Any) -> int | float:
    """Return a number from ``low`` to ``high``, with their dimension; each is equally likely."""
    try:
        dimension = common_dimension(dimension_of(low), dimension_of(high))
    except DimensionError as error:
        raise ValueError(f"cannot draw between {error}") from None
    if low > high:
        raise ValueError(f"{RANDOM}: {low} is above {high}")
    span = make_quantity(high - low, NUMBER)
    return make_quantity(min(low + span * source.random(), float(high)), dimension)


FUNCTIONS: dict[str, Callable[..., object]] = {
    "min": _minimum,
    "max": _maximum,
    "abs": _absolute_value,
    "round": _round,
    "len": len,
    RANDOM: _draw,
}
"""Functions that an expression can call; ``random`` also takes the source of random numbers."""

FUNCTION_HELP = {
    "min": "min(A, B, ...) or min(LIST): the smallest value; all have one dimension",
    "max": "max(A, B, ...) or max(LIST): the greatest value; all have one dimension",
    "abs": "abs(X): the size of a number or a quantity without its sign",
    "round": "round(X) or round(X, DIGITS): to a whole number, or to DIGITS decimals; a quantity in its usual unit",
    "len": "len(X): the number of members of a list, or of characters of a text",
    RANDOM: "random(LOW, HIGH): a number or a quantity between two of one dimension, from the seed of the run",
}
"""Call and meaning of each function, for ``mission show``."""


def check_text_length(text: str) -> str:
    """Return ``text``. Raises ValueError if it is longer than MAX_TEXT."""
    if len(text) > MAX_TEXT:
        raise ValueError(f"a text of more than {MAX_TEXT:,} characters")
    return text


def describe_value(value: object) -> str:
    """Return a value as text for a message."""
    if isinstance(value, str):
        return f"the text {quoted_value(value)}"
    if isinstance(value, int | float):
        return str(value).lower() if isinstance(value, bool) else str(value)
    return (
        quoted_value(value) if value is None or isinstance(value, list | tuple | dict) else f"a {type(value).__name__}"
    )
