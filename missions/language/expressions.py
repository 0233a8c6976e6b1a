"""Expression parser and evaluator: comparisons, arithmetic and logic over params, variables and the robot's state.

There is no lexer or tokenizer of our own: Python's parser (``ast``) reads expressions, and an evaluator with a strict
allow-list computes them. An expression cannot import, call other functions than those listed, or access attributes that
start with an underscore.
"""

import ast
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

from config.diagnostics import suggest_from
from config.units import UNITS, Quantity, dimension_text, example, quoted_value, si_value, unit_of
from drivers.api.fast_dataclass import dataclass
from drivers.errors import NotConnected
from missions.language.kinds import (
    CONSTANTS,
    STATE_KINDS,
    QuantityRestorer,
    as_python,
    character_range,
    member_dimensions,
    members_in,
    syntax_hint,
)
from missions.language.nodes import FAILURE_NAME
from missions.language.operators import (
    BINARY,
    COMPARE,
    FUNCTIONS,
    RANDOM,
    UNARY,
    apply_sign,
    check_data_size,
    check_text_length,
    combine,
    compare,
    make_list,
    member_at,
    out_of_range,
)
from missions.language.synonyms import function_hint

if TYPE_CHECKING:
    from missions.language.inference import ExpressionLocation


MAX_LENGTH = 1000
"""Maximum number of characters of an expression."""

MAX_NESTING = 100
"""Maximum nesting depth of an expression: each part is read, checked and evaluated recursively."""

RANDOM_ARGUMENTS = 2
"""Number of arguments of ``random``: its bounds."""

TOO_DEEP_MESSAGE = f"an expression nested too deeply: at most {MAX_NESTING} levels"


class ExpressionError(ValueError):
    """An expression that cannot be parsed or evaluated.

    ``column`` (from 0, None if unknown) and ``length`` are the place in the text that ``parse`` was given.
    """

    def __init__(self, message: str, column: int | None = None, length: int = 1) -> None:
        super().__init__(message)
        self.column = column
        self.length = length


@dataclass(frozen=True, slots=True)
class NameReference:
    """A name that an expression reads, with its first member ("percent" of ``battery.percent``).

    ``column`` and ``length`` are its place in the text. ``compared`` is true if the name is compared by ``==`` or
    ``in``: then the user may have meant a text and left out the quotes.
    """

    name: str
    member: str
    column: int
    length: int
    compared: bool = False

    @property
    def dotted(self) -> str:
        """Name and member as written, such as ``battery.percent``."""
        return f"{self.name}.{self.member}" if self.member else self.name


@dataclass(frozen=True, slots=True)
class Expression:
    """A parsed expression: its text, its syntax tree, and the names that it ``reads``, in order."""

    text: str
    tree: ast.expr
    reads: tuple[NameReference, ...]
    python: str
    column: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names without members: ``battery`` for ``battery.percent``, in order, each once."""
        return tuple(dict.fromkeys(read.name for read in self.reads))

    @property
    def draws(self) -> tuple[ast.Call, ...]:
        """Calls of ``random``."""
        return tuple(node for node in ast.walk(self.tree) if isinstance(node, ast.Call) and is_draw(node))

    def place(self, node: ast.expr) -> tuple[int, int]:
        """Return column and length of a node of the expression, in the text that ``parse`` was given."""
        start, end = character_range(self.python, node)
        return self.column + start, end - start

    def evaluate(self, scope: Mapping[str, object]) -> object:
        """Return the value of the expression, with the variables of ``scope``.

        Raises ExpressionError, or NotConnected if a part of the robot does not report now.
        """
        try:
            return _value(self.tree, scope)
        except ExpressionError:
            raise
        except ZeroDivisionError:
            raise ExpressionError(f"{quoted_value(self.text)} divides by zero") from None
        except (TypeError, ValueError, OverflowError, RecursionError) as error:
            raise ExpressionError(f"{quoted_value(self.text)}: {error}") from None


def parse(text: str, column: int = 0) -> Expression:
    """Parse an expression that begins at ``column`` of a text. Raises ExpressionError."""
    # Joined to one line, so that columns are offsets in the text, even if it has several lines.
    line = re.sub(r"\s", " ", text)
    stripped = line.strip()
    column += len(line) - len(line.lstrip())
    if not stripped:
        raise ExpressionError("an empty expression", column)
    if len(stripped) > MAX_LENGTH:
        raise ExpressionError(f"an expression of more than {MAX_LENGTH} characters", column)
    python, literals = as_python(stripped)
    try:
        with warnings.catch_warnings(action="ignore"):  # such as "1or 2", which Python accepts
            tree = ast.parse(python, mode="eval").body
    except (RecursionError, MemoryError):
        raise ExpressionError(TOO_DEEP_MESSAGE, column) from None
    except (SyntaxError, ValueError) as error:
        hint, place = syntax_hint(stripped), 0
        if isinstance(error, SyntaxError):  # the offset counts from 1; 0 is the end
            place = min((error.offset or len(stripped)) - 1, len(stripped) - 1)
            hint = hint or ("; something is missing at its end" if error.offset == 0 else "")
        raise ExpressionError(f"{quoted_value(stripped)} is not an expression{hint}", column + max(0, place)) from None
    if _is_too_deep(tree):
        raise ExpressionError(TOO_DEEP_MESSAGE, column)
    try:
        tree = QuantityRestorer(python, literals).visit(tree)
        _check_allowed(tree)
        return Expression(stripped, tree, _reads(python, tree, column), python, column)
    except _NotAllowedError as error:
        start, end = character_range(python, error.node)
        raise ExpressionError(str(error), column + start, end - start) from None


def _is_too_deep(tree: ast.AST) -> bool:
    depth, row = 0, [tree]
    while row and depth <= MAX_NESTING:
        below = (part for node in row for part in ast.iter_child_nodes(node))
        depth, row = depth + 1, [part for part in below if isinstance(part, ast.expr)]
    return depth > MAX_NESTING


def is_draw(node: ast.expr) -> bool:
    """Return whether a part of an expression is a call of ``random``."""
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == RANDOM


def draws_number(formula: "Expression | Template | None") -> bool:
    """Return whether an expression or a template calls ``random``, so that each evaluation has another value."""
    parts = () if formula is None else formula.parts if isinstance(formula, Template) else (formula,)
    return any(isinstance(part, Expression) and part.draws for part in parts)


def is_calculation(formula: Expression) -> bool:
    """Return whether an expression is more than a name, a member or a constant."""
    return not isinstance(formula.tree, ast.Name | ast.Attribute | ast.Constant)


def _reads(text: str, tree: ast.expr, column: int) -> tuple[NameReference, ...]:
    nodes = list(ast.walk(tree))
    called = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    members = {id(node.value): node for node in nodes if isinstance(node, ast.Attribute)}
    compared = {id(each) for node in nodes if isinstance(node, ast.Compare) for each in _operands(node)}
    found = []
    for node in nodes:
        if isinstance(node, ast.Name) and id(node) not in called and node.id not in CONSTANTS:
            member = members.get(id(node))
            start, end = character_range(text, member or node)
            name = member.attr if member else ""
            found.append(NameReference(node.id, name, column + start, end - start, id(node) in compared))
    return tuple(sorted(found, key=lambda read: read.column))


def _operands(node: ast.Compare) -> list[ast.expr]:
    """Return both sides of a test by ``==``, ``!=`` or ``in``, and the items of lists; empty for other tests."""
    if not all(isinstance(op, ast.Eq | ast.NotEq | ast.In | ast.NotIn) for op in node.ops):
        return []
    sides = [node.left, *node.comparators]
    return [*sides, *(item for side in sides if isinstance(side, ast.List | ast.Tuple) for item in side.elts)]


class _NotAllowedError(Exception):
    """An expression uses Python syntax that is not allowed in missions, at ``node``."""

    def __init__(self, message: str, node: ast.expr) -> None:
        super().__init__(message)
        self.node = node


def _check_allowed(node: ast.expr) -> None:  # noqa: C901, PLR0912 - an arm for each form: the allow-list
    """Raise _NotAllowedError if ``node`` uses Python syntax that is not allowed in missions."""
    match node:
        case ast.Constant(value=int() | float() as value) if out_of_range(value):
            raise _NotAllowedError("a number out of range", node)
        case ast.Constant(value=int() | float() | str() | bool() | None) | ast.Name():
            return
        case ast.BoolOp(values=parts) | ast.List(elts=parts) | ast.Tuple(elts=parts):
            pass
        case ast.UnaryOp(op=op, operand=part) if type(op) in UNARY:
            parts = [part]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in BINARY:
            parts = [left, right]
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARE for op in ops):
            parts = [left, *others]
        case ast.IfExp(test=test, body=body, orelse=orelse):
            parts = [test, body, orelse]
        case ast.Attribute(value=value, attr=name):
            if name.startswith("_"):
                raise _NotAllowedError(f"{quoted_value(name)} is private", node)
            parts = [value]
        case ast.Subscript(value=value, slice=place) if not isinstance(place, ast.Slice | ast.Tuple):
            parts = [value, place]
        case ast.Call(func=ast.Name(id=name) as function, args=parts, keywords=[]):
            if name not in FUNCTIONS:
                hint = function_hint(name) or f"the functions are {', '.join(FUNCTIONS)}"
                raise _NotAllowedError(f"{quoted_value(name)} cannot be called; {hint}", function)
            if name == RANDOM and len(parts) != RANDOM_ARGUMENTS:
                raise _NotAllowedError(f"'{RANDOM}' needs two values, such as {RANDOM}(1 s, 3 s)", node)
        case ast.Set(elts=[part]):
            _check_allowed(part)
            raise _NotAllowedError(f"write one pair of braces around {quoted_value(ast.unparse(part))}", node)
        case _:
            raise _NotAllowedError(f"{quoted_value(ast.unparse(node))} is not allowed in an expression", node)
    for part in parts:
        _check_allowed(part)


def _value(node: ast.expr, scope: Mapping[str, object]) -> Any:  # noqa: C901, PLR0912 - see _check
    match node:
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name):
            return _look_up(name, scope)
        case ast.BoolOp(op=ast.And(), values=parts):
            return all(_value(part, scope) for part in parts)
        case ast.BoolOp(values=parts):
            return any(_value(part, scope) for part in parts)
        case ast.List(elts=parts) | ast.Tuple(elts=parts):
            return make_list([_value(part, scope) for part in parts])
        case ast.UnaryOp(op=ast.Not(), operand=part):
            return not _value(part, scope)
        case ast.UnaryOp(op=op, operand=part):
            return apply_sign(op, _value(part, scope))
        case ast.BinOp(left=left, op=op, right=right):
            return combine(op, _value(left, scope), _value(right, scope))
        case ast.Compare(left=left, ops=ops, comparators=others):
            values = [_value(part, scope) for part in (left, *others)]
            return all(compare(op, a, b) for op, a, b in zip(ops, values, values[1:], strict=False))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return _value(body if _value(test, scope) else orelse, scope)
        case ast.Attribute(value=ast.Name(id=part), attr=name) if part in STATE_KINDS:
            return as_quantity(_member(_look_up(part, scope), name), STATE_KINDS[part].get(name))
        case ast.Attribute(value=value, attr=name):
            owner = _value(value, scope)
            found = _member(owner, name)
            return as_quantity(found, _dimension(owner, name))
        case ast.Subscript(value=value, slice=place):
            return member_at(_value(value, scope), _value(place, scope))
        case ast.Call(func=ast.Name(id=name), args=parts):
            values = [_value(part, scope) for part in parts]
            return FUNCTIONS[name](*([_random_source(scope)] if name == RANDOM else []), *values)
    raise ExpressionError(f"{quoted_value(ast.unparse(node))} is not allowed in an expression")


def _look_up(name: str, scope: Mapping[str, object]) -> object:
    if name in scope:
        return scope[name]
    if name in CONSTANTS:
        return CONSTANTS[name]
    raise ExpressionError(f"'{name}' is not set")


def _random_source(scope: Mapping[str, object]) -> object:
    if RANDOM in scope:
        return scope[RANDOM]
    raise ExpressionError(f"'{RANDOM}' has values only in the run of a mission")


def as_quantity(found: object, kind: object) -> object:
    """Return a number as a quantity if its kind is a dimension; other values unchanged."""
    if isinstance(kind, str) and kind in UNITS and isinstance(found, int | float):
        return found if isinstance(found, bool | Quantity) else Quantity(found, kind)
    return found


def _dimension(owner: object, name: str) -> str | None:
    kind: type = type(owner)
    return member_dimensions(kind).get(name)


def _member(owner: object, name: str) -> object:
    if isinstance(owner, Mapping):
        if name in owner:
            return owner[name]
    elif owner is not None and not isinstance(owner, str | int | float | list):
        try:
            found = getattr(owner, name, _MISSING)
        except NotConnected:  # the caller suspends its node
            raise
        except Exception as error:  # a property may raise any error, such as a driver's
            raise ExpressionError(f"'{name}' cannot be read: {error}") from error
        if found is not _MISSING and not callable(found):
            return found
    hint = suggest_from(name, members_in(owner))
    raise ExpressionError(
        f"'{name}' is not there" + (": nothing is stored yet" if owner is None else hint and f"; {hint}")
    )


_MISSING = object()


# Values in a mission: constants, ``${...}`` expressions, and texts that contain expressions.

Convert = Callable[[object], object]
"""Converts a value of a mission to a value of a leaf; raises ValueError with the error text."""

_HOLE = re.compile(r"\$\{((?:[^{}'\"]|'[^']*'|\"[^\"]*\")*)\}")


@dataclass(frozen=True, slots=True)
class Template:
    """A text with ``${...}`` expressions; ``parts`` are its literal texts and expressions in order.

    The value of a template with nothing but one expression keeps its type; otherwise it is a text.
    """

    parts: tuple[str | Expression, ...]

    @property
    def reads(self) -> tuple[NameReference, ...]:
        """Names that the expressions read."""
        return tuple(read for part in self.parts if isinstance(part, Expression) for read in part.reads)

    def evaluate(self, scope: Mapping[str, object]) -> object:
        """Return the text with all values inserted. Raises ExpressionError."""
        if len(self.parts) == 1 and isinstance(self.parts[0], Expression):
            return self.parts[0].evaluate(scope)
        filled = (part if isinstance(part, str) else format_value(part.evaluate(scope)) for part in self.parts)
        try:
            return check_text_length("".join(filled))
        except ExpressionError:
            raise
        except ValueError as error:
            raise ExpressionError(str(error)) from None


@dataclass(frozen=True, slots=True)
class Value:
    """Value of a leaf's argument: ``constant``, or a ``template`` that is evaluated when the node starts.

    ``convert`` converts the result. ``location`` is the place of the template in its file. ``local_names`` are names
    that only this value can read, in addition to the variables: the reason of a failure.
    """

    constant: object = None
    template: Template | Expression | None = None
    convert: Convert | None = None
    location: "ExpressionLocation | None" = field(default=None, compare=False)
    local_names: Mapping[str, object] | None = field(default=None, compare=False)

    def resolve(self, scope: Mapping[str, object]) -> object:
        """Return the present value of the argument. Raises ExpressionError or ValueError with a short reason."""
        if self.template is None:
            return self.constant
        found = self.template.evaluate(scope if self.local_names is None else {**scope, **self.local_names})
        return found if self.convert is None else self.convert(found)


@dataclass(frozen=True, slots=True)
class DataTemplate(Template):
    """A list or a mapping in a mission with ``${...}`` in it.

    ``data`` has it as nested lists and dicts, in which a ``Value`` stands for each constant or expression.
    """

    data: Any = field(default=None, hash=False)

    @property
    def values(self) -> "list[Value]":
        """All values in the list or mapping, and in those inside it, in order."""
        return list(data_values(self.data))

    def evaluate(self, scope: Mapping[str, object]) -> object:
        """Return the list or mapping with all values calculated. Raises ExpressionError."""
        try:
            return check_data_size(map_data(self.data, lambda value: value.resolve(scope)))
        except ExpressionError:
            raise
        except ValueError as error:
            raise ExpressionError(str(error)) from None


def map_data(data: Any, function: "Callable[[Value], object]") -> object:
    """Return a copy of nested lists and dicts, in which ``function`` has replaced each ``Value``."""
    if isinstance(data, Mapping):
        return {key: map_data(each, function) for key, each in data.items()}
    return [map_data(each, function) for each in data] if isinstance(data, list) else function(data)


def data_values(data: Any) -> "Iterator[Value]":
    """Yield each ``Value`` in nested lists and dicts, in order."""
    if isinstance(data, Mapping | list):
        for each in data.values() if isinstance(data, Mapping) else data:
            yield from data_values(each)
    else:
        yield data


def plain_values(value: Value) -> list[Value]:
    """Return the values inside ``value`` if it is a list or a mapping; otherwise ``value`` alone."""
    return value.template.values if isinstance(value.template, DataTemplate) else [value]


def reads_failure(value: Value) -> bool:
    """Return whether an expression reads the reason of the last failure around it."""
    return value.template is not None and any(read.name == FAILURE_NAME for read in value.template.reads)


INVALID_VALUE = Value(template=Template(()))
"""Placeholder for the value of an argument with an error that has been reported."""


def template(text: str) -> Template | None:
    """Parse a text with ``${...}``; None if there is none. Raises ExpressionError with its column."""
    parts: list[str | Expression] = []
    end = 0
    for hole in _HOLE.finditer(text):
        _require_closed(text, end, hole.start())
        if text[end : hole.start()]:
            parts.append(text[end : hole.start()])
        parts.append(parse(hole[1], hole.start(1)))
        end = hole.end()
    _require_closed(text, end, len(text))
    if not parts:
        return None
    if text[end:]:
        parts.append(text[end:])
    return Template(tuple(parts))


def _require_closed(text: str, start: int, end: int) -> None:
    """Raise ExpressionError if ``text`` has a ``${`` between ``start`` and ``end`` that was not parsed."""
    at = text.find("${", start, end)
    if at >= 0:
        inside, closed, _ = text[at + 2 :].partition("}")
        what = "has no '}'"
        if "${" in inside:
            what = "holds another '${': write the name in it without braces"
        elif "{" in inside:
            what = "holds a brace: store the mapping with 'set' first, and write its name here"
        elif closed:
            what = "holds a quote that is not closed"
        raise ExpressionError(f"'${{' {what}", at, 2)


def format_value(value: object) -> str:
    """Return a value as text for people: no trailing zeros, yes and no for true and false."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "nothing"
    if isinstance(value, float) and not isinstance(value, Quantity):
        return f"{float(value):.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(format_value(item) for item in value)
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {format_value(item)}' for key, item in value.items())}}}"
    return str(value)


def in_si(value: object, dimension: str) -> float:
    """Return a number or a quantity in the SI unit of ``dimension``. Raises ValueError for another dimension.

    A plain number is accepted only as a share, such as 0.5 for 50 %.
    """
    if isinstance(value, bool | Quantity) or not isinstance(value, int | float):
        return si_value(value, dimension)
    if dimension == "share" and math.isfinite(value):
        return float(value)
    raise ValueError(
        f"{needs_message(dimension)}, got the number {format_value(float(value))}: {multiply_hint(dimension)}"
    )


def needs_message(dimension: str) -> str:
    """Return the start of an error message: the required dimension, with an example."""
    return f"needs {dimension_text(dimension)}" + (f" such as '{example(dimension)}'" if dimension in UNITS else "")


def divide_hint(dimension: str) -> str:
    """Return the hint how to turn a quantity into a number."""
    return f"divide it by 1 {unit_of(dimension)}"


def multiply_hint(dimension: str) -> str:
    """Return the hint how to turn a number into a quantity."""
    return f"multiply it by 1 {unit_of(dimension)}" + (" or 1 rad" if dimension == "angle" else "")


def as_whole_number(value: object) -> int | None:
    """Return a value as an int; None if it is not a whole number."""
    if isinstance(value, bool | Quantity) or not isinstance(value, int | float):
        return None
    return int(value) if math.isfinite(value) and value == int(value) else None
