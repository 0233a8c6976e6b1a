"""Base class of leaves that drive the base, with time limits and obstacle checks, and the leaves for simple motions."""

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
"""Factor and margin (seconds) from the expected duration of a motion to its time limit."""

MAX_TICK_TIME = 1.0
"""Maximum seconds that a ``MotionClock`` counts for one tick, so that a pause of the run counts as one second."""

NO_PROGRESS_TIMEOUT = 30.0
"""Seconds for which a base under a ROS 2 action may stand still. Nav2 itself gives up after 10 s."""

UNHINDERED_REASONS = ("", "limited")
"""Values of ``Steering.reason`` that mean that nothing hinders the base: no limit, or only its own limits.

With these, the ``MotionClock`` counts all time, even while the base drives slowly.
"""


def seconds_for(distance: float, speed: float, limit: float, acceleration: float) -> float:
    """Return an estimate, on the long side, of the seconds for a motion from rest to rest over ``distance`` (m or rad).

    ``speed`` is the requested speed, ``limit`` the base's maximum speed, ``acceleration`` that of the base.
    """
    fastest = max(min(abs(speed), limit), 1e-6)
    return abs(distance) / fastest + 3 * fastest / acceleration


def seconds_to_drive(distance: float, speed: float, limits: BaseLimits) -> float:
    """Return an estimate of the seconds to drive ``distance`` metres at ``speed`` m/s, within the base's limits."""
    return seconds_for(distance, speed, limits.speed, limits.acceleration)


def seconds_to_turn(angle: float, speed: float, limits: BaseLimits) -> float:
    """Return an estimate of the seconds to turn by ``angle`` radians at ``speed`` rad/s, within the base's limits."""
    return seconds_for(angle, speed, limits.turn, limits.turn_acceleration)


class MotionClock:
    """Clock for the time limit of a motion: counts seconds, and fewer of them while the base must drive slowly."""

    def __init__(self) -> None:
        self.spent = 0.0
        self._at: float | None = None

    def restart(self) -> None:
        """Reset the counted seconds to 0, for a new motion."""
        self.spent, self._at = 0.0, None

    def stop(self) -> None:
        """Stop counting until the next call of ``run``, while a person has control or the base does not report."""
        self._at = None

    def grant(self, seconds: float) -> None:
        """Subtract ``seconds`` from the counted time, so that a correction does not use up the time limit."""
        self.spent -= seconds

    def scale(self, before: float, limit: float) -> None:
        """Scale the counted seconds when the time limit changes, so that the same share of the limit is used up.

        ``before`` and ``limit`` are the old and the new limit in seconds.
        """
        if isfinite(before) and isfinite(limit):
            self.spent *= limit / before

    def run(self, now: float, steering: Steering) -> float:
        """Count the time since the last call, and return the total of counted seconds.

        The time counts in proportion to the velocity that the base permits: half of it if ``steering`` allows half of
        the requested velocity.
        """
        if self._at is not None:
            self.spent += min(now - self._at, MAX_TICK_TIME) * _permitted_share(steering)
        self._at = now
        return self.spent


def time_limit(seconds: float) -> float:
    """Return the time limit in seconds of a motion that is expected to take ``seconds``."""
    return TIME_LIMIT_FACTOR * seconds + TIME_LIMIT_MARGIN


def _permitted_share(steering: Steering) -> float:
    """Return the share of the requested velocity that the base permits, less than 1 at an obstacle, for example."""
    if steering.reason in UNHINDERED_REASONS or steering.fault:
        return 1.0
    requested, allowed = _size(steering.requested), _size(steering.allowed)
    return 1.0 if requested == 0.0 else min(1.0, allowed / requested)


def _size(velocity: Velocity) -> float:
    return abs(velocity.linear) or abs(velocity.angular)


BRAKING_SHARE, TURN_BRAKING_SHARE = 0.5, 0.34
"""Shares of the base's acceleration and turn acceleration that an approach uses for braking."""

CRAWL_SPEED = 0.02
"""Speed in m/s of the last part of an approach, so that the base rolls on for only a few millimetres."""

CRAWL_TURN_RATE = math.radians(4)
"""Turn rate in rad/s of the last part of a turn, so that the base turns on only a little after the stop."""

REACTION_TIME = 0.25
"""Seconds from a report of the base until the command that answers it takes effect.

It is the sum of the dead time of a Kobuki (users measured 0.2 s) and a tick.
"""

RANGE_GUARD_TIMEOUT = 5.0
"""Seconds to wait while the range guard stops the base, since people in the way usually walk on."""

SETTLING_TIMEOUT = 4.0
"""Seconds to wait until the base's driver has estimated the gyro's drift.

It is slightly longer than the driver's own timeout for the estimate.
"""

STANDSTILL_SPEED = 0.01
"""Speed (m/s or rad/s) below which the base stands still."""


DEAD_RECKONING_NOTE = " (dead reckoning)"
"""Suffix of all reasons on a base without odometry."""


class MotionDirection(Enum):
    """Direction of a base's motion: ahead, on the spot, or straight back.

    It decides which obstacles stop the motion.
    """

    AHEAD = "ahead"
    ROUND = "round"  # on the spot, or back in a curve
    BACK = "back"  # straight


class BaseMotion(Leaf):
    """Base class of leaves that drive the base; subclasses implement ``go``. The base stops unless the leaf succeeds.

    It fails at an obstacle in its ``motion_direction``, and while the base is latched. While a person or a reflex has
    control, it waits, then continues from the new pose. It also fails if the base refuses a command for another reason,
    if the range guard stops the base for too long, and at its time limit.
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
        """Return the expected seconds of the motion from ``state`` on; None for a motion that runs until it is halted.

        ``start`` is the pose of the base at the start of the leaf. The time limit is computed from the result. If the
        base's limits change, the method is called again with the same state.
        """
        del state, start
        return None

    def _may_settle(self) -> bool:
        """Return True while there is time left to wait for the estimate of the gyro's drift."""
        now = self.run.now()
        if self._settling_since is None:
            self._settling_since = now
        return now - self._settling_since <= SETTLING_TIMEOUT

    def _time_limit_reason(self, state: BaseState, steering: Steering) -> str:
        """Return the reason if the time limit is over, else an empty text.

        If the limits of the base change, the time limit changes too, but the same share of it stays used up. So a
        series of changes cannot extend a motion for ever.
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
        """Present direction of the motion."""
        return MotionDirection.AHEAD

    @abstractmethod
    def go(self, state: BaseState, start: Pose2D) -> Status:
        """Do the work of one tick with the newest report; ``start`` is the pose at the start."""

    def stop_reason(self, state: BaseState, steering: Steering) -> str:
        """Return why the motion cannot continue, or an empty text."""
        return obstacle_reason(state, self.motion_direction, steering)

    def resume(self, state: BaseState) -> None:
        """Adapt to a new pose of the base, after a person or a reflex has moved it."""
        del state
        self._stopping = False

    def state(self) -> BaseState | None:
        """Return the newest report of the base, or None if it is too old. The first report sets the start pose."""
        reading = self.robot.base.state()
        if not reading.good or reading.value is None:
            return None
        if self._start is None:
            self._start = reading.value.pose
        return reading.value

    def steer(self, velocity: Velocity, activity: str) -> Status:
        """Send a velocity to the base and return RUNNING, with the text ``activity`` as the reason.

        Fails if the base refuses the velocity for longer than REACTION_TIME. While the range guard stops the base, the
        leaf waits for RANGE_GUARD_TIMEOUT instead.
        """
        allowed = self.robot.base.drive(velocity)
        if allowed != ZERO_VELOCITY or velocity == ZERO_VELOCITY:
            self._refused_since = None
            return self.wait(activity)
        now, steering = self.run.now(), self.robot.base.steering()
        if self._refused_since is None:
            self._refused_since = now
        guarded = is_guarded(steering)
        if now - self._refused_since <= (RANGE_GUARD_TIMEOUT if guarded else REACTION_TIME):
            return self.wait(f"{activity}: {steering.reason}" if guarded else activity)
        reason = steering.reason or "it is not permitted"
        return self.fail(reason if guarded else f"the base does not move: {reason}")

    def come_to_rest(self, speed: float) -> Status:
        """Stop the base, and return SUCCESS when ``speed`` is below STANDSTILL_SPEED."""
        if not self._stopping:
            self._stopping = True
            self.robot.base.stop()
        return SUCCESS if abs(speed) < STANDSTILL_SPEED else self.wait("stopping")

    def approach(self, left: float, *, braking: float, crawl: float) -> float:
        """Return the speed for the remaining distance ``left`` (m or rad); 0 when it is time to stop.

        ``braking`` is the deceleration to use, ``crawl`` the lowest speed before the stop. With a constant deceleration
        b, the remaining distance is v^2 / 2b. A command takes effect a time T after its report, so the remaining
        distance at that report is (v + b T)^2 / 2b. The exact T matters little: the last part is at crawl speed, and
        the base stops at half the distance that it crawls in T.
        """
        if self._stopping or left <= crawl * REACTION_TIME / 2:
            return 0.0
        return max(crawl, math.sqrt(2 * braking * left) - braking * REACTION_TIME)

    @property
    def braking(self) -> float:
        """Deceleration in m/s^2 with which the base stops at the end of a drive."""
        return BRAKING_SHARE * self.robot.base.limits.acceleration

    @property
    def turn_braking(self) -> float:
        """Deceleration in rad/s^2 with which the base stops at the end of a turn."""
        return TURN_BRAKING_SHARE * self.robot.base.limits.turn_acceleration

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.base.stop()


def latch_reason(base: Base) -> str:
    """Return why the base is latched, or an empty text."""
    return f"the base is stopped: {base.latched}" if base.latched else ""


def motion_fault_reason(steering: Steering) -> str:
    """Return the fault for which the base stopped a mission's command, or an empty text."""
    return steering.fault if steering.source in (Source.MISSION, None) else ""


def obstacle_reason(state: BaseState, direction: MotionDirection, steering: Steering | None = None) -> str:
    """Return what stops a base from moving in a direction, or an empty text.

    A bump stops motions ahead only. A cliff stops every motion but straight back, since a turn could fall over the
    edge. If the safety reflex has control, the base counts as bumped, even if it has backed off already.
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
    """Return the name of the source that has control of the base instead of the mission, or an empty text."""
    if steering.source is Source.TELEOP:
        return "teleoperation has control"
    if steering.source is Source.SAFETY:
        return steering.reason or "a reflex has control"
    return ""


# Turning on the spot to a heading, exactly: what all leaves do the same way that end with a turn.

HEADING_TOLERANCE = math.radians(0.1)
"""Largest heading error in radians after a turn that is accepted without a correction."""

NUDGE_RATE = CRAWL_TURN_RATE / 2
"""Turn rate in rad/s of a heading correction after a turn.

The wheels of a Kobuki then turn at 4 mm/s; its commands are in whole mm/s.
"""

MAX_NUDGE_TIME = 5.0
"""Maximum seconds by which a heading correction extends the time limit of a turn.

A correction can take long if the base reports rarely, because the turn may then end several degrees off.
"""

MAX_NUDGES = 3
"""Maximum number of heading corrections after a turn."""


class Spin(BaseMotion):
    """Base class of motions that turn to a heading, with corrections.

    The base's reaction time is not known exactly, so a turn stops up to half a degree before or after the heading.
    Corrections turn for a computed time instead, so that the reaction time does not matter.
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
        """Turn to ``heading`` (radians), to the left if ``direction`` is 1, to the right if it is -1.

        ``speed`` is the maximum turn rate in rad/s, ``state`` the newest report, and ``activity`` the reason to show
        while the base turns. Returns SUCCESS when the base stands still.
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
"""Gain from the heading error to the turn rate in 1/s: a degree is corrected within about a second."""

MAX_STEERING_RATE = 0.5
"""Maximum turn rate in rad/s with which a base on a straight line corrects its heading."""


class DriveLeaf(BaseMotion):
    """Drive straight ahead, or straight back for a negative distance.

    Running until odometry has measured the distance and the base stands still, then succeeds. Fails after a bump, at a
    cliff, when a wheel drops, and while the base is latched. It also fails after 5 s at an obstacle that the range
    guard sees. While a person steers the base, it waits, then continues along its line.
    """

    tag = "drive"
    example = "- drive: 0.5 m"
    output_doc = "the distance driven, by odometry (m; negative backwards)"
    output_type = Length
    distance: float = argument("length", "distance; negative is backwards", principal=True)
    speed: float = argument("speed", "maximum speed", default=0.2, low=0.01, high=0.7)
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
        driven = self.result = distance_along(start, state.pose)
        speed = self.approach((self.distance - driven) * self._direction, braking=self.braking, crawl=CRAWL_SPEED)
        if speed == 0.0:
            return self.come_to_rest(state.velocity.linear)
        steer = STEERING_GAIN * (start.heading - state.pose.heading)
        turn = max(-MAX_STEERING_RATE, min(MAX_STEERING_RATE, steer))
        return self.steer(
            Velocity(self._direction * min(speed, self.speed), turn), f"{driven:.2f} of {self.distance:.2f} m"
        )


def distance_along(start: Pose2D, now: Pose2D) -> float:
    """Return how far ``now`` lies ahead of ``start`` along the heading of ``start``, in metres."""
    return (now.x - start.x) * math.cos(start.heading) + (now.y - start.y) * math.sin(start.heading)


# The leaf that drives along a part of a circle.


class Arc(BaseMotion):
    """Drive forwards along an arc: to the left for a positive angle, to the right for a negative angle.

    Running until the gyro has measured the angle and the base stands still, then succeeds. Fails after a bump, at a
    cliff, when a wheel drops, and while the base is latched. While a person steers the base, it waits, then continues
    to its angle.
    """

    tag = "arc"
    example = "- arc: {radius: 0.5 m, angle: 180 deg}"
    output_doc = "the angle driven, by the gyro (rad)"
    output_type = Angle
    radius: float = argument("length", "radius of the arc", low=0.05, high=10.0)
    angle: float = argument("angle", "angle of the arc; positive is to the left", default=math.tau)
    speed: float = argument("speed", "speed along the arc", default=0.2, low=0.01, high=0.7)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        left, limits = self.angle - (state.pose.heading - start.heading), self.robot.base.limits
        driving = seconds_to_drive(left * self.radius, self.speed, limits)
        return max(driving, seconds_to_turn(left, self.speed / self.radius, limits))

    def go(self, state: BaseState, start: Pose2D) -> Status:
        direction = math.copysign(1.0, self.angle)
        angle = self.result = state.pose.heading - start.heading
        # Whichever of driving and turning needs more care on this circle says how fast it may go round.
        rate = self.approach(
            (self.angle - angle) * direction,
            braking=min(self.turn_braking, self.braking / self.radius),
            crawl=min(CRAWL_TURN_RATE, CRAWL_SPEED / self.radius),
        )
        if rate == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        rate = min(rate, self.speed / self.radius)
        activity = f"{math.degrees(angle):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.steer(Velocity(rate * self.radius, direction * rate), activity)


# The leaf that keeps the base at a velocity.


class Cruise(BaseMotion):
    """Drive with a speed and a turn rate until halted.

    Running all the time; it never succeeds. Fails after a bump, at a cliff ahead, when a wheel drops, and while the
    base is latched. It waits while a person steers the base.
    """

    tag = "velocity"
    example = "- velocity: {speed: 0.1 m/s, turn: 20 deg/s}\n  timeout: 5 s"
    ends = frozenset({"failure"})
    speed: float = argument("speed", "speed; negative is backwards", default=0.0, low=-0.7, high=0.7)
    turn: float = argument("turn rate", "turn rate; positive is to the left", default=0.0, low=-3.5, high=3.5)

    @property
    def motion_direction(self) -> MotionDirection:
        if self.speed > 0.0:
            return MotionDirection.AHEAD
        return MotionDirection.BACK if self.turn == 0.0 else MotionDirection.ROUND

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        velocity = state.velocity
        activity = f"{velocity.linear:.2f} m/s, {velocity.angular:.2f} rad/s"
        return self.steer(Velocity(self.speed, self.turn), activity)


# The leaf that stops the base.

STOP_TIMEOUT = 5.0
"""Seconds within which a stopped base must stand still."""


class StopLeaf(BaseMotion):
    """Stop the base.

    Running until the base stands still, then succeeds; fails if it still moves after 5 s.
    """

    tag = "stop"
    example = "- stop"

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
    """Turn on the spot: to the left for a positive angle, to the right for a negative angle.

    Running until the gyro has measured the angle and the base stands still, then succeeds. Fails at a cliff (the base
    may then only drive straight back), when a wheel drops, and while the base is latched. While a person steers the
    base, it waits, then continues to its angle.
    """

    tag = "turn"
    example = "- turn: 90 deg"
    output_doc = "the angle turned, by the gyro (rad)"
    output_type = Angle
    angle: float = argument("angle", "angle; positive is to the left", principal=True)
    speed: float = argument(
        "turn rate", "maximum turn rate", default=math.radians(60), low=math.radians(1), high=math.pi
    )
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
        angle = self.result = state.pose.heading - start.heading
        activity = f"{math.degrees(angle):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.turn_to(start.heading + self.angle, self._direction, self.speed, state, activity)
