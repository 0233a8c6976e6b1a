"""Translation of expressions of missions to scripts of BehaviorTree.CPP, as far as both have the same meaning.

A script has numbers, texts and blackboard entries. It has nothing for the robot's state, quantities, lists, members of
results, functions and null. A blackboard entry keeps the type of its first value: a whole number never becomes a
fraction.
"""

import ast
import re
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal

from behaviours.leaf import Leaf
from config.units import Quantity, parse_quantity
from config.yaml_nodes import Node, Scalar
from missions.language.expressions import Expression, ExpressionError, Template, Value, parse, template
from missions.language.kinds import CONSTANTS, STATE_KINDS, kind_of_type
from missions.language.nodes import FOR_EACH, MISSION
from missions.language.plan import Step

WHOLE, FRACTION, FLAG, TEXT, ANY, OTHER = "whole", "fraction", "flag", "text", "any", "other"
"""Kinds of values in scripts. ``any`` is a value of a caller, ``other`` one that no script can hold."""

Kinds = Mapping[str, str]
NUMBERS = (WHOLE, FRACTION)
ENTRY_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
PLAIN_TEXT = re.compile(r"[^'\\\x00-\x1f]*")
ARITHMETIC: Mapping[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
COMPARISONS: Mapping[type[ast.cmpop], str] = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


class NotAScriptError(ValueError):
    """Raised for a step or expression that BehaviorTree.CPP cannot express; the message names the missing part."""


def script_condition(node: Node | None, kinds: Kinds) -> str:
    """Return the condition in a YAML node as a script; ``kinds`` are those of variables. Raises NotAScriptError."""
    text, kind = script_expression(node, kinds)
    if kind not in (FLAG, *NUMBERS, ANY):
        raise NotAScriptError("a condition that is not true or false")
    return text


def script_expression(node: Node | None, kinds: Kinds) -> tuple[str, str]:
    """Return the expression in a YAML node as a script, and the kind of its value; ``kinds`` are those of variables.

    Raises NotAScriptError.
    """
    text = node.text if isinstance(node, Scalar) else ""
    hole = re.fullmatch(r"\s*\$\{(.*)\}\s*", text, re.DOTALL)
    try:
        return _script_of(parse(hole[1] if hole else text).tree, kinds)
    except ExpressionError as error:
        raise NotAScriptError("a value other than an expression") from error


def value_of(node: Node) -> Value:
    """Return the value in a YAML node as written: a constant, or a template in which params have no values yet."""
    if not isinstance(node, Scalar):
        return Value(())
    found = template(node.text) if isinstance(node.value, str) else None
    quantity = None if node.quoted else parse_quantity(node.text)
    return Value(node.value if quantity is None else quantity, found)


def script_value(value: Value, kinds: Kinds, target: str) -> str:
    """Return a value as a script that can be assigned to a blackboard entry whose kind is ``target``.

    Raises NotAScriptError if it cannot be a script, or has another kind.
    """
    if value.template is None:
        text, kind = _constant(value.constant, as_fraction=target == FRACTION)
    elif isinstance(value.template, Template):
        text, kind = _joined(value.template, kinds)
    else:
        text, kind = _script_of(value.template.tree, kinds)
    if kind != target and not (ANY in (kind, target) and OTHER not in (kind, target)):
        raise NotAScriptError(
            "a variable for several kinds of values" if target == OTHER else f"a {kind} as a {target}"
        )
    return text


def _joined(found: Template, kinds: Kinds) -> tuple[str, str]:
    if len(found.parts) == 1 and isinstance(found.parts[0], Expression):
        return _script_of(found.parts[0].tree, kinds)
    words = list[str]()
    for part in found.parts:
        text, kind = _constant(part) if isinstance(part, str) else _script_of(part.tree, kinds)
        if kind != TEXT:
            raise NotAScriptError("a number inside a text")
        words.append(text if isinstance(part, str) else _operand(part.tree, text))
    return " .. ".join(words), TEXT


def _constant(value: object, *, as_fraction: bool = False) -> tuple[str, str]:
    match value:
        case Quantity():
            raise NotAScriptError("a quantity with a unit")
        case bool():
            return ("true" if value else "false"), FLAG
        case int():
            return (f"{value}.0", FRACTION) if as_fraction else (str(value), WHOLE)
        case float():
            text = format(Decimal(repr(value)), "f")
            return (text if "." in text else f"{text}.0"), FRACTION
        case str() if PLAIN_TEXT.fullmatch(value):
            return f"'{value}'", TEXT
        case str():
            raise NotAScriptError("a text with a quote or a line break")
        case None:
            raise NotAScriptError("null")
    raise NotAScriptError("a list or a mapping")


def _script_of(node: ast.expr, kinds: Kinds) -> tuple[str, str]:
    """Return the syntax tree of an expression as a script, and the kind of its value. Raises NotAScriptError."""
    match node:
        case ast.Constant(value=value):
            return _constant(value)
        case ast.Name(id=name) if name in CONSTANTS:
            return _constant(CONSTANTS[name])
        case ast.Name(id=name):
            return _entry(name, kinds)
        case ast.BoolOp(op=op, values=parts):
            sign = " && " if isinstance(op, ast.And) else " || "
            return sign.join(_operand(part, _truth(part, kinds)) for part in parts), FLAG
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=part):
            return _signed(node.op, part, kinds)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
            return _calculation(left, op, right, kinds)
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARISONS for op in ops):
            return _comparison([left, *others], [COMPARISONS[type(op)] for op in ops], kinds)
        case ast.IfExp():
            return _choice(node, kinds)
    raise NotAScriptError(_name_of(node))


def _signed(op: ast.unaryop, part: ast.expr, kinds: Kinds) -> tuple[str, str]:
    if isinstance(op, ast.Not):
        return f"!{_operand(part, _truth(part, kinds))}", FLAG
    text, kind = _script_of(part, kinds)
    return f"-{_operand(part, text)}", _number(kind)


def _choice(node: ast.IfExp, kinds: Kinds) -> tuple[str, str]:
    (one, kind), (other, other_kind) = _script_of(node.body, kinds), _script_of(node.orelse, kinds)
    if kind != other_kind:
        raise NotAScriptError("a choice between two kinds of values")
    test = _operand(node.test, _truth(node.test, kinds))
    return f"{test} ? {_operand(node.body, one)} : {_operand(node.orelse, other)}", kind


def _entry(name: str, kinds: Kinds) -> tuple[str, str]:
    kind = kinds.get(name, OTHER)
    if name in STATE_KINDS:
        raise NotAScriptError(f"'{name}', the robot's state")
    if kind == OTHER or not ENTRY_NAME.fullmatch(name):
        raise NotAScriptError(f"the value of '{name}'")
    return name, kind


def _truth(node: ast.expr, kinds: Kinds) -> str:
    text, kind = _script_of(node, kinds)
    if kind == TEXT:
        raise NotAScriptError("a text as a condition")
    return text


def _calculation(left: ast.expr, op: ast.operator, right: ast.expr, kinds: Kinds) -> tuple[str, str]:
    (one, kind), (other, other_kind) = _script_of(left, kinds), _script_of(right, kinds)
    text = f"{_operand(left, one)} {ARITHMETIC[type(op)]} {_operand(right, other)}"
    if isinstance(op, ast.Div):
        _number(kind), _number(other_kind)
        return text, FRACTION
    if ANY in (kind, other_kind):
        return text, ANY if _number(kind) and _number(other_kind) else OTHER
    return text, FRACTION if FRACTION in (_number(kind), _number(other_kind)) else WHOLE


def _number(kind: str) -> str:
    if kind not in (*NUMBERS, ANY):
        raise NotAScriptError(f"a calculation with a {kind}")
    return kind


def _comparison(operands: list[ast.expr], signs: list[str], kinds: Kinds) -> tuple[str, str]:
    written = [_script_of(each, kinds) for each in operands]
    found = {NUMBERS[0] if kind in NUMBERS else kind for _, kind in written} - {ANY}
    if len(found) > 1 or FLAG in found:
        raise NotAScriptError("a comparison with true or false, or of two kinds of values")
    texts = [_operand(each, text) for each, (text, _) in zip(operands, written, strict=True)]
    pairs = zip(signs, texts[1:], strict=True)
    return " ".join([texts[0], *(f"{sign} {text}" for sign, text in pairs)]), FLAG


def _operand(node: ast.expr, text: str) -> str:
    return text if isinstance(node, ast.Name | ast.Constant) else f"({text})"


def _name_of(node: ast.expr) -> str:
    match node:
        case ast.Call(func=ast.Name(id=name)):
            return f"the function '{name}'"
        case ast.Attribute():
            return f"'{ast.unparse(node)}'"
        case ast.BinOp() | ast.Compare():
            return f"the operator of '{ast.unparse(node)}'"
    return f"'{ast.unparse(node)}'"


# Kinds of the variables of a mission.


def variable_kinds(
    steps: Iterable[Step], params: Mapping[str, str], values: Callable[[Step], Mapping[str, Value]]
) -> dict[str, str]:
    """Return the kinds of values of a mission's variables, by name; ``params`` are the kinds of its params.

    ``steps`` are the steps that share these variables. ``values`` returns the values that a ``set`` step assigns.
    """
    found = dict(params)
    steps = list(steps)
    for _ in range(len(steps) + 2):  # a value may read a variable that a later step sets
        before = dict(found)
        for step in steps:
            for name, kind in _set_kinds(step, found, values):
                found[name] = _joined_kind(found.get(name), kind)
        if found == before:
            break
    return found


def _set_kinds(step: Step, kinds: Kinds, values: Callable[[Step], Mapping[str, Value]]) -> Iterable[tuple[str, str]]:
    if step.leaf is not None and step.leaf.open_ended:
        for name, value in values(step).items():
            kind = _kind_of(value, kinds)
            if kind:
                yield name, kind
    elif step.output_variable is not None:
        yield step.output_variable, _output_kind(step.leaf)
    elif step.kind == MISSION:
        yield from ((name, ANY) for name in step.returns)
    elif step.kind == FOR_EACH:
        yield from zip(step.binds, (OTHER, WHOLE), strict=False)


def _output_kind(leaf: type[Leaf] | None) -> str:
    kind = None if leaf is None else kind_of_type(leaf.output_type)
    return {"text": TEXT, "flag": FLAG, "number": FRACTION}.get(str(kind), OTHER)


def _kind_of(value: Value, kinds: Kinds) -> str:
    """Return the kind of a value; empty for null, and for an expression with a variable whose kind is not known yet."""
    if value.template is None and value.constant is None:
        return ""
    try:
        if value.template is None:
            return _constant(value.constant)[1]
        if isinstance(value.template, Template):
            return _joined(value.template, kinds)[1]
        return _script_of(value.template.tree, kinds)[1]
    except NotAScriptError:
        reads = () if value.template is None else value.template.reads
        return "" if any(read.name not in kinds and read.name not in STATE_KINDS for read in reads) else OTHER


def _joined_kind(one: str | None, other: str) -> str:
    if one is None or one == other:
        return other
    if {one, other} == {*NUMBERS}:
        return FRACTION
    return ANY if ANY in (one, other) and OTHER not in (one, other) else OTHER
