"""``dataclass`` of the standard library, made in a fraction of the time: a start makes some hundreds of classes.

Python 3.11 and 3.12 compile each method of each class by itself. Here ``__init__`` alone is compiled, and the other
methods share their code. Fields, ``replace``, ``asdict``, ``match``, copies and messages are as of the standard
library, and a class of one make may inherit from one of the other.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from operator import attrgetter
from reprlib import recursive_repr
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any, cast

__all__ = ["dataclass"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(cls=None, /, *, frozen=False, eq=True, slots=False, kw_only=False):
        """Do what ``dataclasses.dataclass`` does, for the options that are used here."""

        def make(plain):
            return _make_dataclass(plain, frozen=frozen, eq=eq, slots=slots, kw_only=kw_only)

        return make if cls is None else make(cls)


ValuesGetter = Callable[[object], tuple[Any, ...]]
"""Gives the values of some fields of an instance."""


def _make_dataclass(cls: type, *, frozen: bool, eq: bool, slots: bool, kw_only: bool) -> type:
    """Return ``plain`` as a dataclass; methods that it has of its own stay."""
    own = frozenset(cls.__dict__)
    bases = [vars(base)["__dataclass_params__"] for base in cls.__mro__[1:] if "__dataclass_params__" in vars(base)]
    if any(base.frozen is not frozen for base in bases):
        raise TypeError(f"{cls.__qualname__} and the dataclasses that it inherits from are frozen, or none of them is")
    with _unfreeze_bases(bases):
        made: type[Any] = dataclasses.dataclass(init=False, repr=False, eq=False, slots=slots, kw_only=kw_only)(cls)
    vars(made)["__dataclass_params__"].frozen = frozen  # so that those of the standard library may inherit from it
    fields = dataclasses.fields(made)
    methods: dict[str, Callable[..., Any] | None] = {
        "__init__": _make_init(made, frozen),
        "__repr__": _make_repr(fields),
    }
    if eq:
        methods["__eq__"] = _make_eq(_make_values_getter(field.name for field in fields if field.compare))
        hashed = _make_values_getter(f.name for f in fields if (f.compare if f.hash is None else f.hash))
        if "__hash__" not in own or ("__eq__" in own and cls.__dict__["__hash__"] is None):
            own -= {"__hash__"}
            methods["__hash__"] = _make_hash(hashed) if frozen else None
    if frozen:
        names = frozenset(field.name for field in fields)
        methods |= {
            "__setattr__": _make_frozen_setter(made, names, "assign to"),
            "__delattr__": _make_frozen_setter(made, names, "delete"),
        }
        if slots:
            methods |= {"__getstate__": _get_state, "__setstate__": _set_state}
    for name, method in methods.items():
        if name not in own:
            if method is not None:
                method.__qualname__ = f"{made.__qualname__}.{name}"
            setattr(made, name, method)
    return made


@contextmanager
def _unfreeze_bases(bases: list[Any]) -> Iterator[None]:
    """Let a class inherit from frozen ones that is frozen itself only once its methods are made."""
    were = [base.frozen for base in bases]
    for base in bases:
        base.frozen = False
    try:
        yield
    finally:
        for base, frozen in zip(bases, were, strict=True):
            base.frozen = frozen


def _make_init(cls: type, frozen: bool) -> Callable[..., None]:
    """Return an ``__init__`` that takes the fields in their order, those that are ``kw_only`` by their names."""
    fields = dataclasses.fields(cls)
    shape = tuple((_value_source(field), field.kw_only) for field in fields)
    names = {f"f{place}": field.name for place, field in enumerate(fields)}
    scope: dict[str, object] = {"_set": object.__setattr__, "_none": dataclasses.MISSING}
    taken: list[object] = []
    named: dict[str, object] = {}
    for place, field in enumerate(fields):
        given: object = dataclasses.MISSING
        if field.default_factory is not dataclasses.MISSING:
            names[f"_new_f{place}"] = f"_new_{field.name}"
            scope[f"_new_{field.name}"] = field.default_factory
        elif (given := field.default) is not dataclasses.MISSING and not field.init:
            names[f"_given_f{place}"] = f"_given_{field.name}"
            scope[f"_given_{field.name}"] = given
        if not field.init or (given is dataclasses.MISSING and "_new" not in _value_source(field)):
            continue
        if field.kw_only:
            named[field.name] = given
        else:
            taken.append(given)
    code = _compile_init(shape, frozen, hasattr(cls, "__post_init__"))
    code = code.replace(
        co_varnames=tuple(names.get(name, name) for name in code.co_varnames),
        co_names=tuple(names.get(name, name) for name in code.co_names),
        co_consts=tuple(names.get(const, const) if isinstance(const, str) else const for const in code.co_consts),
    )
    init = FunctionType(code, scope, "__init__", tuple(taken) or None)
    init.__kwdefaults__ = named or None
    init.__annotations__ = {**{field.name: field.type for field in fields if field.init}, "return": None}
    return init


def _value_source(field: dataclasses.Field[Any]) -> str:
    """Return where the value of a field comes from."""
    made_anew = "_new" if field.default_factory is not dataclasses.MISSING else ""
    if field.init:
        return f"taken{made_anew}"
    return made_anew or ("_given" if field.default is not dataclasses.MISSING else "")


@cache
def _compile_init(shape: tuple[tuple[str, bool], ...], frozen: bool, post_init: bool) -> CodeType:
    """Return the code of an ``__init__`` for fields of such kinds, named ``f0``, ``f1``... to be named anew.

    To compile takes ten times as long as to give names, and many classes are of one shape.
    """
    taken: list[str] = []
    named: list[str] = []
    body: list[str] = []
    for place, (kind, kw_only) in enumerate(shape):
        name = f"f{place}"
        match kind:
            case "taken":
                value = name
            case "taken_new":
                value = f"_new_{name}() if {name} is _none else {name}"
            case "_new":
                value = f"_new_{name}()"
            case "_given":
                value = f"_given_{name}"
            case _:
                continue
        if kind.startswith("taken"):
            (named if kw_only else taken).append(name)
        body.append(f" _set(self,{name!r},{value})" if frozen else f" self.{name}={value}")
    if post_init:
        body.append(" self.__post_init__()")
    parameters = ",".join(["self", *taken, *(["*", *named] if named else [])])
    scope: dict[str, Any] = {}
    exec(f"def __init__({parameters}):\n" + "\n".join(body or [" pass"]), scope)  # noqa: S102 - of names of ours
    code: CodeType = scope["__init__"].__code__
    return code


def _make_values_getter(names: Iterable[str]) -> ValuesGetter:
    """Return what gives the values of the attributes of these names, in a tuple also where it is one or none."""
    several = tuple(names)
    if len(several) > 1:
        return cast(ValuesGetter, attrgetter(*several))
    return lambda instance: tuple(getattr(instance, name) for name in several)


def _make_repr(fields: tuple[dataclasses.Field[Any], ...]) -> Callable[[object], str]:
    names = [field.name for field in fields if field.repr]

    @recursive_repr()
    def shown(self: object) -> str:
        values = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__qualname__}({values})"

    return shown


def _make_eq(values: ValuesGetter) -> Callable[[object, object], Any]:
    def equal(self: object, other: object) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return equal


def _make_hash(values: ValuesGetter) -> Callable[[object], int]:
    return lambda self: hash(values(self))


def _make_frozen_setter(cls: type, names: frozenset[str], action: str) -> Callable[..., None]:
    """Return a ``__setattr__`` or ``__delattr__`` that refuses fields, and all else but of subclasses."""
    plain = "__setattr__" if action == "assign to" else "__delattr__"

    def refused(self: object, name: str, *value: object) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot {action} field {name!r}")
        getattr(super(cls, self), plain)(name, *value)

    return refused


@cache
def _field_names(cls: Any) -> tuple[str, ...]:
    """Return the names of the fields of a class; asked for each value that is packed."""
    return tuple(field.name for field in dataclasses.fields(cls))


def _get_state(self: object) -> list[object]:
    """Return the values of all fields, for copies and pickles: they cannot be set one by one."""
    made: Any = type(self)
    return [getattr(self, name) for name in _field_names(made)]


def _set_state(self: object, state: list[object]) -> None:
    """Set the values of all fields."""
    made: Any = type(self)
    for name, value in zip(_field_names(made), state, strict=True):
        object.__setattr__(self, name, value)
