"""Makes what a test file gives go wrong: at its time, and right again, by the hand that twins have for tests."""

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from functools import partial

from drivers.api import Sides, Source, Velocity
from drivers.base.twin import BaseTwin
from drivers.errors import DriverError
from drivers.head.twin import HeadTwin
from drivers.servos.twin import JointsTwin, NeckTwin
from drivers.sim.plug import Plug
from drivers.sim.things import BackupLimit
from missions.plugins.testing.history import History
from missions.plugins.testing.mishaps import OF_THE_DRIVE, RUN, Mishap
from missions.plugins.testing.moments import Happening
from missions.runner import Runner

SLIP = 0.9
"""The share of their way that wheels slip."""

BACKING = 0.025
"""Metres that a base with a backup limit backs: an inch, as users report of a Create 3."""

BY_HAND = Velocity(0.15, 0.4)
"""How a base is driven by hand, again and again after so many seconds."""

RENEWED = 0.1

SOMEBODY = "a mishap"
"""Who stops a run that is stopped."""


def _switch_drive(base: BaseTwin, fault: Mishap, now: float, *, on: bool) -> None:
    """Begin or end a fault of the drive or the odometry of a base."""
    body = base.body
    match fault.state:
        case "blocked":
            body.wheels.blocked = on
        case "slipping":
            body.wheels.slip = SLIP if on else 0.0
        case "reversed":
            body.reversed = on
        case "uncounted":
            body.counters.lost = on
        case "drifting":
            body.gyro.drift(fault.amount if on else 0.0, now)
        case "late":
            base.late.seconds = fault.amount if on else 0.0
        case "e_stopped":
            body.e_stop = on
        case _:
            body.backup_limit = BackupLimit(BACKING) if on else None


class Trouble:
    """All that goes wrong with the twins of one run. Raises TypeError for one that is not in simulated time.

    Time passes while the run is paused or stopped: else it would never end.
    """

    def __init__(self, runner: Runner, history: History) -> None:
        if runner.twins is None:
            raise TypeError("only a run in simulated time has twins")
        self._runner, self._twins = runner, runner.twins
        self._history = history
        self._felt: list[Mishap] = []  # what the base is made to feel now
        self._driven = 0  # by so many hands
        self.struck: list[Mishap] = []
        """What has gone wrong so far, each with when it began."""

    def arrange(self, mishaps: Iterable[Mishap]) -> None:
        """See to it that each happens when it is due; what is so from the beginning is so at once."""
        for mishap in mishaps:
            if mishap.moment is not None:
                self._wait(mishap)
            elif mishap.start > 0.0:
                self._twins.timeline.at(mishap.start, partial(self.begin, mishap))
            else:
                self.begin(mishap)

    def _wait(self, mishap: Mishap) -> None:
        """Let it happen when its moment comes for the first time: after that tick, not within it."""

        def hear(happening: Happening) -> None:
            if mishap.moment is not None and mishap.moment.fits(happening):
                self._history.told.remove(hear)
                self._twins.timeline.at(self._now(), partial(self.begin, mishap))

        self._history.told.append(hear)

    def begin(self, mishap: Mishap) -> None:
        """Let it happen now, whatever it says of its time."""
        self.struck.append(replace(mishap, start=self._now()))
        if mishap.part == RUN:
            self._hold_up(mishap)
            return
        self._switch(mishap, on=True)
        if mishap.seconds < math.inf:
            self._twins.timeline.at(self._now() + mishap.seconds, partial(self._switch, mishap, on=False))

    def _now(self) -> float:
        return self._twins.timeline.clock.now()

    def _switch(self, mishap: Mishap, *, on: bool) -> None:
        """Begin or end it. The checker has made sure that the part is there."""
        twins = self._twins
        twin = twins.parts.get(mishap.part)
        plug: Plug | None = None if twin is None else twin.plug
        match mishap.state:
            case "unplugged" if plug is not None:
                plug.unplug() if on else plug.plug_in()
            case _ if isinstance(twin, JointsTwin):
                _fail_joint(twin, mishap, on=on)
            case _ if isinstance(twin, NeckTwin | HeadTwin):
                twin.fail(mishap.state if on else "")
            case "frozen" if twins.camera is not None:
                twins.camera.freeze() if on else twins.camera.thaw()
            case "covered" if twins.camera is not None:
                twins.camera.cover() if on else twins.camera.uncover()
            case "slow" if twins.camera is not None:
                twins.camera.slow_down() if on else twins.camera.slow_down(1)
            case "deaf" if twins.microphone is not None:
                twins.microphone.dulled = on
            case "hanging" if twins.voice is not None:
                twins.voice.hanging = on
            case _ if twins.base is not None:
                self._switch_base(twins.base, mishap, on=on)

    def _switch_base(self, base: BaseTwin, mishap: Mishap, *, on: bool) -> None:
        match mishap.state:
            case "driven":
                self._driven += 1 if on else -1
                self._drive(base) if on else base.stop(source=Source.TELEOP)
            case "lifted":
                base.lift(up=on)
            case "docked":
                base.feed(on=on)
            case "battery":
                base.drain(100.0 * mishap.amount)
            case state if state in OF_THE_DRIVE:
                _switch_drive(base, mishap, self._now(), on=on)
            case _:
                self._felt = felt = [each for each in self._felt if each is not mishap] + ([mishap] if on else [])
                buttons = frozenset(int(each.detail) for each in felt if each.state == "button")
                base.press(_sides(felt, "bumped"), cliff=_sides(felt, "cliff"), buttons=buttons)

    def _drive(self, base: BaseTwin) -> None:
        """Drive it as a person does who holds a key, for as long as somebody does."""
        if self._driven:
            with suppress(DriverError):  # unplugged, or latched: the person tries again
                base.drive(BY_HAND, source=Source.TELEOP)
            self._twins.timeline.at(self._now() + RENEWED, partial(self._drive, base))

    def _hold_up(self, mishap: Mishap) -> None:
        """Let no tick come for a while: the loop is late, or somebody has paused or stopped the run."""
        runner, timeline = self._runner, self._twins.timeline
        executive, latch, until = runner.executive, runner.latch, self._now() + mishap.seconds
        executive.idle = executive.run.wait
        match mishap.state:
            case "stalled":  # what is due goes on within, as the world does around a process that is held up
                timeline.run(until)
            case "paused":
                executive.pause()
                timeline.at(until, executive.resume)
            case _:
                latch.stop(SOMEBODY)
                timeline.at(until, partial(self._release, latch.number))

    def _release(self, number: int) -> None:
        if self._runner.latch.release(number):
            self._runner.executive.resume()


def _fail_joint(twin: JointsTwin, mishap: Mishap, *, on: bool) -> None:
    match mishap.state:
        case "overloaded":
            twin.overload(mishap.detail)
        case "turned":
            twin.turn_by_hand(mishap.detail, mishap.amount)
        case "pushed" if on:
            twin.push(mishap.detail, mishap.amount)
        case _:
            twin.fail(mishap.detail, mishap.state if on else "")


def _sides(mishaps: list[Mishap], state: str) -> Sides:
    sides = {mishap.detail for mishap in mishaps if mishap.state == state}
    return Sides(left="left" in sides, centre="centre" in sides, right="right" in sides)
