"""What all leaves that drive the base have in common: they look at it at each tick, and stop it unless they succeed."""

import math
from abc import abstractmethod
from enum import Enum
from math import isfinite

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.run import BY_DEAD_RECKONING
from drivers.api import (
    STILL,
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

MARGIN_SHARE, MARGIN = 1.5, 5.0
"""A motion may take so many times as long as it can take, and so many seconds more."""

LONGEST_TICK = 1.0
"""Seconds between two ticks that count at most: a run that is paused is not ticked, so a pause counts as one second."""

NO_PROGRESS_LIMIT = 30.0
"""Seconds for which a motion that a node of ROS 2 does may stand still. Nav2 gives up after 10 s by itself."""

UNHINDERED = ("", "limited")
"""Reasons for which a base goes slower than wanted that do not stop the clock."""


def seconds_for(way: float, speed: float, limit: float, acceleration: float) -> float:
    """Return how long a way (m or rad) takes from rest to rest: two ramps, and braking that is half as hard."""
    fastest = max(min(abs(speed), limit), 1e-6)
    return abs(way) / fastest + 3 * fastest / acceleration


def seconds_to_drive(way: float, speed: float, limits: BaseLimits) -> float:
    """Return how long it takes to drive a way in metres."""
    return seconds_for(way, speed, limits.speed, limits.acceleration)


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
            self.spent += min(now - self._at, LONGEST_TICK) * _share(steering)
        self._at = now
        return self.spent


def limit_of(seconds: float) -> float:
    """Return the time limit of a motion that can be done in so many seconds."""
    return MARGIN_SHARE * seconds + MARGIN


def _share(steering: Steering) -> float:
    """Return which share of what is wanted the base may do: less where something holds it up, such as an obstacle."""
    if steering.because in UNHINDERED or steering.fault:
        return 1.0
    wanted, given = _size(steering.wanted), _size(steering.given)
    return 1.0 if wanted == 0.0 else min(1.0, given / wanted)


def _size(velocity: Velocity) -> float:
    return abs(velocity.linear) or abs(velocity.angular)


BRAKING, TURN_BRAKING = 0.5, 0.34
"""Which share of the base's greatest acceleration, and turn acceleration, the approach to a goal counts on."""

CRAWL = 0.02
"""Speed in m/s of the last bit: what the base still rolls after it was told to stop is then a few millimetres."""

TURN_CRAWL = math.radians(4)
"""The same in rad/s."""

REACTION = 0.25
"""Seconds from a report to the motion that answers it: the Kobuki's dead time (users measured 0.2 s) and a tick."""

HELD_OFF = 5.0
"""Seconds for which a leaf waits while the range guard keeps the base from moving: people walk on."""

SETTLING_LIMIT = 4.0
"""Seconds for which a motion waits for the drift of the gyro: a little longer than a driver needs to give up."""

STANDSTILL = 0.01
"""Below this speed (m/s or rad/s) it has stopped."""


RECKONED = " (dead reckoning)"
"""Said of all that is done on a base that measures nothing."""


class Way(Enum):
    """Where a motion leads; what the base feels matters accordingly."""

    AHEAD = "ahead"
    ROUND = "round"  # on the spot, or back in a curve
    BACK = "back"  # straight


class Motion(Leaf):
    """Drives the base as ``go`` says, from a start pose, in a ``way``; it stops it unless it has succeeded.

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
    _clocked: BaseState | None = None
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
        trouble = held_up(self.robot.base) or disobeyed(steering) or self.trouble(state, steering)
        if trouble:
            return self.fail(trouble)
        if state.settling and not self._stopping and self._may_settle():
            self._clock.stop()
            return self.wait("waiting for the drift of the gyro to be known")
        override = overriding(steering)
        if override:
            self._refused_since, self._limit = None, None
            self._clock.restart()
            self.resume(state)
            return self.wait(override)
        late = self._overdue(state, steering)
        if late:
            return self.fail(late)
        status = self.go(state, self._start)
        if state.reckoned and status is SUCCESS and self.keeps in (Length, Angle):
            self.feedback_message = BY_DEAD_RECKONING
            self.run.reckoned = True
        elif state.reckoned and status is not SUCCESS and not self.feedback_message.endswith(RECKONED):
            self.feedback_message += RECKONED
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
        return now - self._settling_since <= SETTLING_LIMIT

    def _overdue(self, state: BaseState, steering: Steering) -> str:
        """Say that it takes longer than it can take, or nothing.

        When the limits of the base change, so does the time limit; the share of it that is spent stays spent, so no
        series of changes keeps a motion alive.
        """
        if self._start is None:
            return ""
        limits = self.robot.base.limits
        if self._limit is None or self._clocked is None:
            self._clocked, self._limits = state, limits
            self._limit = self._time_limit(state, self._start)
        elif limits != self._limits:
            self._limits, before = limits, self._limit
            self._limit = self._time_limit(self._clocked, self._start)
            self._clock.scale(before, self._limit)
        if self._clock.run(self.run.now(), steering) <= self._limit:
            return ""
        return f"not done within its time limit of {self._limit:.0f} s"

    def _time_limit(self, state: BaseState, start: Pose2D) -> float:
        seconds = self.seconds_needed(state, start)
        return math.inf if seconds is None else limit_of(seconds)

    @property
    def way(self) -> Way:
        """Where it leads now."""
        return Way.AHEAD

    @abstractmethod
    def go(self, state: BaseState, start: Pose2D) -> Status:
        """Do one tick's work with what the base reports, from where it started."""

    def trouble(self, state: BaseState, steering: Steering) -> str:
        """Say why it cannot go on, or nothing."""
        return obstacle(state, self.way, steering)

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

    def steer(self, velocity: Velocity, doing: str) -> Status:
        """Tell the base to move so, and go on; fail once it has refused all of it for longer than a reaction takes.

        While the range guard keeps it from moving, fail after ``HELD_OFF`` seconds.
        """
        given = self.robot.base.drive(velocity)
        if given != STILL or velocity == STILL:
            self._refused_since = None
            return self.wait(doing)
        now, steering = self.run.now(), self.robot.base.steering()
        if self._refused_since is None:
            self._refused_since = now
        guarded = is_guarded(steering)
        if now - self._refused_since <= (HELD_OFF if guarded else REACTION):
            return self.wait(f"{doing}: {steering.because}" if guarded else doing)
        because = steering.because or "it is not permitted"
        return self.fail(because if guarded else f"the base does not move: {because}")

    def come_to_rest(self, speed: float) -> Status:
        """Stop, and succeed once it stands still."""
        if not self._stopping:
            self._stopping = True
            self.robot.base.stop()
        return SUCCESS if abs(speed) < STANDSTILL else self.wait("stopping")

    def approach(self, left: float, *, braking: float, crawl: float) -> float:
        """Return how fast to go with ``left`` (m or rad) to go; 0 when it is time to stop.

        A motion that ends at the goal with an even deceleration b has v^2 / 2b left. A command that acts a time T
        after its report meets v + b T at that report, hence (v + b T)^2 / 2b. How long T really is, matters little: the
        last bit is done at a crawl, and half of what that covers in T is where to stop.
        """
        if self._stopping or left <= crawl * REACTION / 2:
            return 0.0
        return max(crawl, math.sqrt(2 * braking * left) - braking * REACTION)

    @property
    def braking(self) -> float:
        """The deceleration in m/s^2 that an approach counts on."""
        return BRAKING * self.robot.base.limits.acceleration

    @property
    def turn_braking(self) -> float:
        """The same in rad/s^2."""
        return TURN_BRAKING * self.robot.base.limits.turn_acceleration

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.base.stop()


def held_up(base: Base) -> str:
    """Say why a base does not move at all until somebody enables it, or nothing."""
    return f"the base is stopped: {base.latched}" if base.latched else ""


def disobeyed(steering: Steering) -> str:
    """Say why a mission's command was stopped because the base did not do it, or nothing."""
    return steering.fault if steering.source in (Source.MISSION, None) else ""


def obstacle(state: BaseState, way: Way, steering: Steering | None = None) -> str:
    """Say what stops a base from going on in a way, or nothing.

    What is ahead matters only where it goes there; but at an edge there is no way but straight back: with a turn it
    would fall. A base that ``steering`` says is backing off has bumped, though it may have left that behind already.
    """
    if state.wheel_drop:
        return "a wheel has dropped"
    if state.cliff and way is not Way.BACK:
        return "a cliff ahead" if way is Way.AHEAD else "a cliff ahead: the only way is straight back"
    if way is Way.AHEAD and (state.bumper or (steering is not None and steering.source is Source.SAFETY)):
        return "bumped into something"
    return ""


def overriding(steering: Steering) -> str:
    """Say who goes before a mission and has the wheels now, or nothing."""
    if steering.source is Source.TELEOP:
        return "teleoperation has the wheels"
    if steering.source is Source.SAFETY:
        return steering.because or "a reflex has the wheels"
    return ""


# Turning on the spot to a heading, exactly: what all leaves do the same way that end with a turn.

FINE = math.radians(0.1)
"""Radians beside the heading that are near enough."""

NUDGE = TURN_CRAWL / 2
"""Turn rate of a correction in rad/s: the wheels of a Kobuki turn at 4 mm/s then, of which it knows whole ones."""

MAX_NUDGE_GRANT = 5.0
"""Seconds by which a correction extends the time limit at most: with rare odometry a turn ends degrees beside."""

NUDGES = 3
"""Corrections at most: where they do not help, more of them will not."""


class Spin(Motion):
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

    def turn_to(self, heading: float, direction: float, speed: float, state: BaseState, doing: str) -> Status:
        """Turn to ``heading`` (radians), left for a positive ``direction``, at ``speed`` rad/s at most.

        Succeeds once it stands still.
        """
        left, now = heading - state.pose.heading, self.run.now()
        if self._nudge is not None:
            rate, ends = self._nudge
            if now < ends:
                return self.steer(Velocity(0.0, rate), doing)
            self._nudge, self._stopping, self._rolls_until = None, False, now + REACTION
            return self.come_to_rest(math.inf)
        rate = self.approach(left * direction, braking=self.turn_braking, crawl=TURN_CRAWL)
        if rate > 0.0 and self._nudges == 0:
            return self.steer(Velocity(0.0, direction * min(rate, speed)), doing)
        if self.come_to_rest(state.velocity.angular) is not SUCCESS or now < self._rolls_until:
            return self.wait("stopping")
        if abs(left) <= FINE or self._nudges == NUDGES:
            return SUCCESS
        self._nudges += 1
        seconds = abs(left) / NUDGE
        self._clock.grant(min(seconds, MAX_NUDGE_GRANT))
        self._nudge = math.copysign(NUDGE, left), now + seconds
        return self.steer(Velocity(0.0, self._nudge[0]), doing)


# The leaf that drives straight ahead or back.

STEERING = 2.0
"""rad/s for each radian off the line: a degree is turned back within about a second."""

MOST_STEERING = 0.5
"""rad/s at most."""


class Drive(Motion):
    """Drive straight ahead, or back for a negative distance.

    Running until the distance is covered by odometry and the base stands still, then succeeds.
    Fails when it bumps into something or comes to a cliff, when a wheel drops, once the range guard has seen something
    in its way for 5 s, and while the base is stopped until somebody enables it. While somebody steers the base by hand
    it waits, then goes on along its line.
    """

    word = "drive"
    stores = "how far it went, by odometry (m; negative backwards)"
    keeps = Length
    distance: float = argument("length", "how far; negative is backwards", principal=True)
    speed: float = argument("speed", "how fast", default=0.2, low=0.01, high=0.7)
    _direction = 1.0

    @property
    def way(self) -> Way:
        return Way.AHEAD if self._direction > 0 else Way.BACK

    def initialise(self) -> None:
        super().initialise()
        self._direction = math.copysign(1.0, self.distance)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        return seconds_to_drive(self.distance - along(start, state.pose), self.speed, self.robot.base.limits)

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._start is not None:
            self._direction = math.copysign(1.0, self.distance - along(self._start, state.pose))

    def go(self, state: BaseState, start: Pose2D) -> Status:
        gone = self.result = along(start, state.pose)
        speed = self.approach((self.distance - gone) * self._direction, braking=self.braking, crawl=CRAWL)
        if speed == 0.0:
            return self.come_to_rest(state.velocity.linear)
        steer = STEERING * (start.heading - state.pose.heading)
        turn = max(-MOST_STEERING, min(MOST_STEERING, steer))
        return self.steer(
            Velocity(self._direction * min(speed, self.speed), turn), f"{gone:.2f} of {self.distance:.2f} m"
        )


def along(start: Pose2D, now: Pose2D) -> float:
    """Return how far ``now`` lies ahead of ``start`` along its heading, in metres."""
    return (now.x - start.x) * math.cos(start.heading) + (now.y - start.y) * math.sin(start.heading)


# The leaf that drives along a part of a circle.


class Arc(Motion):
    """Drive forwards along a part of a circle: to the left for a positive angle, to the right for a negative one.

    Running until the base has turned by the angle, by the gyro, and stands still, then succeeds.
    Fails when it bumps into something or comes to a cliff, when a wheel drops, and while the base is stopped until
    somebody enables it. While somebody steers the base by hand it waits, then goes on until it has turned so far.
    """

    word = "arc"
    stores = "how far round it went, by the gyro (rad)"
    keeps = Angle
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
            crawl=min(TURN_CRAWL, CRAWL / self.radius),
        )
        if rate == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        rate = min(rate, self.speed / self.radius)
        doing = f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.steer(Velocity(rate * self.radius, direction * rate), doing)


# The leaf that keeps the base at a velocity.


class Cruise(Motion):
    """Keep the base at a speed and a turn rate, until it is halted.

    Running all the time; it never succeeds. Fails when it bumps into something or comes to a cliff ahead, when a wheel
    drops, and while the base is stopped until somebody enables it. While somebody steers the base by hand it waits.
    """

    word = "velocity"
    ends = frozenset({"failure"})
    speed: float = argument("speed", "how fast; negative is backwards", default=0.0, low=-0.7, high=0.7)
    turn: float = argument("turn rate", "how fast to turn; positive is to the left", default=0.0, low=-3.5, high=3.5)

    @property
    def way(self) -> Way:
        if self.speed > 0.0:
            return Way.AHEAD
        return Way.BACK if self.turn == 0.0 else Way.ROUND

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        velocity = state.velocity
        doing = f"{velocity.linear:.2f} m/s, {velocity.angular:.2f} rad/s"
        return self.steer(Velocity(self.speed, self.turn), doing)


# The leaf that stops the base.

STOP_LIMIT = 5.0
"""Seconds within which a base must stand that was stopped."""


class Stop(Motion):
    """Stop the base.

    Running until it stands still, then succeeds; fails when it still moves after 5 s.
    """

    word = "stop"

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
        if moving < STANDSTILL and self.elapsed >= REACTION:
            return SUCCESS
        if self.elapsed > STOP_LIMIT:
            return self.fail(f"the base still moves {STOP_LIMIT:g} s after it was stopped")
        return self.wait("stopping")


# The leaf that turns on the spot.


class Turn(Spin):
    """Turn on the spot: to the left for a positive angle, to the right for a negative one.

    Running until the angle is reached by the gyro and the base stands still, then succeeds.
    Fails at a cliff, where the only way is straight back, when a wheel drops, and while the base is stopped until
    somebody enables it. While somebody steers the base by hand it waits, then goes on to its angle.
    """

    word = "turn"
    stores = "how far it turned, by the gyro (rad)"
    keeps = Angle
    angle: float = argument("angle", "how far; positive is to the left", principal=True)
    speed: float = argument("turn rate", "how fast", default=math.radians(60), low=math.radians(1), high=math.pi)
    _direction = 1.0

    @property
    def way(self) -> Way:
        return Way.ROUND

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
