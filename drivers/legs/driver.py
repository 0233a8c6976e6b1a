"""A base that walks: joints of two legs, led by the walking engine 100 times a second.

It begins from wherever its legs are found, slowly, and ends in a stand: a stop lets the step that is under way end and
closes the feet. Its pose is dead reckoning: the steps that it was told to make. Where its joints are gone, it forgets
the walk; they hold or go limp as their own section says, and a later walk begins anew from where they are.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from threading import Event
from types import MappingProxyType
from typing import Literal, Unpack

import numpy as np

from drivers.api import (
    FALLEN,
    STILL,
    BaseState,
    DeviceStatus,
    Health,
    Joints,
    JointState,
    Pose2D,
    Quality,
    Reading,
    Source,
    Velocity,
)
from drivers.api import Posture as Poised
from drivers.api.gait import GaitKeys
from drivers.base.arbitrated import ArbitratedBase, BaseSettings
from drivers.base.limits import require
from drivers.clock import Clock
from drivers.errors import DeviceFault, DriverError, NotConnected
from drivers.legs.acts import Acts, is_near
from drivers.legs.body import Floats
from drivers.legs.compensation import Compensation
from drivers.legs.engine import PERIOD, Engine, Felt, Posture
from drivers.legs.falling import Falls
from drivers.servos.commanded import CommandedJoints

LONGEST_STEP = 0.03
"""Seconds of a walk that are made up for at most after a turn that came late: the walk is slower then, and no leap."""

STIFFENING_TIME = 1.0
"""Seconds that limp joints have to hold, from the first step of a way to a stand; one that has shut down never does."""

SILENT_AFTER = 0.3
"""Seconds without a reading of a leg's joint after which the walk is given up: not sooner, for it ends in mid-step."""


class LegsBase(ArbitratedBase):
    """A ``drivers.api.Base`` of the legs of ``joints``, which somebody else opens and closes.

    ``step`` is to be called every ``PERIOD``. ``felt`` is asked for the trunk's attitude, where something measures it.
    When it falls, the legs are latched, and ``at_fall`` says whether they go limp; arms of legs that
    were led go to ``tucked`` (radians).
    """

    PERIOD = PERIOD
    has_witnesses = False  # steps slip, and the trunk sways: joints, falls and the clock of a walk remain

    def __init__(
        self,
        joints: Joints,
        clock: Clock,
        engine: Engine,
        *,
        felt: Callable[[], Felt | None] = lambda: None,
        compensation: Compensation | None = None,
        torques: Mapping[str, float] = MappingProxyType({}),
        at_fall: Literal["relax", "hold"] = "relax",
        tucked: Mapping[str, float] = MappingProxyType({}),
        **settings: Unpack[BaseSettings],
    ) -> None:
        super().__init__(clock, **settings)
        self.legs = self
        if isinstance(joints, CommandedJoints):
            joints.watched = False  # the floor keeps joints from their goals that carry a body
        self._joints, self._engine, self._felt_now = joints, engine, felt
        self._at_fall, self._tucked, self._compensation = at_fall, tucked, compensation
        self._legs = engine.body.walking
        self._open = self._there = self._ready = False  # ready: the legs are where the engine has them
        self._acts = Acts(engine, joints.limits, torques)
        self._stepped_at = 0.0
        self._stiff = False
        self._limp_since: float | None = None  # while the legs are led
        self._falls, self._fallen = Falls(engine), False
        self._latest: Reading[BaseState] = Reading(None, 0.0, Quality.NONE)
        self.stands = Event()
        self.stands.set()

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Walk so; see ``ArbitratedBase``. Raises DeviceFault too when it has fallen, or a leg is far from a stand."""
        if velocity != STILL and self._fallen:
            raise DeviceFault(f"{self.name}: {FALLEN}", hint="put it up by hand")
        if velocity != STILL and self._there and not self.walking:
            self._refuse_far()
        return super().drive(velocity, source=source)

    def perform(self, act: str, gait: GaitKeys | None = None) -> float:
        """Perform an act of the legs, once a walk has ended; see ``drivers.api.Legs``. It is not for legs that lie."""
        self._require()
        with self._lock:
            require(self.name, self._mux.latched)
            if self._fallen:
                raise DeviceFault(f"{self.name}: {FALLEN}", hint="put it up by hand, or by `get_up`")
            return self._acts.ask(act, gait, self._clock.now())

    def stop(self, *, source: Source | None = None) -> None:
        """Come to a stand; see ``ArbitratedBase``. Legs that move to a stand or a sit stay where they are."""
        with self._lock:
            if source in (None, Source.MISSION):
                self._acts.end()
            super().stop(source=source)

    def state(self) -> Reading[BaseState]:
        """The newest report; stale while the joints are not there."""
        latest = self._latest
        return latest if self._there or latest.value is None else replace(latest, quality=Quality.STALE)

    def health(self) -> Health:
        """Say whether the joints of both legs are there."""
        if not self._open:
            return Health(False, f"{self.name}: not opened yet", "open it first")
        returned = self._mux.absence.returned
        if self._there:
            return Health(True, counters=self._mux.command_delays.counters("command"), returned=returned)
        silent = [name for name in self._legs if not self._joints.states()[name].good]
        said = self._joints.health()
        what = f"nothing heard of {', '.join(silent)}" if silent else "its joints are gone"
        detail = f"{self.name}: {what}" + (f": {said.detail}" if said.detail else "")
        return Health(False, detail, said.hint or "look at the power and the cable of its servos", returned=returned)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Use the joints as soon as they are there."""
        self._mux.absence.begin()
        self._open = True

    def close(self) -> None:
        """Take no step any more. Safe from any state, more than once."""
        self.stop()
        self._open = self._there = False

    # --- whoever steps it ---------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Look at the joints, and tell them where to be. An error ends the walk, latches the base and is raised."""
        if not self._open:
            return
        try:
            self._step()
        except BaseException as error:  # SystemExit too, as drivers.legs.make takes it
            with self._lock:
                self._forget()
                self._mux.latch(f"the walk failed: {type(error).__name__}: {error}")
            raise

    def _step(self) -> None:
        now, states = self._clock.now(), self._joints.states()
        heard = all(now - (each := states[name]).stamp <= SILENT_AFTER and each.value for name in self._legs)
        if not (heard and self._joints.health().online):
            self._lose()
            return
        felt = self._felt_now()
        with self._lock:
            self._take(states, felt, now)
            try:
                wanted = self._mux.next_velocity(now, self._last_state)
                self._go(STILL if self._fallen else wanted, states, felt, now)
            except NotConnected:
                self._lose()
            except DeviceFault as fault:  # latched: somebody has to enable the arm
                self._forget()
                self._mux.latch(str(fault))
            steering = self._mux.steering
        self._report_steering(steering)

    @property
    def walking(self) -> bool:
        """Whether its legs are led right now."""
        return self._acts.busy or not self._engine.standing

    def _take(self, states: Mapping[str, Reading[JointState]], felt: Felt | None, now: float) -> None:
        """Take in how the joints are, and where the walk has led."""
        values = [reading.value for name in self._legs if (reading := states[name]).value is not None]
        if not self._there:
            self._there = True
            self._report_online(f"{self.name}: the joints of both legs are there")
        limp = [name for name, value in zip(self._legs, values, strict=True) if not value.torque]
        if not (limp and self.walking):
            self._limp_since = None
        elif self._limp_since is None:
            self._limp_since = now
        if self._limp_since is not None and (self._stiff or now - self._limp_since > STIFFENING_TIME):
            self._mux.latch(f"{', '.join(limp)} went limp")
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {', '.join(limp)} went limp in a walk"))
        if limp:
            self._forget()
        self._stiff = not limp
        afoot = self.walking or self._acts.posture is Poised.STANDING
        self._falls.look(felt, values, now, afoot=afoot)
        self._fall(self._falls.fallen, limp=felt is not None, led=afoot and not self._mux.latched)
        pose, (ahead, _, turn) = self._engine.pose
        if self._acts.busy:
            ahead, turn = self._acts.speed
        state = BaseState(
            Pose2D(pose.x, pose.y, pose.heading),
            Velocity(ahead, turn),
            battery_voltage=sum(value.voltage for value in values) / len(values),
            battery_percent=100.0,
            reckoned=True,
            lean=self._falls.lean,
            fallen=self._fallen,
            posture=Poised.MOVING if not self._engine.standing else self._acts.posture,
        )
        self._latest = Reading(state, now, Quality.GOOD)
        self._remember(now, state.pose)
        self._mux.on_report(now)
        self._mux.on_state(state, now)

    def _fall(self, fallen: bool, *, limp: bool, led: bool) -> None:
        """Notice a fall: stop the walk, leave legs as the robot file says, draw in arms of ``led`` legs."""
        if fallen and not self._fallen:
            self._forget()
            self._mux.latch(FALLEN)
            with suppress(DriverError):
                if limp and self._at_fall == "relax":  # what bears nothing may be held up by hand, and stays as it is
                    self._joints.relax(self._legs)
                if self._tucked and limp and led:
                    self._joints.move(self._tucked)
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {FALLEN}", "put it up by hand"))
        self._fallen = fallen

    def _go(self, wanted: Velocity, states: Mapping[str, Reading[JointState]], felt: Felt | None, now: float) -> None:
        dt, self._stepped_at = min(max(now - self._stepped_at, 0.0), LONGEST_STEP), now
        moving = wanted != STILL
        if self._mux.latched:
            self._acts.end()
        if self._engine.standing:
            self._ready = self._ready and is_near(self._engine.ready, self._legs, states)  # others move them too
            posture = self._acts.step(self._here(states), now, dt, walk=moving and not self._ready)
            if posture is not None:
                self._ready = self._acts.posture is Poised.STANDING
                self._send(posture, dt)
            if self._acts.busy or not (moving and self._ready):
                self._set_stands()
                return
        self.stands.clear()
        self._engine.command(wanted.linear, 0.0, wanted.angular)
        self._send(self._engine.step(dt, felt), dt)
        self._set_stands()

    def _set_stands(self) -> None:
        if not self.walking:
            self.stands.set()

    def _send(self, posture: Posture, dt: float) -> None:
        if posture.refused and not self._mux.latched:
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {posture.refused}", "take shorter steps"))
            self._mux.latch(posture.refused)  # it ends in a stand, whoever goes on commanding
        sent = posture.angles if self._compensation is None else self._compensation.goals(posture, dt)
        self._joints.move(dict(zip(self._legs, sent.tolist(), strict=True)))

    def _here(self, states: Mapping[str, Reading[JointState]]) -> Floats:
        """Return where the joints of the legs are, all of which were heard of."""
        return np.array([value.position for name in self._legs if (value := states[name].value) is not None])

    def _refuse_far(self) -> None:
        here = self._here(self._joints.states())
        if len(here) == len(self._legs) and (far := self._acts.far(here)):
            raise DeviceFault(f"{self.name}: {far}", hint="bring its legs to a stand by a gesture, or by hand")

    def _forget(self) -> None:
        """Forget the walk: the legs are not where it has them."""
        if self._compensation is not None:
            self._compensation.rest()
        self._engine.rest()
        self._acts.forget()
        self._ready = False
        self.stands.set()

    def _lose(self) -> None:
        self._forget()
        self._acts.end()
        self._mux.stop()
        self._stiff = False
        if self._there:
            self._there = False
            self._silent = True
            health = self.health()
            self._report(DeviceStatus(self.name, "offline", health.detail, health.hint))

    # --- of ArbitratedBase --------------------------------------------------------------------------------------------

    @property
    def _last_state(self) -> BaseState | None:
        return self._latest.value

    def _offline_error(self, now: float) -> NotConnected | None:  # noqa: ARG002 - it knows by itself
        if self._there:
            return None
        health = self.health()
        return NotConnected(health.detail, hint=health.hint)

    def _require(self) -> None:
        if (absent := self._offline_error(self._clock.now())) is not None:
            raise absent

    def _send_stop(self) -> None:
        """End the walk: with the step that is under way, and one that closes the feet."""
        self._engine.halt()
