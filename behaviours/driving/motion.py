"""What all leaves that drive the base have in common: they look at it at each tick, and stop it unless they succeed."""

import math
from abc import abstractmethod
from enum import Enum
from math import isfinite

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.run import DEAD_RECKONING_REASON
from drivers.api import (
    ZERO_VELOCITY,
    Angle,
    Base,
    BaseLimits,
    BaseState,
    Length,
    Pose2D,
    Source,
    Steering,
    Velocity,
    is_guarded,
)

# The time limit of a motion: the time that it can take plus a margin, on a clock that slows while it is held up.

TIME_LIMIT_FACTOR, TIME_LIMIT_MARGIN = 1.5, 5.0
"""A motion may take so many times as long as it can take, and so many seconds more."""

MAX_TICK_TIME = 1.0
"""Seconds between two ticks that count at most: a run that is paused is not ticked, so a pause counts as one second."""

NO_PROGRESS_TIMEOUT = 30.0
"""Seconds for which a motion that a node of ROS 2 does may stand still. Nav2 gives up after 10 s by itself."""

UNHINDERED_REASONS = ("", "limited")
"""Reasons for which a base goes slower than wanted that do not stop the clock."""


def seconds_for(distance: float, speed: float, limit: float, acceleration: float) -> float:
    """Return how long a way (m or rad) takes from rest to rest: two ramps, and braking that is half as hard."""
    fastest = max(min(abs(speed), limit), 1e-6)
    return abs(distance) / fastest + 3 * fastest / acceleration


def seconds_to_drive(distance: float, speed: float, limits: BaseLimits) -> float:
    """Return how long it takes to drive a way in metres."""
    return seconds_for(distance, speed, limits.speed, limits.acceleration)


def seconds_to_turn(angle: float, speed: float, limits: BaseLimits) -> float:
    """Return how long it takes to turn by an angle in radians."""
    return seconds_for(angle, speed, limits.turn, limits.turn_acceleration)


class MotionClock:
    """Counts the seconds in which a motion could go on."""

    def __init__(self) -> None:
        self.spent = 0.0
        self._at: float | None = None

    def restart(self) -> None:
        """Begin at 0."""
        self.spent, self._at = 0.0, None

    def stop(self) -> None:
        """Stand still until the next ``run``: a person has the wheels, or nothing is known of the base."""
        self._at = None

    def grant(self, seconds: float) -> None:
        """Give so many seconds more, for work that the limit does not know of."""
        self.spent -= seconds

    def scale(self, before: float, limit: float) -> None:
        """Keep the share that is spent of a limit when it changes from ``before`` to ``limit`` seconds."""
        if isfinite(before) and isfinite(limit):
            self.spent *= limit / before

    def run(self, now: float, steering: Steering) -> float:
        """Go on until ``now``, as fast as the base may of what is wanted; return the seconds spent."""
        if self._at is not None:
            self.spent += min(now - self._at, MAX_TICK_TIME) * _permitted_share(steering)
        self._at = now
        return self.spent


def time_limit(seconds: float) -> float:
    """Return the time limit of a motion that can be done in so many seconds."""
    return TIME_LIMIT_FACTOR * seconds + TIME_LIMIT_MARGIN


def _permitted_share(steering: Steering) -> float:
    """Return which share of what is wanted the base may do: less where something holds it up, such as an obstacle."""
    if steering.reason in UNHINDERED_REASONS or steering.fault:
        return 1.0
    wanted, given = _size(steering.requested), _size(steering.allowed)
    return 1.0 if wanted == 0.0 else min(1.0, given / wanted)


def _size(velocity: Velocity) -> float:
    return abs(velocity.linear) or abs(velocity.angular)


BRAKING_SHARE, TURN_BRAKING_SHARE = 0.5, 0.34
"""Which share of the base's greatest acceleration, and turn acceleration, the approach to a goal counts on."""

CRAWL_SPEED = 0.02
"""Speed in m/s of the last bit: what the base still rolls after it was told to stop is then a few millimetres."""

CRAWL_TURN_RATE = math.radians(4)
"""The same in rad/s."""

REACTION_TIME = 0.25
"""Seconds from a report to the motion that answers it: the Kobuki's dead time (users measured 0.2 s) and a tick."""

RANGE_GUARD_TIMEOUT = 5.0
"""Seconds for which a leaf waits while the range guard keeps the base from moving: people walk on."""

SETTLING_TIMEOUT = 4.0
"""Seconds for which a motion waits for the drift of the gyro: a little longer than a driver needs to give up."""

STANDSTILL_SPEED = 0.01
"""Below this speed (m/s or rad/s) it has stopped."""


DEAD_RECKONING_NOTE = " (dead reckoning)"
"""Said of all that is done on a base that measures nothing."""


class MotionDirection(Enum):
    """Where a motion leads; what the base feels matters accordingly."""

    AHEAD = "ahead"
    ROUND = "round"  # on the spot, or back in a curve
    BACK = "back"  # straight


class BaseMotion(Leaf):
    """Drives the base as ``go`` says, from a start pose, in a ``motion_direction``; it stops it unless it has succeeded.

    It fails by what the base feels in its way, and while the base is latched. While a person, or a reflex, has the
    wheels it waits, and goes on from where the base is then. What the base refuses for any other reason, such as an
    edge that it has not left behind, fails it too; what the range guard sees in its way, once it has stayed there; and
    its time limit, see ``behaviours.driving.motion``.
    """

    needs = frozenset({"base"})
    drives = frozenset({"base"})
    _start: Pose2D | None = None
    _stopping = False
    _refused_since: float | None = None
    _settling_since: float | None = None
    _clock: MotionClock
    _last_state: BaseState | None = None
    _limit: float | None = None
    _limits: BaseLimits | None = None

    def initialise(self) -> None:
        self._start, self._stopping, self._refused_since, self._settling_since = None, False, None, None
        self._clock, self._limit = MotionClock(), None

    def update(self) -> Status:
        state = self.state()
        if state is None or self._start is None:
            self._clock.stop()
            return self.wait("waiting for the base to report")
        steering = self.robot.base.steering()
        trouble = latch_reason(self.robot.base) or motion_fault_reason(steering) or self.stop_reason(state, steering)
        if trouble:
            return self.fail(trouble)
        if state.settling and not self._stopping and self._may_settle():
            self._clock.stop()
            return self.wait("waiting for the drift of the gyro to be known")
        override = override_reason(steering)
        if override:
            self._refused_since, self._limit = None, None
            self._clock.restart()
            self.resume(state)
            return self.wait(override)
        late = self._time_limit_reason(state, steering)
        if late:
            return self.fail(late)
        status = self.go(state, self._start)
        if state.reckoned and status is SUCCESS and self.output_type in (Length, Angle):
            self.feedback_message = DEAD_RECKONING_REASON
            self.run.dead_reckoned = True
        elif state.reckoned and status is not SUCCESS and not self.feedback_message.endswith(DEAD_RECKONING_NOTE):
            self.feedback_message += DEAD_RECKONING_NOTE
        return status

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float | None:
        """Return how long it can take from ``state`` on; None for a motion that goes on until it is halted.

        Called with the state in which its clock began, and again with the same one when the base's limits change.
        """
        del state, start
        return None

    def _may_settle(self) -> bool:
        """Return whether there is time left to wait for the drift of the gyro."""
        now = self.run.now()
        if self._settling_since is None:
            self._settling_since = now
        return now - self._settling_since <= SETTLING_TIMEOUT

    def _time_limit_reason(self, state: BaseState, steering: Steering) -> str:
        """Say that it takes longer than it can take, or nothing.

        When the limits of the base change, so does the time limit; the share of it that is spent stays spent, so no
        series of changes keeps a motion alive.
        """
        if self._start is None:
            return ""
        limits = self.robot.base.limits
        if self._limit is None or self._last_state is None:
            self._last_state, self._limits = state, limits
            self._limit = self._time_limit(state, self._start)
        elif limits != self._limits:
            self._limits, before = limits, self._limit
            self._limit = self._time_limit(self._last_state, self._start)
            self._clock.scale(before, self._limit)
        if self._clock.run(self.run.now(), steering) <= self._limit:
            return ""
        return f"not done within its time limit of {self._limit:.0f} s"

    def _time_limit(self, state: BaseState, start: Pose2D) -> float:
        seconds = self.seconds_needed(state, start)
        return math.inf if seconds is None else time_limit(seconds)

    @property
    def motion_direction(self) -> MotionDirection:
        """Where it leads now."""
        return MotionDirection.AHEAD

    @abstractmethod
    def go(self, state: BaseState, start: Pose2D) -> Status:
        """Do one tick's work with what the base reports, from where it started."""

    def stop_reason(self, state: BaseState, steering: Steering) -> str:
        """Say why it cannot go on, or nothing."""
        return obstacle_reason(state, self.motion_direction, steering)

    def resume(self, state: BaseState) -> None:
        """Forget what was begun: somebody else has the wheels, and has brought the base to where it is now."""
        del state
        self._stopping = False

    def state(self) -> BaseState | None:
        """Return the base's newest report, None while there is no fresh one; the first one is where it starts."""
        reading = self.robot.base.state()
        if not reading.good or reading.value is None:
            return None
        if self._start is None:
            self._start = reading.value.pose
        return reading.value

    def steer(self, velocity: Velocity, activity: str) -> Status:
        """Tell the base to move so, and go on; fail once it has refused all of it for longer than a reaction takes.

        While the range guard keeps it from moving, fail after ``RANGE_GUARD_TIMEOUT`` seconds.
        """
        given = self.robot.base.drive(velocity)
        if given != ZERO_VELOCITY or velocity == ZERO_VELOCITY:
            self._refused_since = None
            return self.wait(activity)
        now, steering = self.run.now(), self.robot.base.steering()
        if self._refused_since is None:
            self._refused_since = now
        guarded = is_guarded(steering)
        if now - self._refused_since <= (RANGE_GUARD_TIMEOUT if guarded else REACTION_TIME):
            return self.wait(f"{activity}: {steering.reason}" if guarded else activity)
        because = steering.reason or "it is not permitted"
        return self.fail(because if guarded else f"the base does not move: {because}")

    def come_to_rest(self, speed: float) -> Status:
        """Stop, and succeed once it stands still."""
        if not self._stopping:
            self._stopping = True
            self.robot.base.stop()
        return SUCCESS if abs(speed) < STANDSTILL_SPEED else self.wait("stopping")

    def approach(self, left: float, *, braking: float, crawl: float) -> float:
        """Return how fast to go with ``left`` (m or rad) to go; 0 when it is time to stop.

        A motion that ends at the goal with an even deceleration b has v^2 / 2b left. A command that acts a time T
        after its report meets v + b T at that report, hence (v + b T)^2 / 2b. How long T really is, matters little: the
        last bit is done at a crawl, and half of what that covers in T is where to stop.
        """
        if self._stopping or left <= crawl * REACTION_TIME / 2:
            return 0.0
        return max(crawl, math.sqrt(2 * braking * left) - braking * REACTION_TIME)

    @property
    def braking(self) -> float:
        """The deceleration in m/s^2 that an approach counts on."""
        return BRAKING_SHARE * self.robot.base.limits.acceleration

    @property
    def turn_braking(self) -> float:
        """The same in rad/s^2."""
        return TURN_BRAKING_SHARE * self.robot.base.limits.turn_acceleration

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.base.stop()


def latch_reason(base: Base) -> str:
    """Say why a base does not move at all until somebody enables it, or nothing."""
    return f"the base is stopped: {base.latched}" if base.latched else ""


def motion_fault_reason(steering: Steering) -> str:
    """Say why a mission's command was stopped because the base did not do it, or nothing."""
    return steering.fault if steering.source in (Source.MISSION, None) else ""


def obstacle_reason(state: BaseState, direction: MotionDirection, steering: Steering | None = None) -> str:
    """Say what stops a base from going on in a way, or nothing.

    What is ahead matters only where it goes there; but at an edge there is no way but straight back: with a turn it
    would fall. A base that ``steering`` says is backing off has bumped, though it may have left that behind already.
    """
    if state.wheel_drop:
        return "a wheel has dropped"
    if state.cliff and direction is not MotionDirection.BACK:
        return "a cliff ahead" if direction is MotionDirection.AHEAD else "a cliff ahead: the only way is straight back"
    if direction is MotionDirection.AHEAD and (
        state.bumper or (steering is not None and steering.source is Source.SAFETY)
    ):
        return "bumped into something"
    return ""


def override_reason(steering: Steering) -> str:
    """Say who goes before a mission and has the wheels now, or nothing."""
    if steering.source is Source.TELEOP:
        return "teleoperation has the wheels"
    if steering.source is Source.SAFETY:
        return steering.reason or "a reflex has the wheels"
    return ""


# Turning on the spot to a heading, exactly: what all leaves do the same way that end with a turn.

HEADING_TOLERANCE = math.radians(0.1)
"""Radians beside the heading that are near enough."""

NUDGE_RATE = CRAWL_TURN_RATE / 2
"""Turn rate of a correction in rad/s: the wheels of a Kobuki turn at 4 mm/s then, of which it knows whole ones."""

MAX_NUDGE_TIME = 5.0
"""Seconds by which a correction extends the time limit at most: with rare odometry a turn ends degrees beside."""

MAX_NUDGES = 3
"""Corrections at most: where they do not help, more of them will not."""


class Spin(BaseMotion):
    """A motion that turns to a heading.

    How late the base obeys is not known, so it stops up to half a degree beside the heading. What is left it does in
    nudges: for a time that is reckoned before, so that the lag does not matter.
    """

    _nudges = 0
    _nudge: tuple[float, float] | None = None  # its turn rate, and when it ends
    _rolls_until = -math.inf

    def initialise(self) -> None:
        super().initialise()
        self._nudges, self._nudge, self._rolls_until = 0, None, -math.inf

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        self._nudges, self._nudge = 0, None

    def turn_to(self, heading: float, direction: float, speed: float, state: BaseState, activity: str) -> Status:
        """Turn to ``heading`` (radians), left for a positive ``direction``, at ``speed`` rad/s at most.

        Succeeds once it stands still.
        """
        left, now = heading - state.pose.heading, self.run.now()
        if self._nudge is not None:
            rate, ends = self._nudge
            if now < ends:
                return self.steer(Velocity(0.0, rate), activity)
            self._nudge, self._stopping, self._rolls_until = None, False, now + REACTION_TIME
            return self.come_to_rest(math.inf)
        rate = self.approach(left * direction, braking=self.turn_braking, crawl=CRAWL_TURN_RATE)
        if rate > 0.0 and self._nudges == 0:
            return self.steer(Velocity(0.0, direction * min(rate, speed)), activity)
        if self.come_to_rest(state.velocity.angular) is not SUCCESS or now < self._rolls_until:
            return self.wait("stopping")
        if abs(left) <= HEADING_TOLERANCE or self._nudges == MAX_NUDGES:
            return SUCCESS
        self._nudges += 1
        seconds = abs(left) / NUDGE_RATE
        self._clock.grant(min(seconds, MAX_NUDGE_TIME))
        self._nudge = math.copysign(NUDGE_RATE, left), now + seconds
        return self.steer(Velocity(0.0, self._nudge[0]), activity)


# The leaf that drives straight ahead or back.

STEERING_GAIN = 2.0
"""rad/s for each radian off the line: a degree is turned back within about a second."""

MAX_STEERING_RATE = 0.5
"""rad/s at most."""


class DriveLeaf(BaseMotion):
    """Drive straight ahead, or back for a negative distance.

    Running until the distance is covered by odometry and the base stands still, then succeeds.
    Fails when it bumps into something or comes to a cliff, when a wheel drops, once the range guard has seen something
    in its way for 5 s, and while the base is stopped until somebody enables it. While somebody steers the base by hand
    it waits, then goes on along its line.
    """

    tag = "drive"
    output_doc = "how far it went, by odometry (m; negative backwards)"
    output_type = Length
    distance: float = argument("length", "how far; negative is backwards", principal=True)
    speed: float = argument("speed", "how fast", default=0.2, low=0.01, high=0.7)
    _direction = 1.0

    @property
    def motion_direction(self) -> MotionDirection:
        return MotionDirection.AHEAD if self._direction > 0 else MotionDirection.BACK

    def initialise(self) -> None:
        super().initialise()
        self._direction = math.copysign(1.0, self.distance)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        return seconds_to_drive(self.distance - distance_along(start, state.pose), self.speed, self.robot.base.limits)

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._start is not None:
            self._direction = math.copysign(1.0, self.distance - distance_along(self._start, state.pose))

    def go(self, state: BaseState, start: Pose2D) -> Status:
        gone = self.result = distance_along(start, state.pose)
        speed = self.approach((self.distance - gone) * self._direction, braking=self.braking, crawl=CRAWL_SPEED)
        if speed == 0.0:
            return self.come_to_rest(state.velocity.linear)
        steer = STEERING_GAIN * (start.heading - state.pose.heading)
        turn = max(-MAX_STEERING_RATE, min(MAX_STEERING_RATE, steer))
        return self.steer(
            Velocity(self._direction * min(speed, self.speed), turn), f"{gone:.2f} of {self.distance:.2f} m"
        )


def distance_along(start: Pose2D, now: Pose2D) -> float:
    """Return how far ``now`` lies ahead of ``start`` along its heading, in metres."""
    return (now.x - start.x) * math.cos(start.heading) + (now.y - start.y) * math.sin(start.heading)


# The leaf that drives along a part of a circle.


class Arc(BaseMotion):
    """Drive forwards along a part of a circle: to the left for a positive angle, to the right for a negative one.

    Running until the base has turned by the angle, by the gyro, and stands still, then succeeds.
    Fails when it bumps into something or comes to a cliff, when a wheel drops, and while the base is stopped until
    somebody enables it. While somebody steers the base by hand it waits, then goes on until it has turned so far.
    """

    tag = "arc"
    output_doc = "how far round it went, by the gyro (rad)"
    output_type = Angle
    radius: float = argument("length", "of the circle", low=0.05, high=10.0)
    angle: float = argument("angle", "how far round; positive is to the left", default=math.tau)
    speed: float = argument("speed", "how fast along the circle", default=0.2, low=0.01, high=0.7)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        left, limits = self.angle - (state.pose.heading - start.heading), self.robot.base.limits
        driving = seconds_to_drive(left * self.radius, self.speed, limits)
        return max(driving, seconds_to_turn(left, self.speed / self.radius, limits))

    def go(self, state: BaseState, start: Pose2D) -> Status:
        direction = math.copysign(1.0, self.angle)
        turned = self.result = state.pose.heading - start.heading
        # Whichever of driving and turning needs more care on this circle says how fast it may go round.
        rate = self.approach(
            (self.angle - turned) * direction,
            braking=min(self.turn_braking, self.braking / self.radius),
            crawl=min(CRAWL_TURN_RATE, CRAWL_SPEED / self.radius),
        )
        if rate == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        rate = min(rate, self.speed / self.radius)
        doing = f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.steer(Velocity(rate * self.radius, direction * rate), doing)


# The leaf that keeps the base at a velocity.


class Cruise(BaseMotion):
    """Keep the base at a speed and a turn rate, until it is halted.

    Running all the time; it never succeeds. Fails when it bumps into something or comes to a cliff ahead, when a wheel
    drops, and while the base is stopped until somebody enables it. While somebody steers the base by hand it waits.
    """

    tag = "velocity"
    ends = frozenset({"failure"})
    speed: float = argument("speed", "how fast; negative is backwards", default=0.0, low=-0.7, high=0.7)
    turn: float = argument("turn rate", "how fast to turn; positive is to the left", default=0.0, low=-3.5, high=3.5)

    @property
    def motion_direction(self) -> MotionDirection:
        if self.speed > 0.0:
            return MotionDirection.AHEAD
        return MotionDirection.BACK if self.turn == 0.0 else MotionDirection.ROUND

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        velocity = state.velocity
        doing = f"{velocity.linear:.2f} m/s, {velocity.angular:.2f} rad/s"
        return self.steer(Velocity(self.speed, self.turn), doing)


# The leaf that stops the base.

STOP_TIMEOUT = 5.0
"""Seconds within which a base must stand that was stopped."""


class StopLeaf(BaseMotion):
    """Stop the base.

    Running until it stands still, then succeeds; fails when it still moves after 5 s.
    """

    tag = "stop"

    def initialise(self) -> None:
        super().initialise()
        self.robot.base.stop()

    def update(self) -> Status:
        state = self.state()  # whoever else has the wheels, or whatever it feels: it is to stand
        if state is None:
            return self.wait("waiting for the base to report")
        return self.go(state, state.pose)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        moving = max(abs(state.velocity.linear), abs(state.velocity.angular))
        # What it was told a moment before may still be on its way to the wheels.
        if moving < STANDSTILL_SPEED and self.elapsed >= REACTION_TIME:
            return SUCCESS
        if self.elapsed > STOP_TIMEOUT:
            return self.fail(f"the base still moves {STOP_TIMEOUT:g} s after it was stopped")
        return self.wait("stopping")


# The leaf that turns on the spot.


class TurnLeaf(Spin):
    """Turn on the spot: to the left for a positive angle, to the right for a negative one.

    Running until the angle is reached by the gyro and the base stands still, then succeeds.
    Fails at a cliff, where the only way is straight back, when a wheel drops, and while the base is stopped until
    somebody enables it. While somebody steers the base by hand it waits, then goes on to its angle.
    """

    tag = "turn"
    output_doc = "how far it turned, by the gyro (rad)"
    output_type = Angle
    angle: float = argument("angle", "how far; positive is to the left", principal=True)
    speed: float = argument("turn rate", "how fast", default=math.radians(60), low=math.radians(1), high=math.pi)
    _direction = 1.0

    @property
    def motion_direction(self) -> MotionDirection:
        return MotionDirection.ROUND

    def initialise(self) -> None:
        super().initialise()
        self._direction = math.copysign(1.0, self.angle)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        return seconds_to_turn(start.heading + self.angle - state.pose.heading, self.speed, self.robot.base.limits)

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._start is not None:
            self._direction = math.copysign(1.0, self._start.heading + self.angle - state.pose.heading)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        turned = self.result = state.pose.heading - start.heading
        doing = f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.turn_to(start.heading + self.angle, self._direction, self.speed, state, doing)
