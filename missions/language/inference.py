"""Type inference of expressions: finds their kinds (static types), and reports kinds that do not fit.

An error is a kind that does not fit its argument, or two operands of incompatible kinds.
"""

import ast
import re
from collections.abc import Callable, Mapping

from config.diagnostics import Diagnostic, Mark, SourceText, suggest_from
from config.units import NUMBER, UNITS, DimensionError, common_dimension, is_unit, parse_quantity
from config.yaml_nodes import Scalar
from drivers.api.fast_dataclass import dataclass
from missions.language.expressions import (
    DataTemplate,
    Expression,
    Template,
    Value,
    divide_hint,
    multiply_hint,
    needs_message,
)
from missions.language.kinds import (
    CONSTANTS,
    FLAG,
    NOTHING,
    PERCENT,
    STATE_KINDS,
    TEXT,
    UNSETTLED,
    Kind,
    ListKind,
    RecordKind,
    describe_kind,
    is_numeric,
    join_kinds,
    kind_of_value,
)
from missions.language.operators import RANDOM, combined_dimension

ADD_LIST_HINT = "write found + [item] for a list with one more member"

Report = Callable[[ast.expr, str, str], None]
"""Function that takes a part of an expression, the error in it, and a hint."""


def ignore_report(node: ast.expr, message: str, hint: str) -> None:
    """Ignore a type error of an expression."""
    del node, message, hint


class TypeInference:
    """Infers the kinds (static types) of expressions, given the ``kinds`` of variables.

    ``report`` is called with each type error.
    """

    def __init__(self, kinds: Mapping[str, Kind], report: Report = ignore_report) -> None:
        self._kinds = kinds
        self._report = report

    def kind(self, node: ast.expr) -> Kind:
        """Return the kind (static type) of an expression; UNSETTLED if it has an error, which is reported."""
        match node:
            case ast.Constant(value=value):
                return kind_of_value(value)
            case ast.Name(id=name):
                return self._kinds.get(name, kind_of_value(CONSTANTS[name]) if name in CONSTANTS else None)
            case ast.BoolOp(values=parts) | ast.UnaryOp(op=ast.Not(), operand=parts):
                for part in parts if isinstance(parts, list) else [parts]:
                    self.kind(part)
                return FLAG
            case ast.UnaryOp(operand=part):
                return self._require_numeric(part, self.kind(part))
            case ast.BinOp():
                return self._arithmetic_kind(node)
            case ast.Compare():
                return self._comparison_kind(node)
            case ast.IfExp():
                return self._conditional_kind(node)
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                return ListKind(self._common_kind(parts, "the members of a list must have one type"))
        return self._access_kind(node)

    def _access_kind(self, node: ast.expr) -> Kind:
        match node:
            case ast.Attribute(value=ast.Name(id=part), attr=name) if part in STATE_KINDS:
                return STATE_KINDS[part].get(name)
            case ast.Attribute(value=value, attr=name):
                kind = self.kind(value)
                if isinstance(kind, RecordKind) and kind.lacks(name):
                    return self._report_error(node, f"'{name}' is not there", suggest_from(name, kind.members))
                return kind.member(name) if isinstance(kind, RecordKind) else None
            case ast.Subscript(value=value, slice=place):
                kind, at = self.kind(value), self.kind(place)
                if is_numeric(at) and at != NUMBER:
                    return self._report_error(place, f"list indexes are whole numbers, not {describe_kind(at)}")
                if is_numeric(kind) or kind in (TEXT, FLAG, NOTHING):
                    return self._report_error(value, f"only lists have numbered members, not {describe_kind(kind)}")
                return kind.member_kind if isinstance(kind, ListKind) else None
            case ast.Call(func=ast.Name(id=word), args=parts):
                return self._call_kind(word, parts)
        return None

    def _call_kind(self, word: str, parts: list[ast.expr]) -> Kind:
        if word == RANDOM:
            return self._drawn_kind(parts)
        if word in ("min", "max") and len(parts) > 1:
            return self._common_kind(parts, "cannot compare")
        kinds = [self.kind(part) for part in parts]
        if not kinds:
            return None
        if word in ("min", "max"):
            return kinds[0].member_kind if isinstance(kinds[0], ListKind) else None
        return NUMBER if word == "len" else self._require_numeric(parts[0], kinds[0])

    def _drawn_kind(self, bounds: list[ast.expr]) -> Kind:
        """Return the kind of a random number between two bounds."""
        kinds = [self._require_numeric(bound, self.kind(bound)) for bound in bounds]
        for bound, kind in zip(bounds, kinds, strict=True):
            if not _comparable(ast.Eq(), kinds[0], kind):
                message = f"cannot draw between {describe_kind(kinds[0])} and {describe_kind(kind)}"
                return self._report_error(bound, message, _fix_hint(kinds[0], kind))
        low, high = (bound.value if isinstance(bound, ast.Constant) else None for bound in bounds)
        if isinstance(low, int | float) and isinstance(high, int | float) and low > high:
            return self._report_error(bounds[0], f"{low} is above {high}, the second bound")
        return UNSETTLED if UNSETTLED in kinds else join_kinds(*kinds)

    def _arithmetic_kind(self, node: ast.BinOp) -> Kind:
        left, right = self.kind(node.left), self.kind(node.right)
        if isinstance(node.op, ast.Add) and left == right == TEXT:
            return TEXT
        if isinstance(node.op, ast.Add) and (isinstance(left, ListKind) or isinstance(right, ListKind)):
            return self._joined_list_kind(node, left, right)
        left, right = self._require_numeric(node.left, left), self._require_numeric(node.right, right)
        if UNSETTLED in (left, right):
            return UNSETTLED
        if not (isinstance(left, str) and isinstance(right, str)):
            return None if isinstance(node.op, ast.Mult | ast.Div) else left or right
        try:
            return combined_dimension(type(node.op), left, right)
        except ValueError as error:
            return self._report_error(node, str(error), _fix_hint(left, right))

    def _joined_list_kind(self, node: ast.BinOp, left: Kind, right: Kind) -> Kind:
        """Return the kind of the sum ``node`` of two lists, whose kinds are ``left`` and ``right``.

        Report an error if one of them is no list, or if their members have different kinds.
        """
        if not (isinstance(left, ListKind) and isinstance(right, ListKind)):
            other = right if isinstance(left, ListKind) else left
            if other is None or other == UNSETTLED:
                return None
            part = node.right if isinstance(left, ListKind) else node.left
            return self._report_error(part, f"cannot add a list and {describe_kind(other)}", ADD_LIST_HINT)
        one, other = left.member_kind, right.member_kind
        if not _comparable(ast.Eq(), one, other):
            kinds = f"{describe_kind(one)} and {describe_kind(other)}"
            hint = _fix_hint(one, other)
            return self._report_error(node, f"the members of a list must have one type: {kinds}", hint)
        return join_kinds(left, right)

    def _require_numeric(self, node: ast.expr, kind: Kind) -> Kind:
        """Return the kind (static type) of the operand ``node`` as a number.

        Report an error for a text, a list or a record.
        """
        if kind is None or kind == UNSETTLED or is_numeric(kind):
            return kind
        return NUMBER if kind == FLAG else self._report_error(node, f"cannot calculate with {describe_kind(kind)}")

    def _comparison_kind(self, node: ast.Compare) -> Kind:
        parts = [node.left, *node.comparators]
        kinds = [self.kind(part) for part in parts]
        for op, left, right in zip(node.ops, kinds, kinds[1:], strict=False):
            if isinstance(op, ast.In | ast.NotIn) and (is_numeric(right) or right == FLAG):
                self._report_error(node, f"'in' needs a list or a text, not {describe_kind(right)}")
                continue
            among = right.member_kind if isinstance(right, ListKind) else TEXT if right == TEXT else None
            other = among if isinstance(op, ast.In | ast.NotIn) else right
            one, two = (
                (left.member_kind, other.member_kind)
                if isinstance(left, ListKind) and isinstance(other, ListKind)
                else (left, other)
            )
            if not _comparable(op, one, two):
                self._report_error(
                    node, f"cannot compare {describe_kind(one)} and {describe_kind(two)}", _fix_hint(one, two)
                )
        return FLAG

    def _conditional_kind(self, node: ast.IfExp) -> Kind:
        self.kind(node.test)
        one, other = self.kind(node.body), self.kind(node.orelse)
        if is_numeric(one) and is_numeric(other) and join_kinds(one, other) is None:
            return self._report_error(
                node, f"it is either {describe_kind(one)} or {describe_kind(other)}", _fix_hint(one, other)
            )
        return join_kinds(one, other)

    def _common_kind(self, parts: list[ast.expr], rule: str) -> Kind:
        """Return the kind (static type) that fits all ``parts``; report an error if two of them differ.

        ``rule`` begins the text of the error.
        """
        kinds = [self.kind(part) for part in parts]
        kind: Kind = UNSETTLED
        for part, other in zip(parts, kinds, strict=True):
            if not _comparable(ast.Eq(), kind, other):
                return self._report_error(
                    part, f"{rule}: {describe_kind(kind)} and {describe_kind(other)}", _fix_hint(kind, other)
                )
            kind = join_kinds(kind, other)
        return UNSETTLED if UNSETTLED in kinds else kind

    def _report_error(self, node: ast.expr, message: str, hint: str = "") -> Kind:
        self._report(node, message, hint)
        return UNSETTLED


def _comparable(op: ast.cmpop, left: Kind, right: Kind) -> bool:
    if None in (left, right) or UNSETTLED in (left, right):
        return True
    if NOTHING in (left, right):
        return isinstance(op, ast.Eq | ast.NotEq | ast.In | ast.NotIn)
    if is_numeric(left) and is_numeric(right):
        return join_kinds(left, right) is not None
    return left == right or (type(left) is type(right) and not isinstance(left, str))


def _fix_hint(left: Kind, right: Kind) -> str:
    """Return a hint for two operands of incompatible kinds, such as a number and a length; empty if there is none."""
    if {PERCENT, "share"} == {left, right}:
        return "a percent value is a number from 0 to 100: write 20 for 20 %"
    sizes = [kind for kind in (left, right) if isinstance(kind, str) and is_numeric(kind) and kind != NUMBER]
    if NUMBER in (left, right) and len(sizes) == 1:
        return f"a plain number is not a quantity: write its unit, or {multiply_hint(sizes[0])}"
    if {left, right} == {TEXT, NUMBER}:
        return "a text stands in quotes, a number does not"
    return ""


def kind_of_result(value: Value, kinds: Mapping[str, Kind]) -> Kind:
    """Return the kind (static type) of ``value``, a constant or an expression; ``kinds`` are those of variables."""
    match value.template:
        case None:
            return kind_of_value(value.constant)
        case DataTemplate(data=data):
            return _kind_of_data(data, kinds)
        case Template(parts=()):
            return None
        case Expression(tree=tree) | Template(parts=(Expression(tree=tree),)):
            return TypeInference(kinds).kind(tree)
    return TEXT


def _kind_of_data(data: object, kinds: Mapping[str, Kind]) -> Kind:
    """Return the kind of nested lists and mappings with a ``Value`` in place of each plain value."""
    if isinstance(data, Value):
        return kind_of_result(data, kinds)
    if isinstance(data, Mapping):
        return RecordKind("a mapping", members={str(key): _kind_of_data(each, kinds) for key, each in data.items()})
    kind: Kind = UNSETTLED
    for each in data if isinstance(data, list) else ():
        kind = join_kinds(kind, _kind_of_data(each, kinds))
    return ListKind(kind)


CONDITION_KIND = "condition"
"""Kind of a value that must be true or false: of ``if``, ``while``, ``until``, ``check`` and ``wait_until``."""


@dataclass(frozen=True, slots=True)
class ExpressionLocation:
    """Place of an expression: the scalar ``node`` of the file ``source``, for error messages.

    ``label`` begins a message; ``wanted_kind`` is the kind of the argument: a word such as
    ``count``, or a list.
    """

    source: SourceText
    node: Scalar
    label: str
    wanted_kind: Kind = ""

    def place(self, column: int, length: int) -> Mark:
        """Return the place in the file of the part of the expression at ``column`` with ``length`` characters.

        If YAML escapes make the file differ from the text, return the place of the whole scalar.
        """
        begin = self.node.mark.column - 1 + self.node.quoted
        if self.source.line(self.node.mark.line).startswith(self.node.text[: column + length], begin):
            return Mark(self.node.mark.line, begin + column + 1, length)
        return self.node.mark


def find_mismatches(
    formula: Template | Expression, where: ExpressionLocation, kinds: Mapping[str, Kind]
) -> list[Diagnostic]:
    """Return the type errors of an expression or a template; ``kinds`` are the static types of variables."""
    faults: list[Diagnostic] = []

    def note(part: Expression, node: ast.expr, message: str, hint: str) -> None:
        faults.append(Diagnostic(where.source, where.place(*part.place(node)), f"{where.label}{message}", hint))

    parts = formula.parts if isinstance(formula, Template) else (formula,)
    for number, part in enumerate(parts):
        if isinstance(part, str):
            continue

        def report(node: ast.expr, message: str, hint: str, part: Expression = part) -> None:
            note(part, node, f": {message}", hint)

        kind = TypeInference(kinds, report).kind(part.tree)
        after = parts[number + 1] if number + 1 < len(parts) else ""
        if where.wanted_kind == CONDITION_KIND:
            wrong = _no_condition(part.tree, kind)
        elif len(parts) == 1:
            wrong = _mismatch_alone(kind, where.wanted_kind)
        else:
            wrong = _mismatch_before_unit(kind, after, where.wanted_kind)
        if wrong is not None:
            note(part, part.tree, *wrong)
    if len(parts) > 1 and not faults and isinstance(where.wanted_kind, ListKind | RecordKind):
        first = next(part for part in parts if isinstance(part, Expression))
        hint = "write one expression, such as ${[a, b]}" if isinstance(where.wanted_kind, ListKind) else ""
        note(first, first.tree, f" {_misfit(TEXT, where.wanted_kind)}", hint)
    return faults


def _no_condition(node: ast.expr, kind: Kind) -> tuple[str, str] | None:
    """Return error and hint if an expression of ``kind`` is no condition; None for one that may be true or false.

    A number in a variable is accepted: it may stand for true or false.
    """
    match node:
        case ast.Constant():
            fits = kind in (FLAG, NOTHING)
        case ast.Attribute(value=ast.Name(id=name)) if name in STATE_KINDS:
            fits = not (is_numeric(kind) or kind == TEXT)
        case _:
            fits = not is_numeric(kind) or kind == NUMBER
    if fits:
        return None
    hint = (
        "for a time, write 'for', 'timeout' or 'wait'"
        if kind == "duration"
        else "compare it, as in: battery.percent > 20"
    )
    return f" needs a condition that is true or false, got {describe_kind(kind)}", hint


def _mismatch_alone(kind: Kind, wanted_kind: Kind) -> tuple[str, str] | None:
    """Return error and hint if a value without a unit behind it does not fit ``wanted_kind``; None if it fits.

    ``kind`` is the static type of the value.
    """
    message = _misfit(kind, wanted_kind)
    if not message:
        return None
    hint = ""
    if wanted_kind in (NUMBER, "count"):
        hint = divide_hint(str(kind))
    elif isinstance(wanted_kind, str) and kind in (NUMBER, PERCENT):
        hint = multiply_hint(wanted_kind)
    return f" {message}", hint


def _misfit(kind: Kind, wanted_kind: Kind) -> str:
    """Return the error if a value of ``kind`` (its static type) does not fit ``wanted_kind``; empty if it fits."""
    if kind is None or kind in (UNSETTLED, NOTHING):
        return ""
    if isinstance(wanted_kind, ListKind):
        if not isinstance(kind, ListKind):
            return f"needs a list, got {describe_kind(kind)}"
        message = _misfit(kind.member_kind, wanted_kind.member_kind)
        return message and f"has a wrong member: it {message}"
    if isinstance(wanted_kind, RecordKind):
        return _mapping_misfit(kind, wanted_kind.members)
    if wanted_kind in UNITS:
        fits = is_numeric(kind) and _is_same_dimension(kind, str(wanted_kind))
        return "" if fits else f"{needs_message(str(wanted_kind))}, got {describe_kind(kind)}"
    if wanted_kind in (NUMBER, "count") and is_numeric(kind) and not _is_same_dimension(kind, NUMBER):
        return f"needs a number, got {describe_kind(kind)}"
    return ""


def _mapping_misfit(kind: Kind, wanted: Mapping[str, Kind]) -> str:
    """Return the error if a value of ``kind`` (its static type) is no mapping with the keys and kinds in ``wanted``.

    Empty if it is, or if its keys are unknown.
    """
    if not isinstance(kind, RecordKind):
        return f"needs a mapping with {', '.join(wanted)}, got {describe_kind(kind)}"
    if not kind.members:  # unknown
        return ""
    different = [key for key in (*wanted, *kind.members) if (key in wanted) != (key in kind.members)]
    if different:
        return f"has no '{different[0]}'" if different[0] in wanted else f"has an unknown key '{different[0]}'"
    messages = ((key, _misfit(kind.member(key), wanted[key])) for key in wanted)
    return next((f"has a wrong '{key}': it {message}" for key, message in messages if message), "")


def _mismatch_before_unit(kind: Kind, after: str | Expression, wanted_kind: Kind) -> tuple[str, str] | None:
    """Return error and hint for a value before a unit in a text: "${n} deg"; None if it fits."""
    word = _WORD.match(after) if isinstance(after, str) else None
    if word is None or not is_unit(word[1]):
        return None
    if is_numeric(kind) and not _is_same_dimension(kind, NUMBER):
        return (
            f": {describe_kind(kind)} is written with its unit",
            f"leave '{word[1]}' out, or {divide_hint(str(kind))}",
        )
    written = parse_quantity(f"1 {word[1]}")
    if wanted_kind in UNITS and written is not None and written.dimension != wanted_kind:
        return f" {needs_message(wanted_kind)}, got {describe_kind(written.dimension)}", ""
    return None


_WORD = re.compile(r"\s*([A-Za-z%°][A-Za-z/^2²°%]*)")


def _is_same_dimension(kind: Kind, dimension: str) -> bool:
    try:
        common_dimension(str(kind), dimension)
    except DimensionError:
        return False
    return True
