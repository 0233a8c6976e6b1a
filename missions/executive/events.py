"""The one stream of events that a run makes, and everything else listens to."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from threading import RLock
from typing import ClassVar, TextIO

from py_trees.common import Status

STATUS_WORDS = {
    Status.RUNNING: "running",
    Status.SUCCESS: "success",
    Status.FAILURE: "failure",
    Status.INVALID: "idle",
}
"""How a status is written in events, tests and pictures."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened ``t`` seconds after the start of the run. ``event`` names its kind in files."""

    event: ClassVar[str] = ""
    t: float

    def as_dict(self) -> dict[str, object]:
        """Return it as it is written to a file: ``event`` first, then its fields; what is None is left out."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        values["t"] = round(self.t, 6)
        return {"event": self.event} | {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True, slots=True)
class Started(Event):
    """A mission begins."""

    event: ClassVar[str] = "started"
    mission: str
    file: str
    robot: str
    params: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Ticked(Event):
    """The root was ticked for the ``tick``-th time, with this result; ``late`` says by how many seconds too late."""

    event: ClassVar[str] = "tick"
    tick: int
    status: str
    late: float | None = None


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class PerceptSeen(Event):
    """Perception has searched a frame, taken at ``stamp`` (seconds since the start)."""

    event: ClassVar[str] = "percept"
    stamp: float
    faces: tuple[Mapping[str, object], ...]


@dataclass(frozen=True, slots=True)
class CommandSent(Event):
    """A behaviour, or the executive itself, has commanded a part of the robot."""

    event: ClassVar[str] = "command"
    tick: int
    to: str
    source: str
    values: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class FaultRaised(Event):
    """A device tells of itself (``what`` is ``offline``, ``online`` or ``fault``), or the executive of an overrun."""

    event: ClassVar[str] = "fault"
    part: str
    what: str
    detail: str
    hint: str = ""


@dataclass(frozen=True, slots=True)
class Ended(Event):
    """The mission is over and the robot at rest."""

    event: ClassVar[str] = "ended"
    mission: str
    result: str
    reason: str
    seconds: float
    ticks: int


Listener = Callable[[Event], None]


@dataclass(slots=True)
class Stream:
    """Passes each event to every listener, in one order, from whichever thread it comes."""

    listeners: list[Listener] = field(default_factory=list)
    _lock: RLock = field(default_factory=RLock)

    def emit(self, event: Event) -> None:
        """Tell all listeners. One that raises OSError (a full disk) is told no more; the run goes on."""
        with self._lock:
            for listener in list(self.listeners):
                try:
                    listener(event)
                except OSError:
                    self.listeners.remove(listener)


class JsonLines:
    """Writes events to a text file, one JSON object a line, each flushed, so that a killed run keeps its past."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def __call__(self, event: Event) -> None:
        """Write one event."""
        self._file.write(json.dumps(event.as_dict(), default=str, ensure_ascii=False) + "\n")
        self._file.flush()
