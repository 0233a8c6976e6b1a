"""Simulated head of hobby servos: the driver's motion profile in whole degrees, and two simulated servos."""

from collections.abc import Callable
from dataclasses import replace
from math import inf

from drivers.api import (
    HEAD_ACCELERATION,
    HeadPose,
    Health,
    Quality,
    Reading,
    ReconnectPolicy,
    StatusCallback,
    ignore,
)
from drivers.clock import Clock
from drivers.head.axis import MAX_DEGREES, SERVO_LAG, ServoAxis, make_servo_axis, next_degrees
from drivers.head.keys import TwoServoKeys
from drivers.head.pantilt import STRAIGHT_AHEAD, PanTiltMotion, ProfiledHead
from drivers.sim.context import SimContext
from drivers.sim.plug import SimulatedPlug
from drivers.sim.servo import SERVO_SPEED, Shaft
from drivers.transport.reconnect import LatchingPart, ReconnectTracker


class ServoHeadTwin(ProfiledHead[ServoAxis], LatchingPart):
    """Simulated head of two hobby servos: a ``drivers.api.Head``. Not thread-safe.

    Call ``step`` every ``STEP_INTERVAL``. ``pan``, ``tilt``, ``speed`` (rad/s), ``acceleration`` (rad/s^2) and
    ``start`` are as for ``ArduinoHead``: after ``open`` the head moves from the start angles of the sketch to
    ``start``. The pose is the last setpoint in whole degrees; ``true_pose`` returns the simulated angles. The plug
    powers the board, so the board restarts at each connection: then the goal is dropped, and the head does not move
    until a command. ``away`` is the reconnect policy. ``changed`` is called with each change of the pose. Raises
    ValueError for impossible values.
    """

    STEP_INTERVAL = 0.02
    LAG = SERVO_LAG

    def __init__(
        self,
        clock: Clock,
        *,
        pan: ServoAxis,
        tilt: ServoAxis,
        speed: float,
        acceleration: float = HEAD_ACCELERATION,
        away: ReconnectPolicy | None = None,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
        start: HeadPose = STRAIGHT_AHEAD,
        name: str = "head",
    ) -> None:
        self.name = name
        self.plug = SimulatedPlug(self.name, report, on_online=self._on_plugged, on_offline=self._on_unplugged)
        super().__init__(
            clock, PanTiltMotion(self.name, pan, tilt, speed=speed, acceleration=acceleration, start=start), changed
        )
        self._untrimmed_axes = (pan, tilt)  # a later trim changes the setpoints, not the mounting
        self._shafts = tuple(
            Shaft(float(axis.start_degrees), float(axis.start_degrees), SERVO_SPEED) for axis in (pan, tilt)
        )
        self._reconnect = ReconnectTracker(away)
        self._sent: tuple[int, ...] | None = None  # degrees; None before the first connection
        self._pose = STRAIGHT_AHEAD
        self._stamp = -inf
        self._reversed = False

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected while unplugged, DeviceFault while latched.
        """
        self._motion.check(target)
        self.plug.check_online()
        self._reconnect.require_unlatched(self.name)
        accepted = self.limits.clamp(target)
        pan, tilt = self._motion.axes  # as the driver: the motion ends at whole degrees of the servos
        self._motion.look(
            HeadPose(pan.nearest_angle(accepted.pan), tilt.nearest_angle(accepted.tilt)), self._clock.now()
        )
        self.step()
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Pose of the last setpoints; stale while unplugged, and none before the first connection."""
        if self._sent is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return Reading(self._pose, self._stamp, Quality.GOOD if self.plug.online else Quality.STALE)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Connect at once, unless unplugged."""
        self._reconnect.restart()
        self.plug.open()

    def close(self) -> None:
        """Hold at once; the servos keep their angles. Safe from any state, more than once."""
        self._on_unplugged()
        self.plug.close()

    def health(self) -> Health:
        """Return whether the head is plugged in."""
        return replace(self.plug.health({}), reconnected_at=self._reconnect.reconnected_at)

    def step(self) -> None:
        """Advance: send each axis its next whole degree if it has changed."""
        if not self.plug.online:
            return
        now = self._clock.now()
        self._reconnect.on_report(now)
        still = self._motion.is_still
        if still and self._is_settled:
            self._stamp = now
            self._history.add(now, (self._pose.pan, self._pose.tilt))
            return
        self._is_settled = still
        pan, tilt = way = self._motion.advance(now)
        sent = next_degrees(self._motion, way, self._sent)
        pose = HeadPose(pan.axis.to_radians(sent[0]), tilt.axis.to_radians(sent[1]))
        turned = self._sent is None or pose != self._pose
        self._pose = pose
        if sent != self._sent:
            self._sent = sent
            for shaft, goal in zip(self._shafts, sent, strict=True):
                shaft.advance(now)
                shaft.goal = float(MAX_DEGREES - goal if self._reversed else goal)
        self._stamp = now
        self._history.add(now, (self._pose.pan, self._pose.tilt))
        if turned:
            self._changed()

    def true_pose(self, now: float) -> HeadPose:
        """Return the simulated angles of the servos at time ``now``, which lag a little behind the setpoints."""
        pan, tilt = (
            axis.to_radians(shaft.advance(now)) for axis, shaft in zip(self._untrimmed_axes, self._shafts, strict=True)
        )
        return HeadPose(pan, tilt)

    def fail(self, fault: str = "") -> None:
        """Set the servo fault: "blocked", "reversed", or "" for none; no sensor detects it."""
        self._reversed = fault == "reversed"
        for shaft in self._shafts:
            shaft.advance(self._clock.now())
            shaft.motion_factor = 0.0 if fault == "blocked" else 1.0
        self._sent = None
        self._is_settled = False

    def _on_plugged(self) -> None:
        """Continue from the start angles of a booted sketch; move to the start pose only at the first time."""
        now, axes = self._clock.now(), self._motion.axes
        self._reconnect.on_report(now, restarted=True)
        pan, tilt = (axis.to_radians(axis.start_degrees) for axis in axes)
        if self._has_start:
            self._motion.drop_goal(pan=pan, tilt=tilt, now=now)
        else:
            self._motion.set_position(HeadPose(pan, tilt), now)
        self._has_start, self._sent, self._is_settled = True, None, False
        self.step()

    def _on_unplugged(self) -> None:
        """Drop the goal: the servos hold the last setpoints."""
        if self._sent is not None:
            self._motion.drop_goal(pan=self._pose.pan, tilt=self._pose.tilt, now=self._clock.now())


def make_head_twin(keys: TwoServoKeys, away: ReconnectPolicy, context: SimContext) -> ServoHeadTwin:
    """Return the twin of a head of two hobby servos."""
    return ServoHeadTwin(
        context.clock,
        pan=make_servo_axis(keys.pan),
        tilt=make_servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        away=away,
        report=context.report,
        name=context.part_name,
    )
