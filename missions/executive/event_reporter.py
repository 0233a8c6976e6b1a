"""Converts notices, speech, views and commands of a robot, from their threads, into events of a run."""

import logging
import traceback
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from math import isfinite

from behaviours.run import RunState, log
from drivers.api import DeviceStatus, Source, Steering
from missions.executive.events import CommandSent, FaultRaised, Logged, PerceptSeen
from missions.executive.stream import EventStream
from perception.api import Face, Marker, Percept, Thing, View

OVERRIDE_SOURCES = frozenset({Source.SAFETY, Source.TELEOP})
"""Sources of base commands that take precedence over the mission: the reflexes, and a person who drives."""


class EventReporter:
    """Emits events of the robot to the ``stream`` of a ``run``, and wakes the run if a tick should follow."""

    def __init__(self, run: RunState, stream: EventStream) -> None:
        self._run = run
        self._stream = stream
        self._last_source: Source | None = None
        self._commands: dict[str, tuple[str, Mapping[str, object]]] = {}  # the last command of each part

    def on_notice(self, notice: DeviceStatus) -> None:
        """Emit a status change of a device."""
        self._stream.emit(FaultRaised(self._run.clock.now(), notice.device, notice.kind, notice.message, notice.hint))
        self._run.wake()

    def on_log(self, record: logging.LogRecord) -> None:
        """Emit an event for a record of Python's logging, with its traceback if it has one."""
        text = record.getMessage()
        if record.exc_info is not None:
            text += "\n" + "".join(traceback.format_exception(record.exc_info[1])).rstrip()
        self._stream.emit(Logged(self._run.clock.now(), record.levelname.lower(), text))

    def on_speech(self, text: str) -> None:
        """Emit speech of the robot."""
        self._stream.emit(Logged(self._run.clock.now(), "voice", text))

    def on_person_speech(self, who: str, text: str) -> None:
        """Emit speech of a person in a simulated world."""
        self._stream.emit(Logged(self._run.clock.now(), "person", f"{who}: {text}"))

    def on_view(self, view: View) -> None:
        """Emit the percepts of a picture."""
        self._stream.emit(percept_event(view, self._run.clock.now()))
        self._run.wake()

    def on_command(self, to: str, source: str, values: Mapping[str, object]) -> None:
        """Emit a command to the part ``to``, unless ``source`` sent the same command last.

        Commands to the voice are always emitted.
        """
        if to != "voice" and self._commands.get(to) == (source, values):
            return
        self._commands[to] = source, values
        self._stream.emit(CommandSent(self._run.clock.now(), self._run.tick, to, source, values))

    def on_safe_stop(self, parts: Collection[str]) -> None:
        """Emit the stop of a base that a leaf had set in motion and that was stopped for it."""
        source, values = self._commands.get("base", ("", {}))
        if "base" in parts and source not in OVERRIDE_SOURCES and (values.get("linear") or values.get("angular")):
            self.on_command("base", source, {"linear": 0.0, "angular": 0.0})

    def on_steering(self, steering: Steering) -> None:
        """Emit the velocity of the base if reflexes or a person decide it; leaves report their own commands.

        When the source stops commanding, its stop is emitted. A latched base is reported with source `safety`.
        """
        before, self._last_source = self._last_source, steering.source
        source = steering.source or (Source.SAFETY if steering.reason else before)
        if source not in OVERRIDE_SOURCES:
            return
        values: dict[str, object] = {"linear": round(steering.allowed.linear, 4)}
        values["angular"] = round(steering.allowed.angular, 4)
        if steering.allowed != steering.requested:
            values["requested_linear"] = round(steering.requested.linear, 4)
            values["requested_angular"] = round(steering.requested.angular, 4)
        if steering.reason:
            values["reason"] = steering.reason
        self.on_command("base", str(source), values)


@contextmanager
def capture_log(on_record: Callable[[logging.LogRecord], None]) -> Iterator[None]:
    """Pass the log records of missions and internal errors, from level INFO up, to ``on_record``.

    Inside the context, they are not printed by Python's logging.
    """
    handler, before = _LogHandler(on_record), (log.level, log.propagate)
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    log.propagate = False
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.level, log.propagate = before


class _LogHandler(logging.Handler):
    """Logging handler that calls a function."""

    def __init__(self, on_record: Callable[[logging.LogRecord], None]) -> None:
        super().__init__()
        self._on_record = on_record

    def emit(self, record: logging.LogRecord) -> None:
        self._on_record(record)


def percept_event(view: View, t: float) -> PerceptSeen:
    """Return the event at ``t`` seconds for the faces, things and markers in a view."""
    faces, things, markers = (
        tuple(_percept_dict(percept) for percept in kind) for kind in (view.faces, view.things, view.markers)
    )
    stamp = 0.0 if view.looked is None else view.looked
    return PerceptSeen(t, stamp, faces, things or None, markers or None)


def _percept_dict(percept: Percept) -> Mapping[str, object]:
    """Return a percept as in events: angles in radians, the box in pixels."""
    box = percept.box
    values = {
        "id": percept.id,
        "box": [round(value, 1) for value in (box.x, box.y, box.width, box.height)],
        "stamp": percept.stamp,
        "bearing": round(percept.bearing, 4),
        "elevation": round(percept.elevation, 4),
        "yaw": round(percept.yaw, 4),
        "pitch": round(percept.pitch, 4),
        "distance": round(percept.distance, 2) if isfinite(percept.distance) else None,
    }
    match percept:
        case Thing():
            return values | {"name": percept.name, "colour": percept.colour, "shape": percept.shape}
        case Marker():
            return values | {"name": percept.name, "number": percept.number, "heading": round(percept.heading, 4)}
        case Face() if percept.name:
            return values | {"name": percept.name}
        case _:
            return values
