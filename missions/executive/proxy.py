"""Proxies of parts, generated from their protocols: they cache queries, and report, record and permit commands.

One class is compiled for each protocol, from the marks of its members (``drivers.api.marks``). In it, a query without
arguments is only a dict lookup, since such queries are the most frequent operation of a tick. A command is one method.
The order of a command is: report, record, permit, device; some commands are reported after the device accepted them.
"""

import linecache
from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from functools import cache, partial
from inspect import Parameter
from types import MappingProxyType
from typing import Any, TypeVar

from behaviours.leaf import Leaf
from drivers.api import Base, Device, Head, Joints, Sounds
from drivers.api.marks import CommandMark, ProtocolMember, members
from drivers.errors import BadRequest, DriverError
from missions.executive.tick_cache import PartCache, TickCache

CommandValues = Mapping[str, object]
"""Values of a command by name, as its event contains them, such as the speed of ``drive``."""

CommandReport = Callable[[str, str, CommandValues], None]
"""Function that is called with each command of a leaf: name of the part, name of the leaf, values of the command."""


def _drive(arguments: tuple[Any, ...], given: Any) -> CommandValues:
    """Return the velocity that the base applies, and the requested one if limits changed it, as event values."""
    velocity = arguments[0]
    values = {"linear": round(given.linear, 4), "angular": round(given.angular, 4)}
    if given != velocity:
        values |= {"requested_linear": round(velocity.linear, 4), "requested_angular": round(velocity.angular, 4)}
    return values


def _stop(_: tuple[Any, ...], __: Any) -> CommandValues:
    return {"linear": 0.0, "angular": 0.0}


def _tune(arguments: tuple[Any, ...], _: Any) -> CommandValues:
    return {"tune": str(arguments[0])}


def _look(_: tuple[Any, ...], accepted: Any) -> CommandValues:
    return {"pan": round(accepted.pan, 4), "tilt": round(accepted.tilt, 4)}


def _move(_: tuple[Any, ...], accepted: Any) -> CommandValues:
    return {joint: round(goal, 4) for joint, goal in accepted.items()}


def _follow(arguments: tuple[Any, ...], _: Any) -> CommandValues:
    return {"follow": {coupling.follower: coupling.leader for coupling in arguments[0]}}


def _recover(_: tuple[Any, ...], recovered: Any) -> CommandValues:
    return {"recover": list(recovered)}


REPORTED_VALUES: Mapping[Callable[..., object], Callable[[tuple[Any, ...], Any], CommandValues]] = MappingProxyType(
    {
        Base.drive: _drive,
        Base.stop: _stop,
        Sounds.play: _tune,
        Head.look: _look,
        Joints.move: _move,
        Joints.follow: _follow,
        Joints.recover: _recover,
    }
)
"""Functions that return the values of a command for its event, by method, from the command's arguments and result.

The result is None if the command is reported before the device gets it. Methods without such a function are reported by
name, with their arguments.
"""


T = TypeVar("T")

Permit = Callable[[Device, Leaf | None], None]
"""Called with a device before a command of a leaf, if any, moves it; raises DeviceFault to refuse."""


def permit_all(device: Device, leaf: Leaf | None) -> None:
    """Permit every command."""
    del device, leaf


class Proxy:
    """Base class of all proxies: the ``device``, its cached values in ``memo``, and the report of its commands.

    ``_leaf`` is the leaf that uses the proxy, and ``_tell`` the function that reports its commands; both may be None.
    """

    CAPABILITIES: tuple[str, ...] = ()
    __slots__ = ("_answers", "_device", "_leaf", "_memo", "_permit", "_source", "_tell")

    def __init__(self, device: Any, memo: PartCache, permit: Permit = permit_all) -> None:
        self._device, self._memo, self._permit = device, memo, permit
        self._answers = memo.tick_cache
        self._source = ""
        self._leaf: Leaf | None = None
        self._tell: CommandReport | None = None

    def for_leaf(self, source: str, tell: CommandReport, leaf: Leaf | None = None) -> Any:
        """Return a copy of this proxy for one leaf, with the same device and cache.

        ``tell`` is called with each command and ``source``, the leaf's name. ``permit_motion`` of ``leaf`` is called
        before each command that moves the device or makes it limp, ``on_motion`` after each that has moved it.
        """
        leafs = object.__new__(type(self))
        for name in (*Proxy.__slots__, *self.__slots__):
            setattr(leafs, name, getattr(self, name))
        leafs._source, leafs._tell, leafs._leaf = source, tell, leaf
        for name in self.CAPABILITIES:
            if (found := getattr(self, name)) is not None:
                setattr(leafs, name, found.for_leaf(source, tell, leaf))
        return leafs


def make_proxy(part: str, protocol: type, device: T, cache: TickCache, permit: Permit = permit_all) -> T:
    """Return a proxy of ``device`` with this protocol; ``cache`` knows it by the name of its ``part``.

    ``permit`` is called before each command that moves the device.
    """
    known = members(protocol).values()
    questions = {each.name: _query_of(device, each) for each in known if each.kind in {"reading", "property"}}
    passive = getattr(
        device, "passive_view", device
    )  # a device that is paused without queries is sampled for the record only
    memo = cache.add_part(
        part,
        questions,
        sampled={each.name: _query_of(passive, each) for each in known if each.is_sampled},
        fixed=[each.name for each in known if each.is_fixed],
    )
    proxy: T = proxy_class(protocol)(device, memo, permit)
    return proxy


def _query_of(device: object, member: ProtocolMember) -> Callable[[], object]:
    """Return a function that reads the value of ``member``, a property or a method without arguments, from a device."""
    if member.kind == "property":
        return partial(getattr, device, member.name)
    reading: Callable[[], object] = getattr(device, member.name)
    return reading


def for_leaf(part: T, source: str, tell: CommandReport, leaf: Leaf | None = None) -> T:
    """Return the proxy of a part for one leaf; see ``Proxy.for_leaf``."""
    if not isinstance(part, Proxy):
        raise TypeError(f"{part!r} is not a proxy: call `with_proxies` first")
    leafs: T = part.for_leaf(source, tell, leaf)
    return leafs


@cache
def proxy_class(protocol: type) -> type[Any]:
    """Return the proxy class for a protocol; tracebacks show its generated source."""
    writer = _ProxySourceWriter(protocol)
    source = "\n".join(writer.lines()) + "\n"
    file = f"<proxy of {protocol.__module__}.{protocol.__qualname__}>"
    linecache.cache[file] = len(source), None, source.splitlines(keepends=True), file
    exec(compile(source, file, "exec"), writer.names)  # noqa: S102 - the source is of our own writing
    generated: type[Any] = writer.names[f"{protocol.__name__}Proxy"]
    return generated


class _ProxySourceWriter:
    """Generates the Python source of a proxy class for a protocol; ``names`` are the globals of that source."""

    def __init__(self, protocol: type) -> None:
        self._protocol = protocol
        self._members = members(protocol).values()
        self.names: dict[str, Any] = {
            "Proxy": Proxy,
            "BadRequest": BadRequest,
            "DriverError": DriverError,
            "partial": partial,
            "__name__": __name__,
        }

    def lines(self) -> Iterator[str]:
        """Yield the source lines of the proxy class."""
        readings = [each.name for each in self._members if each.kind == "reading"]
        direct = [each.name for each in self._members if each.kind == "direct property"]
        optional = {each.name: each.protocol for each in self._members if each.kind == "capability"}
        yield f"class {self._protocol.__name__}Proxy(Proxy):"
        yield f"    __slots__ = {(*direct, *readings, *optional)!r}"
        yield f"    CAPABILITIES = {(*optional,)!r}"
        yield "    def __init__(self, device, memo, permit):"
        yield "        Proxy.__init__(self, device, memo, permit)"
        for name in direct:
            yield f"        self.{name} = device.{name}"
        for name in readings:
            yield f"        self.{name} = partial(memo.__getitem__, {name!r})"
        for name, protocol in optional.items():
            # Its commands belong to the device around it: they share its cache, and move that device.
            known = self._bind_name(f"{name}_class", partial(proxy_class, protocol))
            yield f"        found, permit_it = device.{name}, lambda _, leaf: permit(device, leaf)"
            yield f"        self.{name} = None if found is None else {known}()(found, memo, permit_it)"
        for member in self._members:
            match member.kind:
                case "property":
                    yield "    @property"
                    yield f"    def {member.name}(self):"
                    yield f"        return self._memo[{member.name!r}]"
                case "question":
                    yield self._signature(member)
                    yield f"        ask = self._device.{member.name}"
                    yield f"        return self._memo.query({member.name!r}, ask, {_parameter_names(member)})"
                case "direct method":
                    yield self._signature(member)
                    yield "        if self._tell is not None:"
                    why = f"a behaviour cannot {member.name} a part of its robot"
                    yield f"            raise BadRequest(self.name + {': ' + why!r})"
                    yield f"        return self._device.{member.name}({_call_arguments(member)})"
                case "command" if member.command is not None:
                    yield self._signature(member)
                    yield from (f"        {line}" for line in self._body(member, member.command))

    def _signature(self, member: ProtocolMember) -> str:
        parameters, star = ["self"], False
        for each in member.parameters:
            if each.kind is Parameter.KEYWORD_ONLY and not star:
                parameters.append("*")
                star = True
            default = ""
            if each.default is not Parameter.empty:
                default = f"={self._bind_name(f'{member.name}_{each.name}_default', each.default)}"
            parameters.append(each.name + default)
        return f"    def {member.name}({', '.join(parameters)}):"

    def _body(self, member: ProtocolMember, command: CommandMark) -> Iterator[str]:
        name, arguments = member.name, f"({_parameter_names(member)}{',' if member.parameters else ''})"
        yield "tell = self._tell"
        yield from self._convert_arguments(member, command)
        # A command that the leaf must not give is neither reported nor recorded, as a rerun does not give it either.
        if command.moves or command.releases:
            yield "leaf = self._leaf"
        if command.releases:
            yield "if leaf is not None:"
            yield "    leaf.permit_motion()"
        yield from self._if_moving(member, command, "if leaf is not None:", "    leaf.permit_motion()")
        if command.report == "before":
            yield from self._report_lines(member, command, arguments, "None")
        yield "memo, answers = self._memo, self._answers"
        yield "memo.clear()"
        yield "if answers.errors:"
        yield "    answers.clear_errors(memo.part)"
        yield "try:"
        yield from (f"    {line}" for line in self._if_moving(member, command, "self._permit(self._device, leaf)"))
        yield f"    result = self._device.{name}({_call_arguments(member)})"
        yield "except DriverError as error:"
        yield f"    memo.record({name!r}, {arguments}, error)"
        yield "    raise"
        yield from self._if_moving(member, command, "if leaf is not None:", "    leaf.on_motion(memo.part)")
        yield "if answers.is_recording and answers.is_open:"
        yield f"    answers.answers.append((memo.part, {name!r}, {arguments}, result))"
        if command.report == "after":
            yield from self._report_lines(member, command, arguments, "result")
        yield "return result"

    def _if_moving(self, member: ProtocolMember, command: CommandMark, *lines: str) -> Iterator[str]:
        """Yield ``lines`` of the source for a command that moves the device, under a condition if only some do."""
        if callable(command.moves):
            yield f"if {self._bind_name(f'{member.name}_moves', command.moves)}({_parameter_names(member)}):"
            yield from (f"    {line}" for line in lines)
        elif command.moves:
            yield from lines

    def _convert_arguments(self, member: ProtocolMember, command: CommandMark) -> Iterator[str]:
        """Yield the source lines that convert the arguments of a command before use."""
        if command.leaf_converters:
            yield "if tell is not None:"
            for parameter, change in command.leaf_converters.items():
                yield f"    {parameter} = {self._bind_name(f'{member.name}_{parameter}_as_leaf', change)}({parameter})"
        for each in member.parameters:
            if (keep := command.converters.get(each.name)) is not None:
                converted = f"{self._bind_name(f'{member.name}_{each.name}_kept', keep)}({each.name})"
                absent = f"None if {each.name} is None else " if each.default is None else ""
                yield f"{each.name} = {absent}{converted}"

    def _report_lines(self, member: ProtocolMember, command: CommandMark, arguments: str, result: str) -> Iterator[str]:
        if member.function in REPORTED_VALUES:
            values = (
                f"{self._bind_name(f'{member.name}_told', REPORTED_VALUES[member.function])}({arguments}, {result})"
            )
        else:
            keys = [member.name, *(each.name for each in member.parameters[1:])]
            reported = [_reported_argument(each, command.converters) for each in member.parameters] or ["True"]
            values = f"{{{', '.join(f'{key!r}: {value}' for key, value in zip(keys, reported, strict=True))}}}"
        yield "if tell is not None:"
        yield f"    tell(self.name, self._source, {values})"

    def _bind_name(self, name: str, value: object) -> str:
        """Add a value to the globals of the generated source; return its name there."""
        self.names[f"_{name}"] = value
        return f"_{name}"


def _parameter_names(member: ProtocolMember) -> str:
    return ", ".join(each.name for each in member.parameters)


def _call_arguments(member: ProtocolMember) -> str:
    """Return the source text of the arguments in a call of the device's method."""
    keyword_only = Parameter.KEYWORD_ONLY
    return ", ".join(
        f"{each.name}={each.name}" if each.kind is keyword_only else each.name for each in member.parameters
    )


def _reported_argument(parameter: Parameter, kept: Mapping[str, Callable[[Any], object]]) -> str:
    """Return the source text that converts an argument to a JSON type for the event of a command.

    An argument that is None becomes True there, since None fields are left out of events. ``kept`` are the arguments
    that are converted to another type first, such as a tuple.
    """
    name, kind = parameter.name, parameter.annotation
    if kept.get(name) is tuple:
        text = f"list({name})"
    else:
        text = f"str({name})" if isinstance(kind, type) and issubclass(kind, StrEnum) else name
    return f"True if {name} is None else {text}" if parameter.default is None else text
