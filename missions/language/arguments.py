"""The arguments of a leaf: from what the mission says to what the leaf takes."""

import math
from collections.abc import Callable
from functools import partial

from py_trees.common import Status

from behaviours.leaf import Argument, Leaf
from config.faults import one_of
from config.marked import Listing, Mapping, Node, Scalar
from config.units import UNITS, in_dimension, quantity, written
from missions.language.notes import Notes
from missions.language.values import Convert, Value, shown

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
                notes.fault(name.mark, f"'{leaf.word}' has no argument '{name.text}'", one_of(name.text, declared))
    elif node is not None and not (isinstance(node, Scalar) and node.value is None):
        principal = next((argument for argument in declared.values() if argument.principal), None)
        if principal is not None:
            values[principal.name] = read_argument(notes, principal, node, f"'{leaf.word}'")
        else:
            takes = f"; write {leaf.word}: {{{', '.join(declared)}: ...}}" if declared else " none"
            notes.fault(node.mark, f"'{leaf.word}' takes no argument without a name{takes if declared else ''}")
    return values | _defaults(notes, leaf, key, values)


def _defaults(notes: Notes, leaf: type[Leaf], key: Scalar, given: dict[str, Value]) -> dict[str, Value]:
    """Note what must be given and is not; look up the defaults that are names of things."""
    values = {}
    for argument in leaf.arguments.values():
        if argument.name in given:
            continue
        if argument.required:
            notes.fault(key.mark, f"'{leaf.word}' needs '{argument.name}': {argument.help}")
        elif argument.kind in notes.things:
            values[argument.name] = notes.constant(key, argument.default, f"'{leaf.word}'", converter(notes, argument))
    return values


def _read_open(notes: Notes, leaf: type[Leaf], key: Scalar, node: Node | None) -> dict[str, Value]:
    """Read a leaf whose argument names are the mission's own, such as ``set``."""
    if not isinstance(node, Mapping) or not node.entries:
        notes.fault(key.mark, f"'{leaf.word}' needs names and values", f"write {leaf.word}: {{count: 1}}")
        return {}
    anything = Argument("", "value", "")
    return {name.text: read_argument(notes, anything, given, f"'{name.text}'") for name, given in node.entries}


def read_argument(notes: Notes, argument: Argument, node: Node, what: str) -> Value:
    """Read one argument from its node."""
    convert = converter(notes, argument)
    if argument.span:
        return _read_span(notes, argument, node, what)
    if isinstance(node, Scalar):
        return notes.value(node, what, convert)
    if argument.kind == "outcomes" and isinstance(node, Listing):
        return notes.constant(node, [_scalar(item) for item in node.items], what, convert)
    if argument.kind == "value":
        return notes.constant(node, _plain(node), what, convert)
    notes.fault(node.mark, f"{what} needs one value, not a {'list' if isinstance(node, Listing) else 'mapping'}")
    return Value()


def _read_span(notes: Notes, argument: Argument, node: Node, what: str) -> Value:
    example = f"two values, such as [{written(0, argument.kind)}, {written(1, argument.kind)}]"
    if not isinstance(node, Listing) or len(node.items) != 2:
        notes.fault(node.mark, f"{what} needs {example}")
        return Value()
    ends = [
        notes.value(item, what, converter(notes, argument)) if isinstance(item, Scalar) else Value()
        for item in node.items
    ]
    low, high = ends[0].constant, ends[1].constant
    if isinstance(low, float) and isinstance(high, float):
        if low >= high:
            notes.fault(node.mark, f"{what}: the first value must be below the second")
        return Value((low, high))
    if any(end.template is not None for end in ends):
        notes.fault(node.mark, f"{what}: the two values must be known before the mission starts: numbers or params")
    return Value()


def converter(notes: Notes, argument: Argument) -> Convert:
    """Return what turns a mission's value into this argument's."""
    kind = argument.kind
    if kind in UNITS:
        return partial(_measure, argument)
    if kind in notes.things:
        return partial(_find, notes.things[kind])
    return partial(_PLAIN[kind], argument)


def _measure(argument: Argument, value: object) -> float:
    # A number that an expression has calculated is in SI units already; one that stands in the file must say its unit.
    si = value if type(value) is float else in_dimension(value, argument.kind)
    if not argument.low <= si <= argument.high:
        raise ValueError(_bounds(argument, lambda bound: written(bound, argument.kind)))
    return float(si)


def _find(lookup: Callable[[str], object], value: object) -> object:
    return lookup(shown(value))


def _text(argument: Argument, value: object) -> str:
    del argument
    return shown(value)


def _number(argument: Argument, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"needs a number, got '{shown(value)}'")
    if not argument.low <= value <= argument.high:
        raise ValueError(_bounds(argument, lambda bound: f"{bound:g}"))
    return float(value)


def _count(argument: Argument, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int | float) or value != int(value):
        raise ValueError(f"needs a whole number, got '{shown(value)}'")
    return int(_number(argument, value))


def _flag(argument: Argument, value: object) -> bool:
    del argument
    if not isinstance(value, bool):
        raise ValueError(f"needs true or false, got '{shown(value)}'")
    return value


def _anything(argument: Argument, value: object) -> object:
    del argument
    return known_quantity(value)


def _outcomes(argument: Argument, value: object) -> tuple[Status, ...]:
    del argument
    words = [shown(word) for word in value] if isinstance(value, list) else [shown(value)]
    for word in words:
        if word not in OUTCOMES:
            raise ValueError(f"takes a list of running, success and failure, got '{word}'")
    if not words:
        raise ValueError("needs at least one of running, success and failure")
    return tuple(OUTCOMES[word] for word in words)


_PLAIN: dict[str, Callable[[Argument, object], object]] = {
    "text": _text,
    "number": _number,
    "count": _count,
    "flag": _flag,
    "value": _anything,
    "outcomes": _outcomes,
}


def known_quantity(value: object) -> object:
    """Return a text such as "30 deg" as a quantity, anything else as it is."""
    found = quantity(value) if isinstance(value, str) else None
    return value if found is None else found


def _bounds(argument: Argument, show: Callable[[float], str]) -> str:
    if math.isinf(argument.high):
        return f"must be at least {show(argument.low)}"
    if math.isinf(argument.low):
        return f"must be at most {show(argument.high)}"
    return f"must be between {show(argument.low)} and {show(argument.high)}"


def _scalar(node: Node) -> object:
    return node.value if isinstance(node, Scalar) else None


def _plain(node: Node) -> object:
    """Return a node as plain lists, dicts and values."""
    if isinstance(node, Scalar):
        return known_quantity(node.value)
    if isinstance(node, Listing):
        return [_plain(item) for item in node.items]
    return {key.text: _plain(value) for key, value in node.entries}
