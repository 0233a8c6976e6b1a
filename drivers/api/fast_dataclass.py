"""Fast ``dataclass``: as in the standard library, but made in a fraction of the time.

When a command starts, some hundreds of dataclasses are made, and Python 3.11 and 3.12 compile each method of each of
them. Here only ``__init__`` is compiled, and the other methods share their code. Fields, ``replace``, ``asdict``,
``match``, copies and messages are as in the standard library. A dataclass of this module may inherit from one of the
standard library, and the other way round.
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
        """Do the same as ``dataclasses.dataclass``, for the options that MissionTree uses."""

        def make(plain):
            return _make_dataclass(plain, frozen=frozen, eq=eq, slots=slots, kw_only=kw_only)

        return make if cls is None else make(cls)


ValuesGetter = Callable[[object], tuple[Any, ...]]
"""Returns the values of some fields of an instance."""


def _make_dataclass(cls: type, *, frozen: bool, eq: bool, slots: bool, kw_only: bool) -> type:
    """Return ``cls`` as a dataclass; methods that it defines itself stay."""
    own = frozenset(cls.__dict__)
    bases = [vars(base)["__dataclass_params__"] for base in cls.__mro__[1:] if "__dataclass_params__" in vars(base)]
    if any(base.frozen is not frozen for base in bases):
        raise TypeError(f"{cls.__qualname__} and its base dataclasses must all be frozen, or none")
    with _unfreeze_bases(bases):
        new_class: type[Any] = dataclasses.dataclass(init=False, repr=False, eq=False, slots=slots, kw_only=kw_only)(
            cls
        )
    vars(new_class)["__dataclass_params__"].frozen = frozen  # so that standard dataclasses may inherit from it
    fields = dataclasses.fields(new_class)
    methods: dict[str, Callable[..., Any] | None] = {
        "__init__": _make_init(new_class, frozen),
        "__repr__": _make_repr(fields),
    }
    if eq:
        methods["__eq__"] = _make_eq(_make_values_getter(field.name for field in fields if field.compare))
        hash_values = _make_values_getter(f.name for f in fields if (f.compare if f.hash is None else f.hash))
        if "__hash__" not in own or ("__eq__" in own and cls.__dict__["__hash__"] is None):
            own -= {"__hash__"}
            methods["__hash__"] = _make_hash(hash_values) if frozen else None
    if frozen:
        names = frozenset(field.name for field in fields)
        methods |= {
            "__setattr__": _make_frozen_setter(new_class, names, "assign to"),
            "__delattr__": _make_frozen_setter(new_class, names, "delete"),
        }
        if slots:
            methods |= {"__getstate__": _get_state, "__setstate__": _set_state}
    for name, method in methods.items():
        if name not in own:
            if method is not None:
                method.__qualname__ = f"{new_class.__qualname__}.{name}"
            setattr(new_class, name, method)
    return new_class


@contextmanager
def _unfreeze_bases(bases: list[Any]) -> Iterator[None]:
    """Mark frozen base classes as not frozen while the context lasts.

    A new class may inherit from frozen bases, but is itself frozen only after its creation.
    """
    frozen_flags = [base.frozen for base in bases]
    for base in bases:
        base.frozen = False
    try:
        yield
    finally:
        for base, frozen in zip(bases, frozen_flags, strict=True):
            base.frozen = frozen


def _make_init(cls: type, frozen: bool) -> Callable[..., None]:
    """Return an ``__init__`` that takes the fields in their order, and ``kw_only`` ones by name."""
    fields = dataclasses.fields(cls)
    shape = tuple((_value_source(field), field.kw_only) for field in fields)
    names = {f"f{place}": field.name for place, field in enumerate(fields)}
    scope: dict[str, object] = {"_set": object.__setattr__, "_none": dataclasses.MISSING}
    defaults: list[object] = []
    keyword_defaults: dict[str, object] = {}
    for place, field in enumerate(fields):
        default: object = dataclasses.MISSING
        if field.default_factory is not dataclasses.MISSING:
            names[f"_new_f{place}"] = f"_new_{field.name}"
            scope[f"_new_{field.name}"] = field.default_factory
        elif (default := field.default) is not dataclasses.MISSING and not field.init:
            names[f"_given_f{place}"] = f"_given_{field.name}"
            scope[f"_given_{field.name}"] = default
        if not field.init or (default is dataclasses.MISSING and "_new" not in _value_source(field)):
            continue
        if field.kw_only:
            keyword_defaults[field.name] = default
        else:
            defaults.append(default)
    code = _compile_init(shape, frozen, hasattr(cls, "__post_init__"))
    code = code.replace(
        co_varnames=tuple(names.get(name, name) for name in code.co_varnames),
        co_names=tuple(names.get(name, name) for name in code.co_names),
        co_consts=tuple(names.get(const, const) if isinstance(const, str) else const for const in code.co_consts),
    )
    init = FunctionType(code, scope, "__init__", tuple(defaults) or None)
    init.__kwdefaults__ = keyword_defaults or None
    init.__annotations__ = {**{field.name: field.type for field in fields if field.init}, "return": None}
    return init


def _value_source(field: dataclasses.Field[Any]) -> str:
    """Return a code for the origin of a field's value.

    "taken" is an argument, "_given" a default that cannot be passed. "taken_new" and "_new" are the same for a field
    with a default factory. The code is empty for a field without a value.
    """
    made_anew = "_new" if field.default_factory is not dataclasses.MISSING else ""
    if field.init:
        return f"taken{made_anew}"
    return made_anew or ("_given" if field.default is not dataclasses.MISSING else "")


@cache
def _compile_init(shape: tuple[tuple[str, bool], ...], frozen: bool, post_init: bool) -> CodeType:
    """Return the code of an ``__init__`` whose fields are called ``f0``, ``f1``..., to be renamed for each class.

    ``shape`` has a pair for each field: the origin of its value (see ``_value_source``), and whether it is
    keyword-only. Compiling takes ten times as long as renaming, and many classes have the same shape.
    """
    positional: list[str] = []
    keyword_only: list[str] = []
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
            (keyword_only if kw_only else positional).append(name)
        body.append(f" _set(self,{name!r},{value})" if frozen else f" self.{name}={value}")
    if post_init:
        body.append(" self.__post_init__()")
    parameters = ",".join(["self", *positional, *(["*", *keyword_only] if keyword_only else [])])
    scope: dict[str, Any] = {}
    exec(f"def __init__({parameters}):\n" + "\n".join(body or [" pass"]), scope)  # noqa: S102 - of names of ours
    code: CodeType = scope["__init__"].__code__
    return code


def _make_values_getter(names: Iterable[str]) -> ValuesGetter:
    """Return a function that returns the named attributes of an object, always as a tuple."""
    names_tuple = tuple(names)
    if len(names_tuple) > 1:
        return cast(ValuesGetter, attrgetter(*names_tuple))
    return lambda instance: tuple(getattr(instance, name) for name in names_tuple)


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
    """Return a ``__setattr__`` or ``__delattr__`` that raises FrozenInstanceError for the fields ``names`` of ``cls``.

    Instances of subclasses may set other attributes.
    """
    plain = "__setattr__" if action == "assign to" else "__delattr__"

    def refused(self: object, name: str, *value: object) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot {action} field {name!r}")
        getattr(super(cls, self), plain)(name, *value)

    return refused


@cache
def _field_names(cls: Any) -> tuple[str, ...]:
    """Return the names of the fields of a class; cached, since each pickled value needs them."""
    return tuple(field.name for field in dataclasses.fields(cls))


def _get_state(self: object) -> list[object]:
    """Return the values of all fields, for copies and pickles: a frozen instance cannot be set field by field."""
    made: Any = type(self)
    return [getattr(self, name) for name in _field_names(made)]


def _set_state(self: object, state: list[object]) -> None:
    made: Any = type(self)
    for name, value in zip(_field_names(made), state, strict=True):
        object.__setattr__(self, name, value)
