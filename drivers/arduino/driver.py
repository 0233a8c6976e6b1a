"""The head's driver: turns goals into small steps of two hobby servos, sent to a board with the Rodney sketch."""

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
    """A ``drivers.api.Head`` of two hobby servos on ``board``, which may carry a second one.

    The servos tell nothing and turn as fast as they can, so the driver leads them: from the angle commanded last it
    goes to the goal within ``speed`` (rad/s) and ``acceleration`` (rad/s^2), each axis for itself, and sends an axis
    the next whole degree whenever it has come to the one before. The pose is what was sent, hence in whole degrees; a
    servo lags behind it by a few hundredths of a second.

    The sketch sends its servos to positions of its own when it starts. From there the head goes to ``start`` at first
    (unless it is to ``stay``, or nobody knows where it stands), and later nowhere before it is commanded; a goal does
    not survive the loss of the connection.
    After ``close`` the board keeps its servos where they are.
    ``changed`` is called whenever the pose has changed, mostly from the link's thread.
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
        self._sent: tuple[int, ...] = ()  # degrees; empty before it is known where the servos stand
        self._last_pose: Reading[HeadPose] | None = None
        self._is_guess = False  # the degrees are a guess, and no goal has been accepted since
        self._resend = False  # send both servos their degrees, also where the guess equals the goal

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected until the board has said that it takes angles, DeviceFault
        while the head is latched.
        """
        self._motion.check(target)
        self.board.require_ready()
        accepted = self.limits.clamp(target)
        pan, tilt = self._motion.axes
        # The way ends where the servos will stand. From between two degrees the next one would first have to make up
        # for the part of a degree that they never went, and its beginning would wait for that and for a pulse.
        self._motion.look(
            HeadPose(pan.nearest_angle(accepted.pan), tilt.nearest_angle(accepted.tilt)), self._sync_time()
        )
        self._is_settled = False
        self._is_guess, self._resend = False, self._resend or self._is_guess
        self.board.send(self)  # the first degree does not wait for the next pulse
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Where the servos were sent last; stale while the board is not there, and none before it first was."""
        newest = self._last_pose
        if newest is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return newest if self.board.is_ready else replace(newest, quality=Quality.STALE)

    @property
    def latched(self) -> str:
        """Why it moves no more until it is enabled; empty while it does."""
        return self.board.latched

    def enable(self) -> None:
        """Let it move again, after it was away for long."""
        self.board.enable()

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start looking for the board."""
        self.board.open(self)

    def close(self) -> None:
        """Hold at once, and let the board go."""
        self._hold()
        self.board.close(self)

    def health(self) -> Health:
        """Say whether the board takes angles, and what it is waiting for if not."""
        return self.board.health()

    # --- on the board: see drivers.arduino.board.BoardDevice ---------------------------------------------------------

    @property
    def servos(self) -> frozenset[int]:
        """The numbers of its servos."""
        return frozenset(axis.index for axis in self._motion.axes)

    def set_angles(self, degrees: Mapping[int, int], *, has_encoders: bool, known: bool) -> Mapping[int, int]:
        """Go on from where the servos stand; stay there, but for the first time that it is known where that is."""
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
        """Give up the goal; the first goal is yet to come."""
        if self._has_start:
            self._hold()

    def pause_until(self, now: float) -> bool:
        """Stand still until time ``now``; say whether a degree is to be sent."""
        self._motion.pause_until(now)
        if self._last_pose is not None and self._last_pose.value is not None:
            self._record_pose(self._last_pose.value, now)
        return not self._is_settled

    def next_angles(self, now: float) -> list[ServoAngle]:
        """Move on; return each axis whose whole degree has changed, and both at the first goal after a guess."""
        self._is_settled = self._motion.is_still  # the last degree is sent now, and no other unless somebody wants one
        pan, tilt = way = self._motion.advance(now)
        degrees = next_degrees(self._motion, way, self._sent)
        pose = HeadPose(pan.axis.to_radians(degrees[0]), tilt.axis.to_radians(degrees[1]))
        steps = zip((pan.axis, tilt.axis), degrees, self._sent, strict=True)
        angles = [ServoAngle(axis.index, new) for axis, new, old in steps if new != old or self._resend]
        self._sent, self._resend = degrees, False
        self._record_pose(pose, now)
        return angles

    def _record_pose(self, pose: HeadPose, now: float) -> None:
        """Take note of where the servos stand at time ``now``."""
        turned = self._last_pose is None or pose != self._last_pose.value
        self._last_pose = Reading(pose, now, Quality.GOOD)
        self._history.add(now, (pose.pan, pose.tilt))
        if turned:
            self._changed()

    def _hold(self) -> None:
        """Give up the goal: the servos stay at the degrees sent last, of which the profile may be a little short."""
        if self._last_pose is not None and self._last_pose.value is not None:
            sent = self._last_pose.value
            self._motion.drop_goal(pan=sent.pan, tilt=sent.tilt, now=self._clock.now())

    def _sync_time(self) -> float:
        """Return the time, until which nothing has moved if nothing may be sent."""
        now = self._clock.now()
        if not self.board.can_send:
            self._motion.pause_until(now, 0.0)
        return now


# From the keys of a robot file to the driver of a Rodney head.

OFFLINE_HINT = "flash docs/keeper_head/keeper_head.ino; look at its power and its cable"


def make(keys: ArduinoKeys, site: DriverContext) -> Head:
    """Return the driver; where its servos were left is kept, but for a virtual one."""
    link = SerialLink(site.part, site.port, keys.baud, report=site.report)
    remembered = None if site.state_folder is None else ServoAngleStore(site.state_folder, site.port)
    if keys.protocol == "lines":
        from drivers.head.guardian_head import GuardianHead  # noqa: PLC0415 - few boards have that sketch

        return GuardianHead(
            link,
            site.clock,
            pan=make_servo_axis(keys.pan),
            tilt=make_servo_axis(keys.tilt),
            speed=keys.speed,
            acceleration=keys.acceleration,
            away=keys.away,
            report=site.report,
            name=site.part,
            angle_store=remembered,
            hint=OFFLINE_HINT,
        )
    board = ArduinoBoard(
        link,
        site.clock,
        boot_delay=0.0 if site.is_virtual else keys.boot,
        report=site.report,
        away=keys.away,
        angle_store=remembered,
    )
    return _make_head(board, keys, site)


def make_second(keys: SecondPanTiltKeys, site: DriverContext) -> ArduinoHead:
    """Return the driver of a second pan/tilt on the board of the robot's head."""
    first: ArduinoHead = site.needed_parts["head"]
    return _make_head(first.board, keys, site)


def _make_head(board: ArduinoBoard, keys: TwoServoKeys, site: DriverContext) -> ArduinoHead:
    return ArduinoHead(
        board,
        site.clock,
        pan=make_servo_axis(keys.pan),
        tilt=make_servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        name=site.part,
    )
