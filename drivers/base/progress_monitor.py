"""Progress monitor of a base: does it do what it was told? Time, commands and reports are handed in.

Over about one second, commanded and measured motion are compared in amount and sign, driving and turning separately.
The tolerance covers dead time and ramp of a base, late and rare odometry, slip of 20 %, slopes and carpet. A base whose
pose is dead reckoning measures nothing: it is never compared with its own commands, but with what its range finder and
its IMU see, where it has some (``drivers.base.witnesses``); else only the clock of its motions is left.
"""

from collections import deque
from math import cos, degrees, inf, remainder, sin, tau
from typing import Protocol

from drivers.api import STILL, BaseState, Pose2D, Velocity
from drivers.api.measures import length_text
from drivers.api.quick import dataclass
from drivers.base.motion_fault import (
    ANGULAR_CAUSES,
    LINEAR_CAUSES,
    MotionFault,
    commanded,
    felt,
    hint_of,
    overcurrent,
    reported_by,
)

# Commanded and measured motion over a sliding window of time, as an interval for what the commands can have caused.
#
# A base obeys late: after a dead time, along its own ramp, and its odometry comes late, too. So the true velocity is
# taken to lie between the lowest and the highest velocity that was sent within the last moments (``lag``).


@dataclass(frozen=True, slots=True)
class MotionSums:
    """Sums since the beginning, at time ``at``: metres and radians.

    ``low`` and ``high`` bound what the commands can have caused, ``moved`` is what was measured.
    """

    at: float
    low: Velocity = STILL
    high: Velocity = STILL
    moved: Velocity = STILL

    def since(self, before: "MotionSums") -> "MotionSums":
        """Return the motion since ``before``; ``at`` is the time that it took."""
        return MotionSums(
            self.at - before.at,
            _minus(self.low, before.low),
            _minus(self.high, before.high),
            _minus(self.moved, before.moved),
        )


class SentVelocities:
    """The velocities sent within the last ``lag`` seconds."""

    def __init__(self, lag: float) -> None:
        self.lag = lag
        self._sent: deque[tuple[float, Velocity]] = deque([(-inf, STILL)])

    @property
    def standing(self) -> bool:
        """Whether nothing but standing still was sent within the lag."""
        return len(self._sent) == 1 and self._sent[0][1] == STILL

    def add(self, now: float, velocity: Velocity) -> None:
        """Note that ``velocity`` is sent from ``now`` on."""
        if self._sent[-1][1] != velocity:
            self._sent.append((now, velocity))

    def bounds(self, now: float) -> tuple[Velocity, Velocity]:
        """Return the lowest and the highest velocity in force within the lag before ``now``."""
        sent = self._sent
        while len(sent) > 1 and sent[1][0] <= now - self.lag:
            sent.popleft()
        if len(sent) < 2:
            return sent[0][1], sent[0][1]
        linear, angular = [each.linear for _, each in sent], [each.angular for _, each in sent]
        return Velocity(min(linear), min(angular)), Velocity(max(linear), max(angular))


class MotionWindow:
    """The sums of the last ``length`` seconds, one kept every ``spacing`` seconds."""

    def __init__(self, length: float, spacing: float) -> None:
        self._length, self._spacing = length, spacing
        self._kept: deque[MotionSums] = deque()

    def restart(self) -> None:
        """Forget all sums."""
        self._kept.clear()

    def add(self, sums: MotionSums) -> MotionSums:
        """Take the newest sums; return the motion within the window, or since the restart."""
        kept = self._kept
        if not kept or sums.at - kept[-1].at >= self._spacing:
            kept.append(sums)
        while len(kept) > 1 and kept[1].at <= sums.at - self._length:
            kept.popleft()
        return sums.since(kept[0])


def moved(before: Pose2D, after: Pose2D) -> Velocity:
    """Return the motion between two poses: metres along the mean heading, and radians."""
    turn = after.heading - before.heading
    along = before.heading + remainder(turn, tau) / 2
    way = (after.x - before.x) * cos(along) + (after.y - before.y) * sin(along)
    return Velocity(way, turn)


def plus(one: Velocity, other: Velocity, times: float = 1.0) -> Velocity:
    """Return the sum of two velocities or motions, the second one multiplied."""
    return Velocity(one.linear + times * other.linear, one.angular + times * other.angular)


def _minus(one: Velocity, other: Velocity) -> Velocity:
    return Velocity(one.linear - other.linear, one.angular - other.angular)


WINDOW, SLOW_WINDOW = 1.0, 3.0
"""Seconds over which motion is compared; over the longer one, slow motion and small differences show, too."""

LAG = 0.5
"""Seconds that a base may take to obey, and its odometry to tell; the interval of its reports comes on top of that."""

MAX_INTERVAL = 0.5
"""Seconds between two reports that are still counted on."""

NO_DATA_TIMEOUT = 1.0
"""Seconds without a new report after which a moving base is stopped."""

GAP = 0.15
"""Seconds without a renewal after which the base may have stopped by itself: a computer was held up."""

MIN_SHARE, MAX_SHARE = 0.6, 1.5
"""Which share of the commanded motion must be measured at least, and may be at most: half is one of two encoders."""

TOLERANCE = Velocity(0.02, 0.1)
"""Metres and radians by which motion may differ besides."""

OPPOSITE = Velocity(0.015, 0.06)
"""Metres and radians that a base may move against the command: the play of its gears, a slope as it starts."""

TURN_PER_WAY = 0.5
"""Radians that each metre may turn a base more or less: wheels that slip on one side."""

WAY_PER_TURN = 0.03
"""Metres that each radian may move it: the middle of a turn is not that of the base."""

CRAWL = 0.05
"""m/s below which friction may hold a base."""

OVERCURRENT_TIMEOUT = 1.0
"""Seconds of overload after which a base is stopped, whatever its encoders count: its wheels may slip."""


@dataclass(frozen=True, slots=True)
class Instruments:
    """What measures the motion of a base, in words."""

    linear: str = "odometry"
    angular: str = "odometry"


class Witness(Protocol):
    """An instrument beside the odometry: those of ``drivers.base.witnesses``."""

    def restart(self) -> None:
        """Forget what was seen."""
        ...

    def compare(self, now: float, state: BaseState) -> MotionFault | None:
        """Return a fault if the base does not move as ``state`` says."""
        ...


class ProgressMonitor:
    """Compares what a base is sent with what it reports. Not safe between threads.

    ``instruments`` names what measures its motion.
    """

    def __init__(self, instruments: Instruments | None = None) -> None:
        self._instruments = instruments or Instruments()
        self._windows = (MotionWindow(WINDOW, 0.04), MotionWindow(SLOW_WINDOW, 0.2))
        self._interval = 0.0
        self.witnesses: list[Witness] = []
        self.restart()

    def restart(self) -> None:
        """Forget all that was sent and measured."""
        self._sent = SentVelocities(LAG + self._interval)
        self._updated_at = 0.0
        self._sums = MotionSums(0.0)
        self._state: BaseState | None = None
        self._pose: Pose2D | None = None
        self._reported_at = 0.0
        self._overloaded_since: float | None = None
        for window in self._windows:
            window.restart()
        for witness in self.witnesses:
            witness.restart()

    @property
    def watching(self) -> bool:
        """Whether the base moves, or has been told to until a moment ago: then each report counts."""
        return not self._sent.standing

    def update(self, now: float, sent: Velocity, state: BaseState | None) -> MotionFault | None:
        """Take what is ``sent`` to the base from now on, and its newest report; return why it must stop, or None."""
        if self.watching and now - self._updated_at > NO_DATA_TIMEOUT:  # the base or the computer was away
            self.restart()
        if sent == STILL and self._sent.standing:
            self._rest(now, state)
            return None
        if self._sent.standing:
            self._begin(now, state)
        self._advance(now)
        self._sent.add(now, sent)
        new = state is not None and state is not self._state
        if new and state is not None:
            self._take(now, state)
        if state is None or sent == STILL:
            self._overloaded_since = None  # a motor at rest is not overloaded: the next start has its own peak
            return None
        if now - self._reported_at > NO_DATA_TIMEOUT:
            return MotionFault(
                f"{commanded(sent)}, and no report of the base for {NO_DATA_TIMEOUT:g} s", "look at its cable"
            )
        if not new:
            return None
        fault = None if state.reckoned else self._overload(now, sent, state) or self._compare(sent, state)
        return fault or next(filter(None, (witness.compare(now, state) for witness in self.witnesses)), None)

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _rest(self, now: float, state: BaseState | None) -> None:
        """Begin the next motion from here."""
        if state is not None and state is not self._state:
            self._interval = min(max(now - self._reported_at, 0.0), MAX_INTERVAL)
            self._state, self._pose, self._reported_at = state, state.pose, now
        self._overloaded_since = None

    def _begin(self, now: float, state: BaseState | None) -> None:
        """Begin to count at the start of a motion."""
        self._state, self._pose = state, None if state is None else state.pose
        self._updated_at = self._reported_at = now
        self._sums = MotionSums(now)
        for window in self._windows:
            window.restart()
        for witness in self.witnesses:
            witness.restart()

    def _advance(self, now: float) -> None:
        """Add up what was commanded since the last update."""
        before, self._updated_at = self._updated_at, now
        if now - before > GAP:
            self._sent.add(before + GAP, STILL)
        if now > before:
            low, high = self._sent.bounds(now)
            sums, seconds = self._sums, now - before
            self._sums = MotionSums(now, plus(sums.low, low, seconds), plus(sums.high, high, seconds), sums.moved)

    def _take(self, now: float, state: BaseState) -> None:
        """Add up what was measured since the last report."""
        before, self._state, self._pose = self._pose, state, state.pose
        if before is not None:
            self._interval = min(max(now - self._reported_at, 0.9 * self._interval), MAX_INTERVAL)
            sums = self._sums
            self._sums = MotionSums(sums.at, sums.low, sums.high, plus(sums.moved, moved(before, state.pose)))
        self._sent.lag = LAG + self._interval
        self._reported_at = now

    def _overload(self, now: float, sent: Velocity, state: BaseState) -> MotionFault | None:
        """Return a fault once a motor has been overloaded for too long."""
        if not state.overcurrent:
            self._overloaded_since = None
            return None
        if self._overloaded_since is None:
            self._overloaded_since = now
        if now - self._overloaded_since < OVERCURRENT_TIMEOUT:
            return None
        reason = f"{commanded(sent)}, {overcurrent(state)} for {OVERCURRENT_TIMEOUT:g} s: something holds the base"
        return MotionFault(reason, "free its wheels and its way")

    def _compare(self, sent: Velocity, state: BaseState) -> MotionFault | None:
        """Compare the sums within each window."""
        for window in self._windows:
            motion = window.add(self._sums)
            way = max(abs(motion.low.linear), abs(motion.high.linear))
            turn = max(abs(motion.low.angular), abs(motion.high.angular))
            fault = self._drives(motion, sent, state, turn) or self._turns(motion, sent, state, way)
            if fault is not None:
                return fault
        return None

    def _drives(self, motion: MotionSums, sent: Velocity, state: BaseState, turn: float) -> MotionFault | None:
        low, high, measured = motion.low.linear, motion.high.linear, motion.moved.linear
        more = WAY_PER_TURN * turn
        off = deviation(low, high, measured, TOLERANCE.linear + more, OPPOSITE.linear + more)
        if off is None:
            return None
        told = commanded(Velocity(sent.linear or (low + high) / 2 / motion.at, 0.0))
        found = f"{reported_by(self._instruments.linear)} {length_text(measured)}"
        cause, hint = LINEAR_CAUSES[off]
        if off == "none" and 0.0 < abs(sent.linear) < CRAWL:
            cause += ", or its motors cannot turn so slowly"
        if off in ("none", "less"):
            cause, hint = cause + felt(state), hint_of(state) or hint
        return MotionFault(f"{told} for {motion.at:.1f} s, {found}: {cause}", hint)

    def _turns(self, motion: MotionSums, sent: Velocity, state: BaseState, way: float) -> MotionFault | None:
        low, high, measured = motion.low.angular, motion.high.angular, motion.moved.angular
        more = TURN_PER_WAY * way
        off = deviation(low, high, measured, TOLERANCE.angular + more, OPPOSITE.angular + more)
        if off is None:
            return None
        told = commanded(Velocity(0.0, sent.angular)) if sent.angular or not way else commanded(sent)
        found = f"{reported_by(self._instruments.angular)} {degrees(measured):.0f} deg"
        cause, hint = ANGULAR_CAUSES[off]
        if off in ("none", "less"):
            cause, hint = cause + felt(state), hint_of(state) or hint
        return MotionFault(f"{told} for {motion.at:.1f} s, {found}: {cause}", hint)


def deviation(low: float, high: float, measured: float, tolerance: float, opposite: float) -> str | None:
    """Return how a measured motion differs from commands that can have caused ``low`` to ``high``; None if it fits.

    "none": hardly any of it; "less"; "more"; "opposite": the other way round.
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
    """Return the least motion that fits."""
    if low < 0.0:
        return MAX_SHARE * low - tolerance
    return max(MIN_SHARE * low - tolerance, -opposite) if high > 0.0 else -tolerance
