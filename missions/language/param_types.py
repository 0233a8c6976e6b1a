"""The types of a mission's params: what a caller may give, and what is made of it. A list is all of one kind."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from collections.abc import Mapping as Named
from dataclasses import replace
from functools import partial

from behaviours.leaf import REQUIRED, Argument, Leaf
from config.faults import Diagnostic, InvalidFileError, Mark, Source, note, one_of
from config.marked import Listing, Mapping, Node, Plain, Scalar, compose, plain
from config.units import NUMBER, UNITS, Quantity, article, quantity, seen
from drivers.api.quick import dataclass
from missions.language.arguments import NAMES, converter, default_value, read_argument
from missions.language.counts import COUNTS
from missions.language.expressions import UNREAD, Convert, Value, shown
from missions.language.kinds import FLAG, TEXT, Kind, ListOf
from missions.language.nodes import BRANCHES, FOR_EACH, MISSION, MODIFIERS, SWITCHES
from missions.language.notes import Notes

FORM = "such as [kitchen, hall]"

Meant = Callable[[Scalar], object]
"""Returns the value that a scalar has, as a member of a list."""


def list_members(node: Listing, meant: Meant) -> list[object]:
    """Return the values of a list's members. Raises ValueError for what cannot be one."""
    return [_member(item, meant) for item in node.items]


def _member(node: Node, meant: Meant) -> object:
    if not isinstance(node, Scalar):
        raise ValueError("needs plain values as its members: a list holds no lists and no mappings")
    if "${" in node.text:
        raise ValueError(f"cannot have the member {seen(node.text)}: lists in a file hold plain values")
    return meant(node)


def typed_list(text: str, meant: Meant) -> list[object]:
    """Read a list from a command line: ``kitchen, hall``, or in brackets. Raises ValueError."""
    text = text.strip()
    try:
        node = compose(Source("", text if text.startswith("[") else f"[{text}]"))
    except InvalidFileError:
        node = None
    if not isinstance(node, Listing):
        raise ValueError(f"needs a list, such as 'kitchen, hall', got {seen(text)}")
    return list_members(node, meant)


def list_of(convert: Convert) -> Convert:
    """Return what turns a list into one whose members ``convert`` has turned."""
    return partial(_each, convert)


def _each(convert: Convert, value: object) -> list[object]:
    if not isinstance(value, list | tuple):
        raise ValueError(f"needs a list, {FORM}, got {seen(value)}")
    found = []
    for number, each in enumerate(value, start=1):
        try:
            found.append(convert(each))
        except (ValueError, LookupError) as error:
            raise ValueError(f"has a wrong member {number}: it {error.args[0] if error.args else error}") from None
    return found


LIST = "list"
"""The type of a param that has members, all of one type."""

NAMED = ("person", "place", "gesture", "move", MISSION, "file")
"""The types whose values are the names of something."""

TYPES = (*UNITS, "text", "number", "count", "flag", "choice", *NAMED, LIST)
"""The values of ``type`` of a param in its long form."""

WRONG = object()
"""Stands for a default that was refused: what would come of it is no fault of its own."""


@dataclass(frozen=True, slots=True)
class ParamType:
    """The type of a param: ``kind`` is one of TYPES; ``of`` is the same, or the type of the members of a list.

    A value, or a member, lies between ``low`` and ``high``, or is one of ``choices``, where there are some.
    """

    kind: str
    of: str
    convert: Convert
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()

    @property
    def values(self) -> Kind:
        """The kind of its values."""
        return ListOf(param_kind(self.of)) if self.kind == LIST else param_kind(self.of)

    def meant(self, node: Scalar) -> Plain:
        """Return the value that a scalar of a file has as this param, or as a member of it."""
        if self.of in (*NAMES, *NAMED):
            return node.text
        found = default_value(node)
        return (
            node.text if self.of in UNITS and isinstance(found, int | float) and type(found) is not Quantity else found
        )

    def take(self, text: str) -> object:
        """Read a value from a command line. Raises ValueError that says what was expected."""
        if self.kind == LIST:
            return self.convert(typed_list(text, self.meant))
        if self.of in (*NAMES, *NAMED):
            return self.convert(text)
        found = quantity(text)
        meant = text if self.of in UNITS and text else plain(text)
        return self.convert(meant if found is None else found)

    def default(self, notes: Notes, node: Node, what: str) -> object:
        """Read a default, which cannot be calculated; ``what`` begins the message of a fault."""
        if isinstance(node, Scalar) and "${" in node.text:
            notes.fault(node.mark, f"the default of {what} cannot be calculated", "write a plain value")
            return WRONG
        found = self.read(notes, node, what)
        return WRONG if found is UNREAD else found.constant

    def read(self, notes: Notes, node: Node, what: str) -> Value:
        """Read the value that a mission gives; ``what`` begins the message of a fault."""
        if isinstance(node, Scalar):
            return notes.value(
                replace(node, value=self.meant(node)),
                what,
                self.convert,
                self.kind if self.kind != LIST else f"{LIST} of {self.of}",
            )
        if isinstance(node, Mapping) or self.kind != LIST:
            notes.fault(node.mark, f"{what} needs one value")
            return UNREAD
        try:
            return notes.constant(node, list_members(node, self.meant), what, self.convert)
        except ValueError as error:
            notes.fault(node.mark, f"{what} {error}")
            return UNREAD


def param_kind(word: str) -> Kind:
    """Return the kind of the values that a param of a type has."""
    if word.startswith(f"{LIST} of "):
        return ListOf(param_kind(word.removeprefix(f"{LIST} of ")))
    if word in UNITS:
        return word
    if word in (NUMBER, "count"):
        return NUMBER
    return FLAG if word == FLAG else TEXT if word in (*NAMES, *NAMED) else None


def inferred(notes: Notes, name: str, node: Node) -> ParamType | None:
    """Return the type of a param that has nothing but a default."""
    if isinstance(node, Scalar):
        return _of_kind(notes, Argument(name, kind_of(default_value(node)), ""))
    kind = _common_kind(notes, name, node) if isinstance(node, Listing) else None
    return None if kind is None else _of_kind(notes, Argument(name, kind, ""), many=True)


def declared(notes: Notes, name: str, node: Mapping) -> ParamType | None:
    """Return the type of a param in its long form; None, and a fault, where it is none."""
    given = node.get("default")
    kind, of = (_word(notes, name, node, key) for key in ("type", "of"))
    if "" in (kind, of):  # wrong, which has been noted
        return None
    choices = _choices(notes, name, node, kind if of is None else of)
    if choices is None:
        return None
    if kind is None and given is None and not choices:
        notes.fault(node.mark, f"param '{name}' needs a default, or a type", "write {type: text} or {default: 60 s}")
        return None
    many = kind == LIST or of is not None or (kind is None and isinstance(given, Listing))
    one = of if many else kind
    if one is None and choices:
        one = "choice"
    elif one is None and given is not None:
        found = inferred(notes, name, given)
        one = None if found is None else found.of
    elif one is None:
        notes.fault(node.mark, f"param '{name}' needs 'of', the type of its members", "write {type: list, of: text}")
    if one is None:
        return None
    argument = Argument(name, one, "", choices=choices)
    bounds = {
        side: read_argument(notes, argument, bound, f"param '{name}': '{side}'").constant
        for side in ("low", "high")
        if (bound := node.get(side)) is not None
    }
    numbers = {side: bound for side, bound in bounds.items() if isinstance(bound, int | float)}
    low, high = numbers.get("low", -math.inf), numbers.get("high", math.inf)
    return _of_kind(notes, replace(argument, low=low, high=high), many=many)


def kind_of(value: object) -> str:
    """Return the type of a plain value; "value" for nothing."""
    if isinstance(value, Quantity):
        return value.dimension
    if isinstance(value, bool):
        return "flag"
    if isinstance(value, int | float):
        return "number"
    return "text" if isinstance(value, str) else "value"


def _of_kind(notes: Notes, argument: Argument, *, many: bool = False) -> ParamType:
    one = _keeping(converter(notes, argument), argument.kind)
    bounds = argument.low, argument.high, argument.choices
    return ParamType(LIST if many else argument.kind, argument.kind, list_of(one) if many else one, *bounds)


def _keeping(check: Convert, kind: str) -> Convert:
    """Check as an argument is checked, but keep quantities, numbers and names as they are written."""

    def convert(value: object) -> object:
        checked = check(value)
        if kind in NAMED:
            return shown(value)
        if kind in UNITS and isinstance(checked, float):
            return value if isinstance(value, Quantity) else Quantity(checked, kind)
        as_written = isinstance(value, Quantity) or (isinstance(value, int) and not isinstance(value, bool))
        return value if as_written and kind != "text" else checked

    return convert


def _common_kind(notes: Notes, name: str, node: Listing) -> str | None:
    """Return the kind of all members of a list."""
    items = [item for item in node.items if isinstance(item, Scalar)]
    kinds = [kind_of(default_value(item)) for item in items]
    if not kinds:
        message = "a list holds no lists and no mappings" if node.items else "an empty list needs 'of'"
        notes.fault(node.mark, f"param '{name}': {message}", "write {type: list, of: text, default: []}")
        return None
    for item, kind in zip(items, kinds, strict=True):
        if kind != kinds[0]:
            both = f"{seen(items[0].text)} is {article(kinds[0])}, {seen(item.text)} {article(kind)}"
            notes.fault(item.mark, f"param '{name}': the members of a list are of one type: {both}")
            return None
    return kinds[0]


def _word(notes: Notes, name: str, node: Mapping, key: str) -> str | None:
    """Return the type that a key names, None where the key is missing, and nothing where the type is unknown."""
    given = node.get(key)
    if given is None:
        return None
    word = given.text if isinstance(given, Scalar) else ""
    known = TYPES if key == "type" else TYPES[:-1]
    if word in known:
        return word
    notes.fault(given.mark, f"param '{name}': unknown type {seen(word or None)}", one_of(word, known))
    return ""


def _choices(notes: Notes, name: str, beside: Mapping, kind: str | None) -> tuple[str, ...] | None:
    """Return the words that a choice has, nothing for what is no choice; None where there is a fault."""
    node = beside.get("choices")
    if node is None and kind != "choice":
        return ()
    found = tuple(item.text for item in node.items if isinstance(item, Scalar)) if isinstance(node, Listing) else ()
    if not found or kind not in (None, "choice", LIST):
        example = "write {type: choice, choices: [left, right]}"
        message = f"param '{name}' needs 'choices', a list of words" if not found else f"param '{name}' is no choice"
        notes.fault((node or beside).mark, message, example)
        return None
    return found


# A mission's params: their names, types and defaults, and the values that a caller gives them.

# What sets the variables of a mission: read before its steps, since an expression may stand above what sets it.

KNOWN = {*BRANCHES, *MODIFIERS, *COUNTS, "name", "with"}
"""The words besides those of leaves and ``as`` that mean something beside a behaviour."""

Leaves = Named[str, type[Leaf]]


def setters(node: Node, leaves: Leaves) -> dict[str, list[type[Leaf] | None]]:
    """Return the variables that anything below ``node`` sets, each with the leaves that ``as`` keeps something of.

    None stands for what may be anything: ``returns``, a leaf such as ``set``, or ``as`` beside a mission.
    """
    found = defaultdict(list)
    for name, leaf in _pairs(node, leaves):
        found[name].append(leaf)
    return dict(found)


def of_one_kind(found: Named[str, list[type[Leaf] | None]]) -> dict[str, type[Leaf]]:
    """Return the variables into which leaves alone put something, and all of them of one type; each with a leaf."""
    kinds = {name: {None if leaf is None else leaf.keeps for leaf in leaves} for name, leaves in found.items()}
    one = [name for name, types in kinds.items() if len(types) == 1 and None not in types]
    return {name: leaf for name in one if (leaf := found[name][0]) is not None}


def _pairs(node: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    if isinstance(node, Listing):
        for item in node.items:
            yield from _pairs(item, leaves)
    elif isinstance(node, Mapping):
        for key, value in node.entries:
            yield from _beside(node, key.text, value, leaves)


def _beside(node: Mapping, word: str, value: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    """Yield what one key of a node sets, or what is below it."""
    leaf = leaves.get(word)
    if word == "as" and isinstance(value, Scalar):
        yield value.text, next((leaves[key.text] for key, _ in node.entries if key.text in leaves), None)
    elif isinstance(value, Mapping) and ((leaf is not None and leaf.open_ended) or _is_returns(node, word)):
        yield from ((name.text, None) for name, _ in value.entries)
    elif word == FOR_EACH and isinstance(value, Mapping):
        names = (value.get("as"), value.get("number"))
        yield from ((name.text, None) for name in names if isinstance(name, Scalar))
        do = value.get("do")
        yield from () if do is None else _pairs(do, leaves)
    elif word in SWITCHES and isinstance(value, Mapping):
        cases = value.get("cases")
        branches = [case for _, case in cases.entries] if isinstance(cases, Mapping) else []
        for branch in (*branches, value.get("default")):
            if branch is not None:
                yield from _pairs(branch, leaves)
    elif isinstance(value, Listing):
        yield from _pairs(value, leaves)
    elif isinstance(value, Mapping) and leaf is None and word not in KNOWN:
        # A word that nobody knows: it may be meant for one that sets what is written below it.
        yield from ((name.text, None) for name, _ in value.entries)
        yield from _pairs(value, leaves)
    elif isinstance(value, Scalar) and leaf is None and value.text.isidentifier() and word not in KNOWN:
        yield value.text, None


def _is_returns(beside: Mapping, key: str) -> bool:
    return key == "returns" and beside.get(MISSION) is not None


KEYS = ("default", "type", "of", "choices", "help", "low", "high")
"""The keys of a param in its long form."""


@dataclass(frozen=True, slots=True)
class Param:
    """One param: an argument of the mission. ``default`` is REQUIRED for one that the caller must give, or WRONG."""

    name: str
    default: object
    help: str
    type: ParamType

    @property
    def kind(self) -> str:
        """The word for its type."""
        return self.type.kind

    @property
    def required(self) -> bool:
        """True when the caller must give it."""
        return self.default is REQUIRED

    @property
    def known(self) -> bool:
        """True when it has a value even where the caller gives none."""
        return self.default not in (REQUIRED, WRONG)

    def take(self, text: str) -> object:
        """Read a value from a command line. Raises ValueError that says what was expected."""
        return self.type.take(text)


def read_params(notes: Notes, node: Node | None) -> dict[str, Param]:
    """Read the ``params`` of a mission: ``name: default``, or ``name: {default, type, help, low, high}``."""
    if node is not None and not isinstance(node, Mapping):
        notes.fault(node.mark, "'params' needs names and their defaults", "write 'patience: 60 s' under it")
    found: dict[str, Param] = {}
    for key, value in node.entries if isinstance(node, Mapping) else ():
        notes.new_name(key, "a param")
        param = _long(notes, key.text, value) if isinstance(value, Mapping) else _short(notes, key.text, value)
        if param is None:  # noted: what it holds is not known
            notes.stored.add(key.text)
            notes.awaited.add(key.text)
        else:
            found[key.text] = param
    return found


def _short(notes: Notes, name: str, value: Node) -> Param | None:
    found = inferred(notes, name, value)
    return None if found is None else Param(name, found.default(notes, value, f"param '{name}'"), "", found)


def _long(notes: Notes, name: str, node: Mapping) -> Param | None:
    what = f"param '{name}'"
    for key, _ in node.entries:
        if key.text not in KEYS:
            notes.fault(key.mark, f"{what} has no key '{key.text}'", one_of(key.text, KEYS))
    found, given, text = declared(notes, name, node), node.get("default"), node.get("help")
    if found is None:
        return None
    default = REQUIRED if given is None else found.default(notes, given, what)
    return Param(name, default, text.text if isinstance(text, Scalar) else "", found)


def take_params(
    notes: Notes, params: Named[str, Param], given: Named[str, str], mission: str, *, complete: bool
) -> None:
    """Put the caller's values in the place of the defaults; where ``complete``, note what is still missing."""
    for name, param in params.items():
        if param.known:
            notes.params[name] = param.default
        elif name not in given:
            notes.stored.add(name)
            notes.awaited.add(name)
            notes.kinds[name] = param.type.values
            if complete and param.required:
                source = Source("--param", "")
                hint = f'--param {name}="..."' + (f"  ({param.help})" if param.help else "")
                message = f"mission '{mission}' needs '{name}', {article(param.kind)}"
                note(notes.faults, Diagnostic(source, Mark(), message, hint))
    for name, text in given.items():
        source = Source(f"--param {name}", f"{name}={text}")
        if name not in params and name in notes.awaited:
            continue
        if name not in params:
            hint = one_of(name, params) or "it has none"
            message = f"mission '{mission}' has no param {seen(name)}"
            note(notes.faults, Diagnostic(source, Mark(1, 1, len(name)), message, hint))
            continue
        try:
            notes.params[name] = params[name].take(text)
        except (ValueError, LookupError) as error:
            message = f"'{name}' {error.args[0] if error.args else error}"
            note(notes.faults, Diagnostic(source, Mark(1, len(name) + 2, max(1, len(text))), message))
