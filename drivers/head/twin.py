"""The twin of a Rodney head: the real driver's profiles in whole degrees, and two servos that follow them."""

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
    """A ``drivers.api.Head`` made of arithmetic. ``step`` is to be called every ``STEP_INTERVAL``; for one thread.

    ``pan``, ``tilt``, ``speed`` (rad/s), ``acceleration`` (rad/s^2) and ``start`` as for ``ArduinoHead``: from where
    the sketch puts its servos it goes to ``start`` once opened. Its pose is what the servos were sent, in whole
    degrees; ``true_pose`` is where they are. A goal does not survive the plug, which its board has its power from: it
    starts anew, and the head stays there until it is told. ``away`` says what of before goes on.
    ``changed`` is called whenever the pose has changed.
    Raises ValueError for values that make no sense.
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
        self._untrimmed_axes = (pan, tilt)  # what it is trimmed to later turns it in truth
        self._shafts = tuple(
            Shaft(float(axis.start_degrees), float(axis.start_degrees), SERVO_SPEED) for axis in (pan, tilt)
        )
        self._reconnect = ReconnectTracker(away)
        self._sent: tuple[int, ...] | None = None  # degrees; None before it was ever there
        self._pose = STRAIGHT_AHEAD
        self._stamp = -inf
        self._reversed = False

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected while it is not there, DeviceFault while it is latched.
        """
        self._motion.check(target)
        self.plug.check_online()
        self._reconnect.require_unlatched(self.name)
        accepted = self.limits.clamp(target)
        pan, tilt = self._motion.axes  # as the real one: its way ends where the servos will stand
        self._motion.look(
            HeadPose(pan.nearest_angle(accepted.pan), tilt.nearest_angle(accepted.tilt)), self._clock.now()
        )
        self.step()
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Where the servos were sent last; stale while it is not there, and none before it first was."""
        if self._sent is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return Reading(self._pose, self._stamp, Quality.GOOD if self.plug.online else Quality.STALE)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        self._reconnect.restart()
        self.plug.open()

    def close(self) -> None:
        """Hold at once, and let the servos stand where they are. Safe from any state, more than once."""
        self._on_unplugged()
        self.plug.close()

    def health(self) -> Health:
        """Say whether it is there."""
        return replace(self.plug.health({}), reconnected_at=self._reconnect.reconnected_at)

    def step(self) -> None:
        """Move on: send each axis the next whole degree, where it is not that already."""
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
        """Where the servos really stand at time ``now``: they lag a little behind what they were sent."""
        pan, tilt = (
            axis.to_radians(shaft.advance(now)) for axis, shaft in zip(self._untrimmed_axes, self._shafts, strict=True)
        )
        return HeadPose(pan, tilt)

    def fail(self, fault: str = "") -> None:
        """Let its servos be "blocked" or "reversed", or as they should be; nobody measures where they stand."""
        self._reversed = fault == "reversed"
        for shaft in self._shafts:
            shaft.advance(self._clock.now())
            shaft.motion_factor = 0.0 if fault == "blocked" else 1.0
        self._sent = None
        self._is_settled = False

    def _on_plugged(self) -> None:
        """Go on from where a sketch that has just started has put its servos; stay there, but for the first time."""
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
        """Give up the goal: the servos stay at the degrees sent last."""
        if self._sent is not None:
            self._motion.drop_goal(pan=self._pose.pan, tilt=self._pose.tilt, now=self._clock.now())


def make_head_twin(keys: TwoServoKeys, away: ReconnectPolicy, stage: SimContext) -> ServoHeadTwin:
    """Return the twin of a head of two hobby servos."""
    return ServoHeadTwin(
        stage.clock,
        pan=make_servo_axis(keys.pan),
        tilt=make_servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        away=away,
        report=stage.report,
        name=stage.part_name,
    )
