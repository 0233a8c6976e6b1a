"""Kinds: static types of values in missions.

A kind is the dimension of a number ("length", "number"), ``TEXT``, ``FLAG``, ``NOTHING``, a list or a record; None if
unknown. Classes declare the kinds of their members by annotations: ``distance: Annotated[float, "length"]``.
"""

import ast
import keyword
import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from config.units import NUMBER, UNITS, DimensionError, Quantity, common_dimension, dimension_text, parse_quantity
from drivers.api.fast_dataclass import dataclass
from missions.language.robot_state import ROBOT_STATE

# Attributes that an expression may read: fields and properties, but no methods and nothing private.


def members_of(kind: type) -> list[str]:
    """Return the names of public fields and properties of a class."""
    public = (name for name in {*dir(kind), *_hints(kind)} if not name.startswith("_"))
    return sorted(name for name in public if not callable(getattr(kind, name, None)))


def members_in(value: object) -> list[str]:
    """Return the names of the members of ``value``; empty for a text, a number or a list."""
    if isinstance(value, Mapping):
        return sorted(str(key) for key in value if not str(key).startswith("_"))
    return [] if value is None or isinstance(value, str | int | float | list) else members_of(type(value))


# Quantities and words that Python's parser would read differently.
#
# Each is replaced by a name of the same length, so that columns stay offsets in the text.

CONSTANTS = {"true": True, "false": False, "null": None, "none": None}
"""Constants of expressions with their values, as written in YAML."""

RESERVED_WORDS = frozenset(
    ["and", "async", "await", "else", "False", "for", "if", "in", "is", "lambda", "None", "not", "or", "True", "yield"]
)
"""Words that cannot be names in expressions, since they have a meaning in Python expressions."""

PYTHON_KEYWORDS = "|".join(word for word in keyword.kwlist if word not in RESERVED_WORDS)
KEYWORD_OR_TEXT = re.compile(rf"""("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')|\b({PYTHON_KEYWORDS})\b""")

OPERATOR_WORDS = "(?:and|or|if|else|in|not)"
"""Pattern of the words that can follow an operand in an expression."""

BOLD_A = 0x1D41A
"""Code point of MATHEMATICAL BOLD SMALL A; b to z follow. Bold letters make a name of a Python keyword."""

UNIT_PATTERN = "|".join(
    sorted(map(re.escape, {unit for units in UNITS.values() for unit in units} - {"%"}), key=len)[::-1]
)
QUANTITY_PATTERN = re.compile(
    r"""("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')"""  # texts are skipped
    rf"|(?<![\w.])((?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s*(?:(?:{UNIT_PATTERN})(?![\w(])|%(?=\s*(?:$|[])<>=!,*/%+-]|{OPERATOR_WORDS}\b))))"
)
"""Pattern of a quantity in an expression, such as ``1.5 m/s``.

"%" is a unit, except before an operand, where it is the modulo operator.
"""

STAND_IN = "\ua66e"
"""Letter that replaces each character of a quantity before Python's parser reads the expression.

So a quantity becomes a name of the same length.
"""


def as_python(text: str) -> tuple[str, dict[int, str]]:
    """Return an expression in Python syntax, and the quantities in it by start column; names stand for them."""
    literals = {found.start(): found[2] for found in QUANTITY_PATTERN.finditer(text) if found[2]}
    plain = QUANTITY_PATTERN.sub(lambda found: found[1] or STAND_IN * len(found[2]), text)
    return KEYWORD_OR_TEXT.sub(_as_name, plain), literals


def _as_name(found: re.Match[str]) -> str:
    """Return a Python keyword such as ``from`` as a name of the same length.

    Python recognises keywords by plain letters only, but normalises bold letters in names (NFKC, reference manual 2.3).
    """
    quoted, word = found.groups()
    return str(quoted) if word is None else chr(BOLD_A + ord(word[0]) - ord("a")) + word[1:]


class QuantityRestorer(ast.NodeTransformer):
    """Replaces the stand-in names in a syntax tree by their quantities."""

    def __init__(self, python: str, literals: Mapping[int, str]) -> None:
        self._python = python
        self._literals = literals

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Return the quantity of a stand-in name, or the name itself."""
        written = self._literals.get(character_range(self._python, node)[0]) if self._literals else None
        found = None if written is None else parse_quantity(written)
        if found is None:
            return node
        return ast.copy_location(ast.Constant(found), node)


def character_range(text: str, node: ast.expr) -> tuple[int, int]:
    """Return start and end of a syntax node in characters; Python's parser has them in UTF-8 bytes."""
    data = text.encode()
    end = len(data) if node.end_col_offset is None else node.end_col_offset
    return len(data[: node.col_offset].decode()), len(data[:end].decode())


def syntax_hint(text: str) -> str:
    """Return the hint for operators of other languages; empty if there is none."""
    if "${" in text:
        return "; write it without '${' and '}'"
    for sign, word in (("&&", "and"), ("||", "or")):
        if sign in text:
            return f"; write '{word}' for '{sign}'"
    if re.search(r"(?<![=!<>])=(?!=)", text):
        return "; compare with '=='"
    if re.search(r"\?.*:", text):
        return "; write 'A if CONDITION else B' for 'CONDITION ? A : B'"
    return "; write 'not' for '!'" if re.search("!(?!=)", text) else ""


TEXT, FLAG, NOTHING = "text", "flag", "nothing"

PERCENT = "percent"
"""Kind of a value such as ``battery.percent``: a plain number from 0 to 100, not a share from 0 to 1."""

UNSETTLED = "unsettled"
"""Kind (static type) of a value that has an error, or whose type depends on itself; it is not checked."""


@dataclass(frozen=True, slots=True)
class ListKind:
    """Kind (static type) of a list: the kind that all its members have."""

    member_kind: "Kind"


@dataclass(frozen=True, slots=True)
class RecordKind:
    """Kind (static type) of a value with members: those of the class ``declared_type``, or ``members`` by name.

    ``noun`` is the kind's name in messages; ``other_kind`` is the kind of all other members.
    """

    noun: str
    declared_type: type | None = None
    members: Mapping[str, "Kind"] = field(default_factory=dict, hash=False)
    other_kind: "Kind" = None

    def member(self, name: str) -> "Kind":
        """Return the kind (static type) of the member ``name``; None if it is not known."""
        known = self.members if self.declared_type is None else member_kinds(self.declared_type)
        return known.get(name, self.other_kind)

    def lacks(self, name: str) -> bool:
        """Return True if all members are known and ``name`` is not among them."""
        return (
            self.declared_type is None and self.other_kind is None and bool(self.members) and name not in self.members
        )


Kind = str | ListKind | RecordKind | None

STATE_KINDS: Mapping[str, Mapping[str, Kind]] = {
    name: {member: value.kind for member, value in part.values.items()} for name, part in ROBOT_STATE.items()
}
"""Kinds (static types) of the robot's state by part and member, such as ``battery.percent``."""


def is_numeric(kind: Kind) -> bool:
    """Return True for a number of any dimension."""
    return isinstance(kind, str) and kind not in (TEXT, FLAG, NOTHING, UNSETTLED)


def describe_kind(kind: Kind) -> str:
    """Return a kind as text for messages: "a length", "a text", "true or false"."""
    if isinstance(kind, str):
        return {FLAG: "true or false", NOTHING: "nothing", TEXT: "a text"}.get(kind) or dimension_text(kind)
    return "a list" if isinstance(kind, ListKind) else kind.noun if isinstance(kind, RecordKind) else "something"


def join_kinds(one: Kind, other: Kind) -> Kind:
    """Return the kind (static type) of a value that has kind ``one`` or ``other``; None if nothing fits both."""
    if one == other or other in (UNSETTLED, NOTHING):
        return one
    if one in (UNSETTLED, NOTHING):
        return other
    if is_numeric(one) and is_numeric(other):
        try:
            return common_dimension(str(one), str(other))
        except DimensionError:
            return None
    if isinstance(one, ListKind) and isinstance(other, ListKind):
        return ListKind(join_kinds(one.member_kind, other.member_kind))
    if isinstance(one, RecordKind) and isinstance(other, RecordKind) and one.members.keys() == other.members.keys():
        return replace(one, members={name: join_kinds(kind, other.members[name]) for name, kind in one.members.items()})
    return None


def kind_of_value(value: object) -> Kind:
    """Return the kind (static type) of a value, such as "length" for a quantity in metres."""
    if isinstance(value, Quantity):
        return value.dimension
    if isinstance(value, bool):
        return FLAG
    if isinstance(value, list | tuple):
        return ListKind(kind_of_value(value[0]) if value else UNSETTLED)
    if isinstance(value, Mapping):
        return RecordKind("a mapping", members={str(name): kind_of_value(each) for name, each in value.items()})
    return NOTHING if value is None else kind_of_type(type(value))


def kind_of_type(hint: Any) -> Kind:
    """Return the kind (static type in missions) of a Python type or annotation; None if it has none."""
    if hint in (Any, object):  # Any is a class since Python 3.11
        return None
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return next((each for each in arguments[1:] if each in UNITS), None)
    if origin in (Union, UnionType):
        some = [each for each in arguments if each is not NoneType]
        return kind_of_type(some[0]) if len(some) == 1 else None
    if origin is not None and issubclass(origin, Mapping):
        return RecordKind("a mapping", other_kind=kind_of_type(arguments[1]))
    if origin is not None and issubclass(origin, Sequence):
        return ListKind(kind_of_type(arguments[0]))
    return _kind_of_class(hint) if isinstance(hint, type) else None


def _kind_of_class(kind: type) -> Kind:
    if issubclass(kind, bool):
        return FLAG
    if issubclass(kind, int | float):
        return NUMBER
    if issubclass(kind, str):
        return TEXT
    return RecordKind(f"a {kind.__name__}", kind)


@cache
def member_kinds(kind: type) -> Mapping[str, Kind]:
    """Return the kinds (static types) of the members of a class, from its annotations and those of its properties."""
    hints = _hints(kind)
    for name in members_of(kind):
        declared = getattr(kind, name, None)
        if isinstance(declared, property):
            hints[name] = _hints(declared.fget).get("return")
    return {name: kind_of_type(hint) for name, hint in hints.items() if not name.startswith("_")}


def _hints(declared: Any) -> dict[str, Any]:
    try:
        return get_type_hints(declared, include_extras=True)
    except Exception:  # the annotations of another library may name missing types
        return {}


@cache
def member_dimensions(kind: type) -> Mapping[str, str]:
    """Return the dimensions of the members of a class that are quantities."""
    return {name: each for name, each in member_kinds(kind).items() if isinstance(each, str) and each in UNITS}
