"""The head's driver: turns goals into small steps of two hobby servos, sent to a board with the Rodney sketch."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from drivers.api import HEAD_ACCELERATION, Head, HeadPose, Health, Quality, Reading, ignore
from drivers.api.driver import Site
from drivers.arduino.board import Board
from drivers.arduino.declared import ArduinoKeys, SecondKeys
from drivers.arduino.wire import ServoAngle
from drivers.clock import Clock
from drivers.head.axis import TRAILING, ServoAxis, next_degrees, servo_axis
from drivers.head.keys import TwoServoKeys
from drivers.head.memory import Memory
from drivers.head.pantilt import AHEAD, LedHead, PanTilt
from drivers.transport.link import Link


class ArduinoHead(LedHead[ServoAxis]):
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

    TRAILS = TRAILING

    def __init__(
        self,
        board: Board,
        clock: Clock,
        *,
        pan: ServoAxis,
        tilt: ServoAxis,
        speed: float,
        acceleration: float = HEAD_ACCELERATION,
        changed: Callable[[], None] = ignore,
        name: str = "head",
        start: HeadPose = AHEAD,
    ) -> None:
        if pan.index == tilt.index:
            raise ValueError(f"{name}: pan and tilt are both servo {pan.index}")
        self.name = name
        self.board = board
        super().__init__(clock, PanTilt(name, pan, tilt, speed=speed, acceleration=acceleration, start=start), changed)
        self._sent: tuple[int, ...] = ()  # degrees; empty before it is known where the servos stand
        self._newest: Reading[HeadPose] | None = None
        self._guessed = False  # the degrees are a guess, and no goal has been accepted since
        self._resend = False  # send both servos their degrees, also where the guess equals the goal

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected until the board has said that it takes angles, DeviceFault
        while the head is latched.
        """
        self._way.check(target)
        self.board.require()
        accepted = self.limits.clamp(target)
        pan, tilt = self._way.axes
        # The way ends where the servos will stand. From between two degrees the next one would first have to make up
        # for the part of a degree that they never went, and its beginning would wait for that and for a pulse.
        self._way.look(HeadPose(pan.nearest(accepted.pan), tilt.nearest(accepted.tilt)), self._now())
        self._settled = False
        self._guessed, self._resend = False, self._resend or self._guessed
        self.board.send(self)  # the first degree does not wait for the next pulse
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Where the servos were sent last; stale while the board is not there, and none before it first was."""
        newest = self._newest
        if newest is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return newest if self.board.ready else replace(newest, quality=Quality.STALE)

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

    # --- on the board: see drivers.arduino.board.Mounted ---------------------------------------------------------

    @property
    def servos(self) -> frozenset[int]:
        """The numbers of its servos."""
        return frozenset(axis.index for axis in self._way.axes)

    def stands(self, degrees: Mapping[int, int], *, later: bool, known: bool) -> Mapping[int, int]:
        """Go on from where the servos stand; stay there, but for the first time that it is known where that is."""
        now = self._clock.now()
        axes = self._way.axes
        self._sent = tuple(degrees.get(axis.index, axis.awake_by(later=later)) for axis in axes)
        pan, tilt = (axis.to_radians(sent) for axis, sent in zip(axes, self._sent, strict=True))
        if self._began or not known:
            self._way.let_go(pan=pan, tilt=tilt, now=now)
        else:
            self._way.place(HeadPose(pan, tilt), now)
        self._began, self._settled = True, False
        self._guessed, self._resend = not known, False
        self._tell(HeadPose(pan, tilt), now)
        return {axis.index: sent for axis, sent in zip(axes, self._sent, strict=True)}

    def lost(self) -> None:
        """Give up the goal; the first goal is yet to come."""
        if self._began:
            self._hold()

    def waits(self, now: float) -> bool:
        """Stand still until time ``now``; say whether a degree is to be sent."""
        self._way.hold(now)
        if self._newest is not None and self._newest.value is not None:
            self._tell(self._newest.value, now)
        return not self._settled

    def due(self, now: float) -> list[ServoAngle]:
        """Move on; return each axis whose whole degree has changed, and both at the first goal after a guess."""
        self._settled = self._way.still  # the last degree is sent now, and no other unless somebody wants one
        pan, tilt = way = self._way.advance(now)
        degrees = next_degrees(self._way, way, self._sent)
        pose = HeadPose(pan.axis.to_radians(degrees[0]), tilt.axis.to_radians(degrees[1]))
        steps = zip((pan.axis, tilt.axis), degrees, self._sent, strict=True)
        angles = [ServoAngle(axis.index, new) for axis, new, old in steps if new != old or self._resend]
        self._sent, self._resend = degrees, False
        self._tell(pose, now)
        return angles

    def _tell(self, pose: HeadPose, now: float) -> None:
        """Take note of where the servos stand at time ``now``."""
        turned = self._newest is None or pose != self._newest.value
        self._newest = Reading(pose, now, Quality.GOOD)
        self._history.add(now, (pose.pan, pose.tilt))
        if turned:
            self._changed()

    def _hold(self) -> None:
        """Give up the goal: the servos stay at the degrees sent last, of which the profile may be a little short."""
        if self._newest is not None and self._newest.value is not None:
            sent = self._newest.value
            self._way.let_go(pan=sent.pan, tilt=sent.tilt, now=self._clock.now())

    def _now(self) -> float:
        """Return the time, until which nothing has moved if nothing may be sent."""
        now = self._clock.now()
        if not self.board.sure:
            self._way.hold(now, 0.0)
        return now


# From the keys of a robot file to the driver of a Rodney head.

CURE = "flash docs/keeper_head/keeper_head.ino; look at its power and its cable"


def make(keys: ArduinoKeys, site: Site) -> Head:
    """Return the driver; where its servos were left is kept, but for a virtual one."""
    link = Link(site.part, site.port, keys.baud, report=site.report)
    remembered = None if site.state is None else Memory(site.state, site.port)
    if keys.protocol == "lines":
        from drivers.head.guardian_head import KeeperHead  # noqa: PLC0415 - few boards have that sketch

        return KeeperHead(
            link,
            site.clock,
            pan=servo_axis(keys.pan),
            tilt=servo_axis(keys.tilt),
            speed=keys.speed,
            acceleration=keys.acceleration,
            away=keys.away,
            report=site.report,
            name=site.part,
            remembered=remembered,
            cure=CURE,
        )
    board = Board(
        link,
        site.clock,
        boot_delay=0.0 if site.virtual else keys.boot,
        report=site.report,
        away=keys.away,
        remembered=remembered,
    )
    return _on(board, keys, site)


def second(keys: SecondKeys, site: Site) -> ArduinoHead:
    """Return the driver of a second pan/tilt on the board of the robot's head."""
    first: ArduinoHead = site.parts["head"]
    return _on(first.board, keys, site)


def _on(board: Board, keys: TwoServoKeys, site: Site) -> ArduinoHead:
    return ArduinoHead(
        board,
        site.clock,
        pan=servo_axis(keys.pan),
        tilt=servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        name=site.part,
    )
