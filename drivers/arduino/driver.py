"""Driver of the Rodney head: turns goals into setpoints of two hobby servos."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from drivers.api import HEAD_ACCELERATION, Head, HeadPose, Health, Quality, Reading, ignore
from drivers.api.driver import DriverContext
from drivers.arduino.board import ArduinoBoard
from drivers.arduino.declared import ArduinoKeys, SecondPanTiltKeys
from drivers.arduino.wire import ServoAngle
from drivers.clock import Clock
from drivers.head.angle_store import ServoAngleStore
from drivers.head.axis import SERVO_LAG, ServoAxis, make_servo_axis, next_degrees
from drivers.head.keys import TwoServoKeys
from drivers.head.pantilt import STRAIGHT_AHEAD, PanTiltMotion, ProfiledHead
from drivers.transport.link import SerialLink


class ArduinoHead(ProfiledHead[ServoAxis]):
    """Head of two hobby servos on ``board``, which may carry a second pan/tilt device: a ``drivers.api.Head``.

    Hobby servos report nothing and turn at full speed, so the driver moves them in steps along a motion profile: each
    axis goes from its last setpoint to the goal within ``speed`` (rad/s) and ``acceleration`` (rad/s^2), and gets the
    next whole degree when it has reached the previous one. The pose is the last setpoint, hence in whole degrees; a
    servo lags a few hundredths of a second behind.

    The sketch moves its servos to start angles of its own. From there the head first moves to ``start``, unless that is
    switched off or the angles are unknown; later it moves only on command. A goal does not survive a disconnect. After
    ``close`` the board holds the servos. ``changed`` is called with each change of the pose, mostly from the link's
    thread.
    """

    LAG = SERVO_LAG

    def __init__(
        self,
        board: ArduinoBoard,
        clock: Clock,
        *,
        pan: ServoAxis,
        tilt: ServoAxis,
        speed: float,
        acceleration: float = HEAD_ACCELERATION,
        changed: Callable[[], None] = ignore,
        name: str = "head",
        start: HeadPose = STRAIGHT_AHEAD,
    ) -> None:
        if pan.index == tilt.index:
            raise ValueError(f"{name}: pan and tilt are both servo {pan.index}")
        self.name = name
        self.board = board
        super().__init__(
            clock, PanTiltMotion(name, pan, tilt, speed=speed, acceleration=acceleration, start=start), changed
        )
        self._sent: tuple[int, ...] = ()  # degrees; empty until the servo angles are known
        self._last_pose: Reading[HeadPose] | None = None
        self._is_guess = False  # the angles are a guess, and there was no goal since
        self._resend = False  # send both setpoints, even if the guess equals the goal

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected until the board accepts setpoints, DeviceFault while the
        head is latched.
        """
        self._motion.check(target)
        self.board.require_ready()
        accepted = self.limits.clamp(target)
        pan, tilt = self._motion.axes
        # The motion ends at whole degrees of the servos. From between two degrees the next motion would have to cover
        # the missing part of a degree first, so its start would be delayed until the next poll.
        self._motion.look(
            HeadPose(pan.nearest_angle(accepted.pan), tilt.nearest_angle(accepted.tilt)), self._sync_time()
        )
        self._is_settled = False
        self._is_guess, self._resend = False, self._resend or self._is_guess
        self.board.send(self)  # the first degree does not wait for the next poll
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Pose of the last setpoints; stale while the board is offline, and none before its first connection."""
        newest = self._last_pose
        if newest is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return newest if self.board.is_ready else replace(newest, quality=Quality.STALE)

    @property
    def latched(self) -> str:
        """Reason of the latch; empty if not latched."""
        return self.board.latched

    def enable(self) -> None:
        """Release the latch after a long absence."""
        self.board.enable()

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start the search for the board."""
        self.board.open(self)

    def close(self) -> None:
        """Hold at once, and release the board."""
        self._hold()
        self.board.close(self)

    def health(self) -> Health:
        """Return whether the board accepts setpoints, and if not, the reason."""
        return self.board.health()

    # --- on the board: see drivers.arduino.board.BoardDevice ---------------------------------------------------------

    @property
    def servos(self) -> frozenset[int]:
        """Numbers of the head's servos."""
        return frozenset(axis.index for axis in self._motion.axes)

    def set_angles(self, degrees: Mapping[int, int], *, has_encoders: bool, known: bool) -> Mapping[int, int]:
        """Continue from the given servo angles; move to the start pose the first time that the angles are known."""
        now = self._clock.now()
        axes = self._motion.axes
        self._sent = tuple(
            degrees.get(axis.index, axis.start_degrees_of_sketch(has_encoders=has_encoders)) for axis in axes
        )
        pan, tilt = (axis.to_radians(sent) for axis, sent in zip(axes, self._sent, strict=True))
        if self._has_start or not known:
            self._motion.drop_goal(pan=pan, tilt=tilt, now=now)
        else:
            self._motion.set_position(HeadPose(pan, tilt), now)
        self._has_start, self._is_settled = True, False
        self._is_guess, self._resend = not known, False
        self._record_pose(HeadPose(pan, tilt), now)
        return {axis.index: sent for axis, sent in zip(axes, self._sent, strict=True)}

    def drop_goal(self) -> None:
        """Drop the goal, except the start pose before the first connection."""
        if self._has_start:
            self._hold()

    def pause_until(self, now: float) -> bool:
        self._motion.pause_until(now)
        if self._last_pose is not None and self._last_pose.value is not None:
            self._record_pose(self._last_pose.value, now)
        return not self._is_settled

    def next_angles(self, now: float) -> list[ServoAngle]:
        """Advance to time ``now``; return the setpoints of the servos whose whole degree has changed.

        If the servo angles were only assumed, the first goal after that returns the setpoints of both servos.
        """
        self._is_settled = self._motion.is_still  # the last degree is sent now, and no other without a new goal
        pan, tilt = way = self._motion.advance(now)
        degrees = next_degrees(self._motion, way, self._sent)
        pose = HeadPose(pan.axis.to_radians(degrees[0]), tilt.axis.to_radians(degrees[1]))
        steps = zip((pan.axis, tilt.axis), degrees, self._sent, strict=True)
        angles = [ServoAngle(axis.index, new) for axis, new, old in steps if new != old or self._resend]
        self._sent, self._resend = degrees, False
        self._record_pose(pose, now)
        return angles

    def _record_pose(self, pose: HeadPose, now: float) -> None:
        """Record the pose of the servos at time ``now``."""
        turned = self._last_pose is None or pose != self._last_pose.value
        self._last_pose = Reading(pose, now, Quality.GOOD)
        self._history.add(now, (pose.pan, pose.tilt))
        if turned:
            self._changed()

    def _hold(self) -> None:
        """Drop the goal: the servos hold the last setpoints, which may be slightly ahead of the motion profile."""
        if self._last_pose is not None and self._last_pose.value is not None:
            sent = self._last_pose.value
            self._motion.drop_goal(pan=sent.pan, tilt=sent.tilt, now=self._clock.now())

    def _sync_time(self) -> float:
        """Return the current time.

        If nothing may be sent to the board now, the motion profile skips the time until now, and does not catch up.
        """
        now = self._clock.now()
        if not self.board.can_send:
            self._motion.pause_until(now, 0.0)
        return now


# Factories of a Rodney head from the keys of a robot file.

OFFLINE_HINT = "flash docs/keeper_head/keeper_head.ino; check its power and cable"


def make(keys: ArduinoKeys, context: DriverContext) -> Head:
    """Return the driver of a head on an Arduino; it stores the servo angles, unless the head is virtual."""
    link = SerialLink(context.part, context.port, keys.baud, report=context.report)
    remembered = None if context.state_folder is None else ServoAngleStore(context.state_folder, context.port)
    if keys.protocol == "lines":
        from drivers.head.guardian_head import GuardianHead  # noqa: PLC0415 - few boards have that sketch

        return GuardianHead(
            link,
            context.clock,
            pan=make_servo_axis(keys.pan),
            tilt=make_servo_axis(keys.tilt),
            speed=keys.speed,
            acceleration=keys.acceleration,
            away=keys.away,
            report=context.report,
            name=context.part,
            angle_store=remembered,
            hint=OFFLINE_HINT,
        )
    board = ArduinoBoard(
        link,
        context.clock,
        boot_delay=0.0 if context.is_virtual else keys.boot,
        report=context.report,
        away=keys.away,
        angle_store=remembered,
    )
    return _make_head(board, keys, context)


def make_second(keys: SecondPanTiltKeys, context: DriverContext) -> ArduinoHead:
    """Return the driver of a second pan/tilt device on the board of the robot's head."""
    first: ArduinoHead = context.needed_parts["head"]
    return _make_head(first.board, keys, context)


def _make_head(board: ArduinoBoard, keys: TwoServoKeys, context: DriverContext) -> ArduinoHead:
    return ArduinoHead(
        board,
        context.clock,
        pan=make_servo_axis(keys.pan),
        tilt=make_servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        name=context.part,
    )
