"""Injects the faults of a test file into twins at their time, and ends them."""

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from functools import partial

from drivers.api import Sides, Source, Velocity
from drivers.base.twin import BaseTwin
from drivers.errors import DriverError
from drivers.head.twin import ServoHeadTwin
from drivers.servos.twin import JointsTwin, NeckTwin
from drivers.sim.plug import SimulatedPlug
from drivers.sim.world_objects import BackupLimit
from missions.plugins.testing.case_history import CaseHistory
from missions.plugins.testing.event_specs import ObservedEvent
from missions.plugins.testing.fault_specs import DRIVE_STATES, RUN, FaultSpec
from missions.runner import Runner

SLIP_SHARE = 0.9
"""Share of their path that slipping wheels lose."""

BACKUP_DISTANCE = 0.025
"""Metres that a base drives back before its backup limit stops it: an inch, as users report of a Create 3."""

HAND_VELOCITY = Velocity(0.15, 0.4)
"""Velocity (m/s, rad/s) with which a simulated person drives the base."""

HAND_COMMAND_INTERVAL = 0.1
"""Seconds between two drive commands of a simulated person."""

STOPPED_BY = "a mishap"
"""Name that a simulated stop reports as the person who stopped the run."""


def _switch_drive(base: BaseTwin, fault: FaultSpec, now: float, *, on: bool) -> None:
    """Begin or end a fault of a base's drive or odometry."""
    body = base.body
    match fault.state:
        case "blocked":
            body.wheels.blocked = on
        case "slipping":
            body.wheels.slip = SLIP_SHARE if on else 0.0
        case "reversed":
            body.reversed = on
        case "uncounted":
            body.wheel_encoders.is_lost = on
        case "drifting":
            body.gyro_drift.set_rate(fault.amount if on else 0.0, now)
        case "late":
            base.late.delay = fault.amount if on else 0.0
        case "e_stopped":
            body.e_stop = on
        case _:
            body.backup_limit = BackupLimit(BACKUP_DISTANCE) if on else None


class FaultInjector:
    """Injects faults into the twins of one run. Raises TypeError for a run that is not in simulated time.

    The times of faults go on while the run is paused or stopped, so that a fault that pauses the run can end.
    """

    def __init__(self, runner: Runner, history: CaseHistory) -> None:
        if runner.twins is None:
            raise TypeError("only runs in simulated time have twins")
        self._runner, self._twins = runner, runner.twins
        self._history = history
        self._pressed: list[FaultSpec] = []  # what the base is made to feel now
        self._hand_count = 0  # by so many hands
        self.started_faults: list[FaultSpec] = []
        """Faults that have started, each with its actual start time."""

    def schedule(self, faults: Iterable[FaultSpec]) -> None:
        """Schedule the faults; faults that begin at 0 start at once."""
        for mishap in faults:
            if mishap.trigger is not None:
                self._wait_for_trigger(mishap)
            elif mishap.start > 0.0:
                self._twins.timeline.call_at(mishap.start, partial(self.start, mishap))
            else:
                self.start(mishap)

    def _wait_for_trigger(self, fault: FaultSpec) -> None:
        """Start a fault when its trigger first occurs, after the tick in which it occurs."""

        def hear(happening: ObservedEvent) -> None:
            if fault.trigger is not None and fault.trigger.matches(happening):
                self._history.listeners.remove(hear)
                self._twins.timeline.call_at(self._now(), partial(self.start, fault))

        self._history.listeners.append(hear)

    def start(self, fault: FaultSpec) -> None:
        """Start a fault now, ignoring its start time."""
        self.started_faults.append(replace(fault, start=self._now()))
        if fault.part == RUN:
            self._suspend_run(fault)
            return
        self._switch(fault, on=True)
        if fault.seconds < math.inf:
            self._twins.timeline.call_at(self._now() + fault.seconds, partial(self._switch, fault, on=False))

    def _now(self) -> float:
        return self._twins.timeline.clock.now()

    def _switch(self, fault: FaultSpec, *, on: bool) -> None:
        """Begin or end a fault. The checker has verified that the part exists."""
        twins = self._twins
        twin = twins.parts.get(fault.part)
        plug: SimulatedPlug | None = None if twin is None else twin.plug
        match fault.state:
            case "unplugged" if plug is not None:
                plug.unplug() if on else plug.plug_in()
            case _ if isinstance(twin, JointsTwin):
                _fail_joint(twin, fault, on=on)
            case _ if isinstance(twin, NeckTwin | ServoHeadTwin):
                twin.fail(fault.state if on else "")
            case "frozen" if twins.camera is not None:
                twins.camera.freeze() if on else twins.camera.thaw()
            case "covered" if twins.camera is not None:
                twins.camera.cover() if on else twins.camera.uncover()
            case "slow" if twins.camera is not None:
                twins.camera.slow_down() if on else twins.camera.slow_down(1)
            case "deaf" if twins.microphone is not None:
                twins.microphone.hears_nothing = on
            case "hanging" if twins.voice is not None:
                twins.voice.is_hanging = on
            case _ if twins.base is not None:
                self._switch_base(twins.base, fault, on=on)

    def _switch_base(self, base: BaseTwin, fault: FaultSpec, *, on: bool) -> None:
        match fault.state:
            case "driven":
                self._hand_count += 1 if on else -1
                self._drive_by_hand(base) if on else base.stop(source=Source.TELEOP)
            case "lifted":
                base.lift(up=on)
            case "docked":
                base.set_power(on=on)
            case "battery":
                base.drain(100.0 * fault.amount)
            case state if state in DRIVE_STATES:
                _switch_drive(base, fault, self._now(), on=on)
            case _:
                self._pressed = felt = [each for each in self._pressed if each is not fault] + ([fault] if on else [])
                buttons = frozenset(int(each.detail) for each in felt if each.state == "button")
                base.press(_sides(felt, "bumped"), cliff=_sides(felt, "cliff"), buttons=buttons)

    def _drive_by_hand(self, base: BaseTwin) -> None:
        """Repeat the velocity command of a simulated person until the last fault of this kind ends."""
        if self._hand_count:
            with suppress(DriverError):  # unplugged, or latched: the person tries again
                base.drive(HAND_VELOCITY, source=Source.TELEOP)
            self._twins.timeline.call_at(self._now() + HAND_COMMAND_INTERVAL, partial(self._drive_by_hand, base))

    def _suspend_run(self, fault: FaultSpec) -> None:
        """Suspend ticks for a time: the loop is delayed, or the run is paused or stopped."""
        runner, timeline = self._runner, self._twins.timeline
        executive, latch, until = runner.executive, runner.latch, self._now() + fault.seconds
        executive.idle = executive.run.wait
        match fault.state:
            case "stalled":  # what is due goes on within, as the world does around a process that is held up
                timeline.run_until(until)
            case "paused":
                executive.pause()
                timeline.call_at(until, executive.resume)
            case _:
                latch.stop(STOPPED_BY)
                timeline.call_at(until, partial(self._release, latch.stop_count))

    def _release(self, number: int) -> None:
        if self._runner.latch.release(number):
            self._runner.executive.resume()


def _fail_joint(twin: JointsTwin, fault: FaultSpec, *, on: bool) -> None:
    match fault.state:
        case "overloaded":
            twin.overload(fault.detail)
        case "turned":
            twin.turn_by_hand(fault.detail, fault.amount)
        case "pushed" if on:
            twin.push(fault.detail, fault.amount)
        case _:
            twin.fail(fault.detail, fault.state if on else "")


def _sides(faults: list[FaultSpec], state: str) -> Sides:
    sides = {mishap.detail for mishap in faults if mishap.state == state}
    return Sides(left="left" in sides, centre="centre" in sides, right="right" in sides)
