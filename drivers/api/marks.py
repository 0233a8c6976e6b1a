"""Marks on the members of a part's protocol, from which its proxy, replay and test double are generated.

A member without a mark is a query. When a leaf calls a query, the result is recorded. Queries without arguments are
recorded in each tick, even if no leaf calls them. A query whose return type is ``Annotated[..., UNSAMPLED]`` is the
exception: it is recorded only when a leaf calls it.
"""

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import cache
from inspect import Parameter, signature
from types import FunctionType
from typing import Any, Literal, TypeVar, get_args

from drivers.api.fast_dataclass import dataclass

F = TypeVar("F", bound=Callable[..., object])

UNSAMPLED = "unsampled"
"""Annotation of the return type of a query that is not sampled for the record in each tick."""

_MARK = "mark"


def reply_none(*_: object) -> None:
    """Return None, as the reply in a replay to a command that differs from the record.

    It is the default of ``CommandMark.default_reply``.
    """


@dataclass(frozen=True, slots=True)
class CommandMark:
    """Mark of a command: how it is reported, permitted and recorded.

    ``report`` is the time of the report: before the device gets the command, after it has accepted it, or never.
    ``moves`` tells whether the command starts a motion and so needs a permit: always, never, or a function of its
    arguments. ``releases`` marks a command that makes joints limp, so that they may fall. ``converters``
    convert arguments for the record and the device. ``leaf_converters`` convert arguments of commands from a leaf; they
    may raise BadRequest. ``default_reply`` takes the part and the arguments, and returns the reply in a replay to a
    command that differs from the record.
    """

    report: Literal["before", "after", "never"]
    moves: bool | Callable[..., bool] = False
    converters: Mapping[str, Callable[[Any], object]] = field(default_factory=dict)
    leaf_converters: Mapping[str, Callable[[Any], object]] = field(default_factory=dict)
    default_reply: Callable[..., object] = reply_none
    releases: bool = False


def command(
    report: Literal["before", "after", "never"],
    *,
    moves: bool | Callable[..., bool] = False,
    converters: Mapping[str, Callable[[Any], object]] | None = None,
    leaf_converters: Mapping[str, Callable[[Any], object]] | None = None,
    default_reply: Callable[..., object] = reply_none,
    releases: bool = False,
) -> Callable[[F], F]:
    """Mark a method as a command; see ``CommandMark``."""
    return _set_mark(CommandMark(report, moves, converters or {}, leaf_converters or {}, default_reply, releases))


def fixed(member: F) -> F:
    """Mark the getter of a constant property, which is sampled once for the record."""
    return _set_mark("fixed")(member)


def capability(member: F) -> F:
    """Mark the getter of an optional capability: an object with its own protocol, or None."""
    return _set_mark("capability")(member)


def direct(member: F) -> F:
    """Mark a member that leaves call on the device itself: its proxy neither reports nor records the call."""
    return _set_mark("direct")(member)


def _set_mark(mark: object) -> Callable[[F], F]:
    def decorate(member: F) -> F:
        member.__dict__[_MARK] = mark
        return member

    return decorate


@dataclass(frozen=True, slots=True)
class ProtocolMember:
    """Member of a part's protocol. ``kind`` selects the code that the proxy has for it.

    A ``reading`` is a query without arguments, a ``question`` one with arguments. ``command`` is set for commands only,
    ``parameters`` for methods, ``protocol`` for capabilities. ``is_sampled`` is True for members that are recorded in
    each tick, ``is_fixed`` for those that are recorded once.
    """

    name: str
    kind: Literal["command", "reading", "question", "property", "direct method", "direct property", "capability"]
    function: Callable[..., object]
    parameters: tuple[Parameter, ...] = ()
    command: CommandMark | None = None
    is_sampled: bool = False
    is_fixed: bool = False
    protocol: type | None = None


@cache
def members(protocol: type) -> Mapping[str, ProtocolMember]:
    """Return the members of a protocol by name, inherited ones first, in the order of the source code."""
    result: dict[str, ProtocolMember] = {}
    for each in reversed(protocol.__mro__):
        for name, value in vars(each).items():
            if not name.startswith("_") and isinstance(value, FunctionType | property):
                result[name] = _make_member(name, value)
    return result


def commands(protocol: type) -> frozenset[str]:
    """Return the names of the command methods of a protocol and of its capabilities; all others are queries."""
    all_members = members(protocol).values()
    own = frozenset(each.name for each in all_members if each.command is not None)
    return own.union(*(commands(each.protocol) for each in all_members if each.protocol is not None))


def _make_member(name: str, value: FunctionType | property) -> ProtocolMember:
    if isinstance(value, property):
        getter: Any = value.fget
        mark = getter.__dict__.get(_MARK)
        if mark == "capability":
            optional, _ = get_args(getter.__annotations__["return"])
            return ProtocolMember(name, "capability", getter, protocol=optional)
        return ProtocolMember(
            name, "direct property" if mark == "direct" else "property", getter, is_fixed=mark == "fixed"
        )
    mark = value.__dict__.get(_MARK)
    _, *parameters = signature(value).parameters.values()
    if isinstance(mark, CommandMark):
        return ProtocolMember(name, "command", value, tuple(parameters), mark)
    if mark == "direct":
        return ProtocolMember(name, "direct method", value, tuple(parameters))
    if parameters:
        return ProtocolMember(name, "question", value, tuple(parameters))
    sampled = UNSAMPLED not in getattr(value.__annotations__.get("return"), "__metadata__", ())
    return ProtocolMember(name, "reading", value, is_sampled=sampled)
