"""Exact JSON encoding of all values that drivers and perception report.

Values of a declared type use ``missions.codec``; numpy arrays are base64. Values of any type (a reply, a variable)
carry their type under ``$`` if JSON would lose it::

    {"$": "HeadPose", "pan": 0.1, "tilt": 0.0}      {"$": "tuple", "of": [1, 2]}      {"$": "float", "of": "nan"}

numpy is imported on first use: most records have no arrays, and their writer starts in half the time.
"""

import base64
import json
import types
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import is_dataclass
from enum import Enum
from functools import cache, partial
from math import isfinite
from typing import Any, TypeVar

import drivers.api
import perception.api
from drivers.api.measures import Array
from drivers.errors import BadRequest, DeviceFault, DriverError, NoReply, NotConnected, SensorSilent
from missions.codec import Coder, Rules, coder, decode, encode, identity, number

T = TypeVar("T")

TAG = "$"
"""Key of an encoded JSON object that holds the type of the value."""

TYPES_BY_NAME: Mapping[str, type[Any]] = {
    name: found
    for module in (drivers.api, perception.api)
    for name, found in vars(module).items()
    if isinstance(found, type) and (is_dataclass(found) or issubclass(found, Enum)) and found is not Enum
}
"""Value types of drivers and perception, by class name."""

ERRORS_BY_NAME: Mapping[str, type[DriverError]] = {
    error.__name__: error for error in (NotConnected, SensorSilent, NoReply, DeviceFault, BadRequest, DriverError)
}
"""Device errors, by class name."""


def to_json(value: object) -> object:
    """Return a value as JSON; ``from_json`` decodes it with the value's type."""
    return encode(value, RULES)


def from_json(data: object, kind: type[T]) -> T:
    """Return the value of type ``kind`` that ``to_json`` encoded. Raises ValueError for invalid data."""
    try:
        return decode(kind, data, RULES)
    except (LookupError, TypeError, AttributeError, ValueError, OverflowError) as error:
        raise ValueError(f"no {getattr(kind, '__name__', kind)}: {json.dumps(data):.80}: {error}") from error


def decode_view(message: Mapping[str, object]) -> perception.api.View:
    """Return the percepts of a message on /percepts as a view. Raises ValueError."""
    return from_json({name: value for name, value in message.items() if name != "t"}, perception.api.View)


def tag_value(value: object) -> object:
    """Return a value of any type as JSON that ``untag_value`` decodes; values of unknown types become text."""
    kind: Any = type(value)
    return _tagger(kind)(value)


@cache
def _tagger(kind: Any) -> Callable[[Any], object]:
    """Return the encoder of a type; cached, since every reply needs one."""
    name: str = kind.__name__
    known = TYPES_BY_NAME.get(name) is kind
    if issubclass(kind, Enum):
        return (lambda value: {TAG: name, "of": value.value}) if known else _tag_text
    if issubclass(kind, bool | int | str | types.NoneType):
        return identity
    ways: Sequence[tuple[type[Any], Callable[[Any], object]]] = (
        (float, lambda value: value if isfinite(value) else _tag("float", number(value))),
        (list, lambda value: [tag_value(each) for each in value]),
        (tuple, lambda value: _tag("tuple", [tag_value(each) for each in value])),
        (Mapping, _tag_mapping),
        (DriverError, _tag_error),
        (AbstractSet, lambda value: _tag("set", [tag_value(each) for each in value])),
    )
    if known:
        return partial(_tag_known, name, coder(kind, RULES).encode)
    return next((way for made, way in ways if issubclass(kind, made)), None) or _numpy_tagger(kind)


def _numpy_tagger(kind: type[Any]) -> Callable[[Any], object]:
    """Return the encoder of a type that may be a numpy type."""
    if not any(base.__module__ == "numpy" for base in kind.__mro__):
        return _tag_text
    import numpy as np  # noqa: PLC0415 - see the module

    if issubclass(kind, np.generic):
        return lambda value: tag_value(value.item())
    return (lambda value: _tag("array", _encode_array(value))) if issubclass(kind, np.ndarray) else _tag_text


def untag_value(data: object) -> Any:
    """Return the value that ``tag_value`` encoded. Raises LookupError, TypeError or ValueError for invalid data."""
    if isinstance(data, list):
        return [untag_value(each) for each in data]
    if not isinstance(data, dict):
        return data
    name = data.get(TAG)
    if name is None:
        return {key: untag_value(value) for key, value in data.items()}
    if name in _CONTAINER_DECODERS:
        return _CONTAINER_DECODERS[name](data["of"])
    if name in ERRORS_BY_NAME:
        return ERRORS_BY_NAME[name](data["of"], hint=data["hint"])
    kind: Any = TYPES_BY_NAME[name]
    members = data["of"] if issubclass(kind, Enum) else {key: value for key, value in data.items() if key != TAG}
    return coder(kind, RULES).decode(members)


def dumps(data: object) -> bytes:
    """Return JSON as the bytes of a message."""
    return _JSON.encode(data).encode()


def _plain_number(value: object) -> object:
    """Return a numpy scalar, which some perception returns instead of a number, as a Python number."""
    import numpy as np  # noqa: PLC0415 - see the module

    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"cannot be written: {value!r:.80}")


_JSON = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False, default=_plain_number)
"""JSON encoder that does not check for reference cycles: tagged values have none."""


def _encode_array(value: Any) -> object:
    exact = value.astype(value.dtype.newbyteorder("<"), copy=False)
    data = base64.b64encode(exact.tobytes()).decode()
    return {"dtype": exact.dtype.str, "shape": list(value.shape), "data": data}


def _decode_array(data: Any) -> Any:
    import numpy as np  # noqa: PLC0415 - see the module

    kind = np.dtype(data["dtype"])
    found = np.frombuffer(base64.b64decode(data["data"]), kind).reshape(data["shape"])
    return found.astype(kind.newbyteorder("="))


def _tag(name: str, data: object) -> object:
    return {TAG: name, "of": data}


def _tag_mapping(value: Mapping[Any, Any]) -> object:
    if TAG not in value and all(isinstance(key, str) for key in value):
        return {str(key): tag_value(each) for key, each in value.items()}
    return _tag("mapping", [[tag_value(key), tag_value(each)] for key, each in value.items()])


def _tag_error(error: DriverError) -> object:
    name = next(kind.__name__ for kind in type(error).__mro__ if kind in ERRORS_BY_NAME.values())
    return {TAG: name, "of": str(error), "hint": error.hint}


def _tag_known(name: str, encode: Callable[[Any], object], value: object) -> object:
    written = encode(value)
    return {TAG: name, **written} if isinstance(written, dict) else _tag_text(value)


def _tag_text(value: object) -> object:
    return _tag("text", str(value))


_CONTAINER_DECODERS: Mapping[str, Callable[[Any], Any]] = {
    "tuple": lambda data: tuple(untag_value(each) for each in data),
    "set": lambda data: frozenset(untag_value(each) for each in data),
    "mapping": lambda data: {untag_value(key): untag_value(each) for key, each in data},
    "array": _decode_array,
    "float": float,
    "text": str,
}
"""Decoders of tagged values such as tuples and mappings, by tag; other tags are class names."""

_ARRAY, _TAGGED = Coder(_encode_array, _decode_array), Coder(tag_value, untag_value)

RULES = Rules(finite=False, other=lambda kind: _ARRAY if kind is Array else _TAGGED)
"""Rules by which records encode values: NaN and infinity as text, values of undeclared types with a tag for the type.
"""
