"""Driver of a walking base: joints of two legs, controlled by the walking engine 100 times a second.

A walk begins slowly from any leg position, and ends in a stand: a stop finishes the current step and closes the feet.
The pose is dead reckoning of the commanded steps. If the joints are lost, the walk is dropped; they hold or relax as
configured, and a later walk begins from their position.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from threading import Event
from types import MappingProxyType
from typing import Literal, Unpack

import numpy as np

from drivers.api import (
    FALLEN_REASON,
    ZERO_VELOCITY,
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
from drivers.legs.actions import LegActions, is_near_start
from drivers.legs.body import Floats
from drivers.legs.compensation import Compensation
from drivers.legs.engine import CONTROL_INTERVAL, AttitudeEstimate, LegPosture, WalkingEngine
from drivers.legs.fall_detection import FallDetector
from drivers.servos.servo_joints import ServoJoints

MAX_TIME_STEP = 0.03
"""Maximum time step of a walk in seconds: after a late step the walk is slower, and does not leap."""

TORQUE_ON_TIMEOUT = 1.0
"""Seconds for which leg joints may lack torque at the start of a motion, before the legs are latched."""

READING_TIMEOUT = 0.3
"""Seconds without a reading of a leg joint after which the walk is dropped.

The time is not shorter, because a walk that is dropped ends in mid-step.
"""


class LegsBase(ArbitratedBase):
    """A ``drivers.api.Base`` on the legs of ``joints``, which the caller opens and closes.

    Call ``step`` every ``STEP_INTERVAL``. ``read_attitude`` returns the trunk's attitude, or None if it is not
    measured. A fall latches the legs; ``at_fall`` says whether they relax or hold. If the legs were controlled at the
    fall, the joints in ``tucked`` also move to its angles (radians).
    """

    STEP_INTERVAL = CONTROL_INTERVAL
    has_witnesses = False  # no witnesses: steps slip, and the trunk sways

    def __init__(
        self,
        joints: Joints,
        clock: Clock,
        engine: WalkingEngine,
        *,
        read_attitude: Callable[[], AttitudeEstimate | None] = lambda: None,
        compensation: Compensation | None = None,
        torques: Mapping[str, float] = MappingProxyType({}),
        at_fall: Literal["relax", "hold"] = "relax",
        tucked: Mapping[str, float] = MappingProxyType({}),
        **settings: Unpack[BaseSettings],
    ) -> None:
        super().__init__(clock, **settings)
        self.legs = self
        if isinstance(joints, ServoJoints):
            joints.monitors_progress = False  # loaded joints do not reach their goals
        self._joints, self._engine, self._read_attitude = joints, engine, read_attitude
        self._at_fall, self._tucked, self._compensation = at_fall, tucked, compensation
        self._leg_joints = engine.body.leg_joints
        self._is_open = self._joints_online = self._is_ready = False  # ready: the legs are at the engine's angles
        self._actions = LegActions(engine, joints.limits, torques)
        self._stepped_at = 0.0
        self._stiff = False
        self._limp_since: float | None = None  # while the legs are moved by hand
        self._fall_detector, self._is_fallen = FallDetector(engine), False
        self._last_reading: Reading[BaseState] = Reading(None, 0.0, Quality.NONE)
        self.standing = Event()
        self.standing.set()

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Walk at ``velocity``; see ``ArbitratedBase``.

        Also raises DeviceFault after a fall, or if a leg is far from a stand.
        """
        if velocity != ZERO_VELOCITY and self._is_fallen:
            raise DeviceFault(f"{self.name}: {FALLEN_REASON}", hint="set it upright by hand")
        if velocity != ZERO_VELOCITY and self._joints_online and not self.is_walking:
            self._refuse_unreachable_stand()
        return super().drive(velocity, source=source)

    def perform(self, act: str, gait: GaitKeys | None = None) -> float:
        """Request a leg action after the current walk; see ``drivers.api.Legs``. Raises DeviceFault after a fall."""
        self._require()
        with self._lock:
            require(self.name, self._mux.latched)
            if self._is_fallen:
                raise DeviceFault(f"{self.name}: {FALLEN_REASON}", hint="set it upright by hand, or by `get_up`")
            return self._actions.request(act, gait, self._clock.now())

    def stop(self, *, source: Source | None = None) -> None:
        """Come to a stand; see ``ArbitratedBase``. Legs on the way to a stand or a sit stay where they are."""
        with self._lock:
            if source in (None, Source.MISSION):
                self._actions.cancel()
            super().stop(source=source)

    def state(self) -> Reading[BaseState]:
        """Newest state of the base; stale while the joints are offline."""
        latest = self._last_reading
        return latest if self._joints_online or latest.value is None else replace(latest, quality=Quality.STALE)

    def health(self) -> Health:
        """Return whether the joints of both legs are online."""
        if not self._is_open:
            return Health(False, f"{self.name}: not opened yet", "open it first")
        returned = self._mux.absence.reconnected_at
        if self._joints_online:
            return Health(True, counters=self._mux.command_delays.counters("command"), reconnected_at=returned)
        silent = [name for name in self._leg_joints if not self._joints.states()[name].good]
        said = self._joints.health()
        what = f"no readings of {', '.join(silent)}" if silent else "its joints are gone"
        detail = f"{self.name}: {what}" + (f": {said.detail}" if said.detail else "")
        return Health(
            False, detail, said.hint or "check the power and the cable of its servos", reconnected_at=returned
        )

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Use the joints as soon as they are online."""
        self._mux.absence.restart()
        self._is_open = True

    def close(self) -> None:
        """Stop the base, and no longer use the joints. Safe from any state, more than once."""
        self.stop()
        self._is_open = self._joints_online = False

    # --- steps ---------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Read the joints, and send their goals. An error ends the walk, latches the base and is raised."""
        if not self._is_open:
            return
        try:
            self._step()
        except BaseException as error:  # SystemExit too, as drivers.legs.make takes it
            with self._lock:
                self._reset_walk()
                self._mux.latch(f"the walk failed: {type(error).__name__}: {error}")
            raise

    def _step(self) -> None:
        now, states = self._clock.now(), self._joints.states()
        heard = all(now - (each := states[name]).stamp <= READING_TIMEOUT and each.value for name in self._leg_joints)
        if not (heard and self._joints.health().online):
            self._on_joints_lost()
            return
        felt = self._read_attitude()
        with self._lock:
            self._update_state(states, felt, now)
            try:
                wanted = self._mux.next_velocity(now, self._last_state)
                self._move_legs(ZERO_VELOCITY if self._is_fallen else wanted, states, felt, now)
            except NotConnected:
                self._on_joints_lost()
            except DeviceFault as fault:  # latched: a person must enable the arm
                self._reset_walk()
                self._mux.latch(str(fault))
            steering = self._mux.steering
        self._report_steering(steering)

    @property
    def is_walking(self) -> bool:
        """True while a walk or another leg action controls the legs."""
        return self._actions.is_busy or not self._engine.is_standing

    def _update_state(
        self, states: Mapping[str, Reading[JointState]], attitude: AttitudeEstimate | None, now: float
    ) -> None:
        """Update the state from the readings of the joints and the steps of the walk."""
        values = [reading.value for name in self._leg_joints if (reading := states[name]).value is not None]
        if not self._joints_online:
            self._joints_online = True
            self._report_online(f"{self.name}: the joints of both legs are there")
        limp = [name for name, value in zip(self._leg_joints, values, strict=True) if not value.torque]
        if not (limp and self.is_walking):
            self._limp_since = None
        elif self._limp_since is None:
            self._limp_since = now
        if self._limp_since is not None and (self._stiff or now - self._limp_since > TORQUE_ON_TIMEOUT):
            self._mux.latch(f"{', '.join(limp)} went limp")
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {', '.join(limp)} went limp in a walk"))
        if limp:
            self._reset_walk()
        self._stiff = not limp
        afoot = self.is_walking or self._actions.posture is Poised.STANDING
        self._fall_detector.update(attitude, values, now, legs_led=afoot)
        self._on_fall(self._fall_detector.fallen, limp=attitude is not None, led=afoot and not self._mux.latched)
        pose, (ahead, _, turn) = self._engine.pose
        if self._actions.is_busy:
            ahead, turn = self._actions.speed
        state = BaseState(
            Pose2D(pose.x, pose.y, pose.heading),
            Velocity(ahead, turn),
            battery_voltage=sum(value.voltage for value in values) / len(values),
            battery_percent=100.0,
            reckoned=True,
            lean=self._fall_detector.lean,
            fallen=self._is_fallen,
            posture=Poised.MOVING if not self._engine.is_standing else self._actions.posture,
        )
        self._last_reading = Reading(state, now, Quality.GOOD)
        self._remember(now, state.pose)
        self._mux.on_report(now)
        self._mux.on_state(state, now)

    def _on_fall(self, fallen: bool, *, limp: bool, led: bool) -> None:
        """Handle a fall: drop the walk, relax or hold the legs as configured, and tuck the arms.

        ``limp`` is True if the trunk's attitude is measured: only then the legs may relax and the arms are tucked. Arms
        are tucked only if the legs were controlled at the fall (``led``).
        """
        if fallen and not self._is_fallen:
            self._reset_walk()
            self._mux.latch(FALLEN_REASON)
            with suppress(DriverError):
                if limp and self._at_fall == "relax":  # only the legs: other joints may be held by hand
                    self._joints.relax(self._leg_joints)
                if self._tucked and limp and led:
                    self._joints.move(self._tucked)
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {FALLEN_REASON}", "set it upright by hand"))
        self._is_fallen = fallen

    def _move_legs(
        self, wanted: Velocity, states: Mapping[str, Reading[JointState]], attitude: AttitudeEstimate | None, now: float
    ) -> None:
        dt, self._stepped_at = min(max(now - self._stepped_at, 0.0), MAX_TIME_STEP), now
        moving = wanted != ZERO_VELOCITY
        if self._mux.latched:
            self._actions.cancel()
        if self._engine.is_standing:
            # Other drivers move the legs, too.
            self._is_ready = self._is_ready and is_near_start(self._engine.ready_angles, self._leg_joints, states)
            posture = self._actions.step(self._leg_angles(states), now, dt, walk=moving and not self._is_ready)
            if posture is not None:
                self._is_ready = self._actions.posture is Poised.STANDING
                self._send(posture, dt)
            if self._actions.is_busy or not (moving and self._is_ready):
                self._update_standing()
                return
        self.standing.clear()
        self._engine.command(wanted.linear, 0.0, wanted.angular)
        self._send(self._engine.step(dt, attitude), dt)
        self._update_standing()

    def _update_standing(self) -> None:
        if not self.is_walking:
            self.standing.set()

    def _send(self, posture: LegPosture, dt: float) -> None:
        if posture.refused and not self._mux.latched:
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {posture.refused}", "take shorter steps"))
            self._mux.latch(posture.refused)  # it ends in a stand, despite further commands
        sent = posture.angles if self._compensation is None else self._compensation.goals(posture, dt)
        self._joints.move(dict(zip(self._leg_joints, sent.tolist(), strict=True)))

    def _leg_angles(self, states: Mapping[str, Reading[JointState]]) -> Floats:
        """Return the angles of the leg joints, all of which have a reading."""
        return np.array([value.position for name in self._leg_joints if (value := states[name].value) is not None])

    def _refuse_unreachable_stand(self) -> None:
        here = self._leg_angles(self._joints.states())
        if len(here) == len(self._leg_joints) and (far := self._actions.unreachable_reason(here)):
            raise DeviceFault(f"{self.name}: {far}", hint="bring its legs to a stand by a gesture, or by hand")

    def _reset_walk(self) -> None:
        """Drop the walk: the legs are not where it expects them."""
        if self._compensation is not None:
            self._compensation.reset()
        self._engine.reset()
        self._actions.reset()
        self._is_ready = False
        self.standing.set()

    def _on_joints_lost(self) -> None:
        self._reset_walk()
        self._actions.cancel()
        self._mux.stop()
        self._stiff = False
        if self._joints_online:
            self._joints_online = False
            self._silent = True
            health = self.health()
            self._report(DeviceStatus(self.name, "offline", health.detail, health.hint))

    # --- of ArbitratedBase --------------------------------------------------------------------------------------------

    @property
    def _last_state(self) -> BaseState | None:
        return self._last_reading.value

    def _offline_error(self, now: float) -> NotConnected | None:  # noqa: ARG002 - it knows by itself
        if self._joints_online:
            return None
        health = self.health()
        return NotConnected(health.detail, hint=health.hint)

    def _require(self) -> None:
        if (absent := self._offline_error(self._clock.now())) is not None:
            raise absent

    def _send_stop(self) -> None:
        """End the walk: finish the current step and close the feet."""
        self._engine.halt()
