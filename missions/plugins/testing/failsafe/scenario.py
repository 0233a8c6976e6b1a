"""Simulation of one fault of a base for the studio's failsafe view, with the arbiter, reflexes and guard of real bases.

It works on any base that has a ``BaseRig``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from math import radians
from typing import TYPE_CHECKING, Any, Protocol, cast

from behaviours.run import RunState
from config.library import find_file
from drivers.api import Base, BaseState, Reflexes, Sides, Source, StatusCallback, SteeringCallback, Velocity, ignore
from drivers.api.fast_dataclass import dataclass
from drivers.api.sections import BaseKeys
from drivers.base.arbitrated import settings_of
from drivers.base.twin import BaseTwin
from drivers.errors import DriverError, NotConnected
from drivers.sim.timeline import Timeline
from missions.executive.guard import BaseGuard
from missions.executive.proxied_robot import StaleCommandGuard
from missions.executive.stream import EventStream
from missions.library.drivers import load_robot
from missions.plugins.testing.failsafe.staged_ranger import StagedRanger

if TYPE_CHECKING:
    from behaviours.leaf import Leaf


# Choices of the failsafe page: command source, velocity, fault, battery, and reflexes.

ROBOT = "turtlebot2"
"""Name of the robot whose base, limits and reflexes the failsafe view simulates."""

LEFT, CENTRE, RIGHT, NOTHING = Sides(left=True), Sides(centre=True), Sides(right=True), Sides()


class BaseRig(Protocol):
    """Base under test, with functions that act on its sensors, plug and battery."""

    @property
    def base(self) -> Base:
        """The driver or twin under test."""
        ...

    @property
    def ranger(self) -> "StagedRanger":
        """The range finder that guards the base."""
        ...

    def press_sensors(
        self, bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset()
    ) -> None:
        """Set the pressed bumpers, the uncovered cliff sensors and the pressed buttons."""
        ...

    def lift(self, *, up: bool) -> None:
        """Lift the base off the floor, or put it back."""
        ...

    def set_plugged(self, *, is_plugged: bool) -> None:
        """Plug the base in, or unplug it."""
        ...

    def set_battery(self, percent: float, *, charging: bool) -> None:
        """Set the battery level in percent, and charging."""
        ...


TimedActions = Sequence[tuple[float, Callable[[BaseRig], object]]]
"""Actions on a BaseRig, each with its time in seconds after the first action."""


def _press_for(
    bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset(), seconds: float = 0.5
) -> TimedActions:
    return (0.0, lambda hand: hand.press_sensors(bumper, cliff, buttons)), (seconds, lambda hand: hand.press_sensors())


def _unplug_for(seconds: float) -> TimedActions:
    return (0.0, lambda hand: hand.set_plugged(is_plugged=False)), (
        seconds,
        lambda hand: hand.set_plugged(is_plugged=True),
    )


def _freeze(*, frozen: bool) -> Callable[[BaseRig], object]:
    def do(hand: BaseRig) -> None:
        hand.ranger.frozen = frozen

    return do


STOP_BUTTON, ENABLE_BUTTON = frozenset({0}), frozenset({2})

WHO: Mapping[str, frozenset[Source]] = {
    "a mission": frozenset({Source.MISSION}),
    "a person": frozenset({Source.TELEOP}),
    "both": frozenset({Source.MISSION, Source.TELEOP}),
    "nobody": frozenset(),
}
"""Sources that may command the base in a scenario, by the words of the choice.

Each source repeats its command until the base refuses it for good.
"""

WISHES: Mapping[str, Velocity] = {
    "ahead": Velocity(0.2, 0.0),
    "ahead, gently": Velocity(0.05, 0.0),
    "too fast": Velocity(0.6, 0.0),
    "a curve": Velocity(0.2, radians(60)),
    "back": Velocity(-0.2, 0.0),
    "turn": Velocity(0.0, radians(60)),
}
"""Choices of the velocity that the sources command."""

FAULTS: Mapping[str, TimedActions] = {
    "nothing": (),
    "bumper left": _press_for(bumper=LEFT),
    "bumper centre": _press_for(bumper=CENTRE),
    "bumper right": _press_for(bumper=RIGHT),
    "cliff left": _press_for(cliff=LEFT),
    "cliff centre": _press_for(cliff=CENTRE),
    "lifted for 2 s": ((0.0, lambda hand: hand.lift(up=True)), (2.0, lambda hand: hand.lift(up=False))),
    "stop button": _press_for(buttons=STOP_BUTTON),
    "stop button, then enable": (
        *_press_for(buttons=STOP_BUTTON),
        *((at + 2.0, do) for at, do in _press_for(buttons=ENABLE_BUTTON)),
    ),
    "unplugged for 0.6 s": _unplug_for(0.6),
    "unplugged for 2 s": _unplug_for(2.0),
    "unplugged for 6 s": _unplug_for(6.0),
    "something 2 cm ahead for 2 s": (
        (0.0, lambda hand: hand.ranger.put(0.02)),
        (2.0, lambda hand: hand.ranger.put(None)),
    ),
    "no scans for 4 s": ((0.0, _freeze(frozen=True)), (4.0, _freeze(frozen=False))),
    "the commands stop": (),
}
"""Faults of a base, each as actions on the rig from ``FAULT_START`` on."""

SILENT_FAULT = "the commands stop"

BATTERIES: Mapping[str, tuple[float, bool]] = {
    "full": (100.0, False),
    "low": (20.0, False),
    "critical": (5.0, False),
    "critical, on the dock": (5.0, True),
}
"""Battery states: the level in percent, and whether the battery charges."""

REFLEXES: Mapping[str, Mapping[str, Any]] = {
    "default": {},
    "bumper: stop": {"bumper": "stop"},
    "latch": {"bumper": "latch", "cliff": "latch", "wheel_drop": "latch"},
}
"""Choices of the reflex settings in the robot file, by name."""


@dataclass(frozen=True, slots=True)
class FailsafeSetting:
    """Choices of one scenario: a key of ``WHO``, ``WISHES``, ``FAULTS``, ``BATTERIES`` and ``REFLEXES`` each.

    Raises KeyError for any other word.
    """

    who: str = "a mission"
    wish: str = "ahead"
    fault: str = "nothing"
    battery: str = "full"
    reflexes: str = "default"

    def __post_init__(self) -> None:
        for name, words in CHOICES.items():
            if getattr(self, name) not in words:
                raise KeyError(f"{name} is one of {', '.join(words)}, not {getattr(self, name)!r}")


CHOICES: Mapping[str, Sequence[str]] = {
    "who": tuple(WHO),
    "wish": tuple(WISHES),
    "fault": tuple(FAULTS),
    "battery": tuple(BATTERIES),
    "reflexes": tuple(REFLEXES),
}
"""Available choices by field of a FailsafeSetting."""


@cache
def _shipped_keys() -> BaseKeys:
    keys = load_robot(find_file("robots", ROBOT)).base
    if keys is None:
        raise LookupError(f"{ROBOT} has no base")
    return keys


def keys_for(setting: FailsafeSetting) -> BaseKeys:
    """Return the base keys in the robot file of ``ROBOT``, with the reflexes of a setting."""
    keys = _shipped_keys()
    reflexes: Reflexes = replace(keys.reflexes, **REFLEXES[setting.reflexes])
    return replace(keys, reflexes=reflexes)


FAULT_START, TIME_AFTER_FAULT = 1.01, 9.0
"""Seconds from the start to the fault, and from the fault to the end of the simulation."""

TICK_INTERVAL, TICK_PHASE = 0.04, 0.015
"""Seconds between two commands of missions and of people, and from a base report to the next command."""

LOOK_PHASE = 0.018
"""Seconds from a report of the base until its state is recorded, so that the commands after that report have an effect.
"""

WAITING = "waits"
"""Feedback to a source that commands an unplugged base."""


@dataclass(frozen=True, slots=True)
class ScenarioMoment:
    """State of a base from ``t`` seconds after the start of the fault on, until the next moment.

    ``t`` is negative before the fault. ``source`` is the commanding source ("" for none), ``setpoint`` and ``limited``
    are speeds (m/s, rad/s), ``reason`` is the reason of their difference, and ``latched`` the reason of the latch, from
    the driver. ``mission`` and ``person`` are the feedback to these sources. ``ahead`` is the distance in metres from
    the pose at the fault. A new moment is recorded when any field except ``t`` and ``ahead`` changes.
    """

    t: float
    source: str
    setpoint: tuple[float, float]
    limited: tuple[float, float]
    reason: str
    latched: str
    mission: str
    person: str
    ahead: float

    @property
    def compared_fields(self) -> tuple[object, ...]:
        """All fields except time and position, to find out whether the state has changed."""
        return self.source, self.setpoint, self.limited, self.reason, self.latched, self.mission, self.person


class CommandSource:
    """A mission that retries after each failed behaviour, or a person who holds a key, until ``end_reason`` is set.

    ``feedback`` is the answer to its last command; empty if it was obeyed or waits for its turn.
    """

    def __init__(self, source: Source, velocity: Velocity, base: Base, run: RunState) -> None:
        self.feedback = self.end_reason = ""
        self.started_at = run.clock.now()
        self.label = "the driver"
        self._source, self._velocity, self._base, self._run = source, velocity, base, run
        self._permit = StaleCommandGuard(lambda: None)

    def command(self) -> None:
        """Send the source's velocity command again, unless the source has ended."""
        if self.end_reason:
            return
        mission = self._source is Source.MISSION
        try:
            self._permit(self._base, cast("Leaf", self) if mission else None)
            self._base.drive(self._velocity, source=self._source)
            self.feedback = ""
        except NotConnected:
            self.feedback = WAITING
        except DriverError as error:
            self.feedback = f"fails: {error}" if mission else str(error)
            self.started_at = self._run.clock.now()

    def end(self, why: str) -> None:
        """Stop the base, and send no more commands, for the reason ``why``."""
        self._base.stop(source=self._source)
        self.feedback = self.end_reason = why


class FailsafeScenario:
    """Simulation of one setting on the base of a ``rig``, in the time of ``timeline``; results in ``moments``."""

    def __init__(self, setting: FailsafeSetting, timeline: Timeline, rig: BaseRig) -> None:
        self.moments: list[ScenarioMoment] = []
        self._timeline, self._base = timeline, rig.base
        self._run = RunState(timeline.clock)
        self._guard = BaseGuard(rig.base, keys_for(setting).reflexes, self._run, EventStream())
        wish = WISHES[setting.wish]
        self._sources = {who: CommandSource(who, wish, rig.base, self._run) for who in WHO[setting.who]}
        self._silent = setting.fault == SILENT_FAULT
        self._origin = 0.0
        percent, charging = BATTERIES[setting.battery]
        rig.set_battery(percent, charging=charging)
        for after, do in FAULTS[setting.fault]:
            timeline.call_at(FAULT_START + after, partial(do, rig))

    def play(self) -> Sequence[ScenarioMoment]:
        """Run the scenario; return its moments."""
        self._base.open()
        self._timeline.call_every(TICK_INTERVAL, self._tick, start=TICK_INTERVAL + TICK_PHASE)
        self._timeline.call_every(BaseTwin.STEP_INTERVAL, self._look, start=LOOK_PHASE)
        self._timeline.run_until(FAULT_START + TIME_AFTER_FAULT)
        self._base.close()
        return self.moments

    def _tick(self) -> None:
        """Act as the executive's tick: read the base, then send the sources' commands."""
        why = self._guard.check()
        mission = self._sources.get(Source.MISSION)
        if why and mission is not None and not mission.end_reason:
            mission.end(f"has ended: {why}")
        if self._silent and self._timeline.clock.now() >= FAULT_START:
            return
        for each in self._sources.values():
            each.command()

    def _look(self) -> None:
        """Record a moment if it differs from the last."""
        now, steering = self._timeline.clock.now(), self._base.steering()
        state: BaseState | None = self._base.state().value
        x = 0.0 if state is None else state.pose.x
        if now <= FAULT_START:
            self._origin = x
        feedback = {who: each.feedback for who, each in self._sources.items()}
        moment = ScenarioMoment(
            round(now - FAULT_START, 3),
            steering.source or "",
            _rounded(steering.requested),
            _rounded(steering.allowed),
            steering.reason,
            self._base.latched,
            feedback.get(Source.MISSION, ""),
            feedback.get(Source.TELEOP, ""),
            round(x - self._origin, 3),
        )
        if not self.moments or moment.compared_fields != self.moments[-1].compared_fields:
            self.moments.append(moment)


@dataclass(frozen=True, slots=True)
class NullCallbacks:
    """A ``drivers.base.arbitrated.BaseCallbacks`` that ignores all calls."""

    report: StatusCallback = ignore
    on_change: Callable[[], None] = ignore
    on_steering: SteeringCallback = ignore


class TwinRig:
    """A ``BaseRig`` that creates a simulated base and acts on it."""

    def __init__(self, setting: FailsafeSetting, timeline: Timeline) -> None:
        self.base = BaseTwin(timeline.clock, **settings_of(keys_for(setting), NullCallbacks()))
        self.ranger = StagedRanger(self.base, timeline.clock)
        timeline.call_every(self.base.STEP_INTERVAL, self.base.step)

    def press_sensors(
        self, bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset()
    ) -> None:
        self.base.press(bumper, cliff=cliff, buttons=buttons)

    def lift(self, *, up: bool) -> None:
        self.base.lift(up=up)

    def set_plugged(self, *, is_plugged: bool) -> None:
        if is_plugged:
            self.base.plug.plug_in()
        else:
            self.base.plug.unplug()

    def set_battery(self, percent: float, *, charging: bool) -> None:
        self.base.drain(percent)
        self.base.set_power(on=charging)


def run_scenario(setting: FailsafeSetting) -> Sequence[ScenarioMoment]:
    """Return the moments of a scenario with this setting, simulated with the twin of the base."""
    timeline = Timeline()
    return FailsafeScenario(setting, timeline, TwinRig(setting, timeline)).play()


def _rounded(velocity: Velocity) -> tuple[float, float]:
    return round(velocity.linear, 3), round(velocity.angular, 3)
