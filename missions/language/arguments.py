"""The arguments of a leaf: from what the mission says to what the leaf takes."""

import ast
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from py_trees.common import Status

from behaviours.leaf import Argument, Leaf
from config.faults import key_meant
from config.marked import Listing, Mapping, Node, Scalar
from config.units import EXAMPLES, UNITS, Quantity, quantity, seen, written
from drivers.api.kinds import SEVERAL
from missions.language.expressions import (
    UNREAD,
    Convert,
    Expression,
    ExpressionError,
    Template,
    Value,
    calculates,
    in_si,
    parse,
    shown,
    whole,
)
from missions.language.modifiers import outdent
from missions.language.nodes import MISSION
from missions.language.notes import Notes, hole_meant
from missions.language.operators import described
from missions.language.phrases import KIND as PHRASES
from missions.language.phrases import read_phrases, second_phrase
from perception.api import Face

# Texts of arguments that mean something else: what finds the thing, the file or the mission that one names.
#
# Faces are named by variables alone, which ``as`` has kept; and a calculation without its ``${...}`` is told of.


def check_text(notes: Notes, name: Scalar, node: Node) -> None:
    """Note a text that calculates with a variable, where ``name`` is set to it. A quoted one is meant."""
    if not isinstance(node, Scalar) or node.quoted or not isinstance(node.value, str) or quantity(node.text):
        return
    try:
        formula = parse(node.text)
    except ExpressionError:
        return
    if calculates(formula) and any(read.name in notes.params or read.name in notes.stored for read in formula.reads):
        message = f"'{name.text}' is set to the text {seen(node.text)}, which is not calculated"
        hint = f'write {name.text}: "${{{node.text}}}", or quotes around it for the text'
        notes.fault(node.mark, message, hint)


KIND = "face"
"""The kind of these arguments."""


def read_face(notes: Notes, node: Scalar, what: str) -> Value:
    """Read such an argument: ``${person}``, or nothing."""
    if node.value is None:
        return Value()
    if "${" not in node.text:
        hint = f'write "${{{node.text}}}"' if node.text in notes.stored else _how(notes)
        notes.fault(node.mark, f"{what} needs a face kept by 'as', got the text {seen(node.text)}", hint)
        return UNREAD
    found = notes.value(node, what, as_face)
    kept = notes.kept.get(_variable(found.template))
    if kept is not None and kept.keeps is not None and not _is_face(kept):
        notes.fault(node.mark, f"{what} needs a face kept by 'as', got what '{kept.word}' keeps", _how(notes))
        return UNREAD
    return found


def as_face(value: object) -> Face | None:
    """Return a face, or None. Raises ValueError for anything else."""
    if value is None or isinstance(value, Face):
        return value
    raise ValueError(f"needs a face kept by 'as', got {described(value)}")


def _variable(formula: Template | Expression | None) -> str:
    """Return the variable of which a template's value is all; empty where it is more than that."""
    match formula:
        case Template(parts=(Expression(tree=ast.Name(id=name)),)):
            return name
    return ""


def _is_face(leaf: type[Leaf]) -> bool:
    return isinstance(leaf.keeps, type) and issubclass(leaf.keeps, Face)


def _how(notes: Notes) -> str:
    """Say what to write: a variable that holds a face, where there is one."""
    faces = [name for name, leaf in notes.kept.items() if _is_face(leaf)]
    return f'write "${{{faces[0]}}}"' if faces else 'keep one with as: person, beside find_face, and write "${person}"'


def finder(notes: Notes, kind: str) -> Convert | None:
    """Return what finds the things of a kind by their names, and raises LookupError; None for what is no thing."""
    folder = Path(notes.source.name).parent
    if kind == "file":
        return partial(_file, notes.things.get(kind, Path), folder)
    if kind == MISSION:
        return lambda value: notes.words.find_mission(shown(value), folder)
    return partial(_find, notes.things[kind]) if kind in notes.things else None


def _find(lookup: Callable[[str], object], value: object) -> object:
    return lookup(shown(value))


def _file(lookup: Callable[[str], object], folder: Path, value: object) -> object:
    """Return the file at a path that goes from the mission's folder."""
    return lookup(str(folder / shown(value)))


NAMES = ("text", "joint", "joints", "choice", "file", *SEVERAL)
"""Kinds whose values are texts, whatever they look like."""

SWITCHED = {"on": True, "off": False}
"""What people write for true and false where something is switched."""

OUTCOMES = {"running": Status.RUNNING, "success": Status.SUCCESS, "failure": Status.FAILURE}


def read_arguments(notes: Notes, leaf: type[Leaf], key: Scalar, node: Node | None) -> dict[str, Value]:
    """Read what stands behind a leaf's word: nothing, its principal argument, or a mapping of named ones."""
    if leaf.open_ended:
        return _read_open(notes, leaf, key, node)
    declared = leaf.arguments
    values: dict[str, Value] = {}
    if isinstance(node, Mapping):
        for name, given in node.entries:
            if name.text in declared:
                values[name.text] = read_argument(notes, declared[name.text], given, f"'{leaf.word}': '{name.text}'")
            else:
                hint = second_phrase(leaf, node, name) or outdent(name.text, leaf.word)
                bare = name.text in notes.params and isinstance(given, Scalar) and given.value is None
                hint = hole_meant(f"{{{name.text}}}") if bare else hint or key_meant(name.text, declared)
                notes.fault(name.mark, f"'{leaf.word}' has no argument '{name.text}'", hint, sure=True)
                values[name.text] = UNREAD
    elif node is not None and not (isinstance(node, Scalar) and node.value is None):
        principal = next((argument for argument in declared.values() if argument.principal), None)
        if principal is not None:
            values[principal.name] = read_argument(notes, principal, node, f"'{leaf.word}'")
        else:
            _no_principal(notes, leaf, node)
    return values | _defaults(notes, leaf, key, values)


def _defaults(notes: Notes, leaf: type[Leaf], key: Scalar, given: dict[str, Value]) -> dict[str, Value]:
    """Note what must be given and is not; look up the defaults that are names of things."""
    values = {}
    for argument in leaf.arguments.values():
        if argument.name in given:
            continue
        if argument.required:
            choices = f", one of {', '.join(argument.choices)}" if argument.choices else ""
            notes.fault(key.mark, f"'{leaf.word}' needs '{argument.name}': {argument.help}{choices}")
            values[argument.name] = UNREAD
        elif argument.kind in notes.things and argument.default is not None:
            values[argument.name] = notes.constant(key, argument.default, f"'{leaf.word}'", converter(notes, argument))
    return values


def _no_principal(notes: Notes, leaf: type[Leaf], node: Node) -> None:
    if leaf.arguments:
        hint = f"write {leaf.word}: {{{next(iter(leaf.arguments))}: ...}}; it has {', '.join(leaf.arguments)}"
        notes.fault(node.mark, f"'{leaf.word}' needs its arguments by name", hint)
    else:
        notes.fault(node.mark, f"'{leaf.word}' takes no argument")


def _read_open(notes: Notes, leaf: type[Leaf], key: Scalar, node: Node | None) -> dict[str, Value]:
    """Read a leaf whose argument names are the mission's own, such as ``set``."""
    if not isinstance(node, Mapping) or not node.entries:
        notes.fault(key.mark, f"'{leaf.word}' needs names and values", f"write {leaf.word}: {{count: 1}}")
        return {}
    for name, given in node.entries:
        notes.new_name(name, "a variable")
        check_text(notes, name, given)
    anything = Argument("", "value", "")
    return {name.text: read_argument(notes, anything, given, f"'{name.text}'") for name, given in node.entries}


def read_argument(notes: Notes, argument: Argument, node: Node, what: str) -> Value:
    """Read one argument from its node."""
    if argument.span:
        return _read_span(notes, argument, node, what)
    if argument.by_joint:
        return _read_by_joint(notes, argument, node, what)
    if argument.kind == PHRASES:
        return read_phrases(notes, node, what)
    if argument.kind == KIND and isinstance(node, Scalar):
        return read_face(notes, node, what)
    convert = converter(notes, argument)
    if isinstance(node, Scalar):
        return notes.value(_as_meant(notes, argument, node), what, convert, argument.kind)
    if argument.kind == "outcomes" and isinstance(node, Listing):
        return notes.constant(node, [_scalar(item) for item in node.items], what, convert)
    if argument.kind == "joints" and isinstance(node, Listing):
        names = [item.text if isinstance(item, Scalar) else _scalar(item) for item in node.items]
        return notes.constant(node, names, what, convert)
    if argument.kind == "value":
        return notes.constant(node, _plain(notes, node), what, convert)
    notes.fault(node.mark, f"{what} needs one value, not {_form(node)}")
    return UNREAD


def _as_meant(notes: Notes, argument: Argument, node: Scalar) -> Scalar:
    """Return ``node`` with the value that it has for this argument: a text is a text even where it looks like 007."""
    if node.value is None:
        return node
    if argument.kind in (*NAMES, *UNITS) or argument.kind in notes.things:
        return replace(node, value=node.text)
    return replace(node, value=default_value(node)) if argument.kind == "value" else node


def default_value(node: Scalar) -> str | float | bool | None:
    """Return what a scalar means where anything may stand: what looks like a quantity is one, unless it is quoted."""
    found = None if node.quoted else quantity(node.text)
    return node.value if found is None else found


def _read_span(notes: Notes, argument: Argument, node: Node, what: str) -> Value:
    example = f"two values, such as [{written(0, argument.kind)}, {EXAMPLES[argument.kind]}]"
    if not isinstance(node, Listing) or len(node.items) != 2:
        notes.fault(node.mark, f"{what} needs {example}")
        return UNREAD
    ends = [read_argument(notes, replace(argument, span=False), item, what) for item in node.items]
    if UNREAD in ends:
        return UNREAD
    low, high = ends[0].constant, ends[1].constant
    if isinstance(low, float) and isinstance(high, float):
        if low >= high:
            notes.fault(node.mark, f"{what}: the first value must be below the second")
            return UNREAD
        return Value((low, high))
    if not all(end.template is None or notes.awaits(end.template) for end in ends):
        notes.fault(node.mark, f"{what}: the two values must be known before the mission starts: numbers or params")
    return UNREAD


def _read_by_joint(notes: Notes, argument: Argument, node: Node, what: str) -> Value:
    """Read a mapping from joints to values, each of which may be a param; or one variable that holds all of it."""
    one = replace(argument, by_joint=False)
    if isinstance(node, Scalar) and "${" in node.text:
        return notes.value(node, what, partial(_by_joint, converter(notes, one)))
    if not isinstance(node, Mapping) or not node.entries:
        example = written(0.5, argument.kind) if argument.kind in UNITS else "0.5"
        notes.fault(node.mark, f"{what} needs joints, each with its value, such as {{elbow: {example}}}")
        return UNREAD
    values = {joint.text: read_argument(notes, one, each, f"{what}: '{joint.text}'") for joint, each in node.entries}
    if UNREAD in values.values():
        return UNREAD
    if not all(value.template is None or notes.awaits(value.template) for value in values.values()):
        notes.fault(node.mark, f"{what}: the values must be known before the mission starts: numbers or params")
    return Value({joint: value.constant for joint, value in values.items()})


def _by_joint(convert: Convert, value: object) -> dict[str, object]:
    if not isinstance(value, dict):
        raise ValueError(f"needs joints, each with its value, got {seen(value)}")
    return {joint: convert(each) for joint, each in value.items()}


def converter(notes: Notes, argument: Argument) -> Convert:
    """Return what turns a mission's value into this argument's."""
    kind = argument.kind
    if kind in UNITS:
        return partial(_measure, argument)
    return finder(notes, kind) or partial(_PLAIN.get(kind, _name), argument)


def _measure(argument: Argument, value: object) -> float:
    si = in_si(value, argument.kind)
    if not argument.low <= si <= argument.high:
        raise ValueError(_bounds(argument, lambda bound: written(bound, argument.kind)))
    return si


def _text(argument: Argument, value: object) -> str:
    del argument
    if value is None:
        raise ValueError("needs a text, got nothing")
    return shown(value)


def _number(argument: Argument, value: object) -> float:
    if isinstance(value, bool | Quantity) or not isinstance(value, int | float):
        raise ValueError(f"needs a number, got {seen(value)}")
    if not argument.low <= value <= argument.high:
        raise ValueError(_bounds(argument, lambda bound: f"{bound:g}"))
    return float(value)


def _count(argument: Argument, value: object) -> int:
    number = whole(value)
    if number is None:
        raise ValueError(f"needs a whole number, got {seen(value)}")
    _number(argument, number)
    return number


def _flag(argument: Argument, value: object) -> bool:
    del argument
    if isinstance(value, str) and value in SWITCHED:
        return SWITCHED[value]
    if not isinstance(value, bool):
        raise ValueError(f"needs true or false, got {seen(value)}")
    return value


def _choice(argument: Argument, value: object) -> str:
    word = _text(argument, value)
    if word not in argument.choices:
        raise ValueError(f"needs one of {', '.join(argument.choices)}, got {seen(value)}")
    return word


def _name(argument: Argument, value: object) -> str:
    name = _text(argument, value).strip()
    if not name:
        raise ValueError(f"needs the name of a {argument.kind.removesuffix('s')}")
    return name


def _joints(argument: Argument, value: object) -> tuple[str, ...]:
    names = value if isinstance(value, list) else [value]
    if not names or any(isinstance(name, list | dict) for name in names):
        raise ValueError("needs a joint, a group of them, or a list of names")
    return tuple(_name(argument, name) for name in names)


def _anything(argument: Argument, value: object) -> object:
    del argument
    return value


def _outcomes(argument: Argument, value: object) -> tuple[Status, ...]:
    del argument
    found = []
    for word in value if isinstance(value, list) else [value]:
        if not isinstance(word, str) or word not in OUTCOMES:
            raise ValueError(f"takes a list of running, success and failure, got {seen(word)}")
        found.append(OUTCOMES[word])
    if not found:
        raise ValueError("needs at least one of running, success and failure")
    return tuple(found)


_PLAIN: dict[str, Callable[[Argument, object], object]] = {
    "text": _text,
    "number": _number,
    "count": _count,
    "flag": _flag,
    "choice": _choice,
    "joint": _name,
    "joints": _joints,
    "person": _name,
    "place": _name,
    **dict.fromkeys(SEVERAL, _name),
    "value": _anything,
    "outcomes": _outcomes,
    KIND: lambda _, value: as_face(value),
}


def _bounds(argument: Argument, show: Callable[[float], str]) -> str:
    if math.isinf(argument.high):
        return f"must be at least {show(argument.low)}"
    if math.isinf(argument.low):
        return f"must be at most {show(argument.high)}"
    return f"must be between {show(argument.low)} and {show(argument.high)}"


def _scalar(node: Node) -> object:
    return node.value if isinstance(node, Scalar) else [] if isinstance(node, Listing) else {}


def _form(node: Node) -> str:
    return "a list" if isinstance(node, Listing) else "a mapping"


def _plain(notes: Notes, node: Node) -> object:
    """Return a node as plain lists, dicts and values."""
    if isinstance(node, Listing):
        return [_plain(notes, item) for item in node.items]
    if isinstance(node, Mapping):
        return {key.text: _plain(notes, value) for key, value in node.entries}
    if "${" in node.text:
        notes.fault(node.mark, "'${...}' cannot stand inside a list or a mapping", "set a variable of its own to it")
    return default_value(node)
