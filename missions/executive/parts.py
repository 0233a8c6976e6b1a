"""Health of the parts of a robot, in four levels, with the age of the last reading."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import field
from math import isfinite
from typing import Any, Literal

from behaviours.robot import Robot
from drivers.api import Device, Health, JointState, Latchable, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.kinds import KINDS
from missions.executive.events import Event, ReflexFired

Level = Literal["OK", "WARN", "ERROR", "STALE"]
"""Health level of a part.

OK: it works; WARN: it needs attention; ERROR: disconnected or refusing commands; STALE: no new readings.
"""

MISSES_WINDOW = 2.0
"""Seconds over which the missed replies of a device are counted."""

PICTURE_TIMEOUT = 2.0
"""Maximum age in seconds of the last processed picture."""

MISSES_PREFIX = "misses"
"""Prefix of the names of a driver's counters that count missed replies."""

BATTERY_TEXTS = {"battery_critical": "its battery is critical", "battery_low": "its battery is low"}
"""Texts for the battery conditions of the base, the worse one first."""


@dataclass(frozen=True, slots=True)
class PartStatus:
    """Health of a part; ``age`` of its newest reading in seconds, None without one.

    ``values`` are the figures of that reading in SI units (``battery`` in percent, ``hottest`` in degrees Celsius).
    ``detail`` is the problem, ``hint`` the remedy; both are empty if the level is OK.
    """

    part: str
    level: Level
    age: float | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    detail: str = ""
    hint: str = ""


@dataclass(frozen=True, slots=True)
class Measurement:
    """Newest reading of a part.

    ``stamp`` is None before the first one. ``problem`` lists data that are missing or too old; may be empty.
    """

    stamp: float | None
    values: Mapping[str, float] = field(default_factory=dict)
    problem: str = ""


class PartsMonitor:
    """Watches the ``devices`` of a ``robot``, by part; the battery state comes from events.

    ``last_picture_stamp`` returns the stamp of the last processed picture, None before the first.
    """

    def __init__(
        self, devices: Mapping[str, Device], robot: Robot, last_picture_stamp: Callable[[], float | None] | None = None
    ) -> None:
        self._devices = devices
        self._robot = robot
        self._last_picture_stamp = last_picture_stamp
        self._battery: frozenset[str] = frozenset()
        self._misses: deque[tuple[float, Mapping[str, int]]] = deque()  # time, and total of missed readings by part

    def on_event(self, event: Event) -> None:
        """Update the battery state if ``event`` says that the battery is low or critical, or no longer so."""
        if isinstance(event, ReflexFired) and event.condition in BATTERY_TEXTS:
            what = frozenset({event.condition})
            self._battery = self._battery | what if event.on else self._battery - what

    def check(self, now: float) -> tuple[PartStatus, ...]:
        """Return the status of each part at ``now``, in seconds of the devices' clock.

        In simulated time, call it from the simulation thread.
        """
        health = {part: device.health() for part, device in self._devices.items()}
        self._misses.append((now, {part: _missed_replies(each) for part, each in health.items()}))
        while now - self._misses[0][0] > MISSES_WINDOW:
            self._misses.popleft()
        return tuple(self._status(part, each, now) for part, each in health.items())

    def _status(self, part: str, health: Health, now: float) -> PartStatus:
        measured = self._measurement(part, now)
        age = None if measured is None or measured.stamp is None else max(0.0, now - measured.stamp)
        figures = {} if measured is None else measured.values
        values = {name: value for name, value in figures.items() if isfinite(value)}

        def state(level: Level, detail: str = "", hint: str = "") -> PartStatus:
            return PartStatus(part, level, age, values, detail.removeprefix(f"{part}: "), hint)

        if not health.online:
            return state("ERROR", health.detail or "disconnected", health.hint)
        if refusal := self._refusal(part):
            return state("ERROR", refusal)
        if measured is not None and measured.problem:
            return state("STALE", measured.problem, health.hint)
        if concern := health.detail or self._warning(part):
            return state("WARN", concern, health.hint)
        return state("OK")

    def _refusal(self, part: str) -> str:
        """Return the reason why a connected part does not move; empty if it does."""
        device = self._devices[part]
        if isinstance(device, Latchable) and device.latched:
            return f"stopped until it is enabled: {device.latched}"
        if part != "base":
            return ""
        return BATTERY_TEXTS["battery_critical"] if "battery_critical" in self._battery else ""

    def _warning(self, part: str) -> str:
        """Return the warning about a working part; empty if there is none."""
        if part == "base" and self._battery:
            return BATTERY_TEXTS["battery_low"]
        before, after = self._misses[0][1].get(part, 0), self._misses[-1][1].get(part, 0)
        return f"{after - before} replies missed within {MISSES_WINDOW:g} s" if after > before else ""

    def _measurement(self, part: str, now: float) -> Measurement | None:
        """Return the newest reading of a part; None if it measures nothing, or has no reading yet."""
        robot, kind = self._robot, part
        if (other := self._robot.extra_parts.get(part)) is not None:
            robot, kind = robot.with_named_parts({other.kind: part}), other.kind
        if kind == "camera":
            stamp = None if self._last_picture_stamp is None else self._last_picture_stamp()
            late = stamp is not None and now - stamp > PICTURE_TIMEOUT
            return None if stamp is None else Measurement(stamp, problem="no new picture" if late else "")
        declared = KINDS.get(kind)
        if declared is None or not declared.reading_method:
            return None
        device = getattr(robot, f"{declared.field}_part")
        return None if device is None else _measurement_of(getattr(device, declared.reading_method)())


def _measurement_of(found: Reading[Any] | Mapping[str, Reading[JointState]]) -> Measurement | None:
    if isinstance(found, Mapping):
        return _joints_measurement(found)
    if found.value is None:
        return Measurement(None, problem="no reading yet")
    return Measurement(found.stamp, found.value.figures(), "" if found.good else "no new reading")


def _joints_measurement(readings: Mapping[str, Reading[JointState]]) -> Measurement | None:
    """Return the combined reading of all joints; its age is that of the oldest."""
    if not readings:
        return None
    known = [(reading.stamp, reading.value) for reading in readings.values() if reading.value is not None]
    values = {"joints": float(len(readings)), "moving": float(sum(state.moving for _, state in known))}
    if known:
        values["hottest"] = max(state.temperature for _, state in known)
    silent = ", ".join(name for name, reading in readings.items() if not reading.good)
    return Measurement(min((stamp for stamp, _ in known), default=None), values, f"silent: {silent}" if silent else "")


def _missed_replies(health: Health) -> int:
    """Return the number of missed replies of a device: its total, or the sum over its servos."""
    counters = health.counters
    if MISSES_PREFIX in counters:
        return counters[MISSES_PREFIX]
    return sum(count for name, count in counters.items() if name.startswith(MISSES_PREFIX))
