"""Simulated arm of servos: the joints and rules of the real driver, in one thread and without a bus."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from math import copysign, inf
from typing import ClassVar, Literal

from drivers.api import (
    Coupling,
    HeadPose,
    Health,
    JointState,
    Quality,
    Reading,
    ReconnectPolicy,
    StatusCallback,
    ignore,
)
from drivers.api.joints import ActiveCouplings
from drivers.clock import Clock
from drivers.head.joints_head import JointsHead
from drivers.joints.request_checks import check_couplings, check_move, check_names
from drivers.servos.declared import DynamixelKeys, NeckKeys
from drivers.servos.driver import STALE_AFTER
from drivers.servos.joint import Joint, JointSpec, check_joints
from drivers.servos.make import joint_axis as neck_axis
from drivers.servos.make import joint_specs
from drivers.servos.models import MODELS
from drivers.servos.servo_joints import ServoJoints
from drivers.servos.setpoint_lookahead import approach_speed, lookahead_distance
from drivers.servos.status_report import SHUTDOWN_HINT
from drivers.servos.wire import ServoFault
from drivers.sim.context import SimContext
from drivers.sim.plug import SimulatedPlug
from drivers.sim.servo import FRICTION_TORQUE, Shaft

# One simulated servo of an arm: a turning shaft, stiff, limp or shut down, in angles of its joint.

VOLTAGE = 12.0
"""Voltage that a simulated servo reports."""

TEMPERATURE = 35.0
"""Temperature that a simulated servo reports, in degrees Celsius."""

STALL_LOAD = 0.9
"""Load of a blocked servo as a share of the stall torque."""

TWIN_FAULTS = ("blocked", "frozen", "reversed", "silent", "pushed")
"""Faults of a simulated servo: shaft blocked, sensor frozen, motor reversed, no replies, joint held by a hand."""


class ServoTwin:
    """A simulated servo with the state of its ``joint``. It starts with torque off and the joint at 0.

    ``fault`` is one of ``TWIN_FAULTS``, or empty.
    """

    def __init__(self, name: str, spec: JointSpec) -> None:
        self.joint = Joint(name, spec, MODELS[spec.model], undriven_reason="")
        self._shaft = Shaft(0.0, 0.0, 0.0)
        self._resting_state: JointState | None = None  # its state while it stands still
        self.fault = ""
        self._frozen_position: float | None = None  # reading of a frozen sensor

    def move_to(self, goal: float, speed: float, now: float) -> None:
        """Move to ``goal`` (radians, within the limits) at ``speed`` (rad/s), at most the motor's, from ``now`` on."""
        joint, shaft = self.joint, self._shaft
        if joint.torque and goal == joint.goal and speed == joint.speed:
            return  # already on its way
        joint.goal, joint.torque, joint.speed, self._resting_state = goal, True, speed, None
        shaft.advance(now)
        shaft.goal = joint.angle(joint.ticks(goal))
        wanted = joint.model.speed_ticks(min(max(speed, 0.0), joint.limits.speed)) * joint.model.speed_unit
        shaft.speed = min(wanted, joint.model.free_speed)

    def hold(self, now: float) -> None:
        """Hold the current position; a servo that has shut down stays without torque."""
        if not self.joint.is_shut_down:
            here = self.joint.angle(self.joint.clamp_ticks(self.joint.ticks(self.position(now))))
            self.move_to(here, self.joint.limits.speed, now)

    def fail(self, fault: str, now: float) -> None:
        """Set a fault of the servo from ``now`` on; an empty one ends it."""
        shaft = self._shaft
        self._frozen_position = self.position(now) if fault == "frozen" else None
        shaft.motion_factor = {"blocked": 0.0, "pushed": 0.0, "reversed": -1.0}.get(fault, 1.0)
        self.fault, self._resting_state = fault, None
        self.joint.undriven_reason = "does not answer" if fault == "silent" else ""

    def push(self, angle: float, now: float) -> None:
        """Hold the joint at ``angle`` (radians) by an external force, even against its torque, until ``fail``."""
        self.fail("pushed", now)
        self._shaft.position = self.joint.angle(self.joint.ticks(angle))

    def replace_servo(self, angle: float, now: float) -> None:
        """Simulate a replacement of the servo by an equal one with torque off and the joint at ``angle`` (radians)."""
        self._shaft.advance(now)
        self._shaft.position = self._shaft.goal = self.joint.angle(self.joint.ticks(angle))
        self._resting_state = None

    def stop_at_setpoint(self, now: float) -> None:
        """Stop at the last setpoint, as a real servo does that gets no new setpoint from time ``now`` on."""
        here, far = self._shaft.advance(now), lookahead_distance(self.joint, self.joint.speed)
        goal = min(max(self._shaft.goal, here - far), here + far)
        self.joint.setpoint = self.joint.ticks(goal)
        self._shaft.goal = self.joint.angle(self.joint.setpoint) if self.joint.torque else goal

    def relax(self, now: float) -> None:
        """Switch the torque of the servo off."""
        self._shaft.goal = self._shaft.advance(now)
        self.joint.torque, self.joint.goal, self._resting_state = False, None, None

    def turn_by_hand(self, angle: float, now: float) -> None:
        """Turn the joint to ``angle`` (radians) within the servo's range, if its torque is off."""
        if not self.joint.torque:
            self._shaft.advance(now)
            self._shaft.position = self._shaft.goal = self.joint.angle(self.joint.ticks(angle))
            self._resting_state = None

    def shut_down(self, now: float) -> None:
        """Switch the torque off, as after an overload, until the arm's ``recover``; the goal is kept."""
        goal = self.joint.goal
        self.relax(now)
        self.joint.goal, self.joint.is_shut_down = goal, True

    def angle(self, now: float) -> float:
        """Return the true angle of the joint at time ``now``, in radians."""
        return self._shaft.advance(now)

    def position(self, now: float) -> float:
        """Return the measured angle at time ``now``, in radians, in steps of the sensor."""
        if self._frozen_position is not None:
            self._shaft.advance(now)
            return self._frozen_position
        return self.joint.angle(self.joint.ticks(self._shaft.advance(now)))

    def state(self, now: float) -> JointState:
        """Return the measured state of the joint at time ``now``."""
        joint, shaft = self.joint, self._shaft
        if self._resting_state is not None and self._resting_state.blocked == joint.progress.blocked:
            return self._resting_state
        position = self.position(now)
        way = shaft.goal - shaft.position
        turns = bool(way) and not self.fault
        state = JointState(
            position=position,
            velocity=copysign(shaft.speed, way) if turns else 0.0,
            goal=joint.goal,
            load=copysign(FRICTION_TORQUE if shaft.motion_factor else STALL_LOAD, way) if way else 0.0,
            voltage=VOLTAGE,
            temperature=TEMPERATURE,
            moving=turns,
            torque=joint.torque,
            blocked=joint.progress.blocked,
        )
        self._resting_state = None if way or self.fault else state
        return state


class JointsTwin(ServoJoints):
    """A simulated ``drivers.api.Joints``: an arm whose servos are computed. Not thread-safe.

    Call ``step`` every ``STEP_INTERVAL``; it moves the joints that follow a leader, and calls ``changed``. ``at_rest``
    and ``away`` are those of the real driver: whether the arm holds or relaxes at rest, and its reconnect policy. All
    joints start at 0 with torque off. When the arm is unplugged, its servos stop at their last setpoints. When it is
    plugged in again, servos with requested torque hold their positions. Raises BadRequest that lists all invalid
    ``joints``.
    """

    STEP_INTERVAL = 0.025
    """Seconds between two steps of the simulated arm.

    This is longer than the interval at which the real driver reads its servos, because a simulated reading needs no
    step: it is computed on request.
    """

    always_stiff: ClassVar[bool] = False
    """True for joints whose torque cannot be switched off."""

    def __init__(
        self,
        joints: Mapping[str, JointSpec],
        clock: Clock,
        *,
        at_rest: Literal["hold", "relax"] = "hold",
        away: ReconnectPolicy | None = None,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
        name: str = "arm",
    ) -> None:
        check_joints(name, dict(joints))
        self._servos = {joint: self._make_servo(joint, spec) for joint, spec in joints.items()}
        described = {joint: servo.joint for joint, servo in self._servos.items()}
        super().__init__(described, clock, at_rest=at_rest, away=away, report=report, changed=changed, name=name)
        self.plug = SimulatedPlug(self.name, report, on_online=self._on_plugged_in, on_offline=self._on_unplugged)
        self._following = ActiveCouplings()
        self._read_at = -inf
        self._readings: Mapping[str, Reading[JointState]] = {}

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians); return the clamped goals.

        Ends the following of these joints; those that have shut down are left out, with a notice. Raises BadRequest for
        an unknown joint or a value that is not finite, NotConnected if the arm is unplugged.
        """
        speeds = speeds or {}
        check_move(self.name, goals, speeds, self._servos)
        self._require_ready()
        now = self._clock.now()
        self._refuse_blocked(goals, now)
        accepted = self._goal_limiter.clamp_goals(goals, now)
        self._following.release(goals)
        self._move_joints(accepted, speeds, now)
        return accepted

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Couple followers to leaders at every ``step``, until the next call; () ends all couplings.

        Joints that no longer follow hold their position. A distant follower approaches slowly; after replugging,
        following continues, slowly at first. Raises BadRequest for invalid couplings, and NotConnected, but not to end
        them.
        """
        check_couplings(self.name, couplings, self._servos)
        if couplings:
            self._require_ready()
        freed = self._following.followers_without(couplings)
        self._following = ActiveCouplings(couplings)
        self._hold_or_relax_and_report(freed, stiff=True)

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The current state of each joint; the last one, soon stale, while the arm is unplugged."""
        now = self._clock.now()
        if self.plug.online:
            if self._read_at != now:
                self._read(now)
            return self._readings
        if not self._readings:
            return {name: Reading(None, now, Quality.NONE) for name in self._servos}
        quality = Quality.GOOD if now - self._read_at <= STALE_AFTER else Quality.STALE
        return {name: replace(reading, quality=quality) for name, reading in self._readings.items()}

    def recover(self) -> tuple[str, ...]:
        """Switch the torque of servos that have shut down on again; return the names of their joints.

        The joints stay at their current positions. It also enables the arm. Raises NotConnected.
        """
        self.plug.check_online()
        self._reconnect.enable()
        shut = [servo for servo in self._servos.values() if servo.joint.is_shut_down]
        for servo in shut:
            servo.joint.is_shut_down, servo.joint.torque_request = False, True
            servo.hold(self._clock.now())
        self._read_at = -inf
        return tuple(servo.joint.name for servo in shut)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Connect the simulated arm at once, unless it is unplugged."""
        self._reconnect.restart()
        self.plug.open()

    def rest(self) -> None:
        """Hold or relax all joints, as ``at_rest`` says; report servos that did not get the command. Never raises."""
        self._reporter.report_not_at_rest(
            self._hold_or_relax(self._servos, stiff=self._stiff_at_rest), stiff=self._stiff_at_rest
        )

    def close(self) -> None:
        """Bring the arm to rest and disconnect. Safe from any state, more than once."""
        self.rest()
        self.plug.close()
        self._reporter.reset()
        for servo in self._servos.values():
            servo.joint.is_unconfirmed = False

    def health(self) -> Health:
        """Return whether the arm is connected, and which servos have shut down."""
        health = replace(self.plug.health({}), reconnected_at=self._reconnect.reconnected_at)
        shut = [servo.joint.title for servo in self._servos.values() if servo.joint.is_shut_down]
        if not health.online or not shut:
            return health
        return replace(health, detail=f"{self.name}: {', '.join(shut)} has shut down", hint=SHUTDOWN_HINT)

    def step(self) -> None:
        """Update the followers, stop blocked joints, and call ``changed``. Readings are computed on request."""
        if self.plug.online:
            self._reconnect.on_report(self._clock.now())
            if self._following:
                self._update_followers(self._clock.now())
            self._stop_blocked_joints(self._clock.now())
            self._changed()

    # --- for tests of missions --------------------------------------------------------------------------

    def true_angle(self, joint: str, now: float) -> float:
        """Return the true angle of ``joint`` at time ``now``, in radians."""
        return self._servos[joint].angle(now)

    def overload(self, joint: str) -> None:
        """Shut the servo of ``joint`` down by an overload. Raises BadRequest for an unknown joint."""
        check_names(self.name, {joint}, self._servos)
        servo, now = self._servos[joint], self._clock.now()
        if servo.joint.is_shut_down:
            return
        servo.shut_down(now)
        self._read_at = -inf
        if self.plug.online:
            servo.joint.reading = Reading(servo.state(now), now, Quality.GOOD)
            self._reporter.report_faults(servo.joint, ServoFault.OVERLOAD)
            self._reporter.report_shutdown(servo.joint)

    def fail(self, joint: str, fault: str = "") -> None:
        """Set a fault of ``TWIN_FAULTS`` for the servo of ``joint``; empty ends it.

        Raises BadRequest for an unknown joint.
        """
        check_names(self.name, {joint}, self._servos)
        self._servos[joint].fail(fault, self._clock.now())
        self._read_at = -inf

    def push(self, joint: str, angle: float) -> None:
        """Hold ``joint`` at ``angle`` (radians) by an external force, with or without torque, until ``fail``."""
        check_move(self.name, {joint: angle}, {}, self._servos)
        self._servos[joint].push(angle, self._clock.now())
        self._read_at = -inf

    def replace_servo(self, joint: str, angle: float) -> None:
        """Replace the servo of ``joint``, while unplugged; the joint is then at ``angle`` (radians)."""
        check_move(self.name, {joint: angle}, {}, self._servos)
        self._servos[joint].replace_servo(angle, self._clock.now())

    def turn_by_hand(self, joint: str, angle: float) -> None:
        """Turn ``joint`` to ``angle`` (radians) if its torque is off. Raises BadRequest for an unknown joint."""
        check_move(self.name, {joint: angle}, {}, self._servos)
        self._servos[joint].turn_by_hand(angle, self._clock.now())
        self._read_at = -inf

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _make_servo(self, name: str, spec: JointSpec) -> ServoTwin:
        return ServoTwin(name, spec)

    def _on_plugged_in(self) -> None:
        """Restore the requested torque state of every servo, at its current position.

        A servo whose torque state was never requested stays as it is.
        """
        now = self._clock.now()
        for servo in self._servos.values():
            self._check_displacement(servo.joint, servo.position(now))
            if servo.joint.is_shut_down:
                self._reporter.report_shutdown(servo.joint)
            elif servo.joint.torque_request is False:
                servo.relax(now)
            elif servo.joint.torque_request:
                servo.hold(now)
            servo.joint.is_unconfirmed = False
        self._following.mark_paused()
        if self._reconnect.on_report(now):
            self._following = ActiveCouplings()
        self._reporter.report_unconfirmed()
        self._read(now)

    def _check_displacement(self, joint: Joint, position: float) -> None:
        """Report a joint that was moved while the arm was unplugged."""
        if joint.name in self._readings:
            joint.reading = self._readings[joint.name]
            if (stood := joint.expected_position(position)) is not None:
                joint.approaches_slowly = True
                self._reporter.report_displacement(joint, stood, position)

    def _require_ready(self) -> None:
        """Raise NotConnected while the arm is unplugged, DeviceFault while it is latched."""
        self.plug.check_online()
        self._reconnect.require_unlatched(self.name)

    def _on_unplugged(self) -> None:
        """Keep the last readings, and stop all servos at their setpoints."""
        now = self._clock.now()
        self._read(now)
        for servo in self._servos.values():
            servo.stop_at_setpoint(now)

    def _read(self, now: float) -> None:
        self._readings = {name: self._reading(servo, now) for name, servo in self._servos.items()}
        self._read_at = now

    def _reading(self, servo: ServoTwin, now: float) -> Reading[JointState]:
        """Return the newest reading of a servo; with the fault ``silent`` the last one before, which becomes stale."""
        if servo.fault != "silent":
            return Reading(servo.state(now), now, Quality.GOOD)
        before = self._readings.get(servo.joint.name)
        if before is None or before.value is None:
            return Reading(None, now, Quality.NONE)
        return replace(before, quality=Quality.GOOD if now - before.stamp <= STALE_AFTER else Quality.STALE)

    def _move_joints(self, goals: Mapping[str, float], speeds: Mapping[str, float], now: float) -> None:
        """Move joints to goals within their limits, except those that have shut down."""
        for name, goal in goals.items():
            servo = self._servos[name]
            joint = servo.joint
            able = joint.is_driven and not joint.is_shut_down
            if able:
                joint.torque_request = True
                speed = speeds.get(name, self._limits[name].speed)
                speed = approach_speed(joint, goal, speed, servo.position(now))
                servo.move_to(goal, speed, now)
                joint.progress.command(goal, speed, now)
            if joint.excluded_from_move is able:
                joint.excluded_from_move = not able
                self._reporter.report_excluded()
        self._read_at = -inf

    def _stop_blocked_joints(self, now: float) -> None:
        """Hold joints that are blocked; relax joints that run away."""
        watched = [servo for servo in self._servos.values() if servo.joint.progress.active or servo.fault]
        for servo in watched:
            servo.joint.reading = self._reading(servo, now)
        for joint in self._check_progress(servo.joint for servo in watched):
            self._following.release([joint.name])
            joint.torque_request = self.always_stiff or not joint.progress.runs_away
            if self.always_stiff and joint.progress.runs_away:
                continue  # another goal would drive it the wrong way, too
            servo = self._servos[joint.name]
            servo.hold(now) if joint.torque_request else servo.relax(now)
            self._read_at = -inf

    def _update_followers(self, now: float) -> None:
        pairs = ((coupling.leader, coupling.follower) for coupling in self._following.couplings)
        positions = {name: self._servos[name].position(now) for pair in pairs for name in pair}
        goals = self._goal_limiter.clamp_goals(self._following.goals(positions), now)
        self._move_joints(goals, self._following.speeds(goals, positions, now), now)
        self._following.mark_paused([name for name in goals if self._servos[name].joint.excluded_from_move])

    def _hold_or_relax_and_report(self, names: Collection[str], *, stiff: bool) -> None:
        self._hold_or_relax(names, stiff=stiff)
        self._reporter.report_unconfirmed()

    def _hold_or_relax(self, names: Collection[str], *, stiff: bool) -> list[Joint]:
        """Hold or relax joints; return those that did not get the command, except joints that were never connected."""
        check_names(self.name, set(names), self._servos)
        now = self._clock.now()
        self._following.release(names)
        unheard_by = []
        for name in names:
            servo = self._servos[name]
            servo.joint.torque_request = stiff
            if self.plug.online:
                servo.hold(now) if stiff else servo.relax(now)
                servo.joint.progress.hold(servo.joint.goal if stiff else None)
                self._read_at = -inf
            elif self.plug.connections and not (stiff and servo.joint.is_shut_down):
                servo.joint.is_unconfirmed = True
                unheard_by.append(servo.joint)
        return unheard_by


# The twin of a head of Dynamixel servos: the real driver's steps, with simulated servos.


class NeckTwin(JointsHead[JointsTwin]):
    """Simulated head that is two joints of a simulated arm, and is unplugged with the arm.

    Call ``step`` every ``STEP_INTERVAL``.
    """

    @property
    def plug(self) -> SimulatedPlug:
        """Simulated cable of the servo bus."""
        return self._joints.plug

    def fail(self, fault: str = "") -> None:
        """Set a fault of ``drivers.servos.twin.TWIN_FAULTS`` for both joints; empty ends it."""
        for axis in self._untrimmed_axes:
            self._joints.fail(axis.joint, fault)

    def true_pose(self, now: float) -> HeadPose:
        """Return the head's true pose at time ``now``, computed with the trims at construction.

        So a trim that is changed later changes the true pose.
        """
        pan, tilt = (self._joints.true_angle(axis.joint, now) - axis.trim for axis in self._untrimmed_axes)
        return HeadPose(pan, tilt)


def make(keys: DynamixelKeys, stage: SimContext) -> JointsTwin:
    """Return the simulated arm; in a scene with physics, its servos carry the robot's body."""
    if stage.scene is not None and stage.part_name == "arm":  # the scene's body consists of the arm's joints
        from drivers.servos.rigid_twin import RigidJoints  # noqa: PLC0415 - it extends ``JointsTwin``, and is rare

        return RigidJoints(
            joint_specs(keys), stage.clock, stage.scene, at_rest=keys.at_end, away=keys.away, report=stage.report
        )
    return JointsTwin(
        joint_specs(keys), stage.clock, at_rest=keys.at_end, away=keys.away, report=stage.report, name=stage.part_name
    )


def make_neck(keys: NeckKeys, stage: SimContext) -> NeckTwin:
    """Return the simulated head on two joints of the arm's twin."""
    return NeckTwin(
        stage.parts["arm"],
        stage.clock,
        pan=neck_axis(keys.pan),
        tilt=neck_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        report=stage.report,
        name=stage.part_name,
    )
