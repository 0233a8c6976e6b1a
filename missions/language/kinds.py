"""Kinds: what a value is, as far as that is known before a mission runs.

A kind is the dimension of a number ("length", "number"), or ``TEXT``, ``FLAG``, ``NOTHING``, a list or a record; None
is what may be anything. Classes declare their members in the annotations: ``distance: Annotated[float, "length"]``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from config.units import NUMBER, UNITS, DimensionError, Quantity, common, named
from drivers.api.quick import dataclass
from missions.language.members import members_of

TEXT, FLAG, NOTHING = "text", "flag", "nothing"

PERCENT = "percent"
"""The kind of a number that counts to 100: a number, but no share."""

UNSETTLED = "unsettled"
"""The kind of what depends on a mistake, or on itself: nothing is said of it."""


@dataclass(frozen=True, slots=True)
class ListOf:
    """A list whose members are of one kind."""

    of: "Kind"


@dataclass(frozen=True, slots=True)
class Record:
    """Something with members: those of a class, or some by name; ``others`` is what any other member is."""

    noun: str
    of: type | None = None
    named: Mapping[str, "Kind"] = field(default_factory=dict, hash=False)
    others: "Kind" = None

    def member(self, name: str) -> "Kind":
        """Return the kind of a member."""
        known = self.named if self.of is None else kinds_of(self.of)
        return known.get(name, self.others)

    def lacks(self, name: str) -> bool:
        """True where all members are known by name, and this is none of them."""
        return self.of is None and self.others is None and bool(self.named) and name not in self.named


Kind = str | ListOf | Record | None

STATE: Mapping[str, Mapping[str, Kind]] = {
    "base": {
        "x": "length",
        "y": "length",
        "heading": "angle",
        "reckoned": FLAG,
        "bumper": FLAG,
        "cliff": FLAG,
        "wheel_drop": FLAG,
        "button": NUMBER,
        "docked": FLAG,
        "stopped": FLAG,
        "driver": TEXT,
    },
    "battery": {"percent": PERCENT, "voltage": "voltage", "charging": FLAG, "low": FLAG, "critical": FLAG},
    "face": {
        "seen": FLAG,
        "count": NUMBER,
        "id": NUMBER,
        "name": TEXT,
        "undecided": FLAG,
        "distance": "length",
        "bearing": "angle",
    },
    "head": {"pan": "angle", "tilt": "angle"},
    "range": {"nearest": "length", "ahead": "length"},
}
"""What expressions read of the robot's state, ``battery.percent``, ``face.seen``..., and what each is."""


def is_size(kind: Kind) -> bool:
    """True for a number, whatever its dimension."""
    return isinstance(kind, str) and kind not in (TEXT, FLAG, NOTHING, UNSETTLED)


def told(kind: Kind) -> str:
    """Return "a length", "a text", "true or false"... for a message."""
    if isinstance(kind, str):
        return {FLAG: "true or false", NOTHING: "nothing", TEXT: "a text"}.get(kind) or named(kind)
    return "a list" if isinstance(kind, ListOf) else kind.noun if isinstance(kind, Record) else "something"


def joined(one: Kind, other: Kind) -> Kind:
    """Return the kind of what is the one or the other."""
    if one == other or other in (UNSETTLED, NOTHING):
        return one
    if one in (UNSETTLED, NOTHING):
        return other
    if is_size(one) and is_size(other):
        try:
            return common(str(one), str(other))
        except DimensionError:
            return None
    return None


def kind_of_value(value: object) -> Kind:
    """Return the kind of a value."""
    if isinstance(value, Quantity):
        return value.dimension
    if isinstance(value, bool):
        return FLAG
    if isinstance(value, list | tuple):
        return ListOf(kind_of_value(value[0]) if value else UNSETTLED)
    if isinstance(value, Mapping):
        return Record("a mapping", named={str(name): kind_of_value(each) for name, each in value.items()})
    return NOTHING if value is None else kind_of_type(type(value))


def kind_of_type(hint: Any) -> Kind:
    """Return the kind of the values that a type, or an annotation, stands for."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return next((each for each in arguments[1:] if each in UNITS), None)
    if origin in (Union, UnionType):
        some = [each for each in arguments if each is not NoneType]
        return kind_of_type(some[0]) if len(some) == 1 else None
    if origin is not None and issubclass(origin, Mapping):
        return Record("a mapping", others=kind_of_type(arguments[1]))
    if origin is not None and issubclass(origin, Sequence):
        return ListOf(kind_of_type(arguments[0]))
    return _kind_of_class(hint) if isinstance(hint, type) else None


def _kind_of_class(kind: type) -> Kind:
    if issubclass(kind, bool):
        return FLAG
    if issubclass(kind, int | float):
        return NUMBER
    if issubclass(kind, str):
        return TEXT
    return Record(f"a {kind.__name__}", kind)


@cache
def kinds_of(kind: type) -> Mapping[str, Kind]:
    """Return what is known of the members of a class, from its annotations and those of its properties."""
    hints = _hints(kind)
    for name in members_of(kind):
        declared = getattr(kind, name, None)
        if isinstance(declared, property):
            hints[name] = _hints(declared.fget).get("return")
    return {name: kind_of_type(hint) for name, hint in hints.items() if not name.startswith("_")}


def _hints(declared: Any) -> dict[str, Any]:
    try:
        return get_type_hints(declared, include_extras=True)
    except Exception:  # a class of somebody else's may name what is not there
        return {}


@cache
def dimensions_of(kind: type) -> Mapping[str, str]:
    """Return the members of a class that are quantities, each with its dimension."""
    return {name: each for name, each in kinds_of(kind).items() if isinstance(each, str) and each in UNITS}
