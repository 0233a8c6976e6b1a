"""Arguments of leaves: parsing, checks and conversion of the values in a mission."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from py_trees.common import Status

from behaviours.leaf import Argument, Leaf
from config.diagnostics import suggest_key
from config.units import EXAMPLES, UNITS, Quantity, parse_quantity, quantity_text, quoted_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from drivers.api.kinds import REPEATABLE_KINDS
from missions.language.check_context import CheckContext, hole_hint
from missions.language.expressions import (
    INVALID_VALUE,
    Convert,
    DataTemplate,
    ExpressionError,
    Template,
    Value,
    as_whole_number,
    data_values,
    format_value,
    in_si,
    is_calculation,
    map_data,
    parse,
)
from missions.language.inference import CONDITION_KIND
from missions.language.kinds import ListKind
from missions.language.lists import default_value
from missions.language.modifiers import outdent_hint, read_condition
from missions.language.nodes import MISSION
from missions.language.operators import describe_value
from missions.language.param_hints import sole_name
from missions.language.phrases import PHRASES_KIND as PHRASES
from missions.language.phrases import read_phrases, second_phrase_hint
from perception.api import Face

# Texts of arguments that name something else: functions that find the thing, file or mission.
#
# Faces are named only by variables, which ``as`` has set; a calculation outside ``${...}`` is an error.


def check_text(context: CheckContext, name: Scalar, node: Node) -> None:
    """Report an error if the text argument ``name`` looks like a calculation with a variable, such as ``n + 1``.

    Texts in quotes are accepted.
    """
    if not isinstance(node, Scalar) or node.quoted or not isinstance(node.value, str) or parse_quantity(node.text):
        return
    try:
        formula = parse(node.text)
    except ExpressionError:
        return
    if is_calculation(formula) and any(
        read.name in context.params or read.name in context.variables for read in formula.reads
    ):
        message = f"'{name.text}' is set to the text {quoted_value(node.text)}, which is not calculated"
        hint = f'write {name.text}: "${{{node.text}}}", or quotes around it for the text'
        context.fault(node.mark, message, hint)


CONDITION_HINT = "such as battery.percent > 20"

FACE_KIND = "face"
"""Kind of an argument whose value is a face."""


def read_face(context: CheckContext, node: Scalar, label: str) -> Value:
    """Return the value of a face argument: ``${person}``, or nothing."""
    if node.value is None:
        return Value()
    if "${" not in node.text:
        hint = f'write "${{{node.text}}}"' if node.text in context.variables else _face_hint(context)
        context.fault(node.mark, f"{label} needs a face stored by 'as', got the text {quoted_value(node.text)}", hint)
        return INVALID_VALUE
    found = context.read_value(node, label, as_face)
    source_leaf = context.variable_leaves.get("" if found.template is None else sole_name(found.template))
    if source_leaf is not None and source_leaf.output_type is not None and not _is_face(source_leaf):
        context.fault(
            node.mark,
            f"{label} needs a face stored by 'as', got the result of '{source_leaf.tag}'",
            _face_hint(context),
        )
        return INVALID_VALUE
    return found


def as_face(value: object) -> Face | None:
    """Return ``value`` if it is a face or None. Raises ValueError for any other value."""
    if value is None or isinstance(value, Face):
        return value
    raise ValueError(f"needs a face stored by 'as', got {describe_value(value)}")


def _is_face(leaf: type[Leaf]) -> bool:
    return isinstance(leaf.output_type, type) and issubclass(leaf.output_type, Face)


def _face_hint(context: CheckContext) -> str:
    """Return the hint for a face argument: a variable that holds a face, if there is one."""
    faces = [name for name, leaf in context.variable_leaves.items() if _is_face(leaf)]
    return f'write "${{{faces[0]}}}"' if faces else 'store one with as: person, beside find_face, and write "${person}"'


def thing_converter(context: CheckContext, kind: str) -> Convert | None:
    """Return a function that looks up an object of the ``kind`` (such as "gesture") by name.

    The function raises LookupError for unknown names. None for a kind of argument that is not looked up.
    """
    folder = Path(context.source.name).parent
    if kind == "file":
        return partial(_file, context.things.get(kind, Path), folder)
    if kind == MISSION:
        return lambda value: context.vocabulary.find_mission(format_value(value), folder)
    return partial(_find, context.things[kind]) if kind in context.things else None


def _find(lookup: Callable[[str], object], value: object) -> object:
    return lookup(format_value(value))


def _file(lookup: Callable[[str], object], folder: Path, value: object) -> object:
    """Return the object that ``lookup`` finds for the file ``value``, a path relative to ``folder``."""
    return lookup(str(folder / format_value(value)))


TEXT_KINDS = ("text", "joint", "joints", "choice", "file", *REPEATABLE_KINDS)
"""Kinds of arguments whose values are texts, even if they look like numbers."""

SWITCH_WORDS = {"on": True, "off": False}
"""Words for true and false that flag arguments also accept."""

OUTCOMES = {"running": Status.RUNNING, "success": Status.SUCCESS, "failure": Status.FAILURE}


def read_arguments(context: CheckContext, leaf: type[Leaf], key: Scalar, node: Node | None) -> dict[str, Value]:
    """Return a leaf's arguments by name from the value of its tag: nothing, the principal argument, or a mapping."""
    if leaf.open_ended:
        return _read_open(context, leaf, key, node)
    declared = leaf.arguments
    values: dict[str, Value] = {}
    if isinstance(node, Mapping):
        for name, value_node in node.entries:
            if hint := _condition_hint(context, leaf, name, value_node):
                context.fault(name.mark, f"'{name.text}' is a condition already", hint)
                values |= dict.fromkeys(declared, INVALID_VALUE)
            elif name.text in declared:
                values[name.text] = read_argument(
                    context, declared[name.text], value_node, f"'{leaf.tag}': '{name.text}'"
                )
            else:
                hint = second_phrase_hint(leaf, node, name) or outdent_hint(name.text, leaf.tag)
                bare = name.text in context.params and isinstance(value_node, Scalar) and value_node.value is None
                hint = hole_hint(f"{{{name.text}}}") if bare else hint or suggest_key(name.text, declared)
                context.fault(name.mark, f"'{leaf.tag}' has no argument '{name.text}'", hint, certain=True)
                values[name.text] = INVALID_VALUE
    elif node is not None and not (isinstance(node, Scalar) and node.value is None):
        principal = next((argument for argument in declared.values() if argument.principal), None)
        if principal is not None:
            values[principal.name] = read_argument(context, principal, node, f"'{leaf.tag}'")
        else:
            _report_no_principal(context, leaf, node)
    return values | _defaults(context, leaf, key, values)


def _condition_hint(context: CheckContext, leaf: type[Leaf], name: Scalar, node: Node) -> str:
    """Return the hint for a condition among leaves that is written as an argument of ``check`` or ``wait_until``.

    Empty for all other arguments.
    """
    inner = context.leaves.get(name.text)
    if inner is None or name.text in leaf.arguments or not (inner.instant and {"success", "failure"} <= inner.ends):
        return ""
    value = node.text if isinstance(node, Scalar) else "..."
    return {"check": f"write - {name.text}: {value}", "wait_until": f"write - wait_for: {{{name.text}: {value}}}"}.get(
        leaf.tag, ""
    )


def _defaults(context: CheckContext, leaf: type[Leaf], key: Scalar, given: dict[str, Value]) -> dict[str, Value]:
    """Report the required arguments of a leaf that are not in ``given``.

    Return the defaults that must be looked up, such as the name of a gesture; the leaf has the others already.
    """
    values = {}
    for argument in leaf.arguments.values():
        if argument.name in given:
            continue
        if argument.required:
            choices = f", one of {', '.join(argument.choices)}" if argument.choices else ""
            context.fault(key.mark, f"'{leaf.tag}' needs '{argument.name}': {argument.help}{choices}")
            values[argument.name] = INVALID_VALUE
        elif argument.kind in context.things and argument.default is not None:
            values[argument.name] = context.convert_constant(
                key, argument.default, f"'{leaf.tag}'", converter(context, argument)
            )
    return values


def _report_no_principal(context: CheckContext, leaf: type[Leaf], node: Node) -> None:
    if leaf.arguments:
        hint = f"write {leaf.tag}: {{{next(iter(leaf.arguments))}: ...}}; it has {', '.join(leaf.arguments)}"
        context.fault(node.mark, f"'{leaf.tag}' needs its arguments by name", hint)
    else:
        context.fault(node.mark, f"'{leaf.tag}' takes no argument")


def _read_open(context: CheckContext, leaf: type[Leaf], key: Scalar, node: Node | None) -> dict[str, Value]:
    """Return the arguments of a leaf that takes any argument names, such as ``set: {count: 1}``."""
    if not isinstance(node, Mapping) or not node.entries:
        context.fault(key.mark, f"'{leaf.tag}' needs names and values", f"write {leaf.tag}: {{count: 1}}")
        return {}
    for name, value_node in node.entries:
        context.check_new_name(name, "a variable")
        check_text(context, name, value_node)
    anything = Argument("", "value", "")
    return {
        name.text: read_argument(context, anything, value_node, f"'{name.text}'") for name, value_node in node.entries
    }


def read_argument(context: CheckContext, argument: Argument, node: Node, label: str) -> Value:
    """Return the value of one argument of a leaf from its node."""
    if argument.span:
        return _read_span(context, argument, node, label)
    if argument.by_joint:
        return _read_by_joint(context, argument, node, label)
    read = _READERS.get(argument.kind)
    if read is not None and isinstance(node, Scalar):
        return read(context, node, label)
    if argument.kind == PHRASES:
        return read_phrases(context, node, label)
    convert = converter(context, argument)
    if isinstance(node, Scalar):
        return context.read_value(_as_argument_value(context, argument, node), label, convert, argument.kind)
    if argument.kind == "outcomes" and isinstance(node, Listing):
        return context.convert_constant(node, [_scalar(item) for item in node.items], label, convert)
    if argument.kind == "joints" and isinstance(node, Listing):
        names = [item.text if isinstance(item, Scalar) else _scalar(item) for item in node.items]
        return context.convert_constant(node, names, label, convert)
    if argument.kind == "value":
        return _read_data(context, node, label, convert)
    context.fault(node.mark, f"{label} needs one value, not {_form_name(node)}")
    return INVALID_VALUE


def _read_condition(context: CheckContext, node: Scalar, label: str) -> Value:
    """Return the value of an argument that is an expression, which the leaf evaluates itself."""
    if node.value is None:
        context.fault(node.mark, f"{label} needs an expression", CONDITION_HINT)
        return INVALID_VALUE
    return read_condition(context, label, node)


_READERS: dict[str, Callable[[CheckContext, Scalar, str], Value]] = {
    CONDITION_KIND: _read_condition,
    FACE_KIND: read_face,
}
"""Functions that read the values of arguments with a syntax of their own, by kind of argument."""


def _as_argument_value(context: CheckContext, argument: Argument, node: Scalar) -> Scalar:
    """Return ``node`` with its value as the kind of ``argument`` needs it: a text argument keeps ``007``."""
    if node.value is None:
        return node
    if argument.kind in (*TEXT_KINDS, *UNITS) or argument.kind in context.things:
        return replace(node, value=node.text)
    return replace(node, value=default_value(node)) if argument.kind == "value" else node


def _read_span(context: CheckContext, argument: Argument, node: Node, label: str) -> Value:
    """Read the two ends of a span, each of which may be a param; or a param that holds both."""
    example = f"two values, such as [{quantity_text(0, argument.kind)}, {EXAMPLES[argument.kind]}]"
    one = replace(argument, span=False)
    if isinstance(node, Scalar) and "${" in node.text:
        ends = [context.read_value(node, label, partial(_span, one, example), ListKind(argument.kind))]
        found = ends[0].constant
    elif isinstance(node, Listing) and len(node.items) == ENDS:
        ends = [read_argument(context, one, item, label) for item in node.items]
        found = tuple(end.constant for end in ends)
    else:
        context.fault(node.mark, f"{label} needs {example}")
        return INVALID_VALUE
    if INVALID_VALUE in ends:
        return INVALID_VALUE
    match found:
        case (float() as low, float() as high):
            if low < high:
                return Value((low, high))
            context.fault(node.mark, f"{label}: the first value must be below the second")
        case _:
            message = "the two values must be known before the mission starts: numbers or params"
            context.check_known_early(node, label, message, ends)
    return INVALID_VALUE


def _span(argument: Argument, example: str, value: object) -> tuple[object, ...]:
    if not isinstance(value, list) or len(value) != ENDS:
        raise ValueError(f"needs {example}, got {quoted_value(value)}")
    return tuple(_measure(argument, end) for end in value)


ENDS = 2
"""Number of values of a span."""


def _read_by_joint(context: CheckContext, argument: Argument, node: Node, label: str) -> Value:
    """Return the value of an argument that maps joints to values, such as ``{elbow: 0.5}``.

    The values can be params; a variable that holds such a mapping can stand in its place.
    """
    one = replace(argument, by_joint=False)
    if isinstance(node, Scalar) and "${" in node.text:
        return context.read_value(node, label, partial(_by_joint, converter(context, one)))
    if not isinstance(node, Mapping) or not node.entries:
        example = quantity_text(0.5, argument.kind) if argument.kind in UNITS else "0.5"
        context.fault(node.mark, f"{label} needs joints, each with its value, such as {{elbow: {example}}}")
        return INVALID_VALUE
    values = {joint.text: read_argument(context, one, each, f"{label}: '{joint.text}'") for joint, each in node.entries}
    if INVALID_VALUE in values.values():
        return INVALID_VALUE
    if all(value.template is None for value in values.values()):
        return Value({joint: value.constant for joint, value in values.items()})
    message = "the values must be known before the mission starts: numbers or params"
    context.check_known_early(node, label, message, values.values())
    return INVALID_VALUE


def _by_joint(convert: Convert, value: object) -> dict[str, object]:
    if not isinstance(value, dict):
        raise ValueError(f"needs joints with values, such as {{elbow: 30 deg}}; got {quoted_value(value)}")
    return {joint: convert(each) for joint, each in value.items()}


def converter(context: CheckContext, argument: Argument) -> Convert:
    """Return the function that converts a value of the mission to a value of this argument."""
    kind = argument.kind
    if kind in UNITS:
        return partial(_measure, argument)
    return thing_converter(context, kind) or partial(_CONVERTERS.get(kind, _nonempty_name), argument)


def check_constant(argument: Argument, value: object) -> None:
    """Raise ValueError if a constant from another program or a table does not suit an argument.

    The names of gestures and the like are not looked up; spans and values of joints are not checked.
    """
    if argument.span or argument.by_joint:
        return
    if argument.kind in UNITS:
        _measure(argument, value)
    else:
        _CONVERTERS.get(argument.kind, _any_value)(argument, value)


def _measure(argument: Argument, value: object) -> float:
    si = in_si(value, argument.kind)
    if not argument.low <= si <= argument.high:
        raise ValueError(_bounds(argument, lambda bound: quantity_text(bound, argument.kind)))
    return si


def _text(argument: Argument, value: object) -> str:
    del argument
    if value is None:
        raise ValueError("needs a text, got nothing")
    return format_value(value)


def _number(argument: Argument, value: object) -> float:
    if isinstance(value, bool | Quantity) or not isinstance(value, int | float):
        raise ValueError(f"needs a number, got {quoted_value(value)}")
    if not argument.low <= value <= argument.high:
        raise ValueError(_bounds(argument, lambda bound: f"{bound:g}"))
    return float(value)


def _count(argument: Argument, value: object) -> int:
    number = as_whole_number(value)
    if number is None:
        raise ValueError(f"needs a whole number, got {quoted_value(value)}")
    _number(argument, number)
    return number


def _flag(argument: Argument, value: object) -> bool:
    del argument
    if isinstance(value, str) and value in SWITCH_WORDS:
        return SWITCH_WORDS[value]
    if not isinstance(value, bool):
        raise ValueError(f"needs true or false, got {quoted_value(value)}")
    return value


def _choice(argument: Argument, value: object) -> str:
    word = _text(argument, value)
    if word not in argument.choices:
        raise ValueError(f"needs one of {', '.join(argument.choices)}, got {quoted_value(value)}")
    return word


def _nonempty_name(argument: Argument, value: object) -> str:
    name = _text(argument, value).strip()
    if not name:
        raise ValueError(f"needs the name of a {argument.kind.removesuffix('s')}")
    return name


def _joints(argument: Argument, value: object) -> tuple[str, ...]:
    names = value if isinstance(value, list) else [value]
    if not names or any(isinstance(name, list | dict) for name in names):
        raise ValueError("needs a joint, a group of them, or a list of names")
    return tuple(_nonempty_name(argument, name) for name in names)


def _any_value(argument: Argument, value: object) -> object:
    del argument
    return value


def _outcomes(argument: Argument, value: object) -> tuple[Status, ...]:
    del argument
    found = []
    for word in value if isinstance(value, list) else [value]:
        if not isinstance(word, str) or word not in OUTCOMES:
            raise ValueError(f"takes a list of running, success and failure, got {quoted_value(word)}")
        found.append(OUTCOMES[word])
    if not found:
        raise ValueError("needs at least one of running, success and failure")
    return tuple(found)


_CONVERTERS: dict[str, Callable[[Argument, object], object]] = {
    "text": _text,
    "number": _number,
    "count": _count,
    "flag": _flag,
    "choice": _choice,
    "joint": _nonempty_name,
    "joints": _joints,
    "person": _nonempty_name,
    "place": _nonempty_name,
    **dict.fromkeys(REPEATABLE_KINDS, _nonempty_name),
    "value": _any_value,
    "outcomes": _outcomes,
    FACE_KIND: lambda _, value: as_face(value),
}


def _bounds(argument: Argument, show: Callable[[float], str]) -> str:
    if math.isinf(argument.high):
        return f"must be at least {show(argument.low)}"
    if math.isinf(argument.low):
        return f"must be at most {show(argument.high)}"
    return f"must be between {show(argument.low)} and {show(argument.high)}"


def _scalar(node: Node) -> object:
    return node.value if isinstance(node, Scalar) else [] if isinstance(node, Listing) else {}


def _form_name(node: Node) -> str:
    return "a list" if isinstance(node, Listing) else "a mapping"


def _read_data(context: CheckContext, node: Node, label: str, convert: Convert) -> Value:
    """Return the value of an argument that is a list or a mapping, in which each value may be an expression."""
    data = _data(context, node, label)
    values = list(data_values(data))
    if any(value is INVALID_VALUE for value in values):
        return INVALID_VALUE
    if all(value.template is None for value in values):
        return context.convert_constant(node, map_data(data, lambda value: value.constant), label, convert)
    formulas = (value.template for value in values if value.template is not None)
    parts = (part for formula in formulas for part in (formula.parts if isinstance(formula, Template) else (formula,)))
    return Value(template=DataTemplate(tuple(parts), data), convert=convert)


def _data(context: CheckContext, node: Node, label: str) -> object:
    """Return a YAML node as nested lists and dicts, in which a ``Value`` stands for each scalar."""
    if isinstance(node, Listing):
        return [_data(context, item, label) for item in node.items]
    if isinstance(node, Mapping):
        return {key.text: _data(context, value, label) for key, value in node.entries}
    return context.read_value(replace(node, value=default_value(node)), label, lambda value: value)
