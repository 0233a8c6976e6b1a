"""Params of a mission: their types, defaults, and the overrides of the caller, such as ``--param``."""

import math
from collections import defaultdict
from collections.abc import Iterator
from collections.abc import Mapping as Named
from dataclasses import field, replace

from behaviours.leaf import REQUIRED, Argument, Leaf
from config.diagnostics import Diagnostic, Mark, SourceText, add_diagnostic, suggest_from, suggest_key
from config.units import (
    NUMBER,
    UNITS,
    Quantity,
    corrected_quantity,
    parse_quantity,
    quantity_text,
    quoted_value,
    with_article,
)
from config.yaml_nodes import Listing, Mapping, Node, Plain, Scalar, plain_value
from drivers.api.fast_dataclass import dataclass
from missions.language.arguments import TEXT_KINDS, converter, read_argument
from missions.language.check_context import CheckContext
from missions.language.expressions import INVALID_VALUE, Convert, Value, format_value
from missions.language.kinds import FLAG, TEXT, Kind, ListKind, RecordKind
from missions.language.lists import (
    check_key,
    common_type,
    default_value,
    list_converter,
    list_members,
    mapping_converter,
    parse_list,
    type_of_value,
)
from missions.language.nodes import (
    BRANCHES,
    FINALLY,
    FOR_EACH,
    MISSION,
    MODIFIER_KEYS,
    MODIFIERS,
    ORDER_KEYS,
    RECOVER,
    SWITCHES,
    WAIT_FOR,
)
from missions.language.parallel_counts import COUNTS

LIST_TYPE = "list"
"""Type of a mission param that is a list, with members of one type."""

MAPPING_TYPE = "mapping"
"""Type of the members of a list that are mappings.

A mission does not write this word: ``of`` then has the type of each value, as in ``of: {x: length}``.
"""

BOUNDS = ("low", "high")
"""Keys for the limits of a param."""

ENTRY_KEYS = ("type", "choices", *BOUNDS)
"""Keys of the long form ``{type: length, low: 0 m}``, in which ``of`` gives the type of a mapping's value."""

OF_HINT = "write of: {x: length, y: {type: length, low: 0 m}}"

NAME_TYPES = ("person", "place", "gesture", "move", MISSION, "file")
"""Types of params whose values are names."""

PARAM_TYPES = (*UNITS, "text", "number", "count", "flag", "choice", "value", *NAME_TYPES, LIST_TYPE)
"""Values of the key ``type`` when a param is declared as ``{type: ..., default: ...}``."""

INVALID_DEFAULT = object()
"""Placeholder for the default of a param with an error that has been reported."""


@dataclass(frozen=True, slots=True)
class ParamType:
    """Type of a param: ``kind`` is one of PARAM_TYPES.

    - ``member_type`` is the type of the members of a list, ``mapping`` if they are mappings; for other params it is
      ``kind``.
    - ``entries`` are the types of the values of these mappings, by key.
    - ``convert`` checks and converts a value.
    - ``low`` and ``high`` limit the values, or the members of a list; ``choices`` are all of them if there are any.
    """

    kind: str
    member_type: str
    convert: Convert
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    entries: Named[str, "ParamType"] = field(default_factory=dict, hash=False)

    @property
    def value_kind(self) -> Kind:
        """Kind (static type) of the param's values, for the checks of expressions that read it."""
        if self.entries:
            members = {key: entry.value_kind for key, entry in self.entries.items()}
            return ListKind(RecordKind("a mapping", members=members))
        member_kind = param_kind(self.member_type)
        return ListKind(member_kind) if self.kind == LIST_TYPE else member_kind

    @property
    def member_text(self) -> str:
        """Type of the values, or of list members, with bounds: ``length from 10 cm``, ``{x: length, y: length}``."""
        if self.entries:
            return f"{{{', '.join(f'{key}: {entry.member_text}' for key, entry in self.entries.items())}}}"
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        bounds = (f"{word} {text}" for word, text in zip(("from", "to"), self.bound_texts, strict=True) if text)
        return " ".join((self.member_type, *bounds))

    @property
    def bound_texts(self) -> tuple[str, str]:
        """The bounds ``low`` and ``high`` as texts with units; empty for no bound."""
        return _bound_text(self.low, self.member_type), _bound_text(self.high, self.member_type)

    def _read_scalar(self, key: str, node: Scalar) -> Plain:
        """Return the value of a scalar in a list of this type; ``key`` is its key in a mapping, or empty."""
        return self.entries.get(key, self).scalar_value(node)

    def scalar_value(self, node: Scalar) -> Plain:
        """Return the value of a YAML scalar for this param, or for a member if the param is a list."""
        if self.member_type in (*TEXT_KINDS, *NAME_TYPES):
            return node.text
        found = default_value(node)
        return (
            node.text
            if self.member_type in UNITS and isinstance(found, int | float) and type(found) is not Quantity
            else found
        )

    def parse(self, text: str) -> object:
        """Parse a value of the param from the command line. Raises ValueError with the expected form."""
        if self.kind == LIST_TYPE:
            return self.convert(parse_list(text, self._read_scalar))
        if self.member_type in (*TEXT_KINDS, *NAME_TYPES):
            return self.convert(text)
        found = parse_quantity(text)
        value = text if self.member_type in UNITS and text else plain_value(text)
        return self.convert(value if found is None else found)

    def read_default(self, context: CheckContext, node: Node, label: str) -> object:
        """Read a default, which cannot be an expression; ``label`` begins an error message."""
        if isinstance(node, Scalar) and "${" in node.text:
            context.fault(node.mark, f"the default of {label} cannot be calculated", "write a plain value")
            return INVALID_DEFAULT
        found = self.read_value(context, node, label)
        return INVALID_DEFAULT if found is INVALID_VALUE else found.constant

    def read_value(self, context: CheckContext, node: Node, label: str) -> Value:
        """Return the value of a param from a node of a mission; ``label`` begins an error message."""
        if isinstance(node, Scalar):
            return context.read_value(
                replace(node, value=self.scalar_value(node)),
                label,
                self.convert,
                self.value_kind if self.kind == LIST_TYPE else self.kind,
            )
        if isinstance(node, Mapping) or self.kind != LIST_TYPE:
            context.fault(node.mark, f"{label} needs one value")
            return INVALID_VALUE
        try:
            return context.convert_constant(node, list_members(node, self._read_scalar), label, self.convert)
        except ValueError as error:
            context.fault(node.mark, f"{label} {error}")
            return INVALID_VALUE


def _bound_text(bound: float, member_type: str) -> str:
    if math.isinf(bound):
        return ""
    return quantity_text(bound, member_type) if member_type in UNITS else f"{bound:g}"


def param_kind(word: str) -> Kind:
    """Return the kind (static type) of values for a word of PARAM_TYPES; None if it is unknown."""
    if word in UNITS:
        return word
    if word in (NUMBER, "count"):
        return NUMBER
    return FLAG if word == FLAG else TEXT if word in (*TEXT_KINDS, *NAME_TYPES) else None


def infer_type(context: CheckContext, label: str, node: Node) -> ParamType | None:
    """Return the type of a param with only a default; None if it has an error. ``label`` begins an error message."""
    if isinstance(node, Scalar):
        if not node.quoted and (quantity := corrected_quantity(node.text)):
            hint = f"write '{quantity}', or put it in quotes for a text"
            context.fault(node.mark, f"{label}: unknown unit in {quoted_value(node.text)}", hint)
            return None
        return _make_type(context, Argument("", type_of_value(default_value(node)), ""))
    if not isinstance(node, Listing) or not node.items:
        message = "needs plain values" if isinstance(node, Mapping) else "an empty list needs 'of'"
        context.fault(node.mark, f"{label}: {message}", "write {type: list, of: text, default: []}")
        return None
    kind = common_type(context, label, node)
    if kind is None or isinstance(kind, str):
        return None if kind is None else _make_type(context, Argument("", kind, ""), many=True)
    return _list_of_mappings({key: _make_type(context, Argument("", word, "")) for key, word in kind.items()})


def read_type(context: CheckContext, label: str, node: Mapping) -> ParamType | None:
    """Return the type of a param in its long form; None if it has an error, which is reported.

    ``label`` begins an error message.
    """
    default, of_node = node.get("default"), node.get("of")
    if isinstance(of_node, Mapping):
        return _read_entries(context, label, node, of_node)
    kind, of = (_read_type_word(context, label, node, key) for key in ("type", "of"))
    if "" in (kind, of):  # invalid, and reported already
        return None
    choices = _read_choices(context, label, node, kind if of is None else of)
    if choices is None:
        return None
    if kind is None and default is None and not choices:
        context.fault(node.mark, f"{label} needs a default, or a type", "write {type: text} or {default: 60 s}")
        return None
    is_list = kind == LIST_TYPE or of is not None or (kind is None and isinstance(default, Listing))
    one = of if is_list else kind
    if one is None and choices:
        one = "choice"
    elif one is None and default is not None:
        found = infer_type(context, label, default)
        if found is not None and found.entries:
            _refuse_bounds(context, label, node)
            return found
        one = None if found is None else found.member_type
    elif one is None:
        context.fault(node.mark, f"{label} needs 'of', the type of its members", "write {type: list, of: text}")
    if one is None:
        return None
    argument = Argument("", one, "", choices=choices)
    bounds = {
        side: read_argument(context, argument, bound, f"{label}: '{side}'").constant
        for side in BOUNDS
        if (bound := node.get(side)) is not None
    }
    numbers = {side: bound for side, bound in bounds.items() if isinstance(bound, int | float)}
    low, high = numbers.get("low", -math.inf), numbers.get("high", math.inf)
    return _make_type(context, replace(argument, low=low, high=high), many=is_list)


def _read_entries(context: CheckContext, label: str, beside: Mapping, node: Mapping) -> ParamType | None:
    """Return the type of a list of mappings, with ``of: {x: length, y: {type: length, low: 0 m}}``."""
    word_node = beside.get("type")
    if word_node is not None and not (isinstance(word_node, Scalar) and word_node.text == LIST_TYPE):
        context.fault(word_node.mark, f"{label}: only a list has members with 'of'", "write type: list")
        return None
    if not node.entries:
        context.fault(node.mark, f"{label}: 'of' needs keys with types", OF_HINT)
        return None
    if not all(check_key(context, label, key) for key, _ in node.entries):
        return None
    _refuse_bounds(context, label, beside)
    found = {key.text: _read_entry(context, f"{label}: '{key.text}'", value) for key, value in node.entries}
    entries = {key: entry for key, entry in found.items() if entry is not None}
    return _list_of_mappings(entries) if len(entries) == len(found) else None


def _read_entry(context: CheckContext, label: str, node: Node) -> ParamType | None:
    """Return the type of a value in a mapping: a word, or a mapping with ``type`` and bounds."""
    if isinstance(node, Scalar):
        node = Mapping(node.mark, [(Scalar(node.mark, "type", "type"), node)])
    if not isinstance(node, Mapping):
        context.fault(node.mark, f"{label} needs a type", OF_HINT)
        return None
    for key, value in node.entries:
        if key.text not in ENTRY_KEYS:
            context.fault(
                key.mark, f"{label} has no key '{key.text}'", suggest_key(key.text, ENTRY_KEYS, PARAM_KEY_SYNONYMS)
            )
            return None
        if key.text == "type" and isinstance(value, Scalar) and value.text == LIST_TYPE:
            context.fault(value.mark, f"{label} cannot be a list: a mapping in a list holds plain values")
            return None
    return read_type(context, label, node)


def _refuse_bounds(context: CheckContext, label: str, beside: Mapping) -> None:
    """Report an error for bounds or choices beside a list of mappings; they belong to the values in ``of``."""
    for key, _ in beside.entries:
        if key.text in (*BOUNDS, "choices"):
            context.fault(key.mark, f"{label}: '{key.text}' belongs to one value of the mappings", OF_HINT)


def _list_of_mappings(entries: Named[str, ParamType]) -> ParamType:
    convert = list_converter(mapping_converter({key: entry.convert for key, entry in entries.items()}))
    return ParamType(LIST_TYPE, MAPPING_TYPE, convert, entries=entries)


def _make_type(context: CheckContext, argument: Argument, *, many: bool = False) -> ParamType:
    one = _keep_written(converter(context, argument), argument.kind)
    bounds = argument.low, argument.high, argument.choices
    return ParamType(LIST_TYPE if many else argument.kind, argument.kind, list_converter(one) if many else one, *bounds)


def _keep_written(check: Convert, kind: str) -> Convert:
    """Return a converter that raises the same errors as ``check``, but keeps names, numbers and units as written."""

    def convert(value: object) -> object:
        checked = check(value)
        if kind in NAME_TYPES:
            return format_value(value)
        if kind in UNITS and isinstance(checked, float):
            return value if isinstance(value, Quantity) else Quantity(checked, kind)
        as_written = isinstance(value, Quantity) or (isinstance(value, int) and not isinstance(value, bool))
        return value if as_written and kind != "text" else checked

    return convert


def _read_type_word(context: CheckContext, label: str, node: Mapping, key: str) -> str | None:
    """Return the type of a param under ``key`` ("type" or "of").

    None if the key is missing, empty if the type is unknown, which is reported.
    """
    word_node = node.get(key)
    if word_node is None:
        return None
    word = word_node.text if isinstance(word_node, Scalar) else ""
    known = PARAM_TYPES if key == "type" else PARAM_TYPES[:-1]
    if word in known:
        return word
    context.fault(word_node.mark, f"{label}: unknown type {quoted_value(word or None)}", suggest_from(word, known))
    return ""


def _read_choices(context: CheckContext, label: str, beside: Mapping, kind: str | None) -> tuple[str, ...] | None:
    """Return the words that a param of the type ``choice`` allows; empty for other types, None if there is an error."""
    node = beside.get("choices")
    if node is None and kind != "choice":
        return ()
    found = tuple(item.text for item in node.items if isinstance(item, Scalar)) if isinstance(node, Listing) else ()
    if not found or kind not in (None, "choice", LIST_TYPE):
        example = "write {type: choice, choices: [left, right]}"
        message = f"{label} needs 'choices', a list of words" if not found else f"{label} is not a choice"
        context.fault((node or beside).mark, message, example)
        return None
    return found


# Params of a mission: their names, types and defaults, and the values from the caller.

# Variables that a mission sets: read before its steps, since an expression may be above the step that sets it.

KNOWN_WORDS = {*BRANCHES, *MODIFIERS, *MODIFIER_KEYS, *COUNTS, *ORDER_KEYS, "name", "with"}
"""Words that a node can contain, in addition to ``as`` and leaves: composites, modifiers, counts, name, with."""

BRANCHES_WITH_KEYS = {*SWITCHES, FOR_EACH}
"""Nodes whose value is a mapping with the nodes below at some of its keys."""

Leaves = Named[str, type[Leaf]]


def find_setters(node: Node, leaves: Leaves) -> dict[str, list[type[Leaf] | None]]:
    """Return the variables that are set below ``node``, each with the leaves that set it by ``as``.

    The leaves tell the type of the variable. None is among them if the variable may also get a value of any type: from
    ``returns``, from a leaf such as ``set``, or from ``as`` beside a mission.
    """
    found = defaultdict(list)
    for name, leaf in _iter_setters(node, leaves):
        found[name].append(leaf)
    return dict(found)


def single_kind_leaves(setters: Named[str, list[type[Leaf] | None]]) -> dict[str, type[Leaf]]:
    """Return the variables whose setters all have the same result type, each with one of those leaves."""
    kinds = {name: {None if leaf is None else leaf.output_type for leaf in leaves} for name, leaves in setters.items()}
    one = [name for name, types in kinds.items() if len(types) == 1 and None not in types]
    return {name: leaf for name in one if (leaf := setters[name][0]) is not None}


def _iter_setters(node: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    if isinstance(node, Listing):
        for item in node.items:
            yield from _iter_setters(item, leaves)
    elif isinstance(node, Mapping):
        for key, value in node.entries:
            yield from _iter_key_setters(node, key.text, value, leaves)


def _branches(value: Mapping) -> Iterator[Node]:
    """Yield the nodes below a switch or a ``for_each``."""
    cases = value.get("cases")
    if isinstance(cases, Mapping):
        yield from (case for _, case in cases.entries)
    yield from (node for node in (value.get("default"), value.get("do")) if node is not None)


def _iter_key_setters(node: Mapping, word: str, value: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    """Yield the variables that the key ``word`` of a YAML node sets, and those that nodes below it set.

    Each comes with the leaf that sets it by ``as``, or None.
    """
    leaf = leaves.get(word)
    if word == "as" and isinstance(value, Scalar):
        yield value.text, next((leaves[key.text] for key, _ in node.entries if key.text in leaves), None)
    elif isinstance(value, Mapping) and ((leaf is not None and leaf.open_ended) or _is_returns(node, word)):
        yield from ((name.text, None) for name, _ in value.entries)
    elif word in BRANCHES_WITH_KEYS and isinstance(value, Mapping):
        if word == FOR_EACH:
            names = (value.get("as"), value.get("number"))
            yield from ((name.text, None) for name in names if isinstance(name, Scalar))
        for branch in _branches(value):
            yield from _iter_setters(branch, leaves)
    elif isinstance(value, Listing) or word in (WAIT_FOR, RECOVER, FINALLY):
        yield from _iter_setters(value, leaves)
    elif isinstance(value, Mapping) and leaf is None and word not in KNOWN_WORDS:
        # An unknown word: it may be a misspelt one that sets the variables below it.
        yield from ((name.text, None) for name, _ in value.entries)
        yield from _iter_setters(value, leaves)
    elif isinstance(value, Scalar) and leaf is None and value.text.isidentifier() and word not in KNOWN_WORDS:
        yield value.text, None


def _is_returns(beside: Mapping, key: str) -> bool:
    return key == "returns" and beside.get(MISSION) is not None


PARAM_KEY_SYNONYMS = {
    "default": "value",
    "help": "description desc doc",
    "choices": "options enum values",
    "low": "min minimum",
    "high": "max maximum",
}
"""Keys of a param, each with the words of other systems."""

PARAM_KEYS = ("default", "type", "of", "choices", "help", *BOUNDS)
"""Keys of a param in its long form."""


@dataclass(frozen=True, slots=True)
class Param:
    """A param of a mission: name, default, help and type.

    ``default`` is REQUIRED if the caller must set the param, INVALID_DEFAULT if the default has an error.
    """

    name: str
    default: object
    help: str
    type: ParamType

    @property
    def kind(self) -> str:
        """Word for the type of the param, such as "text"."""
        return self.type.kind

    @property
    def required(self) -> bool:
        """True if the caller must set the param, since it has no default."""
        return self.default is REQUIRED

    @property
    def has_value(self) -> bool:
        """True if the param has a value without the caller."""
        return self.default not in (REQUIRED, INVALID_DEFAULT)

    def parse(self, text: str) -> object:
        """Parse a value of the param from the command line. Raises ValueError with the expected form."""
        return self.type.parse(text)


def read_params(context: CheckContext, node: Node | None) -> dict[str, Param]:
    """Return the ``params`` of a mission by name: ``name: default``, or ``name: {default, type, help, low, high}``."""
    if node is not None and not isinstance(node, Mapping):
        context.fault(node.mark, "'params' needs names and their defaults", "write 'patience: 60 s' under it")
    found: dict[str, Param] = {}
    for key, value in node.entries if isinstance(node, Mapping) else ():
        context.check_new_name(key, "a param")
        param = (
            _read_long(context, key.text, value)
            if isinstance(value, Mapping)
            else _read_short(context, key.text, value)
        )
        if param is None:  # reported already: its type is unknown
            context.variables.add(key.text)
            context.missing_params.add(key.text)
        else:
            found[key.text] = param
            default = value.get("default") if isinstance(value, Mapping) and value.get("type") is None else value
            if isinstance(default, Scalar):
                context.param_nodes[key.text] = default, param.default
    return found


def _read_short(context: CheckContext, name: str, value: Node) -> Param | None:
    label = f"param '{name}'"
    found = infer_type(context, label, value)
    return None if found is None else Param(name, found.read_default(context, value, label), "", found)


def _read_long(context: CheckContext, name: str, node: Mapping) -> Param | None:
    what = f"param '{name}'"
    for key, _ in node.entries:
        if key.text not in PARAM_KEYS:
            context.fault(
                key.mark, f"{what} has no key '{key.text}'", suggest_key(key.text, PARAM_KEYS, PARAM_KEY_SYNONYMS)
            )
    found, default_node, text = read_type(context, what, node), node.get("default"), node.get("help")
    if found is None:
        return None
    default = REQUIRED if default_node is None else found.read_default(context, default_node, what)
    return Param(name, default, text.text if isinstance(text, Scalar) else "", found)


def assign_params(
    context: CheckContext, params: Named[str, Param], texts: Named[str, str], mission: str, *, complete: bool
) -> None:
    """Set the params to the caller's values or the defaults; if ``complete``, report missing ones."""
    for name, param in params.items():
        if param.kind == LIST_TYPE:  # a list without members does not show its type
            context.param_kinds[name] = param.type.value_kind
        if param.has_value:
            context.params[name] = param.default
        elif name not in texts:
            context.variables.add(name)
            context.missing_params.add(name)
            context.param_kinds[name] = param.type.value_kind
            if complete and param.required:
                source = SourceText("--param", "")
                hint = f'--param {name}="..."' + (f"  ({param.help})" if param.help else "")
                message = f"mission '{mission}' needs '{name}', {with_article(param.kind)}"
                add_diagnostic(context.faults, Diagnostic(source, Mark(), message, hint))
    for name, text in texts.items():
        source = SourceText(f"--param {name}", f"{name}={text}")
        if name not in params and name in context.missing_params:
            continue
        if name not in params:
            hint = suggest_from(name, params) or "it has none"
            message = f"mission '{mission}' has no param {quoted_value(name)}"
            add_diagnostic(context.faults, Diagnostic(source, Mark(1, 1, len(name)), message, hint))
            continue
        try:
            context.params[name] = params[name].parse(text)
        except (ValueError, LookupError) as error:
            message = f"'{name}' {error.args[0] if error.args else error}"
            add_diagnostic(context.faults, Diagnostic(source, Mark(1, len(name) + 2, max(1, len(text))), message))
