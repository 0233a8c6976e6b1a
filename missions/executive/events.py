"""What happens in a run, as events: what `missions.executive.stream` tells its listeners."""

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
"""How a status is written in events, tests and pictures."""

SUSPENDED = "suspended"
"""How the status is written of a node that runs only because a sensor has not reported."""

SKIPPED = "skipped"
"""The same of one that has succeeded though its behaviour was not started, because its ``if`` was false."""


def status_word(node: Node) -> str:
    """Return how the status of a node is written now."""
    if node.is_skipped:
        return SKIPPED
    return SUSPENDED if node.is_suspended else STATUS_WORDS[node.status]


def plain_status(word: str) -> str:
    """Return a status as a parent takes it: what was skipped counts as success."""
    return STATUS_WORDS[Status.SUCCESS] if word == SKIPPED else word


@dataclass(slots=True)
class Event:
    """Something that happened ``t`` seconds after the start of the run. ``event`` names its kind in files.

    Not frozen, which would make each cost twice as much; not to be altered, since every listener gets the same one.
    """

    event: ClassVar[str] = ""
    t: float

    def as_dict(self) -> dict[str, object]:
        """Return it as it is written to a file: ``event`` first, then its fields; what is None is left out."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        values["t"] = round(self.t, 6)
        return {"event": self.event} | {name: value for name, value in values.items() if value is not None}


@dataclass(slots=True)
class Started(Event):
    """A mission begins."""

    event: ClassVar[str] = "started"
    mission: str
    file: str
    robot: str
    params: Mapping[str, object]


@dataclass(slots=True)
class Ticked(Event):
    """The root was ticked for the ``tick``-th time, with this result; ``late`` says by how many seconds too late."""

    event: ClassVar[str] = "tick"
    tick: int
    status: str
    late: float | None = None


@dataclass(slots=True)
class NodeChanged(Event):
    """A node has a new status. ``node`` is its stable id within the tree."""

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
    """Perception has searched a frame, taken at ``stamp`` (seconds since the start)."""

    event: ClassVar[str] = "percept"
    stamp: float
    faces: tuple[Mapping[str, object], ...]
    things: tuple[Mapping[str, object], ...] | None = None
    markers: tuple[Mapping[str, object], ...] | None = None


@dataclass(slots=True)
class CommandSent(Event):
    """Somebody has commanded a part of the robot: a behaviour, ``safety`` for its own reflexes, or ``teleop``.

    Where not all of it is in force, ``values`` also have what was ``wanted``, and may say ``because`` of what.
    """

    event: ClassVar[str] = "command"
    tick: int
    to: str
    source: str
    values: Mapping[str, object]


@dataclass(slots=True)
class VariableSet(Event):
    """A variable has another value: of the mission, or of the one inside it whose node has ``scope`` as its key.

    Params are told once, at the start. What is not known, or not there any more, is None. ``dimension`` is that of a
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
    """The base feels something, or is stopped or weak, from now on; or not any more, where ``on`` is False.

    ``what`` is one of ``missions.executive.guard.REFLEXES``. ``where`` says more of it: sides, the number of a button,
    why it is stopped, what is left in the battery.
    """

    event: ClassVar[str] = "reflex"
    tick: int
    what: str
    where: str
    on: bool


@dataclass(slots=True)
class FaultRaised(Event):
    """A part of the robot tells of itself: ``what`` is ``offline``, ``online`` or ``fault``."""

    event: ClassVar[str] = "fault"
    part: str
    what: str
    detail: str
    hint: str = ""

    @property
    def detail_without_part(self) -> str:
        """What is the matter, without the part's name, for where that stands beside it."""
        return self.detail.removeprefix(f"{self.part}: ")


@dataclass(slots=True)
class Logged(Event):
    """A line for people.

    ``level`` is a level of Python's logging in small letters, ``voice`` for what the robot says, or ``person`` for what
    somebody in a simulated world does ("Anna: Hello").
    """

    event: ClassVar[str] = "log"
    level: str
    text: str


@dataclass(slots=True)
class Notified(Event):
    """The mission has something to tell somebody who is not there."""

    event: ClassVar[str] = "notice"
    tick: int
    text: str


@dataclass(slots=True)
class Ended(Event):
    """The mission is over and the robot at rest."""

    event: ClassVar[str] = "ended"
    mission: str
    result: str
    reason: str
    seconds: float
    ticks: int


# The events of a run as lines of JSON, for other programs; values of a mission as JSON can hold them.


def json_value(value: object) -> object:
    """Return ``value`` in plain terms: an object by its fields, a number that is none as None, others in words."""
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
    """Writes events to a text file, one JSON object a line, each flushed, so that a killed run keeps its past.

    ``is_complete`` is False once an event could not be written.
    """

    def __init__(self, file: TextIO) -> None:
        self.is_complete = True
        self._file = file

    def __call__(self, event: Event) -> None:
        """Write one event."""
        line = json.dumps(event.as_dict(), default=json_value, ensure_ascii=False) + "\n"
        self.is_complete = False
        self._file.write(line)
        self._file.flush()
        self.is_complete = True
