"""Type inference of expressions, as far as their variables are known, and whether the type fits its place.

Where its parts do not go together is found here too.
"""

import ast
import re
from collections.abc import Callable, Mapping

from config.faults import Diagnostic, Mark, Source, one_of
from config.marked import Scalar
from config.units import NUMBER, UNITS, DimensionError, common, is_unit, quantity
from drivers.api.quick import dataclass
from missions.language.expressions import Expression, Template, Value, divide, multiply, needs
from missions.language.kinds import (
    FLAG,
    NOTHING,
    PERCENT,
    STATE,
    TEXT,
    UNSETTLED,
    WORDS,
    Kind,
    ListOf,
    Record,
    is_size,
    joined,
    kind_of_value,
    told,
)
from missions.language.operators import combined

Report = Callable[[ast.expr, str, str], None]
"""Takes a part of an expression, what is wrong with it, and what to write."""


def silent(node: ast.expr, message: str, hint: str) -> None:
    """Report nothing."""
    del node, message, hint


class Inference:
    """Infers the kinds of expressions, from those of the names that they read."""

    def __init__(self, kinds: Mapping[str, Kind], report: Report = silent) -> None:
        self._kinds = kinds
        self._report = report

    def kind(self, node: ast.expr) -> Kind:
        """Return the kind of an expression; UNSETTLED where there is a mistake in it, which is reported."""
        match node:
            case ast.Constant(value=value):
                return kind_of_value(value)
            case ast.Name(id=name):
                return self._kinds.get(name, kind_of_value(WORDS[name]) if name in WORDS else None)
            case ast.BoolOp(values=parts) | ast.UnaryOp(op=ast.Not(), operand=parts):
                for part in parts if isinstance(parts, list) else [parts]:
                    self.kind(part)
                return FLAG
            case ast.UnaryOp(operand=part):
                return self._size(part, self.kind(part))
            case ast.BinOp():
                return self._calculated(node)
            case ast.Compare():
                return self._compared(node)
            case ast.IfExp():
                return self._branches(node)
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                return ListOf(self._alike(parts, "the members of a list are of one type"))
        return self._read(node)

    def _read(self, node: ast.expr) -> Kind:
        match node:
            case ast.Attribute(value=ast.Name(id=part), attr=name) if part in STATE:
                return STATE[part].get(name)
            case ast.Attribute(value=value, attr=name):
                kind = self.kind(value)
                if isinstance(kind, Record) and kind.lacks(name):
                    return self._wrong(node, f"'{name}' is not there", one_of(name, kind.named))
                return kind.member(name) if isinstance(kind, Record) else None
            case ast.Subscript(value=value, slice=place):
                kind, at = self.kind(value), self.kind(place)
                if is_size(at) and at != NUMBER:
                    return self._wrong(place, f"the members of a list are counted in whole numbers, not by {told(at)}")
                if is_size(kind) or kind in (TEXT, FLAG, NOTHING):
                    return self._wrong(value, f"only a list has members by number, not {told(kind)}")
                return kind.of if isinstance(kind, ListOf) else None
            case ast.Call(func=ast.Name(id=word), args=parts):
                return self._called(word, parts)
        return None

    def _called(self, word: str, parts: list[ast.expr]) -> Kind:
        if word in ("min", "max") and len(parts) > 1:
            return self._alike(parts, "cannot compare")
        kinds = [self.kind(part) for part in parts]
        if not kinds:
            return None
        if word in ("min", "max"):
            return kinds[0].of if isinstance(kinds[0], ListOf) else None
        return NUMBER if word == "len" else self._size(parts[0], kinds[0])

    def _calculated(self, node: ast.BinOp) -> Kind:
        left, right = self.kind(node.left), self.kind(node.right)
        if isinstance(node.op, ast.Add) and left == right == TEXT:
            return TEXT
        left, right = self._size(node.left, left), self._size(node.right, right)
        if UNSETTLED in (left, right):
            return UNSETTLED
        if not (isinstance(left, str) and isinstance(right, str)):
            return None if isinstance(node.op, ast.Mult | ast.Div) else left or right
        try:
            return combined(type(node.op), left, right)
        except ValueError as error:
            return self._wrong(node, str(error), _cure(left, right))

    def _size(self, node: ast.expr, kind: Kind) -> Kind:
        """Return a kind with which something can be calculated; a mistake where it is of another."""
        if kind is None or kind == UNSETTLED or is_size(kind):
            return kind
        return NUMBER if kind == FLAG else self._wrong(node, f"cannot calculate with {told(kind)}")

    def _compared(self, node: ast.Compare) -> Kind:
        parts = [node.left, *node.comparators]
        kinds = [self.kind(part) for part in parts]
        for op, left, right in zip(node.ops, kinds, kinds[1:], strict=False):
            if isinstance(op, ast.In | ast.NotIn) and (is_size(right) or right == FLAG):
                self._wrong(node, f"'in' needs a list or a text, not {told(right)}")
                continue
            among = right.of if isinstance(right, ListOf) else TEXT if right == TEXT else None
            other = among if isinstance(op, ast.In | ast.NotIn) else right
            one, two = (left.of, other.of) if isinstance(left, ListOf) and isinstance(other, ListOf) else (left, other)
            if not _comparable(op, one, two):
                self._wrong(node, f"cannot compare {told(one)} and {told(two)}", _cure(one, two))
        return FLAG

    def _branches(self, node: ast.IfExp) -> Kind:
        self.kind(node.test)
        one, other = self.kind(node.body), self.kind(node.orelse)
        if is_size(one) and is_size(other) and joined(one, other) is None:
            return self._wrong(node, f"it is {told(one)}, or else {told(other)}", _cure(one, other))
        return joined(one, other)

    def _alike(self, parts: list[ast.expr], rule: str) -> Kind:
        """Return the kind that all parts have."""
        kinds = [self.kind(part) for part in parts]
        kind: Kind = UNSETTLED
        for part, other in zip(parts, kinds, strict=True):
            if not _comparable(ast.Eq(), kind, other):
                return self._wrong(part, f"{rule}: {told(kind)} and {told(other)}", _cure(kind, other))
            kind = joined(kind, other)
        return UNSETTLED if UNSETTLED in kinds else kind

    def _wrong(self, node: ast.expr, message: str, hint: str = "") -> Kind:
        self._report(node, message, hint)
        return UNSETTLED


def _comparable(op: ast.cmpop, left: Kind, right: Kind) -> bool:
    if None in (left, right) or UNSETTLED in (left, right):
        return True
    if NOTHING in (left, right):
        return isinstance(op, ast.Eq | ast.NotEq | ast.In | ast.NotIn)
    if is_size(left) and is_size(right):
        return joined(left, right) is not None
    return left == right or (type(left) is type(right) and not isinstance(left, str))


def _cure(left: Kind, right: Kind) -> str:
    """Say what to write where a plain number stands beside a quantity, or beside a text."""
    if {PERCENT, "share"} == {left, right}:
        return "what is in percent counts to 100: write 20 for 20 %"
    sizes = [kind for kind in (left, right) if isinstance(kind, str) and is_size(kind) and kind != NUMBER]
    if NUMBER in (left, right) and len(sizes) == 1:
        return f"a plain number is no quantity: write its unit, or {multiply(sizes[0])}"
    if {left, right} == {TEXT, NUMBER}:
        return "a text stands in quotes, a number does not"
    return ""


def kind_made(value: Value, kinds: Mapping[str, Kind]) -> Kind:
    """Return the kind of what a value of a mission makes, where names are of these kinds."""
    match value.template:
        case None:
            return kind_of_value(value.constant)
        case Template(parts=()):
            return None
        case Expression(tree=tree) | Template(parts=(Expression(tree=tree),)):
            return Inference(kinds).kind(tree)
    return TEXT


@dataclass(frozen=True, slots=True)
class Where:
    """Where an expression stands: in which scalar of a file, as ``what``; ``wants`` is the kind of the argument."""

    source: Source
    node: Scalar
    what: str
    wants: str = ""

    def place(self, column: int, length: int) -> Mark:
        """Return the place of a part of the scalar's text: the whole of it where the file writes it otherwise."""
        begin = self.node.mark.column - 1 + self.node.quoted
        if self.source.line(self.node.mark.line).startswith(self.node.text[: column + length], begin):
            return Mark(self.node.mark.line, begin + column + 1, length)
        return self.node.mark


def mismatches(formula: Template | Expression, where: Where, kinds: Mapping[str, Kind]) -> list[Diagnostic]:
    """Return the mistakes in what is calculated here, where names are of these kinds."""
    faults: list[Diagnostic] = []

    def note(part: Expression, node: ast.expr, message: str, hint: str) -> None:
        faults.append(Diagnostic(where.source, where.place(*part.place(node)), f"{where.what}{message}", hint))

    parts = formula.parts if isinstance(formula, Template) else (formula,)
    for number, part in enumerate(parts):
        if isinstance(part, str):
            continue

        def report(node: ast.expr, message: str, hint: str, part: Expression = part) -> None:
            note(part, node, f": {message}", hint)

        kind = Inference(kinds, report).kind(part.tree)
        after = parts[number + 1] if number + 1 < len(parts) else ""
        wrong = _alone(kind, where.wants) if len(parts) == 1 else _before(kind, after, where.wants)
        if wrong is not None:
            note(part, part.tree, *wrong)
    return faults


def _alone(kind: Kind, wants: str) -> tuple[str, str] | None:
    """Return what is wrong with a value of this kind, and what to write."""
    if wants in UNITS:
        if (is_size(kind) and not _same(kind, wants)) or kind in (TEXT, FLAG) or isinstance(kind, ListOf):
            return f" {needs(wants)}, got {told(kind)}", multiply(wants) if kind in (NUMBER, PERCENT) else ""
    elif wants in (NUMBER, "count") and is_size(kind) and not _same(kind, NUMBER):
        return f" needs a number, got {told(kind)}", divide(str(kind))
    return None


def _before(kind: Kind, after: str | Expression, wants: str) -> tuple[str, str] | None:
    """Return what is wrong with a value of this kind in a text, before a unit: "${n} deg"."""
    word = _WORD.match(after) if isinstance(after, str) else None
    if word is None or not is_unit(word[1]):
        return None
    if is_size(kind) and not _same(kind, NUMBER):
        return f": {told(kind)} is written with its unit", f"leave '{word[1]}' out, or {divide(str(kind))}"
    written = quantity(f"1 {word[1]}")
    if wants in UNITS and written is not None and written.dimension != wants:
        return f" {needs(wants)}, got {told(written.dimension)}", ""
    return None


_WORD = re.compile(r"\s*([A-Za-z%°][A-Za-z/^2²°%]*)")


def _same(kind: Kind, dimension: str) -> bool:
    try:
        common(str(kind), dimension)
    except DimensionError:
        return False
    return True
