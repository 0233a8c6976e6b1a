"""Messages as dataclasses: their JSON, how it is checked, and the JSON Schema of it.

A message is an object of its fields. Its first member is its word, under the name that its class has in ``key``.
A field is declared as ``Annotated[type, "what it is"]``, a bounded number with a ``Bound`` too; or with the
declaration of an option, which has both.
"""

import inspect
import types
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from functools import cache
from math import inf, isfinite
from reprlib import Repr
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from config.faults import did_you_mean
from drivers.api.quick import dataclass
from missions.options import Option

LONGEST_TEXT = 4096
"""Characters of a text in a command, at most."""

MOST_MEMBERS = 256
"""Members of a list or an object in a command, at most."""

_shown = Repr()
_shown.maxstring = _shown.maxlong = _shown.maxother = 60

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Bound:
    """Between what a number must lie; or, for a text, how long it may be."""

    low: float = -inf
    high: float = inf


class BadMessage(ValueError):
    """What was received is no command. ``error`` is the name of the mistake, as answers tell it."""

    def __init__(self, error: str, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.error, self.hint = error, hint

    def __reduce__(self) -> tuple[type["BadMessage"], tuple[str, str, str]]:
        return BadMessage, (self.error, str(self), self.hint)  # as it comes from another process


@dataclass(frozen=True, slots=True)
class _Member:
    """One declared field: its type without the marks, what it is, its bounds, and whether it must be there."""

    name: str
    kind: Any
    about: str
    bound: Bound
    required: bool
    default: object


def members(kind: Any) -> tuple[_Member, ...]:
    """Return the fields of a message's class."""
    return _members(kind)


@cache
def _members(kind: Any) -> tuple[_Member, ...]:
    hints = get_type_hints(kind, include_extras=True)
    return tuple(_member(each, hints[each.name]) for each in fields(kind))


def _member(field: "Field[Any]", hint: Any) -> _Member:
    marks = getattr(hint, "__metadata__", ())
    about = next((mark for mark in marks if isinstance(mark, str)), "")
    bound = next((mark for mark in marks if isinstance(mark, Bound)), Bound())
    for declared in (mark for mark in marks if isinstance(mark, Option)):  # an option of `mission run`
        about = about or declared.help
        low, high = max(bound.low, _or(declared.low, -inf)), min(bound.high, _or(declared.high, inf))
        bound = Bound(low, high)
    required = field.default is MISSING and field.default_factory is MISSING
    default = None if required or field.default is MISSING else field.default
    return _Member(field.name, get_args(hint)[0] if marks else hint, about, bound, required, default)


def _or(value: float | None, other: float) -> float:
    return other if value is None else value


def read(data: Mapping[str, object], kind: type[T], key: str) -> T:
    """Return the message of class ``kind`` that ``data`` is. Raises BadMessage("bad_field") that names the field."""
    known = {each.name: each for each in members(kind)}
    for name in data:
        if name != key and name not in known:
            raise BadMessage("bad_field", f"it has no member '{str(name)[:60]}'", did_you_mean(str(name), known))
    found = {}
    for name, member in known.items():
        if name in data:
            found[name] = _checked(data[name], member.kind, member.bound, name)
        elif member.required:
            raise BadMessage("bad_field", f"'{name}' is missing: {member.about}")
    return kind(**found)


def _checked(value: object, kind: Any, bound: Bound, name: str) -> object:
    """Return a value as its field has it."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        if value is None:
            return None
        return _checked(value, next(each for each in inner if each is not type(None)), bound, name)
    if origin is Literal:
        if value not in inner:
            raise _wrong(name, f"one of {', '.join(map(str, inner))}", value)
        return value
    if origin is Mapping:
        if not isinstance(value, dict) or len(value) > MOST_MEMBERS:
            raise _wrong(name, "an object", value)
        return {
            _text(key, Bound(), name): _checked(each, inner[1], Bound(), f"{name}.{key}") for key, each in value.items()
        }
    if origin is Sequence:
        if not isinstance(value, list) or len(value) > MOST_MEMBERS:
            raise _wrong(name, "a list", value)
        return [_checked(each, inner[0], Bound(), name) for each in value]
    return _plain(value, kind, bound, name)


def _plain(value: object, kind: Any, bound: Bound, name: str) -> object:
    if kind is bool:
        if not isinstance(value, bool):
            raise _wrong(name, "true or false", value)
        return value
    if kind is str:
        return _text(value, bound, name)
    number = isinstance(value, int) or (kind is float and isinstance(value, float))
    if not number or isinstance(value, bool) or not _is_finite(value):  # type: ignore[arg-type]
        raise _wrong(name, "a number" if kind is float else "a whole number", value)
    if not bound.low <= value <= bound.high:  # type: ignore[operator]
        raise _wrong(name, f"within {bound.low:g} and {bound.high:g}", value)
    return value


def _text(value: object, bound: Bound, name: str) -> str:
    """Return a text that can be written to a file and be a word of a command line."""
    longest = LONGEST_TEXT if bound.high == inf else bound.high
    if not isinstance(value, str) or len(value) > longest:
        raise _wrong(name, f"a text of at most {longest:g} characters", value)
    if "\0" in value or any("\ud800" <= letter <= "\udfff" for letter in value):
        raise _wrong(name, "a text without NUL, and without halves of letters", value)
    return value


def _is_finite(value: float) -> bool:
    try:
        return isfinite(value)
    except OverflowError:  # a whole number beyond all others
        return False


def shown(value: object) -> str:
    """Return the beginning of a value, for a message: however deep it is, and however long."""
    return _shown.repr(value)[:60]


def _wrong(name: str, wanted: str, value: object) -> BadMessage:
    return BadMessage("bad_field", f"'{name[:60]}' must be {wanted}, got {shown(value)}")


def written(message: object, key: str) -> dict[str, object]:
    """Return a message as JSON has it: its word first; what is None is left out."""
    kind: Any = type(message)
    values = ((each.name, getattr(message, each.name)) for each in fields(kind))
    return {key: kind.word} | {name: value for name, value in values if value is not None}


def schema(kinds: Iterable[type[Any]], key: str) -> dict[str, object]:
    """Return the JSON Schema of messages, one definition for each class, by its word."""
    return {kind.word: _definition(kind, key) for kind in kinds}


def _definition(kind: type[Any], key: str) -> dict[str, object]:
    properties: dict[str, object] = {key: {"const": kind.word}}
    for member in members(kind):
        found = _schema_of(member.kind, member.bound)
        properties[member.name] = {"description": member.about, **found} if member.about else found
        if not member.required and member.default not in (None, "", ()):
            properties[member.name] = {**properties[member.name], "default": member.default}  # type: ignore[dict-item]
    required = [key, *(member.name for member in members(kind) if member.required)]
    about = " ".join((inspect.getdoc(kind) or "").split())
    return {
        "description": about,
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


def _schema_of(kind: Any, bound: Bound) -> dict[str, object]:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _schema_of(next(each for each in inner if each is not type(None)), bound)
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is Mapping:
        held = _schema_of(inner[1], Bound())
        return {"type": "object", "additionalProperties": held} if held else {"type": "object"}
    if origin is Sequence:
        return {"type": "array", "items": _schema_of(inner[0], Bound())}
    plain = {bool: "boolean", str: "string", int: "integer", float: "number"}
    if kind not in plain:
        return {}
    found: dict[str, object] = {"type": plain[kind]}
    if kind is str:
        return found if bound.high == inf else found | {"maxLength": int(bound.high)}
    sides = {"minimum": bound.low, "maximum": bound.high}
    return found | {name: side for name, side in sides.items() if isfinite(side)}
