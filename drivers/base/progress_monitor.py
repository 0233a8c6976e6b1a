"""Progress monitor of a base: detects a blocked base by comparing commanded with measured motion.

Distance, turn and their signs are compared over 1 s and 3 s, and distances over 6 s too. The tolerance covers delay
and ramp of the base, odometry that arrives late or seldom, wheel slip of 20 %, slopes and carpet.

Dead reckoning computes the pose from the commands, so it cannot show a fault. For such a base, range finder and IMU
are compared instead (``drivers.base.witnesses``); without them only the motion limits are left. The clock is not read:
times are arguments.
"""

from collections import deque
from math import cos, degrees, inf, remainder, sin, tau
from typing import Protocol

from drivers.api import ZERO_VELOCITY, BaseState, Pose2D, Velocity
from drivers.api.fast_dataclass import dataclass
from drivers.api.measures import length_text
from drivers.base.motion_fault import (
    ANGULAR_CAUSES,
    LINEAR_CAUSES,
    MotionFault,
    describe_causes,
    describe_command,
    describe_instrument,
    describe_overcurrent,
    hint_of,
)

# Commanded and measured motion in a sliding window of time. The commanded motion is an interval.
#
# A base responds late: after a dead time and along its own ramp, and its odometry is late, too. So the true velocity
# lies between the lowest and the highest velocity that was sent within the last ``lag`` seconds.


@dataclass(frozen=True, slots=True)
class MotionSums:
    """Commanded and measured motion of a base from its start to time ``at``, in metres and radians.

    ``low`` and ``high`` are the smallest and largest motion that the commands may have caused, ``moved`` is the
    measured motion.
    """

    at: float
    low: Velocity = ZERO_VELOCITY
    high: Velocity = ZERO_VELOCITY
    moved: Velocity = ZERO_VELOCITY

    def since(self, before: "MotionSums") -> "MotionSums":
        """Return the motion between ``before`` and these sums; ``at`` of the result is the duration in seconds."""
        return MotionSums(
            self.at - before.at,
            _minus(self.low, before.low),
            _minus(self.high, before.high),
            _minus(self.moved, before.moved),
        )


class SentVelocities:
    """Velocities sent to a base within the last ``lag`` seconds; as it reacts late, it may follow any of them."""

    def __init__(self, lag: float) -> None:
        self.lag = lag
        self._sent: deque[tuple[float, Velocity]] = deque([(-inf, ZERO_VELOCITY)])

    @property
    def standing(self) -> bool:
        """Whether only zero was sent within the last ``lag`` seconds."""
        return len(self._sent) == 1 and self._sent[0][1] == ZERO_VELOCITY

    def add(self, now: float, velocity: Velocity) -> None:
        """Add a velocity that is sent from ``now`` on."""
        if self._sent[-1][1] != velocity:
            self._sent.append((now, velocity))

    def bounds(self, now: float) -> tuple[Velocity, Velocity]:
        """Return the lowest and the highest velocity that were in force within ``lag`` seconds before ``now``."""
        sent = self._sent
        while len(sent) > 1 and sent[1][0] <= now - self.lag:
            sent.popleft()
        if len(sent) < 2:
            return sent[0][1], sent[0][1]
        linear, angular = [each.linear for _, each in sent], [each.angular for _, each in sent]
        return Velocity(min(linear), min(angular)), Velocity(max(linear), max(angular))


class MotionWindow:
    """Motion of a base in the last ``length`` seconds: keeps one ``MotionSums`` for each ``spacing`` seconds."""

    def __init__(self, length: float, spacing: float) -> None:
        self._length, self._spacing = length, spacing
        self._kept: deque[MotionSums] = deque()

    def restart(self) -> None:
        """Drop all motion sums."""
        self._kept.clear()

    def add(self, sums: MotionSums) -> MotionSums:
        """Add the newest sums; return the motion within the window, or since the restart if that was later."""
        kept = self._kept
        if not kept or sums.at - kept[-1].at >= self._spacing:
            kept.append(sums)
        while len(kept) > 1 and kept[1].at <= sums.at - self._length:
            kept.popleft()
        return sums.since(kept[0])


def displacement(before: Pose2D, after: Pose2D) -> Velocity:
    """Return the motion from one pose to another: metres along the mean of both headings, and radians turned."""
    turn = after.heading - before.heading
    along = before.heading + remainder(turn, tau) / 2
    way = (after.x - before.x) * cos(along) + (after.y - before.y) * sin(along)
    return Velocity(way, turn)


def add_velocities(one: Velocity, other: Velocity, times: float = 1.0) -> Velocity:
    """Return ``one + times * other`` for two velocities, or two motions in metres and radians."""
    return Velocity(one.linear + times * other.linear, one.angular + times * other.angular)


def _minus(one: Velocity, other: Velocity) -> Velocity:
    return Velocity(one.linear - other.linear, one.angular - other.angular)


WINDOW_TIME, SLOW_WINDOW_TIME = 1.0, 3.0
"""Lengths of the windows of comparison in seconds. The longer one shows slow motion and small differences."""

CREEP_WINDOW_TIME = 6.0
"""Length in seconds of the window that compares only distances.

With one of two encoders lost, half of the distance is measured. At speeds below 0.07 m/s, ``TOLERANCE`` hides that in
the shorter windows. Turns are not compared, since the drift of a gyro grows with the time.
"""

REACTION_TIME = 0.5
"""Seconds from a command to its effect in the odometry, in addition to the interval of the reports."""

MAX_INTERVAL = 0.5
"""Longest interval of reports in seconds that is added to ``REACTION_TIME``."""

NO_DATA_TIMEOUT = 1.0
"""Seconds without a new report after which a moving base is stopped."""

GAP = 0.15
"""Seconds without a renewed command after which the watchdog of the base may have stopped it.

This happens if this computer stalls.
"""

MIN_SHARE, MAX_SHARE = 0.6, 1.5
"""Smallest and largest share of the commanded motion that is measured; half of it is one of two encoders."""

TOLERANCE = Velocity(0.02, 0.1)
"""Tolerated difference of commanded and measured motion in metres and radians, in addition to the other tolerances."""

OPPOSITE = Velocity(0.015, 0.06)
"""Tolerated motion against the commanded direction in metres and radians, such as on a slope at the start."""

TURN_PER_WAY = 0.5
"""Additional tolerance of the turn, in radians per metre travelled: the wheels of one side may slip."""

WAY_PER_TURN = 0.03
"""Additional tolerance of the distance, in metres per radian turned.

The centre of a turn may differ from the middle of the base.
"""

MIN_MONITORED_SPEED = 0.05
"""Commanded speed in m/s below which a base may stand still: friction may exceed the motor's force."""

OVERCURRENT_TIMEOUT = 1.0
"""Seconds of motor overcurrent after which a base is stopped, even if its wheels turn: they may slip."""


@dataclass(frozen=True, slots=True)
class Instruments:
    """Names of the instruments that measure the motion of a base, for messages."""

    linear: str = "odometry"
    angular: str = "odometry"


class Witness(Protocol):
    """Instrument beside the odometry that measures the motion of a base; see ``drivers.base.witnesses``."""

    def restart(self) -> None:
        """Drop all measurements; the next motion begins."""
        ...

    def compare(self, now: float, state: BaseState) -> MotionFault | None:
        """Return a motion fault if the measurements of the witness contradict the odometry in ``state``; else None."""
        ...


class ProgressMonitor:
    """Compares the commanded velocities with the reported states. Not thread-safe.

    ``instruments`` names the instruments of the base, for messages.
    """

    def __init__(self, instruments: Instruments | None = None) -> None:
        self._instruments = instruments or Instruments()
        self._windows = (MotionWindow(WINDOW_TIME, 0.04), MotionWindow(SLOW_WINDOW_TIME, 0.2))
        self._creep_window = MotionWindow(CREEP_WINDOW_TIME, 0.4)
        self._interval = 0.0
        self.witnesses: list[Witness] = []
        self.restart()

    def restart(self) -> None:
        """Drop all sent and measured motion."""
        self._sent = SentVelocities(REACTION_TIME + self._interval)
        self._updated_at = 0.0
        self._sums = MotionSums(0.0)
        self._state: BaseState | None = None
        self._pose: Pose2D | None = None
        self._reported_at = 0.0
        self._overloaded_since: float | None = None
        for window in (*self._windows, self._creep_window):
            window.restart()
        for witness in self.witnesses:
            witness.restart()

    @property
    def watching(self) -> bool:
        """True if a velocity other than zero was sent so recently that the base may move: then compare its reports."""
        return not self._sent.standing

    def update(self, now: float, sent: Velocity, state: BaseState | None) -> MotionFault | None:
        """Compare sent and measured motion once in a control cycle; return a fault if the base must stop, else None.

        ``sent`` is the velocity sent from ``now`` on, ``state`` the newest state, None if unknown.
        """
        if self.watching and now - self._updated_at > NO_DATA_TIMEOUT:  # the base was offline, or this computer stalled
            self.restart()
        if sent == ZERO_VELOCITY and self._sent.standing:
            self._rest(now, state)
            return None
        if self._sent.standing:
            self._begin(now, state)
        self._advance(now)
        self._sent.add(now, sent)
        new = state is not None and state is not self._state
        if new and state is not None:
            self._take(now, state)
        if state is None or sent == ZERO_VELOCITY:
            self._overloaded_since = None  # a motor at rest is not overloaded: the next start has its own peak
            return None
        if now - self._reported_at > NO_DATA_TIMEOUT:
            return MotionFault(
                f"{describe_command(sent)}, and no report of the base for {NO_DATA_TIMEOUT:g} s", "check its cable"
            )
        if not new:
            return None
        fault = None if state.reckoned else self._overload(now, sent, state) or self._compare(sent, state)
        return fault or next(filter(None, (witness.compare(now, state) for witness in self.witnesses)), None)

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _rest(self, now: float, state: BaseState | None) -> None:
        """Store the state of a resting base: the next motion is measured from it."""
        if state is not None and state is not self._state:
            self._interval = min(max(now - self._reported_at, 0.0), MAX_INTERVAL)
            self._state, self._pose, self._reported_at = state, state.pose, now
        self._overloaded_since = None

    def _begin(self, now: float, state: BaseState | None) -> None:
        """Reset the sums and the witnesses, since a motion begins."""
        self._state, self._pose = state, None if state is None else state.pose
        self._updated_at = self._reported_at = now
        self._sums = MotionSums(now)
        for window in (*self._windows, self._creep_window):
            window.restart()
        for witness in self.witnesses:
            witness.restart()

    def _advance(self, now: float) -> None:
        """Add the motion that was commanded since the last update."""
        before, self._updated_at = self._updated_at, now
        if now - before > GAP:
            self._sent.add(before + GAP, ZERO_VELOCITY)
        if now > before:
            low, high = self._sent.bounds(now)
            sums, seconds = self._sums, now - before
            self._sums = MotionSums(
                now, add_velocities(sums.low, low, seconds), add_velocities(sums.high, high, seconds), sums.moved
            )

    def _take(self, now: float, state: BaseState) -> None:
        """Add the motion between the previous report of the base and ``state``."""
        before, self._state, self._pose = self._pose, state, state.pose
        if before is not None:
            self._interval = min(max(now - self._reported_at, 0.9 * self._interval), MAX_INTERVAL)
            sums = self._sums
            self._sums = MotionSums(
                sums.at, sums.low, sums.high, add_velocities(sums.moved, displacement(before, state.pose))
            )
        self._sent.lag = REACTION_TIME + self._interval
        self._reported_at = now

    def _overload(self, now: float, sent: Velocity, state: BaseState) -> MotionFault | None:
        """Return a fault if a motor has been overloaded for ``OVERCURRENT_TIMEOUT``; else None."""
        if not state.overcurrent:
            self._overloaded_since = None
            return None
        if self._overloaded_since is None:
            self._overloaded_since = now
        if now - self._overloaded_since < OVERCURRENT_TIMEOUT:
            return None
        cause = f"{describe_overcurrent(state)} for {OVERCURRENT_TIMEOUT:g} s: something holds the base"
        reason = f"{describe_command(sent)}, {cause}"
        return MotionFault(reason, "free its wheels and its way")

    def _compare(self, sent: Velocity, state: BaseState) -> MotionFault | None:
        """Return a fault if commanded and measured motion differ within a window; else None."""
        for window in self._windows:
            motion = window.add(self._sums)
            fault = self._drives(motion, sent, state) or self._turns(motion, sent, state)
            if fault is not None:
                return fault
        return self._drives(self._creep_window.add(self._sums), sent, state)

    def _drives(self, motion: MotionSums, sent: Velocity, state: BaseState) -> MotionFault | None:
        turn = max(abs(motion.low.angular), abs(motion.high.angular))
        low, high, measured = motion.low.linear, motion.high.linear, motion.moved.linear
        more = WAY_PER_TURN * turn
        off = deviation(low, high, measured, TOLERANCE.linear + more, OPPOSITE.linear + more)
        if off is None:
            return None
        told = describe_command(Velocity(sent.linear or (low + high) / 2 / motion.at, 0.0))
        found = f"{describe_instrument(self._instruments.linear)} {length_text(measured)}"
        cause, hint = LINEAR_CAUSES[off]
        if off == "none" and 0.0 < abs(sent.linear) < MIN_MONITORED_SPEED:
            cause += ", or its motors cannot turn so slowly"
        if off in ("none", "less"):
            cause, hint = cause + describe_causes(state), hint_of(state) or hint
        return MotionFault(f"{told} for {motion.at:.1f} s, {found}: {cause}", hint)

    def _turns(self, motion: MotionSums, sent: Velocity, state: BaseState) -> MotionFault | None:
        way = max(abs(motion.low.linear), abs(motion.high.linear))
        low, high, measured = motion.low.angular, motion.high.angular, motion.moved.angular
        more = TURN_PER_WAY * way
        off = deviation(low, high, measured, TOLERANCE.angular + more, OPPOSITE.angular + more)
        if off is None:
            return None
        told = describe_command(Velocity(0.0, sent.angular)) if sent.angular or not way else describe_command(sent)
        found = f"{describe_instrument(self._instruments.angular)} {degrees(measured):.0f} deg"
        cause, hint = ANGULAR_CAUSES[off]
        if off in ("none", "less"):
            cause, hint = cause + describe_causes(state), hint_of(state) or hint
        return MotionFault(f"{told} for {motion.at:.1f} s, {found}: {cause}", hint)


def deviation(low: float, high: float, measured: float, tolerance: float, opposite: float) -> str | None:
    """Return how ``measured`` motion deviates from the interval ``low`` to ``high``; None if it is tolerated.

    ``tolerance`` widens the interval. ``opposite`` is how far the base may move in the opposite direction without a
    fault. The result is "none" (hardly any motion), "less", "more" or "opposite".
    """
    least, most = _least(low, high, tolerance, opposite), -_least(-high, -low, tolerance, opposite)
    if least <= measured <= most:
        return None
    way = 1.0 if low + high > 0.0 else -1.0
    if low == high == 0.0 or measured * way > max(low * way, high * way):
        return "more"
    if measured * way < -opposite:
        return "opposite"
    return "none" if abs(measured) < 0.2 * max(abs(low), abs(high)) else "less"


def _least(low: float, high: float, tolerance: float, opposite: float) -> float:
    """Return the lower bound of the tolerated motion; see ``deviation``."""
    if low < 0.0:
        return MAX_SHARE * low - tolerance
    return max(MIN_SHARE * low - tolerance, -opposite) if high > 0.0 else -tolerance
