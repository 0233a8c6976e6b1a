"""Strict JSON codec of dataclasses, for records, the control socket, the studio and fleets.

A message is an object of its fields. The type of a field decides its JSON: a dataclass is an object, a tuple or list an
array, an enumeration its value. ``Annotated`` adds to a type a description and a ``Bound``, or an ``Option`` instead of
these two. The JSON Schema includes description and bounds. ``Rules`` are the limits of one channel, such as the control
socket. Data that differs from the declaration raises CodecError.

Pure Python, since the control socket of every run uses it: stopping a robot must not need a compiled package. Coders
are created once per type and cached.
"""

import inspect
import types
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from functools import cache
from math import inf, isfinite
from reprlib import Repr
from sys import float_info
from typing import Any, Literal, NamedTuple, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from config.diagnostics import did_you_mean
from config.file_io import parse_json
from drivers.api.fast_dataclass import dataclass
from missions.options import Option

T = TypeVar("T")

MAX_INTEGER = 2**53
"""Largest integer that a float represents exactly."""

_shown = Repr()
_shown.maxstring = _shown.maxlong = _shown.maxother = 60


class CodecError(ValueError):
    """JSON data that does not match its declaration. ``path`` names the member, ``hint`` is a suggestion."""

    def __init__(self, problem: str, path: str = "", hint: str = "") -> None:
        super().__init__(problem)
        self.problem, self.path, self.hint = problem, path, hint

    def __str__(self) -> str:
        return f"'{self.path[:60]}' {self.problem}" if self.path else self.problem

    def inside(self, name: str) -> "CodecError":
        """Return this error with ``name`` put before its ``path``: the path ``x`` becomes ``pose.x``."""
        name = short_text(name)[1:-1]
        return CodecError(self.problem, f"{name}.{self.path}" if self.path else name, self.hint)


class Coder(NamedTuple):
    """Encoder and decoder of one type. ``decode`` raises CodecError."""

    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]


def identity(value: Any) -> Any:
    """Return the value itself."""
    return value


@dataclass(frozen=True, slots=True)
class Rules:
    """Limits for the JSON messages of one channel, such as the control socket or a record.

    Texts have at most ``max_text`` characters and satisfy the function ``is_text``; ``text`` describes a valid text in
    error messages. Lists and objects have at most ``max_members`` members; numbers are at most ``max_number``. With
    ``finite``, infinity and NaN are refused; otherwise they are written as "nan", "inf" and "-inf". ``omit_none``
    leaves out members that are None. ``other`` is a function that returns the coder of a type which this module does
    not support, such as Any.
    """

    max_text: float = inf
    max_members: float = inf
    max_number: float = float_info.max
    is_text: Callable[[str], bool] = lambda _: True
    text: str = "a text"
    finite: bool = True
    omit_none: bool = False
    other: Callable[[Any], Coder] = lambda _: Coder(identity, identity)


@dataclass(frozen=True, slots=True)
class Bound:
    """Range of a number; for a text, ``high`` is the maximum length."""

    low: float = -inf
    high: float = inf


UNBOUNDED = Bound()


@dataclass(frozen=True, slots=True)
class JsonName:
    """Name of a JSON member that differs from the name of the dataclass field."""

    name: str


@dataclass(frozen=True, slots=True)
class MessageField:
    """Declared field of a message: its names in Python and JSON, type, description, bounds and default.

    ``required`` is true if a message without it is refused.
    """

    name: str
    json_name: str
    kind: Any
    description: str
    bound: Bound
    required: bool
    default: object


@cache
def message_fields(kind: Any) -> tuple[MessageField, ...]:
    """Return the fields of a message class."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple(_message_field(each, hints[each.name]) for each in fields(kind))


def _message_field(field: "Field[Any]", hint: Any) -> MessageField:
    marks = getattr(hint, "__metadata__", ())
    found = {type(mark): mark for mark in marks}
    about, bound = found.get(str, ""), found.get(Bound, UNBOUNDED)
    if option := found.get(Option):
        about = about or option.help
        low, high = (-inf if option.low is None else option.low), (inf if option.high is None else option.high)
        bound = Bound(max(bound.low, low), min(bound.high, high))
    required = field.default is MISSING and field.default_factory is MISSING
    default = None if required or field.default is MISSING else field.default
    word = found.get(JsonName, JsonName(field.name)).name
    return MessageField(field.name, word, get_args(hint)[0] if marks else hint, about, bound, required, default)


def short_text(value: object) -> str:
    """Return the first 60 characters of a value's repr, for an error message; a deep or long value is abbreviated."""
    return _shown.repr(value)[:60]


def encode(message: object, rules: Rules) -> Any:
    """Return a message as JSON data."""
    kind: Any = type(message)
    return coder(kind, rules).encode(message)


def decode(kind: type[T], data: object, rules: Rules) -> T:
    """Return ``data`` as a value of type ``kind``. Raises CodecError."""
    expected: Any = kind
    return cast("T", coder(expected, rules).decode(data))


def encode_tagged(message: Any, key: str, rules: Rules) -> dict[str, Any]:
    """Return a message as JSON data, with the message's ``word`` (its tag, such as "stop") first, under ``key``."""
    return {key: message.word, **encode(message, rules)}


def parse(data: str | bytes, max_bytes: int) -> Any:
    """Return the value of a JSON text of at most ``max_bytes`` without duplicate members. Raises CodecError."""
    if len(data) > max_bytes:
        raise CodecError(f"{len(data)} bytes; at most {max_bytes} are read")
    try:
        return parse_json(data, strict=True)
    except ValueError as error:
        raise CodecError(f"no JSON: {error}"[:200]) from error


def decode_tagged(data: object, key: str, kinds: Mapping[str, type[T]], rules: Rules) -> T:
    """Return the message in JSON ``data``, whose tag under ``key`` selects the class from ``kinds``.

    Raises CodecError.
    """
    if not isinstance(data, dict):
        raise CodecError(f'not an object, such as {{"{key}": "{next(iter(kinds))}"}}')
    word = data.get(key)
    if not isinstance(word, str) or word not in kinds:
        said = word[:60] if isinstance(word, str) else short_text(word)
        raise UnknownTagError(f"unknown command {said!r}", "", did_you_mean(said, kinds))
    return decode(kinds[word], {name: value for name, value in data.items() if name != key}, rules)


class UnknownTagError(CodecError):
    """A message whose tag, the word that names its class, is not known."""


@cache
def coder(kind: Any, rules: Rules, bound: Bound = UNBOUNDED) -> Coder:
    """Return the coder of the type ``kind``, for example a dataclass, a list or a number with a ``bound``.

    A dataclass may contain itself.
    """
    origin, inner = get_origin(kind), get_args(kind)
    made = kind if origin is None else origin
    if isinstance(made, type) and is_dataclass(made):
        return _object(made, rules)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return _enum(kind)
    if origin is Literal:
        words = f"one of {', '.join(inner)}"
        return Coder(identity, _check(words, lambda data: isinstance(data, str) and data in inner))
    if kind in (bool, int, float, str):
        return _plain(kind, rules, bound)
    if origin in (Union, types.UnionType) and len(inner) == 2 and type(None) in inner:
        return _optional(coder(next(each for each in inner if each is not type(None)), rules, bound))
    if origin is tuple and inner[-1:] != (...,):
        return _tuple(tuple(coder(each, rules) for each in inner))
    if origin in (tuple, list, frozenset, Sequence):
        return _list(origin, coder(inner[0], rules), rules)
    if origin is Mapping and inner[0] is str:
        return _mapping(coder(inner[1], rules), rules)
    return rules.other(kind)


def _type_error(expected: str, value: object) -> CodecError:
    return CodecError(f"must be {expected}, got {short_text(value)}")


def _check(expected: str, holds: Callable[[Any], bool]) -> Callable[[Any], Any]:
    """Return a decoder for data that satisfies ``holds``; for other data it raises CodecError with ``expected``."""

    def decode(data: Any) -> Any:
        if not holds(data):
            raise _type_error(expected, data)
        return data

    return decode


def _enum(kind: type[Enum]) -> Coder:
    def decode(data: Any) -> Any:
        try:
            if type(data) in (str, int):
                return kind(data)
        except ValueError:
            pass
        raise _type_error(f"one of {', '.join(str(each.value) for each in kind)}", data)

    return Coder(lambda value: value.value, decode)


def _plain(kind: type, rules: Rules, bound: Bound) -> Coder:
    """Return the coder of a flag, a number or a text."""
    if kind is bool:
        return Coder(identity, _check("true or false", lambda data: isinstance(data, bool)))
    if kind is str:
        longest = rules.max_text if bound.high == inf else bound.high
        expected = rules.text if longest == inf else f"{rules.text} of at most {longest:g} characters"
        fits = lambda data: isinstance(data, str) and len(data) <= longest and rules.is_text(data)  # noqa: E731
        return Coder(identity, _check(expected, fits))
    low, high = max(bound.low, -rules.max_number), min(bound.high, rules.max_number)
    kinds, expected = ((int,), "a whole number") if kind is int else ((int, float), "a number")
    expected += "" if bound == UNBOUNDED else f" within {low:g} and {high:g}"
    decode = _check(expected, lambda data: type(data) in kinds and low <= data <= high)
    if kind is int or rules.finite:
        return Coder(identity, decode)

    def decode_any(data: Any) -> Any:
        if type(data) is float and low <= data <= high:  # most are
            return data
        return float(data) if data in ("nan", "inf", "-inf") else decode(data)

    return Coder(number, decode_any)


def number(value: Any) -> Any:
    """Return a number as JSON data: "nan", "inf" and "-inf" stand for the values that JSON lacks."""
    return value if isfinite(value) else str(float(value))


def _object(kind: Any, rules: Rules) -> Coder:
    """Return the coder of a dataclass. Its members are resolved at first use, since the class may contain itself."""
    derived: Collection[str] = getattr(kind, "derived", ())
    writers: list[tuple[str, str, Callable[[Any], Any]]] = []  # not a cached call, which each message would pay for

    def look_up() -> None:
        ways = (
            (each.json_name, each.name, coder(each.kind, rules, each.bound).encode) for each in message_fields(kind)
        )
        writers.extend([*ways, *((name, name, identity) for name in derived)])

    def encode(message: Any) -> Any:
        if not writers:
            look_up()
        return {word: write(getattr(message, name)) for word, name, write in writers}

    def encode_without_none(message: Any) -> Any:
        if not writers:
            look_up()
        values = ((word, write, getattr(message, name)) for word, name, write in writers)
        return {word: write(value) for word, write, value in values if value is not None}

    return Coder(encode_without_none if rules.omit_none else encode, _object_reader(kind, rules, derived))


def _object_reader(kind: Any, rules: Rules, derived: Collection[str]) -> Callable[[Any], Any]:
    readers: dict[str, tuple[str, Callable[[Any], Any]]] = {}

    def decode(data: Any) -> Any:
        if not isinstance(data, dict):
            raise _type_error(f"an object ({kind.__name__})", data)
        if not readers:
            known = {
                each.json_name: (each.name, coder(each.kind, rules, each.bound).decode) for each in message_fields(kind)
            }
            readers.update(known)  # at once, for other threads
        found, word = {}, ""
        try:
            for word, value in data.items():
                way = readers.get(word)
                if way is not None:
                    found[way[0]] = way[1](value)
                elif word not in derived:
                    raise CodecError(f"is not a member of {kind.__name__}", "", did_you_mean(word, readers))
        except CodecError as error:
            raise error.inside(word) from error
        if len(found) < len(readers):
            _check_required(kind, found)
        return kind(**found)

    return decode


def _check_required(kind: Any, found: Collection[str]) -> None:
    for each in message_fields(kind):
        if each.required and each.name not in found:
            raise CodecError(f"is missing{': ' if each.description else ''}{each.description}", each.json_name)


def _optional(one: Coder) -> Coder:
    return Coder(
        identity if one.encode is identity else lambda value: None if value is None else one.encode(value),
        lambda data: None if data is None else one.decode(data),
    )


def _tuple(coders: tuple[Coder, ...]) -> Coder:
    def decode(data: Any) -> Any:
        if not isinstance(data, list) or len(data) != len(coders):
            raise _type_error(f"a list of {len(coders)}", data)
        return tuple(way.decode(each) for way, each in zip(coders, data, strict=True))

    return Coder(lambda value: [way.encode(each) for way, each in zip(coders, value, strict=True)], decode)


def _list(origin: Any, one: Coder, rules: Rules) -> Coder:
    make = tuple if origin is Sequence else origin
    arrange = sorted if origin is frozenset else identity

    def decode(data: Any) -> Any:
        if not isinstance(data, list) or len(data) > rules.max_members:
            raise _type_error("a list", data)
        return make(map(one.decode, data))

    plain = one.encode is identity and origin is not frozenset
    return Coder(identity if plain else lambda value: [one.encode(each) for each in arrange(value)], decode)


def _mapping(held: Coder, rules: Rules) -> Coder:
    read_name = _plain(str, rules, UNBOUNDED).decode

    def decode(data: Any) -> Any:
        if not isinstance(data, dict) or len(data) > rules.max_members:
            raise _type_error("an object", data)
        found, name = {}, ""
        try:
            for name, value in data.items():
                found[read_name(name)] = held.decode(value)
        except CodecError as error:
            raise error.inside(name) from error
        return found

    def encode(value: Any) -> Any:
        return {name: held.encode(each) for name, each in value.items()}

    return Coder(dict if held.encode is identity else encode, decode)


Schema = dict[str, Any]
"""JSON Schema (draft 2020-12) as plain data."""


def object_schema(kind: Any, rules: Rules, **first: Schema) -> Schema:
    """Return the JSON Schema of the dataclass ``kind``; the members in ``first`` come before its own fields.

    A field of another dataclass refers to that class in ``definitions``.
    """
    properties = dict(first)
    for each in message_fields(kind):
        found = _schema_of(each.kind, each.bound, rules)
        properties[each.json_name] = {"description": each.description, **found} if each.description else found
        if not each.required and each.default not in (None, "", ()) and rules.omit_none:
            properties[each.json_name] = {**properties[each.json_name], "default": each.default}
    for name, about in getattr(kind, "derived", {}).items():
        properties[name] = {"description": about, "type": "string"}
    required = [name for name in properties if not rules.omit_none or name in first]
    return {
        "description": " ".join((inspect.getdoc(kind) or "").split()),
        "type": "object",
        "properties": properties,
        "required": [*dict.fromkeys([*required, *(each.json_name for each in message_fields(kind) if each.required)])],
        "additionalProperties": False,
    }


def definitions(kind: Any, rules: Rules) -> dict[str, Schema]:
    """Return the JSON Schemas, by class name, of all dataclasses that the fields of ``kind`` contain."""
    found: dict[str, Schema] = {}
    waiting = [each.kind for each in message_fields(kind)]
    while waiting:
        hint = waiting.pop()
        waiting += get_args(hint)
        if is_dataclass(hint) and isinstance(hint, type) and hint.__name__ not in found:
            found[hint.__name__] = object_schema(hint, rules)
            waiting += [each.kind for each in message_fields(hint)]
    return found


def _schema_of(kind: Any, bound: Bound, rules: Rules) -> Schema:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        found = _schema_of(next(each for each in inner if each is not type(None)), bound, rules)
        return found if rules.omit_none or "type" not in found else {**found, "type": [found["type"], "null"]}
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is Mapping:
        held = _schema_of(inner[1], UNBOUNDED, rules)
        return {"type": "object", "additionalProperties": held} if held else {"type": "object"}
    if origin in (Sequence, tuple):
        return {"type": "array", "items": _schema_of(inner[0], UNBOUNDED, rules)}
    if isinstance(kind, type) and is_dataclass(kind):
        return {"$ref": f"#/$defs/{kind.__name__}"}
    plain = {bool: "boolean", str: "string", int: "integer", float: "number"}
    if kind not in plain:
        return {}
    found = {"type": plain[kind]}
    if kind is str:
        return found if bound.high == inf else found | {"maxLength": int(bound.high)}
    sides = {"minimum": bound.low, "maximum": bound.high}
    return found | {name: side for name, side in sides.items() if isfinite(side)}
