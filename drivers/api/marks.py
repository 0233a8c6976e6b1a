"""Marks at the members of a part's protocol: from them its proxy, its replay and its test double are generated.

A member without a mark is asked. A method that is asked and takes no argument is sampled for the record where nobody
asks it; ``Annotated[..., UNSAMPLED]`` as what it returns says that it is not.
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
"""Marks what a method returns, where that is not sampled."""

_MARK = "mark"


def reply_none(*_: object) -> None:
    """Return None: what replay takes for the answer to a changed command that answers nothing."""


@dataclass(frozen=True, slots=True)
class CommandMark:
    """How a command is told, permitted and recorded.

    ``report`` says when it is told of: before the device has it, after the device has accepted it, or never. ``moves``
    says whether it sets something moving, and so needs a permit: always, never, or as that says of its arguments.
    ``converters`` makes of an argument what is recorded, and what the device is given. ``leaf_converters`` makes of an argument what
    it is where a mission's leaf commands; it may raise BadRequest. ``default_reply`` takes the part and the arguments, and
    returns what replay takes for the answer to a command that is not as it was recorded.
    """

    report: Literal["before", "after", "never"]
    moves: bool | Callable[..., bool] = False
    converters: Mapping[str, Callable[[Any], object]] = field(default_factory=dict)
    leaf_converters: Mapping[str, Callable[[Any], object]] = field(default_factory=dict)
    default_reply: Callable[..., object] = reply_none


def command(
    report: Literal["before", "after", "never"],
    *,
    moves: bool | Callable[..., bool] = False,
    converters: Mapping[str, Callable[[Any], object]] | None = None,
    leaf_converters: Mapping[str, Callable[[Any], object]] | None = None,
    default_reply: Callable[..., object] = reply_none,
) -> Callable[[F], F]:
    """Mark a method as a command; see ``CommandMark``."""
    return _set_mark(CommandMark(report, moves, converters or {}, leaf_converters or {}, default_reply))


def fixed(member: F) -> F:
    """Mark the getter of a property that never changes: it is sampled once."""
    return _set_mark("fixed")(member)


def capability(member: F) -> F:
    """Mark the getter of an optional capability: an object with a protocol of its own, or None."""
    return _set_mark("capability")(member)


def direct(member: F) -> F:
    """Mark a member that is the device's own: neither told nor recorded."""
    return _set_mark("direct")(member)


def _set_mark(mark: object) -> Callable[[F], F]:
    def decorate(member: F) -> F:
        member.__dict__[_MARK] = mark
        return member

    return decorate


@dataclass(frozen=True, slots=True)
class ProtocolMember:
    """A member of a protocol. ``kind`` is how a proxy treats it: a ``reading`` is a question without arguments.

    ``command`` is there for commands alone, ``parameters`` for methods, ``protocol`` for capabilities. ``is_sampled`` is
    True for what is sampled each time, ``fixed`` for what is sampled once.
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
    """Return the members of a protocol by name, those of what it inherits first, in the order of the source."""
    found: dict[str, ProtocolMember] = {}
    for each in reversed(protocol.__mro__):
        for name, value in vars(each).items():
            if not name.startswith("_") and isinstance(value, FunctionType | property):
                found[name] = _make_member(name, value)
    return found


def commands(protocol: type) -> frozenset[str]:
    """Return the names of the command methods of a protocol and of its capabilities; all others are queries."""
    known = members(protocol).values()
    own = frozenset(each.name for each in known if each.command is not None)
    return own.union(*(commands(each.protocol) for each in known if each.protocol is not None))


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
