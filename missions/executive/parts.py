"""How the parts of a robot are: each in one of four levels, with the age of what it has measured last."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import field
from math import isfinite
from typing import Any, Literal

from behaviours.robot import Robot
from drivers.api import Device, Health, JointState, Latching, Reading
from drivers.api.kinds import KINDS
from drivers.api.quick import dataclass
from missions.executive.events import Event, ReflexFired

Level = Literal["OK", "WARN", "ERROR", "STALE"]
"""The levels by which robots tell of themselves: fine; worth a look; not there, or refusing; silent for too long."""

MISSES_TIME = 2.0
"""Seconds for which replies that were missed are worth a look."""

PICTURE_TIME = 2.0
"""Seconds after which the newest picture that was searched is too old."""

MISSES = "misses"
"""How drivers begin the names of counters of replies that never came."""

BATTERY = {"battery_critical": "its battery is critical", "battery_low": "its battery is low"}
"""What reflexes tell of a base's battery, the worse first."""


@dataclass(frozen=True, slots=True)
class PartState:
    """How a part is. ``age`` is that of its newest reading in seconds, None where it has none.

    ``values`` are the figures of that reading, in SI units (``battery`` in percent, ``hottest`` in degrees Celsius).
    ``detail`` says what is the matter, ``hint`` what to try; both are empty for a part that is OK.
    """

    part: str
    level: Level
    age: float | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    detail: str = ""
    hint: str = ""


@dataclass(frozen=True, slots=True)
class Measured:
    """The newest reading of a part, as far as that matters here.

    ``stamp`` is None where there never was one. ``silent`` says what is missing or too old; it is empty where all is
    there.
    """

    stamp: float | None
    values: Mapping[str, float] = field(default_factory=dict)
    silent: str = ""


class PartsWatch:
    """Looks at the ``devices`` of a ``robot``, by the names of their parts; its battery it knows from the events.

    ``looked`` tells the stamp of the newest picture that was searched, None before the first.
    """

    def __init__(
        self, devices: Mapping[str, Device], robot: Robot, looked: Callable[[], float | None] | None = None
    ) -> None:
        self._devices = devices
        self._robot = robot
        self._looked = looked
        self._battery: frozenset[str] = frozenset()
        self._misses: deque[tuple[float, Mapping[str, int]]] = deque()  # when, and how many in all, by part

    def take(self, event: Event) -> None:
        """Follow one event of the run."""
        if isinstance(event, ReflexFired) and event.what in BATTERY:
            what = frozenset({event.what})
            self._battery = self._battery | what if event.on else self._battery - what

    def look(self, now: float) -> tuple[PartState, ...]:
        """Return how each part is at the time ``now`` of the devices' clock.

        In simulated time, to be called by the thread in which it passes.
        """
        health = {part: device.health() for part, device in self._devices.items()}
        self._misses.append((now, {part: _misses(each) for part, each in health.items()}))
        while now - self._misses[0][0] > MISSES_TIME:
            self._misses.popleft()
        return tuple(self._state(part, each, now) for part, each in health.items())

    def _state(self, part: str, health: Health, now: float) -> PartState:
        measured = self._measured(part, now)
        age = None if measured is None or measured.stamp is None else max(0.0, now - measured.stamp)
        figures = {} if measured is None else measured.values
        values = {name: value for name, value in figures.items() if isfinite(value)}

        def state(level: Level, detail: str = "", hint: str = "") -> PartState:
            return PartState(part, level, age, values, detail.removeprefix(f"{part}: "), hint)

        if not health.online:
            return state("ERROR", health.detail or "not there", health.hint)
        if refusal := self._refusal(part):
            return state("ERROR", refusal)
        if measured is not None and measured.silent:
            return state("STALE", measured.silent, health.hint)
        if concern := health.detail or self._concern(part):
            return state("WARN", concern, health.hint)
        return state("OK")

    def _refusal(self, part: str) -> str:
        """Return why a part that is there does nothing any more."""
        device = self._devices[part]
        if isinstance(device, Latching) and device.latched:
            return f"stopped until it is enabled: {device.latched}"
        if part != "base":
            return ""
        return BATTERY["battery_critical"] if "battery_critical" in self._battery else ""

    def _concern(self, part: str) -> str:
        """Return what is worth a look at a part that works."""
        if part == "base" and self._battery:
            return BATTERY["battery_low"]
        before, after = self._misses[0][1].get(part, 0), self._misses[-1][1].get(part, 0)
        return f"{after - before} replies missed within {MISSES_TIME:g} s" if after > before else ""

    def _measured(self, part: str, now: float) -> Measured | None:
        """Return the newest reading of a part; None for one that measures nothing."""
        robot, kind = self._robot, part
        if (other := self._robot.others.get(part)) is not None:
            robot, kind = robot.of({other.kind: part}), other.kind
        if kind == "camera":
            stamp = None if self._looked is None else self._looked()
            late = stamp is not None and now - stamp > PICTURE_TIME
            return None if stamp is None else Measured(stamp, silent="no new picture" if late else "")
        declared = KINDS.get(kind)
        if declared is None or not declared.reading:
            return None
        device = getattr(robot, f"{declared.field}_part")
        return None if device is None else _measured(getattr(device, declared.reading)())


def _measured(found: Reading[Any] | Mapping[str, Reading[JointState]]) -> Measured | None:
    if isinstance(found, Mapping):
        return _of_joints(found)
    if found.value is None:
        return Measured(None, silent="nothing measured yet")
    return Measured(found.stamp, found.value.figures(), "" if found.good else "nothing new")


def _of_joints(readings: Mapping[str, Reading[JointState]]) -> Measured | None:
    """Return what all joints come to; an arm is as old as its oldest reading."""
    if not readings:
        return None
    known = [(reading.stamp, reading.value) for reading in readings.values() if reading.value is not None]
    values = {"joints": float(len(readings)), "moving": float(sum(state.moving for _, state in known))}
    if known:
        values["hottest"] = max(state.temperature for _, state in known)
    silent = ", ".join(name for name, reading in readings.items() if not reading.good)
    return Measured(min((stamp for stamp, _ in known), default=None), values, f"silent: {silent}" if silent else "")


def _misses(health: Health) -> int:
    """Return how many replies of a device were missed: its own total, else the sum of what it counts by servo."""
    counters = health.counters
    if MISSES in counters:
        return counters[MISSES]
    return sum(count for name, count in counters.items() if name.startswith(MISSES))
