"""Keys of a file, declared once: the fields of a dataclass, each with its dimension, bounds, default and help.

::

    @keys
    class WheelKeys:
        port: str = key(help="The serial port.")
        max_speed: float = key("speed", default=0.5, low=0.01, high=0.7, help="The highest speed.")

The type of a field says what the key takes: a text, a number, true or false, one of some words (``Literal``, or
``among``), with a ``dimension`` a quantity with its unit, ``[low, high]`` or ``[x, y, z]`` of those, a section (another
class of keys), a section whose keys are names (``Mapping``). The reader of files, the JSON Schemas and the reference in
the docs are made of that. Nothing here reads a file.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, Protocol, TypeVar, Union, dataclass_transform, get_args, get_origin, get_type_hints
from typing import overload as overloaded

T = TypeVar("T")

Form = Literal[
    "text",
    "choice",
    "flag",
    "number",
    "integer",
    "quantity",
    "span",
    "triple",
    "spans",
    "section",
    "named",
    "texts",
    "lists",
    "items",
    "rest",
]
"""What a key takes. ``texts`` and ``lists`` are sections whose keys are names: of a text, of a list of texts. ``items``
are a list of sections. ``rest`` is no key of the file: it takes all that the section has besides."""

PERCENT = "percent"
"""The dimension of a share that counts to 100 in the program."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a section: the ``field`` that holds its value, the ``word`` for it in the file, and what it takes.

    ``low`` and ``high`` are in SI units (percent for percent). ``of`` is the class of a section. Without ``required``,
    ``default`` is what holds where the file has no such key. ``each`` is what messages call a section under a name.
    """

    field: str
    word: str
    form: Form
    help: str = ""
    dimension: str = ""
    low: float | None = None
    high: float | None = None
    among: tuple[str, ...] = ()
    of: type | None = None
    required: bool = False
    default: object = None
    each: str = ""


@dataclass(frozen=True, slots=True)
class Mistake:
    """What is wrong with the values of a section beyond each by itself.

    ``at`` is where: words, and places in lists, from the section on; where the file lacks it, ``otherwise``, and then
    what is around it. ``named`` marks the last word itself instead of its value. ``hint`` says what to write; or the
    ``seen`` word is compared with those ``known``. ``about`` are the keys that it comes of: where one of them is wrong
    by itself, that is told alone; without any, it comes of all.
    """

    message: str
    at: tuple[str | int, ...] = ()
    otherwise: tuple[str | int, ...] = ()
    named: bool = False
    hint: str = ""
    seen: str = ""
    known: Collection[str] = ()
    about: tuple[tuple[str | int, ...], ...] = ()


class Checked(Protocol):
    """A class of keys with rules beyond each key by itself."""

    def mistakes(self) -> Iterable[Mistake]:
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
    rest: bool = False,
) -> Any: ...
def key(
    dimension: str = "",
    *,
    default: object = MISSING,
    help: str = "",  # noqa: A002 - it is the word for it
    low: float | None = None,
    high: float | None = None,
    among: Iterable[str] = (),
    word: str = "",
    each: str = "",
    rest: bool = False,
) -> Any:
    """Declare a key. Without a ``default`` the file must have it; one of None is for a key that may be missing.

    ``low`` and ``high`` are bounds in SI units, ``among`` the words that are possible, ``word`` what the file calls it
    where that is not the name of the field, and ``each`` what messages call a section under a name or in a list. With
    ``rest`` it takes all other keys of the section: names of the file's own, each with a quantity of the dimension; or,
    without one, with values in a form that its reader looks at itself.
    """
    told = {
        "dimension": dimension,
        "help": help,
        "low": low,
        "high": high,
        "among": tuple(among),
        "word": word,
        "each": each,
        "rest": rest,
    }
    if isinstance(default, Mapping):
        return field(default_factory=lambda: default, metadata={"key": told})
    return field(default=default, metadata={"key": told})


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key,))
def keys(cls: type[T]) -> type[T]:
    """Make a class of keys: a frozen dataclass whose fields are given by name."""
    return dataclass(frozen=True, kw_only=True)(cls)  # without slots, which two bases cannot both have


def declared(cls: type) -> tuple[Key, ...]:
    """Return the keys of a class of keys, in their order. Raises TypeError for a field of which no key can be made."""
    return _declared(cls)


@cache
def _declared(cls: Any) -> tuple[Key, ...]:
    hints = get_type_hints(cls)
    found = []
    for each in fields(cls):
        told = each.metadata.get("key")
        if told is None:
            continue
        default = each.default_factory() if each.default_factory is not MISSING else each.default
        form, of, among = _form(hints[each.name], told["dimension"], told["among"])
        form, of = ("rest", None) if told["rest"] else (form, of)
        if form is None:
            raise TypeError(f"{cls.__qualname__}.{each.name}: no key can hold {hints[each.name]}")
        found.append(
            Key(
                each.name,
                told["word"] or each.name,
                form,
                told["help"],
                told["dimension"],
                told["low"],
                told["high"],
                among,
                of,
                default is MISSING and not told["rest"],
                None if default is MISSING else default,
                told["each"],
            )
        )
    return tuple(found)


def _form(hint: Any, dimension: str, among: tuple[str, ...]) -> tuple[Form | None, type | None, tuple[str, ...]]:
    """Return what a key of a type takes, the class of its section, and the words that it may be."""
    if get_origin(hint) in (Union, UnionType):
        hint = next(each for each in get_args(hint) if each is not NoneType)
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Literal:
        return "choice", None, inside
    if among:
        return "choice", None, among
    if isinstance(hint, type) and hasattr(hint, "__dataclass_fields__"):
        return "section", hint, ()
    real: Form = "quantity" if dimension else "number"
    plain: Mapping[Any, Form] = {str: "text", bool: "flag", int: "integer", float: real}
    if hint in plain:
        return plain[hint], None, ()
    if origin is tuple:
        forms: Mapping[Any, Form] = {(float, float): "span", (float, float, float): "triple"}
        listed: Form | None = "spans" if inside[1:] == (...,) else None
        if listed and hasattr(inside[0], "__dataclass_fields__"):
            return "items", inside[0], ()
        return forms.get(inside, listed), None, ()
    if isinstance(origin, type) and issubclass(origin, Mapping):
        value = inside[1]
        if value is str:
            return "texts", None, ()
        return ("named", value, ()) if isinstance(value, type) and not get_args(value) else ("lists", None, ())
    return None, None, ()
