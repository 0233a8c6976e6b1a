"""One setting of the failsafe page, stepped through: arbiter, reflexes and guard as they are, on a base in any hand."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, cast

from behaviours.run import Run
from drivers.api import Base, BaseState, Report, Sides, Source, Steered, Velocity, ignore
from drivers.api.quick import dataclass
from drivers.base.arbitrated import settings_of
from drivers.base.twin import BaseTwin
from drivers.errors import DriverError, NotConnected
from drivers.sim.timeline import Timeline
from missions.executive.asked import Decided
from missions.executive.guard import Guard
from missions.executive.stream import Stream
from missions.plugins.testing.failsafe.eyes import StagedRanger
from missions.plugins.testing.failsafe.settings import (
    BATTERIES,
    FAULTS,
    NOTHING,
    SILENCE,
    WHO,
    WISHES,
    Hand,
    Setting,
    keys_for,
)

if TYPE_CHECKING:
    from behaviours.leaf import Leaf

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
