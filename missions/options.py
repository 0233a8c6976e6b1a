"""Declarations of command options: the fields of a dataclass, each with type, bounds, default and help.

::

    @dataclass(frozen=True, kw_only=True)
    class WalkOptions(RunOptions):
        steps: int = option("Number of steps.", default=10, low=1, group="Walking")

The command line, the studio's form, the Python API and the tables of the docs are generated from these declarations.
This module does not import click.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import field, fields
from functools import cache
from math import inf, isfinite
from typing import Any, Literal, TypeVar

from drivers.api.fast_dataclass import dataclass

Kind = Literal[
    "text",
    "flag",
    "choice",
    "integer",
    "number",
    "duration",
    "frequency",
    "size",
    "path",
    "file",
    "params",
    "ports",
    "mission",
    "robot",
    "world",
]
"""Type of an option's value.

``mission``, ``robot`` and ``world`` are names or files; ``params`` and ``ports`` are NAME=VALUE; a ``duration`` is in
s, a ``frequency`` in Hz, a ``size`` in bytes; a ``file`` is a path that is not a folder.
"""


ROS2 = "ROS 2"
"""Heading in the help under which several features list their ROS 2 options."""


@dataclass(frozen=True, slots=True)
class Option:
    """Option of a command. ``low`` and ``high`` bound its value, ``among`` are the possible words.

    ``alone`` is the value that is used if the user writes the option without a value. ``group`` is the heading under
    which the help lists the option. Options that are not for a ``newcomer`` are listed only with ``--help-all``. An
    option with ``several`` can be repeated; its value is a tuple.
    """

    name: str
    flag: str
    kind: Kind
    help: str
    default: object = None
    low: float | None = None
    high: float | None = None
    among: tuple[str, ...] = ()
    metavar: str = ""
    alone: str = ""
    group: str = ""
    newcomer: bool = False
    several: bool = False
    hidden: bool = False

    def fault(self, value: object) -> str:
        """Return the error text if ``value`` is out of bounds or not an allowed word; empty if it is valid.

        For values from Python or the studio: click checks those of the command line.
        """
        if value is None or value == self.default:
            return ""
        if self.among and value not in self.among:
            return f"must be one of {', '.join(self.among)}, got {value!r}"
        if self.low is None and self.high is None:
            return ""
        low, high = -inf if self.low is None else self.low, inf if self.high is None else self.high
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            return f"must be a number, got {value!r}"
        return "" if low <= value <= high else f"must be {self.bounds}, got {value!r}"

    @property
    def bounds(self) -> str:
        """Bounds of the option's value as text, such as "from 1 to 10"; empty if the value is not bounded."""
        if self.low is not None and self.high is not None:
            return f"from {self.low:g} to {self.high:g}"
        return "" if self.low is None else f"at least {self.low:g}"


def option(
    help: str,  # noqa: A002 - it is the word for it
    kind: Kind = "text",
    *,
    default: object = None,
    flag: str = "",
    among: Collection[str] = (),
    **more: Any,
) -> Any:
    """Declare a field as an option. ``flag`` is its name on the command line, if not that of the field.

    Without a ``kind``, a default of False makes a flag, and ``among`` a choice. ``more`` are fields of ``Option``.
    """
    if default is False:
        kind = "flag"
    elif among:
        kind = "choice"
    made = {"help": help, "kind": kind, "flag": flag, "default": default, "among": tuple(among), **more}
    if isinstance(default, Mapping):
        return field(default_factory=lambda: dict(default), metadata={"option": made})
    return field(default=default, metadata={"option": made})


def options_of(cls: type) -> tuple[Option, ...]:
    """Return the options that the dataclass ``cls`` declares, in the order of its fields."""
    return _options_of(cls)


@cache
def _options_of(cls: Any) -> tuple[Option, ...]:
    found = []
    for each in fields(cls):
        if (made := each.metadata.get("option")) is not None:
            flag = made["flag"] or f"--{each.name.replace('_', '-')}"
            found.append(Option(each.name, **made | {"flag": flag}))
    return tuple(found)


def faults(values: object) -> Iterator[tuple[Option, str]]:
    """Yield each option whose value in the dataclass instance ``values`` is invalid, with the error text."""
    for each in options_of(type(values)):
        if fault := each.fault(getattr(values, each.name)):
            yield each, fault


T = TypeVar("T")


def make_options(cls: type[T], values: Mapping[str, object], **more: object) -> T:
    """Return an instance of the dataclass ``cls`` with the option ``values`` by name; None stands for the default.

    ``more`` are the values of fields that are not options.
    """
    options = {each.name: values[each.name] for each in options_of(cls) if values.get(each.name) is not None}
    return cls(**options, **more)
