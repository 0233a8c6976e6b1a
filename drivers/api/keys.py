"""Keys of a file, declared once: the fields of a dataclass, each with its dimension, bounds, default and help.

::

    @keys
    class WheelKeys:
        port: str = key(help="The serial port.")
        max_speed: float = key("speed", default=0.5, low=0.01, high=0.7, help="The highest speed.")

The type of a field says what the key takes: a text, a number, true or false, one of some words (``Literal``, or
``among``), with a ``dimension`` a quantity with its unit, ``[low, high]`` or ``[x, y, z]`` of those, a section (another
class of keys), a list (``tuple[X, ...]``), values under names of the file's own (``Mapping[str, X]``), or one of these
(``X | Y``). What is inside of a list, or under a name, has the dimension, bounds and words of the key, unless
``Annotated`` with others ``inside``. The reader of files, the JSON Schemas and the reference in the docs are made of
that. Nothing here reads a file.
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
"""What a key takes. ``span`` is [low, high], ``vector`` so many quantities. ``list`` and ``marks_key`` hold what is
``inner``; ``either`` is one of its ``options``, ``any`` what its reader
looks at itself. ``rest`` is no key of the file: it takes all that the section has
besides."""

PERCENT = "percent"
"""The dimension of a share that counts to 100 in the program."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a section: the ``field`` that holds its value, the ``word`` for it in the file, and what it takes.

    ``low`` and ``high`` are in SI units (percent for percent). ``of`` is the class of a section, ``sizes`` how many
    quantities a vector has. Without ``required``, ``default`` is what holds where the file has no such key. ``each`` is
    what messages call a section under a name or in a list; ``wrong`` is the message for a value in no such form, and
    ``hint`` what to write then, with {} for its word. A text may be ``blank``.
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
        """The classes of the sections in it, or of those in a list or under names."""
        own = () if self.of is None else (self.of,)
        return own + tuple(of for each in (*self.options, self.inner) if each is not None for of in each.sections)


@dataclass(frozen=True, slots=True)
class KeyDiagnostic:
    """What is wrong with the values of a section beyond each by itself.

    ``at`` is where: words, and places in lists, from the section on; where the file lacks it, ``fallback_at``, and then
    what is around it. ``marks_key`` marks the last word itself instead of its value. ``hint`` says what to write; or the
    ``unknown_word`` word is compared with those ``known_words``. ``about`` are the keys that it comes of: where one of them is wrong
    by itself, that is told alone; without any, it comes of all.
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
    """A class of keys with rules beyond each key by itself.

    It may say in ``unknown`` what messages say of a key that it does not have, with {} for its word.
    """

    def diagnostics(self) -> Iterable[KeyDiagnostic]:
        """Yield what is wrong; asked only where each key is right by itself."""
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
    **told: Any,
) -> Any:
    """Declare a key. Without a ``default`` the file must have it; one of None is for a key that may be missing.

    ``low`` and ``high`` are bounds in SI units, ``among`` the words that are possible, ``word`` what the file calls it
    where that is not the name of the field, and ``each`` what messages call a section under a name or in a list.
    ``wrong`` is the message for a value in another form, and ``hint`` what to write; a text may be ``blank``. With
    ``rest`` it takes all other keys of the section: names of the file's own, each with a quantity of the dimension; or,
    without one, with values in a form that its reader looks at itself.
    """
    data = {"key": inside(dimension, **told), "word": word, "help": help, "rest": rest}
    if isinstance(default, Mapping):
        return field(default_factory=lambda: default, metadata=data)
    return field(default=default, metadata=data)


@dataclass(frozen=True, slots=True)
class ValueConstraints:
    """What is told of the values inside of a key, in an ``Annotated`` type; see ``key``."""

    dimension: str = ""
    low: float | None = None
    high: float | None = None
    among: tuple[str, ...] = ()
    each: str = ""
    wrong: str = ""
    hint: str = ""
    blank: bool = False


def inside(dimension: str = "", *, among: Iterable[str] = (), **constraints: Any) -> ValueConstraints:
    """Tell more of what stands in a list, or under names.

    Its place is the type of a key: ``tuple[Annotated[int, inside(low=1)], ...]``.
    """
    return ValueConstraints(dimension, among=tuple(among), **constraints)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key,))
def keys(cls: type[T]) -> type[T]:
    """Make a class of keys: a frozen dataclass whose fields are given by name."""
    return dataclass(frozen=True, kw_only=True)(cls)  # without slots, which two bases cannot both have


def declared_keys(cls: type) -> tuple[Key, ...]:
    """Return the keys of a class of keys, in their order. Raises TypeError for a field of which no key can be made."""
    return _read_keys(cls)


@cache
def _read_keys(cls: Any) -> tuple[Key, ...]:
    hints = get_type_hints(cls, include_extras=True)
    found = []
    for each in fields(cls):
        told = each.metadata.get("key")
        if told is None:
            continue
        default = each.default_factory() if each.default_factory is not MISSING else each.default
        rest: bool = each.metadata["rest"]
        made = Key(each.name, each.metadata["word"] or each.name, "rest", dimension=told.dimension)
        try:
            made = made if rest else _make_key(made.field, made.word, hints[each.name], told)
        except TypeError as error:
            raise TypeError(f"{cls.__qualname__}.{each.name}: {error}") from None
        required = default is MISSING and not rest
        default = None if default is MISSING else default
        found.append(replace(made, help=each.metadata["help"], required=required, default=default))
    return tuple(found)


def _make_key(name: str, word: str, hint: Any, constraints: ValueConstraints) -> Key:
    """Return what a key of a type takes. Raises TypeError where no key can hold it."""
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
    """Return a key that takes one of several: a quantity or some words, or what differs in its form."""
    words = next((get_args(each) for each in parts if get_origin(each) is Literal), ())
    if words and float in parts:
        return replace(key, form="quantity", among=words)
    within = replace(constraints, wrong="", hint="")
    return replace(key, form="either", options=tuple(_make_key(key.field, key.word, each, within) for each in parts))


def _make_collection_key(key: Key, hint: Any, constraints: ValueConstraints) -> Key:
    """Return a key that takes a list, or values under names. Raises TypeError for another."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is tuple and inner[1:] == (...,):
        return replace(key, form="list", inner=_make_key(key.field, key.word, inner[0], constraints))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        within = replace(constraints, wrong="", hint="")
        return replace(key, form="named", inner=_make_key(key.field, key.word, inner[1], within))
    raise TypeError(f"no key can hold {hint}")


_PLAIN: Mapping[Any, Form] = {str: "text", bool: "flag", int: "integer", float: "number", object: "any"}
"""The types of single values, and of what its reader looks at itself."""
