"""Events of a run, which `missions.executive.stream` delivers to its listeners."""

import json
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import ClassVar, TextIO

from py_trees.common import Status

from behaviours.node import Node
from drivers.api.fast_dataclass import dataclass

STATUS_WORDS = {
    Status.RUNNING: "running",
    Status.SUCCESS: "success",
    Status.FAILURE: "failure",
    Status.INVALID: "idle",
}
"""Words for the statuses of py_trees in events, tests and pictures."""

SUSPENDED = "suspended"
"""Status of a node that runs but waits, because a sensor does not report."""

SKIPPED = "skipped"
"""Status of a node whose behaviour did not start because an ``if`` was false."""


def status_word(node: Node) -> str:
    """Return the present status of a node as written in events."""
    if node.is_skipped:
        return SKIPPED
    return SUSPENDED if node.is_suspended else STATUS_WORDS[node.status]


def plain_status(word: str) -> str:
    """Return a status word with "skipped" replaced by "success": parents treat a skipped child as a success."""
    return STATUS_WORDS[Status.SUCCESS] if word == SKIPPED else word


@dataclass(slots=True)
class Event:
    """Event ``t`` seconds after the start of the run; ``event`` is the word for its type in JSON.

    Do not change an event, since all listeners share it. It is not a frozen dataclass, as that would take twice as long
    to create.
    """

    event: ClassVar[str] = ""
    t: float

    def as_dict(self) -> dict[str, object]:
        """Return the event as in files: ``event`` first, then its fields that are not None."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        values["t"] = round(self.t, 6)
        return {"event": self.event} | {name: value for name, value in values.items() if value is not None}


@dataclass(slots=True)
class Started(Event):
    """A mission has started."""

    event: ClassVar[str] = "started"
    mission: str
    file: str
    robot: str
    params: Mapping[str, object]


@dataclass(slots=True)
class Ticked(Event):
    """The root was ticked for the ``tick``-th time with this status; ``late`` is the delay in seconds."""

    event: ClassVar[str] = "tick"
    tick: int
    status: str
    late: float | None = None


@dataclass(slots=True)
class NodeChanged(Event):
    """A node has a new status; ``node`` is its key in the tree."""

    event: ClassVar[str] = "node_changed"
    tick: int
    node: str
    name: str
    kind: str
    line: int
    status: str
    reason: str


@dataclass(slots=True)
class PerceptSeen(Event):
    """A camera frame was searched; the event holds the faces, things and markers found in it.

    ``stamp`` is the time of the frame, in seconds since the start of the run.
    """

    event: ClassVar[str] = "percept"
    stamp: float
    faces: tuple[Mapping[str, object], ...]
    things: tuple[Mapping[str, object], ...] | None = None
    markers: tuple[Mapping[str, object], ...] | None = None


@dataclass(slots=True)
class CommandSent(Event):
    """A part received a command from a behaviour, from ``safety`` (its reflexes), or from ``teleop``.

    If the command was limited, ``values`` also has the requested values, and a ``reason``.
    """

    event: ClassVar[str] = "command"
    tick: int
    to: str
    source: str
    values: Mapping[str, object]


@dataclass(slots=True)
class VariableSet(Event):
    """A variable has a new value; ``scope`` is the key of the sub-mission's node, empty for the main mission.

    Params are reported once, at the start. The value is None if it is unknown or deleted. ``dimension`` belongs to a
    quantity ("length"), whose value is in SI units.
    """

    event: ClassVar[str] = "variable"
    tick: int
    scope: str
    name: str
    value: object
    dimension: str | None = None


@dataclass(slots=True)
class ReflexFired(Event):
    """A condition of the base begins, or ends if ``on`` is False: a contact, a hazard, a stop, a low battery.

    ``condition`` is one of ``missions.executive.guard.REFLEXES``. ``where`` has details: the sides of a bumper, the
    number of a button, the reason of a stop, the battery percentage.
    """

    event: ClassVar[str] = "reflex"
    tick: int
    condition: str
    where: str
    on: bool


@dataclass(slots=True)
class FaultRaised(Event):
    """A part of the robot reports a change of its state: ``status`` is ``offline``, ``online`` or ``fault``."""

    event: ClassVar[str] = "fault"
    part: str
    status: str
    detail: str
    hint: str = ""

    @property
    def detail_without_part(self) -> str:
        """The detail without the name of the part."""
        return self.detail.removeprefix(f"{self.part}: ")


@dataclass(slots=True)
class Logged(Event):
    """A line for people.

    ``level`` is a lower-case level of Python's logging, ``voice`` for speech of the robot, or ``person`` for speech in
    a simulated world ("Anna: Hello").
    """

    event: ClassVar[str] = "log"
    level: str
    text: str


@dataclass(slots=True)
class Notified(Event):
    """The mission sends a notice to people: the behaviour `notify`."""

    event: ClassVar[str] = "notice"
    tick: int
    text: str


@dataclass(slots=True)
class Ended(Event):
    """The mission has ended and the robot is at rest."""

    event: ClassVar[str] = "ended"
    mission: str
    result: str
    reason: str
    seconds: float
    ticks: int


# Events of a run as lines of JSON, for other programs.


def json_value(value: object) -> object:
    """Return ``value`` as JSON types: objects by their fields, non-finite numbers as None, anything else as text."""
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return value if isfinite(value) else None
        case Mapping():
            return {str(name): json_value(each) for name, each in value.items()}
        case list() | tuple() | set() | frozenset():
            return _json_values(value)
        case _ if is_dataclass(value):
            return {field.name: json_value(getattr(value, field.name)) for field in fields(value)}
        case _:
            return str(value)


def _json_values(values: Collection[object]) -> list[object]:
    return [json_value(value) for value in values]


class JsonLinesWriter:
    """Listener that writes events as JSON lines, flushed one by one, so that a killed run leaves complete lines.

    ``is_complete`` is False once an event could not be written.
    """

    def __init__(self, file: TextIO) -> None:
        self.is_complete = True
        self._file = file

    def __call__(self, event: Event) -> None:
        line = json.dumps(event.as_dict(), default=json_value, ensure_ascii=False) + "\n"
        self.is_complete = False
        self._file.write(line)
        self._file.flush()
        self.is_complete = True
