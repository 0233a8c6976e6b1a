"""Declare the keys of a file: the fields of a dataclass, each with its dimension, bounds, default and help.

    @keys
    class WheelKeys:
        port: str = key(help="The serial port.")
        max_speed: float = key("speed", default=0.5, low=0.01, high=0.7, help="Maximum speed.")

The type of a field determines its value: a text, a number, true or false, or one of some words (``Literal``, or
``among``). With a ``dimension`` it is a quantity with its unit, or ``[low, high]`` or ``[x, y, z]`` of quantities.
Another class of keys is a section, and ``tuple[X, ...]`` is a list. ``Mapping[str, X]`` is for values under names that
the author of the file chooses, such as names of joints; ``X | Y`` is for a value of one of two types. Items of a list
or a mapping have the dimension, bounds and words of the key, unless they are ``Annotated`` with ``inside``. The file
reader, the JSON Schemas and the reference in the docs are made from these declarations. This module reads no file.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import MISSING, field, fields, is_dataclass, replace
from functools import cache
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Protocol,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)
from typing import overload as overloaded

from drivers.api.fast_dataclass import dataclass

T = TypeVar("T")

Form = Literal[
    "text",
    "choice",
    "flag",
    "number",
    "integer",
    "quantity",
    "span",
    "vector",
    "section",
    "list",
    "named",
    "either",
    "any",
    "rest",
]
"""Form of the value of a key in a file.

``span`` is [low, high], ``vector`` several quantities. ``list`` and ``named`` hold values of the form of ``inner``, in
a list or under names; ``either`` is one of ``options``. ``any`` is a value of any form, which the code that reads the
section checks. ``rest`` is not a key of the file: it collects all remaining keys of the section.
"""

PERCENT = "percent"
"""Dimension of a share that is stored as 0 to 100."""


@dataclass(frozen=True, slots=True)
class Key:
    """Key of a section of a file: ``field`` is the field of the dataclass, ``word`` the name in the file.

    ``low`` and ``high`` are in SI units (percent for percent). ``of`` is the class of a section, ``sizes`` are the
    possible lengths of a vector. Without ``required``, ``default`` is the value of a missing key. If the value is a
    list of sections, or sections by name, ``each`` is the noun for one of them in messages, such as "a wall". ``wrong``
    is the message for a value of another form, ``hint`` an example with {} for the word. With ``blank``, a text may be
    empty.
    """

    field: str
    word: str
    form: Form
    help: str = ""
    dimension: str = ""
    low: float | None = None
    high: float | None = None
    among: tuple[str, ...] = ()
    each: str = ""
    wrong: str = ""
    hint: str = ""
    blank: bool = False
    of: type | None = None
    inner: "Key | None" = None
    options: "tuple[Key, ...]" = ()
    sizes: tuple[int, ...] = ()
    required: bool = False
    default: object = None

    @property
    def sections(self) -> tuple[type, ...]:
        """Classes of the sections in the value, also in lists and under names."""
        own = () if self.of is None else (self.of,)
        return own + tuple(of for each in (*self.options, self.inner) if each is not None for of in each.sections)


@dataclass(frozen=True, slots=True)
class KeyDiagnostic:
    """Error in a section of a file whose values are each valid by themselves.

    ``at`` is its place: words, and indexes of lists, from the section on. If the file has no such place,
    ``fallback_at`` is used, then the surrounding section. ``marks_key`` marks the last word itself instead of its
    value. ``hint`` says how to fix it; alternatively ``unknown_word`` is compared with ``known_words`` for a
    suggestion. ``about`` are the keys that cause the error, or all if empty: if one of them is invalid by itself, only
    that is reported.
    """

    message: str
    at: tuple[str | int, ...] = ()
    fallback_at: tuple[str | int, ...] = ()
    marks_key: bool = False
    hint: str = ""
    unknown_word: str = ""
    known_words: Collection[str] = ()
    about: tuple[tuple[str | int, ...], ...] = ()


class ValidatedKeys(Protocol):
    """Class of keys with rules that involve several keys.

    Its optional attribute ``unknown`` is the message for an unknown key, with {} for its word.
    """

    def diagnostics(self) -> Iterable[KeyDiagnostic]:
        """Yield the errors of the section; called only if each key is valid by itself."""
        ...


@overloaded
def key(
    dimension: str = "",
    *,
    default: T,
    help: str = "",
    low: float | None = None,
    high: float | None = None,
    among: Iterable[str] = (),
    word: str = "",
    each: str = "",
    wrong: str = "",
    hint: str = "",
    blank: bool = False,
    rest: bool = False,
) -> T: ...
@overloaded
def key(
    dimension: str = "",
    *,
    help: str = "",
    low: float | None = None,
    high: float | None = None,
    among: Iterable[str] = (),
    word: str = "",
    each: str = "",
    wrong: str = "",
    hint: str = "",
    blank: bool = False,
    rest: bool = False,
) -> Any: ...
def key(
    dimension: str = "",
    *,
    default: object = MISSING,
    help: str = "",  # noqa: A002 - it is the word for it
    word: str = "",
    rest: bool = False,
    **constraints: Any,
) -> Any:
    """Declare a key. Without a ``default`` it is required; a default of None is for an optional key.

    ``low`` and ``high`` are bounds in SI units, ``among`` the permitted words, and ``word`` the name in the file if it
    differs from the field. If the value is a list of sections, or sections by name, ``each`` is the noun for one of
    them in messages, such as "a wall". ``wrong`` is the message for a value of another form, and ``hint`` an example.
    With ``blank``, a text may be empty.

    With ``rest`` the key collects all remaining keys of the section, whose names the author of the file chooses. Each
    has a quantity of the dimension; without a dimension, the code that reads the section checks the values.
    """
    data = {"key": inside(dimension, **constraints), "word": word, "help": help, "rest": rest}
    if isinstance(default, Mapping):
        return field(default_factory=lambda: default, metadata=data)
    return field(default=default, metadata=data)


@dataclass(frozen=True, slots=True)
class ValueConstraints:
    """Constraints of the values of a key, or of its items in an ``Annotated`` type; see ``key``."""

    dimension: str = ""
    low: float | None = None
    high: float | None = None
    among: tuple[str, ...] = ()
    each: str = ""
    wrong: str = ""
    hint: str = ""
    blank: bool = False


def inside(dimension: str = "", *, among: Iterable[str] = (), **constraints: Any) -> ValueConstraints:
    """Return constraints for the items of a list or a mapping.

    Use it in the type of a key: ``tuple[Annotated[int, inside(low=1)], ...]``.
    """
    return ValueConstraints(dimension, among=tuple(among), **constraints)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key,))
def keys(cls: type[T]) -> type[T]:
    """Make a class of keys: a frozen dataclass with keyword-only fields."""
    return dataclass(frozen=True, kw_only=True)(cls)  # without slots, which two bases cannot both have


def declared_keys(cls: type) -> tuple[Key, ...]:
    """Return the keys of a class of keys, in their order. Raises TypeError for a field of an unsupported type."""
    return _read_keys(cls)


@cache
def _read_keys(cls: Any) -> tuple[Key, ...]:
    hints = get_type_hints(cls, include_extras=True)
    keys = []
    for each in fields(cls):
        constraints = each.metadata.get("key")
        if constraints is None:
            continue
        default = each.default_factory() if each.default_factory is not MISSING else each.default
        rest: bool = each.metadata["rest"]
        key = Key(each.name, each.metadata["word"] or each.name, "rest", dimension=constraints.dimension)
        try:
            key = key if rest else _make_key(key.field, key.word, hints[each.name], constraints)
        except TypeError as error:
            raise TypeError(f"{cls.__qualname__}.{each.name}: {error}") from None
        required = default is MISSING and not rest
        default = None if default is MISSING else default
        keys.append(replace(key, help=each.metadata["help"], required=required, default=default))
    return tuple(keys)


def _make_key(name: str, word: str, hint: Any, constraints: ValueConstraints) -> Key:
    """Return the key ``word`` for the field ``name`` of a class of keys, whose type is ``hint``.

    Raises TypeError for an unsupported type.
    """
    if get_origin(hint) is Annotated:
        hint, constraints = get_args(hint)[:2]
    parts = [each for each in get_args(hint) if each is not NoneType] if get_origin(hint) in (Union, UnionType) else []
    if len(parts) == 1:
        return _make_key(name, word, parts[0], constraints)
    made = Key(name, word, "text", **{each.name: getattr(constraints, each.name) for each in fields(constraints)})
    sizes = tuple(len(get_args(each)) for each in parts or [hint] if {*get_args(each)} == {float})
    if sizes and len(sizes) == len(parts or [hint]):
        return replace(made, form="span" if sizes == (2,) and not constraints.wrong else "vector", sizes=sizes)
    if parts:
        return _make_either_key(made, parts, constraints)
    if get_origin(hint) is Literal:
        return replace(made, form="choice", among=get_args(hint))
    if isinstance(hint, type) and is_dataclass(hint):
        return replace(made, form="section", of=hint)
    if hint in _PLAIN:
        plain = "quantity" if hint is float and constraints.dimension else _PLAIN[hint]
        return replace(made, form="choice" if constraints.among else plain)
    return _make_collection_key(made, hint, constraints)


def _make_either_key(key: Key, parts: list[Any], constraints: ValueConstraints) -> Key:
    """Return a copy of ``key`` for a field whose type is a union of ``parts``.

    The value is either a quantity or one of some words, such as ``2 s`` or ``never``; or it has one of several forms.
    """
    words = next((get_args(each) for each in parts if get_origin(each) is Literal), ())
    if words and float in parts:
        return replace(key, form="quantity", among=words)
    within = replace(constraints, wrong="", hint="")
    return replace(key, form="either", options=tuple(_make_key(key.field, key.word, each, within) for each in parts))


def _make_collection_key(key: Key, hint: Any, constraints: ValueConstraints) -> Key:
    """Return a copy of ``key`` for a field whose type ``hint`` is a list, or a mapping of values by name.

    Raises TypeError for another type.
    """
    origin, inner = get_origin(hint), get_args(hint)
    if origin is tuple and inner[1:] == (...,):
        return replace(key, form="list", inner=_make_key(key.field, key.word, inner[0], constraints))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        within = replace(constraints, wrong="", hint="")
        return replace(key, form="named", inner=_make_key(key.field, key.word, inner[1], within))
    raise TypeError(f"no key can hold {hint}")


_PLAIN: Mapping[Any, Form] = {str: "text", bool: "flag", int: "integer", float: "number", object: "any"}
"""Forms of key values by Python type; ``object`` is for values that the reader of the section checks."""
