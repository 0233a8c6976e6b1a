"""Values as JSON and back, bit for bit: whatever drivers and perception say of themselves.

Where a type is declared, it says how to read the JSON: a dataclass is an object of its fields, a tuple an array, an
enumeration its value, an array of numpy its bytes as base64. Where anything may stand (an answer, a variable), what
JSON would not tell apart carries its kind under ``$``::

    {"$": "HeadPose", "pan": 0.1, "tilt": 0.0}      {"$": "tuple", "of": [1, 2]}      {"$": "float", "of": "nan"}

JSON has no numbers beyond the finite ones: those are ``"nan"``, ``"inf"`` and ``"-inf"``.

numpy is imported by the first value of it: most records have none, and their writer starts in half the time.
"""

import base64
import json
import types
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, partial
from math import isfinite
from typing import Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import drivers.api
import perception.api
from drivers.api.measures import Array
from drivers.errors import BadRequest, DeviceFault, DriverError, NoReply, NotConnected, SensorSilent

T = TypeVar("T")

TAG = "$"
"""Under which name a value carries its kind."""

NAMED: Mapping[str, type[Any]] = {
    name: found
    for module in (drivers.api, perception.api)
    for name, found in vars(module).items()
    if isinstance(found, type) and (is_dataclass(found) or issubclass(found, Enum)) and found is not Enum
}
"""The values of drivers and perception by the names of their types."""

ERRORS: Mapping[str, type[DriverError]] = {
    error.__name__: error for error in (NotConnected, SensorSilent, NoReply, DeviceFault, BadRequest, DriverError)
}
"""What can go wrong with a device, by name."""


def to_json(value: object) -> object:
    """Return a value as ``from_json`` reads it when it is told the value's type."""
    kind: Any = type(value)
    return _coder(kind).encode(value)


def from_json(data: object, kind: type[T]) -> T:
    """Return the value of type ``kind`` that was written so. Raises ValueError for what is none."""
    wanted: Any = kind
    try:
        found: T = _coder(wanted).decode(data)
    except (LookupError, TypeError, AttributeError, ValueError, OverflowError) as error:
        raise ValueError(f"no {getattr(kind, '__name__', kind)}: {json.dumps(data):.80}: {error}") from error
    return found


def tagged(value: object) -> object:
    """Return a value of any type as ``untagged`` reads it; of what is not known here, only the words remain."""
    kind: Any = type(value)
    return _tagger(kind)(value)


@cache
def _tagger(kind: Any) -> Callable[[Any], object]:
    """Return how values of a type are written where anything may stand; asked once a type, for it is asked often."""
    name: str = kind.__name__
    known = NAMED.get(name) is kind
    if issubclass(kind, Enum):
        return (lambda value: {TAG: name, "of": value.value}) if known else _tag_text
    if issubclass(kind, bool | int | str | types.NoneType):
        return _same
    ways: Sequence[tuple[type[Any], Callable[[Any], object]]] = (
        (float, lambda value: value if isfinite(value) else _tag("float", number(value))),
        (list, lambda value: [tagged(each) for each in value]),
        (tuple, lambda value: _tag("tuple", [tagged(each) for each in value])),
        (Mapping, _tag_mapping),
        (DriverError, _tag_error),
        (AbstractSet, lambda value: _tag("set", [tagged(each) for each in value])),
    )
    if known:
        return partial(_tag_known, name, _coder(kind).encode)
    return next((way for made, way in ways if issubclass(kind, made)), None) or _numpy_tagger(kind)


def _numpy_tagger(kind: type[Any]) -> Callable[[Any], object]:
    """Return the same for what only numpy may have made."""
    if not any(base.__module__ == "numpy" for base in kind.__mro__):
        return _tag_text
    import numpy as np  # noqa: PLC0415 - see the module

    if issubclass(kind, np.generic):
        return lambda value: tagged(value.item())
    return (lambda value: _tag("array", _array(value))) if issubclass(kind, np.ndarray) else _tag_text


def untagged(data: object) -> Any:
    """Return the value that ``tagged`` has written so. Raises LookupError, TypeError or ValueError for what is none."""
    if isinstance(data, list):
        return [untagged(each) for each in data]
    if not isinstance(data, dict):
        return data
    name = data.get(TAG)
    if name is None:
        return {key: untagged(value) for key, value in data.items()}
    if name in _CONTAINERS:
        return _CONTAINERS[name](data["of"])
    if name in ERRORS:
        return ERRORS[name](data["of"], hint=data["hint"])
    kind: Any = NAMED[name]
    return kind(data["of"]) if issubclass(kind, Enum) else _coder(kind).decode(data)


def number(value: Any) -> object:
    """Return a number as JSON can have it."""
    return value if isfinite(value) else str(float(value))


def dumps(data: object) -> bytes:
    """Return JSON as the bytes of a message."""
    return _JSON.encode(data).encode()


def _plain(value: object) -> object:
    """Return a number of numpy, which some perception gives where a plain one is declared, as a plain one."""
    import numpy as np  # noqa: PLC0415 - see the module

    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"cannot be written: {value!r:.80}")


_JSON = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False, default=_plain)
"""What it is given was just made, and holds nothing that holds itself."""


class _Coder(NamedTuple):
    """How values of one type are written and read."""

    encode: Callable[[Any], object]
    decode: Callable[[Any], Any]


def _same(value: Any) -> Any:
    return value


def _from_number(data: Any) -> Any:
    found = float(data)  # not of more digits than floats have, which would fail far from here
    return data if isinstance(data, int | float) else found


def _array(value: Any) -> object:
    exact = value.astype(value.dtype.newbyteorder("<"), copy=False)
    data = base64.b64encode(exact.tobytes()).decode()
    return {"dtype": exact.dtype.str, "shape": list(value.shape), "data": data}


def _from_array(data: Any) -> Any:
    import numpy as np  # noqa: PLC0415 - see the module

    kind = np.dtype(data["dtype"])
    found = np.frombuffer(base64.b64decode(data["data"]), kind).reshape(data["shape"])
    return found.astype(kind.newbyteorder("="))


def _checked(*kinds: type) -> Callable[[Any], Any]:
    def decode(data: Any) -> Any:
        if not isinstance(data, kinds):
            raise TypeError(f"{data!r:.40} is no {kinds[0].__name__}")
        return data

    return decode


_TAGGED = _Coder(tagged, untagged)
_FLOAT = _Coder(number, _from_number)
_PLAIN = {
    bool: _Coder(_same, _checked(bool)),
    int: _Coder(_same, _checked(int, float)),
    str: _Coder(_same, _checked(str)),
}
_ARRAY = _Coder(_array, _from_array)


@cache
def _coder(kind: Any) -> _Coder:
    """Return how values of a type are written and read; of an unknown one with their kind."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is float:
        return _FLOAT
    if kind in _PLAIN:
        return _PLAIN[kind]
    if kind is Array:
        return _ARRAY
    made = kind if origin is None else origin
    if isinstance(made, type) and is_dataclass(made):
        return _object(made)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return _Coder(lambda value: value.value, kind)
    if origin in (Union, types.UnionType) and len(inner) == 2 and type(None) in inner:
        return _optional(_coder(next(each for each in inner if each is not type(None))))
    return _container(origin, inner)


def _container(origin: Any, inner: tuple[Any, ...]) -> _Coder:
    if origin is tuple and inner[-1:] != (...,):
        return _row(tuple(_coder(each) for each in inner))
    if origin in (tuple, list, frozenset, Sequence):
        make, one = (tuple if origin is Sequence else origin), _coder(inner[0])
        arrange = sorted if origin is frozenset else _same
        return _Coder(
            lambda value: [one.encode(each) for each in arrange(value)],
            lambda data: make(one.decode(each) for each in data),
        )
    if origin is Mapping and inner[0] is str:
        held = _coder(inner[1])
        return _Coder(
            lambda value: {key: held.encode(each) for key, each in value.items()},
            lambda data: {key: held.decode(each) for key, each in data.items()},
        )
    return _TAGGED


def _object(kind: type[Any]) -> _Coder:
    """Return how a dataclass is written: by its fields. One that is missing when it is read has its default.

    A field that was renamed says in its metadata by which name it is ``recorded``: records of before are read, too.
    """
    hints = get_type_hints(kind)
    coders = [
        (field.name, field.metadata.get("recorded", field.name), _coder(hints[field.name])) for field in fields(kind)
    ]

    def encode(value: Any) -> object:
        return {recorded: coder.encode(getattr(value, name)) for name, recorded, coder in coders}

    def decode(data: Any) -> Any:
        if not isinstance(data, dict):
            raise TypeError(f"{data!r:.40} is no object")
        return kind(**{name: coder.decode(data[recorded]) for name, recorded, coder in coders if recorded in data})

    return _Coder(encode, decode)


def _optional(one: _Coder) -> _Coder:
    return _Coder(
        lambda value: None if value is None else one.encode(value),
        lambda data: None if data is None else one.decode(data),
    )


def _row(coders: tuple[_Coder, ...]) -> _Coder:
    return _Coder(
        lambda value: [coder.encode(each) for coder, each in zip(coders, value, strict=True)],
        lambda data: tuple(coder.decode(each) for coder, each in zip(coders, data, strict=True)),
    )


def _tag(name: str, data: object) -> object:
    return {TAG: name, "of": data}


def _tag_mapping(value: Mapping[Any, Any]) -> object:
    if TAG not in value and all(isinstance(key, str) for key in value):
        return {str(key): tagged(each) for key, each in value.items()}
    return _tag("mapping", [[tagged(key), tagged(each)] for key, each in value.items()])


def _tag_error(error: DriverError) -> object:
    name = next(kind.__name__ for kind in type(error).__mro__ if kind in ERRORS.values())
    return {TAG: name, "of": str(error), "hint": error.hint}


def _tag_known(name: str, encode: Callable[[Any], object], value: object) -> object:
    written = encode(value)
    return {TAG: name, **written} if isinstance(written, dict) else _tag_text(value)


def _tag_text(value: object) -> object:
    return _tag("text", str(value))


_CONTAINERS: Mapping[str, Callable[[Any], Any]] = {
    "tuple": lambda data: tuple(untagged(each) for each in data),
    "set": lambda data: frozenset(untagged(each) for each in data),
    "mapping": lambda data: {untagged(key): untagged(each) for key, each in data},
    "array": _from_array,
    "float": float,
    "text": str,
}
"""What a kind means that is not the name of a type."""
