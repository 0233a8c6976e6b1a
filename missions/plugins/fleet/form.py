"""What robots and operators tell each other, as dataclasses: their JSON, and how strictly it is read.

A message that is not exactly as its class says is refused whole: another type, a member too few or too many, a text
that is too long or would move a terminal's cursor.
"""

import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from functools import cache
from types import UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from config.reading import parse_json

MAX_BYTES, MAX_ANSWER = 64 * 1024, 1024 * 1024
"""Bytes of a message, and of an answer, at most."""

MAX_TEXT_LENGTH = 1000
"""Characters of a text, at most."""

MAX_MEMBERS = 4096
"""Members of a list or a mapping, at most."""

MAX_INTEGER = 2**53

T = TypeVar("T")


class BadMessageError(ValueError):
    """What was received is no message of ours; the text says why."""


def as_bytes(message: Any) -> bytes:
    """Return a message as it is sent."""
    return json.dumps(asdict(message), separators=(",", ":"), allow_nan=False).encode()


def read(kind: type[T], data: bytes, most: int = MAX_BYTES) -> T:
    """Return the message of class ``kind`` in ``data``, of so many bytes at ``most``. Raises BadMessageError."""
    return of(kind, parse(data, most))


def parse(data: bytes, most: int = MAX_BYTES) -> Any:
    """Return the JSON in ``data``. Raises BadMessageError."""
    if len(data) > most:
        raise BadMessageError(f"{len(data)} bytes; at most {most} are read")
    try:
        return parse_json(data)
    except ValueError as error:
        raise BadMessageError(f"no JSON: {str(error)[:80]}") from error


def of(kind: type[T], told: object) -> T:
    """Return the message of class ``kind`` that JSON tells. Raises BadMessageError."""
    known = _members(cast("Any", kind))
    if not isinstance(told, dict):
        raise BadMessageError(f"{kind.__name__}: no object")
    if not told.keys() <= known.keys():
        raise BadMessageError(f"{kind.__name__}: unknown member {min(map(ascii, told.keys() - known.keys()))[:60]}")
    missing = [name for name, (_, required) in known.items() if required and name not in told]
    if missing:
        raise BadMessageError(f"{kind.__name__}: '{missing[0]}' is missing")
    return kind(**{name: _checked(value, known[name][0], f"{kind.__name__}.{name}") for name, value in told.items()})


@cache
def _members(kind: Any) -> Mapping[str, tuple[Any, bool]]:
    """Return the types of the members of a class, and whether each must be there."""
    hints = get_type_hints(kind)
    required = {each.name: each.default is MISSING and each.default_factory is MISSING for each in fields(kind)}
    return {name: (hints[name], required[name]) for name in required}


def _checked(value: object, kind: Any, name: str) -> Any:
    """Return a value as its member has it. Raises BadMessageError."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin in (Union, UnionType):
        return None if value is None else _checked(value, inner[0], name)
    if origin is Literal and isinstance(value, str) and value in inner:
        return value
    if origin is tuple and isinstance(value, list) and len(value) <= MAX_MEMBERS:
        return tuple(_checked(each, inner[0], name) for each in value)
    if origin is Mapping and isinstance(value, dict) and len(value) <= MAX_MEMBERS:
        return {_text(key, name): _checked(each, inner[1], name) for key, each in value.items()}
    if kind is str:
        return _text(value, name)
    if (kind is bool) == isinstance(value, bool) and _is_number(value, kind):
        return kind(value)
    raise BadMessageError(f"{name}: {ascii(value)[:60]} is of the wrong type, or out of bounds")


def _is_number(value: object, kind: Any) -> bool:
    """Say whether a value is a number of a kind, within what is exact as a float."""
    if not isinstance(value, int if kind is not float else int | float):
        return False
    return abs(value) <= MAX_INTEGER  # infinities and NaN are not


def _text(value: object, name: str) -> str:
    """Return a text that may stand on a terminal. Raises BadMessageError."""
    if not isinstance(value, str) or len(value) > MAX_TEXT_LENGTH or not value.isprintable():
        raise BadMessageError(
            f"{name}: {ascii(value)[:60]} is no printable text of at most {MAX_TEXT_LENGTH} characters"
        )
    return value
