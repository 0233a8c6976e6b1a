"""One setting of the failsafe page, stepped through: arbiter, reflexes and guard as they are, on a base in any hand."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from math import radians
from typing import TYPE_CHECKING, Any, Protocol, cast

from behaviours.run import Run
from config.library import find
from drivers.api import Base, BaseState, Reflexes, Report, Sides, Source, Steered, Velocity, ignore
from drivers.api.quick import dataclass
from drivers.api.sections import BaseKeys
from drivers.base.arbitrated import settings_of
from drivers.base.twin import BaseTwin
from drivers.errors import DriverError, NotConnected
from drivers.sim.timeline import Timeline
from missions.executive.asked import Decided
from missions.executive.guard import Guard
from missions.executive.stream import Stream
from missions.library.drivers import load_robot
from missions.plugins.testing.failsafe.eyes import StagedRanger

if TYPE_CHECKING:
    from behaviours.leaf import Leaf


# What may be chosen on the failsafe page: who drives a base how, what befalls it, how full it is, and its reflexes.

ROBOT = "turtlebot2"
"""Whose base it is, with its limits and reflexes."""

LEFT, CENTRE, RIGHT, NOTHING = Sides(left=True), Sides(centre=True), Sides(right=True), Sides()


class Hand(Protocol):
    """Whoever can do to a base what befalls it. ``base`` is what it does about that."""

    @property
    def base(self) -> Base:
        """The driver, or the twin."""
        ...

    @property
    def eyes(self) -> "StagedRanger":
        """The range finder that guards it."""
        ...

    def feel(self, bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset()) -> None:
        """Press and uncover its sensors."""
        ...

    def lift(self, *, up: bool) -> None:
        """Take it off the floor, or put it back."""
        ...

    def plug(self, *, there: bool) -> None:
        """Plug it in, or unplug it."""
        ...

    def fill(self, percent: float, *, charging: bool) -> None:
        """Leave so much in its battery."""
        ...


Befalls = Sequence[tuple[float, Callable[[Hand], object]]]
"""What is done to it, and so many seconds after the first of it."""


def _touched(
    bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset(), seconds: float = 0.5
) -> Befalls:
    return (0.0, lambda hand: hand.feel(bumper, cliff, buttons)), (seconds, lambda hand: hand.feel())


def _away(seconds: float) -> Befalls:
    return (0.0, lambda hand: hand.plug(there=False)), (seconds, lambda hand: hand.plug(there=True))


def _freeze(*, frozen: bool) -> Callable[[Hand], object]:
    def do(hand: Hand) -> None:
        hand.eyes.frozen = frozen

    return do


STOP, ENABLE = frozenset({0}), frozenset({2})

WHO: Mapping[str, frozenset[Source]] = {
    "a mission": frozenset({Source.MISSION}),
    "a person": frozenset({Source.TELEOP}),
    "both": frozenset({Source.MISSION, Source.TELEOP}),
    "nobody": frozenset(),
}
"""Who commands: from the beginning on, and until something says no."""

WISHES: Mapping[str, Velocity] = {
    "ahead": Velocity(0.2, 0.0),
    "ahead, gently": Velocity(0.05, 0.0),
    "too fast": Velocity(0.6, 0.0),
    "a curve": Velocity(0.2, radians(60)),
    "back": Velocity(-0.2, 0.0),
    "turn": Velocity(0.0, radians(60)),
}
"""What they want."""

FAULTS: Mapping[str, Befalls] = {
    "nothing": (),
    "bumper left": _touched(bumper=LEFT),
    "bumper centre": _touched(bumper=CENTRE),
    "bumper right": _touched(bumper=RIGHT),
    "cliff left": _touched(cliff=LEFT),
    "cliff centre": _touched(cliff=CENTRE),
    "lifted for 2 s": ((0.0, lambda hand: hand.lift(up=True)), (2.0, lambda hand: hand.lift(up=False))),
    "stop button": _touched(buttons=STOP),
    "stop button, then enable": (*_touched(buttons=STOP), *((at + 2.0, do) for at, do in _touched(buttons=ENABLE))),
    "unplugged for 0.6 s": _away(0.6),
    "unplugged for 2 s": _away(2.0),
    "unplugged for 6 s": _away(6.0),
    "something 2 cm ahead for 2 s": ((0.0, lambda hand: hand.eyes.put(0.02)), (2.0, lambda hand: hand.eyes.put(None))),
    "no scans for 4 s": ((0.0, _freeze(frozen=True)), (4.0, _freeze(frozen=False))),
    "who drives falls silent": (),
}
"""What happens after ``BEGINS``."""

SILENCE = "who drives falls silent"

BATTERIES: Mapping[str, tuple[float, bool]] = {
    "full": (100.0, False),
    "low": (20.0, False),
    "critical": (5.0, False),
    "critical, on the dock": (5.0, True),
}
"""How full its battery is, in percent, and whether it charges."""

REFLEXES: Mapping[str, Mapping[str, Any]] = {
    "as it ships": {},
    "bumper: stop": {"bumper": "stop"},
    "latch": {"bumper": "latch", "cliff": "latch", "wheel_drop": "latch"},
}
"""What its file says of reflexes."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Words of ``WHO``, ``WISHES``, ``FAULTS``, ``BATTERIES`` and ``REFLEXES``. Raises KeyError for others."""

    who: str = "a mission"
    wish: str = "ahead"
    fault: str = "nothing"
    battery: str = "full"
    reflexes: str = "as it ships"

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
"""What can be chosen, by the members of a ``Setting``."""


@cache
def _shipped() -> BaseKeys:
    keys = load_robot(find("robots", ROBOT)).base
    if keys is None:
        raise LookupError(f"{ROBOT} has no base")
    return keys


def keys_for(setting: Setting) -> BaseKeys:
    """Return what the robot file says of its base, with the reflexes of a setting."""
    keys = _shipped()
    reflexes: Reflexes = replace(keys.reflexes, **REFLEXES[setting.reflexes])
    return replace(keys, reflexes=reflexes)


BEGINS, ENDS = 1.01, 9.0
"""Seconds after which something happens, and after that, when nobody looks any more."""

TICK, TICKED = 0.04, 0.015
"""Seconds from one command to the next, of missions and of people, and from a report of the base to the next one."""

LOOKED = 0.018
"""Seconds from a report to a look at what has come of it: also over a wire it has arrived by then."""

AWAY = "waits"
"""What whoever commands a base does that is not there."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What is so from ``t`` seconds after the fault began on (negative: before it): compared by all the rest.

    ``source`` is who commands ("" for nobody), ``wanted`` and ``given`` are speeds (m/s, rad/s), ``because`` is why
    they differ and ``latched`` why it stands until it is enabled, as the driver tells it. ``mission`` and ``person``
    are what these are told. ``ahead`` is how far the base is from where it was when the fault began, in metres.
    """

    t: float
    source: str
    wanted: tuple[float, float]
    given: tuple[float, float]
    because: str
    latched: str
    mission: str
    person: str
    ahead: float

    @property
    def what(self) -> tuple[object, ...]:
        """All but when and where."""
        return self.source, self.wanted, self.given, self.because, self.latched, self.mission, self.person


class Commanding:
    """A mission that tries again whenever a behaviour has failed, or a person who holds a key: until ``ended``.

    ``told`` is what it was told at its last command; empty where it was obeyed, or has to wait for its turn.
    """

    def __init__(self, source: Source, wish: Velocity, base: Base, run: Run) -> None:
        self.told = self.ended = ""
        self.since = run.clock.now()
        self.place = "what drives"
        self._source, self._wish, self._base, self._run = source, wish, base, run
        self._permit = Decided(run, lambda: None)

    def command(self) -> None:
        """Ask for it once more."""
        if self.ended:
            return
        mission = self._source is Source.MISSION
        self._run.working = cast("Leaf", self) if mission else None
        try:
            self._permit(self._base)
            self._base.drive(self._wish, source=self._source)
            self.told = ""
        except NotConnected:
            self.told = AWAY
        except DriverError as error:
            self.told = f"fails: {error}" if mission else str(error)
            self.since = self._run.clock.now()

    def end(self, why: str) -> None:
        """Ask for nothing any more."""
        self._base.stop(source=self._source)
        self.told = self.ended = why


class Ride:
    """One setting, on the base of a ``hand``, whose time is that of ``timeline``. ``moments`` is what came of it."""

    def __init__(self, setting: Setting, timeline: Timeline, hand: Hand) -> None:
        self.moments: list[Moment] = []
        self._timeline, self._base = timeline, hand.base
        self._run = Run(timeline.clock)
        self._guard = Guard(hand.base, keys_for(setting).reflexes, self._run, Stream())
        wish = WISHES[setting.wish]
        self._commanding = {who: Commanding(who, wish, hand.base, self._run) for who in WHO[setting.who]}
        self._silent = setting.fault == SILENCE
        self._origin = 0.0
        percent, charging = BATTERIES[setting.battery]
        hand.fill(percent, charging=charging)
        for after, do in FAULTS[setting.fault]:
            timeline.at(BEGINS + after, partial(do, hand))

    def play(self) -> Sequence[Moment]:
        """Let it happen."""
        self._base.open()
        self._timeline.every(TICK, self._tick, start=TICK + TICKED)
        self._timeline.every(BaseTwin.PERIOD, self._look, start=LOOKED)
        self._timeline.run(BEGINS + ENDS)
        self._base.close()
        return self.moments

    def _tick(self) -> None:
        """Do as the executive does: look at the base, then let whoever commands do so."""
        why = self._guard.look()
        mission = self._commanding.get(Source.MISSION)
        if why and mission is not None and not mission.ended:
            mission.end(f"has ended: {why}")
        if self._silent and self._timeline.clock.now() >= BEGINS:
            return
        for each in self._commanding.values():
            each.command()

    def _look(self) -> None:
        """Keep what is new."""
        now, steering = self._timeline.clock.now(), self._base.steering()
        state: BaseState | None = self._base.state().value
        x = 0.0 if state is None else state.pose.x
        if now <= BEGINS:
            self._origin = x
        told = {who: each.told for who, each in self._commanding.items()}
        moment = Moment(
            round(now - BEGINS, 3),
            steering.source or "",
            _rounded(steering.wanted),
            _rounded(steering.given),
            steering.because,
            self._base.latched,
            told.get(Source.MISSION, ""),
            told.get(Source.TELEOP, ""),
            round(x - self._origin, 3),
        )
        if not self.moments or moment.what != self.moments[-1].what:
            self.moments.append(moment)


@dataclass(frozen=True, slots=True)
class Nobody:
    """Whom a base tells that nobody watches: a ``drivers.base.arbitrated.BaseCallbacks``."""

    report: Report = ignore
    changed: Callable[[], None] = ignore
    steered: Steered = ignore


class TwinHand:
    """A ``Hand`` on a twin, which it makes."""

    def __init__(self, setting: Setting, timeline: Timeline) -> None:
        self.base = BaseTwin(timeline.clock, **settings_of(keys_for(setting), Nobody()))
        self.eyes = StagedRanger(self.base, timeline.clock)
        timeline.every(self.base.PERIOD, self.base.step)

    def feel(self, bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset()) -> None:
        """See Hand."""
        self.base.press(bumper, cliff=cliff, buttons=buttons)

    def lift(self, *, up: bool) -> None:
        """See Hand."""
        self.base.lift(up=up)

    def plug(self, *, there: bool) -> None:
        """See Hand."""
        if there:
            self.base.plug.plug_in()
        else:
            self.base.plug.unplug()

    def fill(self, percent: float, *, charging: bool) -> None:
        """See Hand."""
        self.base.drain(percent)
        self.base.feed(on=charging)


def stepped_through(setting: Setting) -> Sequence[Moment]:
    """Return what comes of a setting, on the twin."""
    timeline = Timeline()
    return Ride(setting, timeline, TwinHand(setting, timeline)).play()


def _rounded(velocity: Velocity) -> tuple[float, float]:
    return round(velocity.linear, 3), round(velocity.angular, 3)
