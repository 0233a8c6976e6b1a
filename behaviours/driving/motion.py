"""What all leaves that drive the base have in common: they look at it at each tick, and stop it unless they succeed."""

import math
from abc import abstractmethod
from enum import Enum

from py_trees.common import Status

from behaviours.driving.time_limit import MotionClock, limit_of
from behaviours.leaf import SUCCESS, Leaf
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
    its time limit, see ``behaviours.driving.time_limit``.
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
