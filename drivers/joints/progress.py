"""Progress of joints towards their goals: detects joints that are blocked, turn the wrong way, or are pushed away.

The goal of a joint is compared with its measured position. A joint that is given up must be held at its position: then
its motor no longer pushes, and the limb does not fall.
"""

from enum import Enum
from math import radians
from typing import Final

from drivers.errors import DeviceFault

TOLERANCE = radians(10)
"""Distance in radians from its goal within which a joint counts as arrived.

A joint with a proportional controller may come to rest beside its goal.
"""

FULL_LOAD, LOADED_TOLERANCE = 0.8, radians(4)
"""Share of the stall torque from which on a joint counts as pushing at full power, and the tolerance in that case."""

BLOCKED_AFTER = 0.8
"""Seconds without progress after which a joint counts as blocked; more for a very slow joint.

It must be less than 1 s: after that, a blocked servo that protects itself switches its torque off and lets the limb
fall.
"""

PROGRESS_STEP, RESOLUTION = radians(2), radians(0.6)
"""Sufficient progress within ``BLOCKED_AFTER``, and the least progress that sensors can detect."""

MIN_SPEED_SHARE = 0.25
"""Share of its commanded speed from which on a slowly moving joint does not count as blocked."""

SETTLE_TIME = 0.3
"""Seconds for which a joint must stay within the tolerance of its goal to count as arrived."""

WRONG_WAY, WRONG_WAY_AFTER = radians(12), 0.5
"""Distance in the wrong direction, and its minimum duration in seconds: a shorter one occurs in braking."""

RETRY_AFTER = 2.0
"""Seconds without a command after which a blocked joint may be moved towards its goal again."""

MAX_READING_GAP = 0.25
"""Maximum seconds between two readings that count as time without progress; a longer gap counts as this time."""

HINT = "free the joint; if nothing holds it, check its cable and its sensor"


class ProgressState(Enum):
    """State of a ``JointProgress``."""

    LIMP, MOVING, HOLDING, BLOCKED = range(4)
    WRONG_WAY = 4  # given up after it turned the wrong way
    WATCHED = 5  # held after that: it may run away
    RUNAWAY = 6  # given up again after it left its held position


class ProgressEvent(Enum):
    """Event of a ``JointProgress``: a command of the caller, or a finding in the readings.

    HERE is a command to the position at which the joint already is.
    """

    COMMAND, HERE, HOLD, RELAX, ARRIVE, BLOCK, TURN_WRONG, RUN_AWAY = range(8)


TRANSITIONS: Final = {
    **{(state, ProgressEvent.RELAX): ProgressState.LIMP for state in list(ProgressState)[1:]},
    (ProgressState.LIMP, ProgressEvent.COMMAND): ProgressState.MOVING,
    (ProgressState.LIMP, ProgressEvent.HOLD): ProgressState.HOLDING,
    (ProgressState.MOVING, ProgressEvent.COMMAND): ProgressState.MOVING,
    (ProgressState.MOVING, ProgressEvent.HOLD): ProgressState.HOLDING,
    (ProgressState.MOVING, ProgressEvent.ARRIVE): ProgressState.HOLDING,
    (ProgressState.MOVING, ProgressEvent.BLOCK): ProgressState.BLOCKED,
    (ProgressState.MOVING, ProgressEvent.TURN_WRONG): ProgressState.WRONG_WAY,
    (ProgressState.HOLDING, ProgressEvent.COMMAND): ProgressState.MOVING,
    (ProgressState.HOLDING, ProgressEvent.HERE): ProgressState.HOLDING,
    (ProgressState.HOLDING, ProgressEvent.HOLD): ProgressState.HOLDING,
    (ProgressState.HOLDING, ProgressEvent.ARRIVE): ProgressState.HOLDING,
    (ProgressState.BLOCKED, ProgressEvent.HOLD): ProgressState.HOLDING,
    (ProgressState.WRONG_WAY, ProgressEvent.HOLD): ProgressState.WATCHED,
    (ProgressState.WRONG_WAY, ProgressEvent.RUN_AWAY): ProgressState.RUNAWAY,
    (ProgressState.WATCHED, ProgressEvent.COMMAND): ProgressState.MOVING,
    (ProgressState.WATCHED, ProgressEvent.HERE): ProgressState.HOLDING,
    (ProgressState.WATCHED, ProgressEvent.HOLD): ProgressState.WATCHED,
    (ProgressState.WATCHED, ProgressEvent.ARRIVE): ProgressState.WATCHED,
    (ProgressState.WATCHED, ProgressEvent.RUN_AWAY): ProgressState.RUNAWAY,
    (ProgressState.RUNAWAY, ProgressEvent.HOLD): ProgressState.WATCHED,
}
"""Next state by state and event; any other pair changes nothing.

A joint that is blocked or has turned the wrong way stays in this state until it is held or relaxed.
"""


class JointProgress:
    """Tracks from its readings whether one joint makes progress towards its goal. Not thread-safe.

    Positions are in radians, times in seconds. ``title`` is the name of the joint in messages. ``blocked`` is the
    reason why the joint is no longer moved to its goal; it is empty while the joint is not blocked.
    """

    def __init__(self, title: str) -> None:
        self.title = title
        self.blocked = ""
        self.state = ProgressState.LIMP
        self._goal = self._settled = 0.0  # settled: the goal that it has reached
        self._blocked_at = 0.0
        self._left_at = 0.0  # held position after it turned the wrong way
        self._speed = self._commanded_at = self._stamp = 0.0
        self._pushed = False  # from its held position, and that was reported
        self._direction = 0  # of the goal, while it is farther than the tolerance
        self._front = self._mark = 0.0  # farthest position in that direction; position of the last progress
        self._front_at = self._near_goal_for = 0.0
        self._stalled_for = self._stall_share = 0.0  # without progress: seconds, and share of the limit at its speed

    @property
    def runs_away(self) -> bool:
        """Whether a joint that turned the wrong way moves on although it is held.

        Its torque must then be switched off.
        """
        return self.state is ProgressState.RUNAWAY

    @property
    def active(self) -> bool:
        """True while readings are needed: while the joint moves, and after it was blocked or turned the wrong way."""
        return self.state not in (ProgressState.LIMP, ProgressState.HOLDING)

    def permit(self, goal: float, now: float) -> None:
        """Raise DeviceFault if the joint is blocked on its way to ``goal``.

        The joint is no longer blocked if ``goal`` is in the opposite direction, or if no command has come for
        ``RETRY_AFTER`` seconds. For a joint that has turned the wrong way only the time counts.
        """
        if not self.blocked:
            return
        waited, self._commanded_at = now - self._commanded_at, now
        back = self.state is ProgressState.BLOCKED and (goal - self._blocked_at) * self._direction < 0
        if waited > RETRY_AFTER or back:
            self.hold(None)
        else:
            raise DeviceFault(self.blocked, hint=HINT)

    def command(self, goal: float, speed: float, now: float) -> None:
        """Store a command to move to ``goal`` (radians) at ``speed`` (rad/s) at most.

        The progress of the joint is measured towards this goal.
        """
        stands = self.state in (ProgressState.HOLDING, ProgressState.WATCHED)
        stays = stands and abs(goal - self._settled) <= RESOLUTION
        if (stands and not stays) or self.state is ProgressState.LIMP:
            self._restart()
        self._handle(ProgressEvent.HERE if stays else ProgressEvent.COMMAND)
        self._goal, self._speed, self._commanded_at = goal, speed, now

    def hold(self, place: float | None) -> None:
        """Expect the joint to stay at ``place`` (radians; None if it is limp); it no longer counts as blocked.

        A joint that turned the wrong way is still checked, because it may run away from ``place``.
        """
        if place is None and self.state is ProgressState.LIMP:
            return  # called with each reading of a limp joint
        self.blocked = ""
        self._handle(ProgressEvent.RELAX if place is None else ProgressEvent.HOLD)
        if place is not None:
            self._goal = self._settled = self._left_at = place
        self._restart()

    def update(self, here: float, load: float, stamp: float) -> str:
        """Handle a reading with position ``here``, ``load`` and time ``stamp``; return a new fault, or an empty string.

        ``load`` is the torque as a share of the stall torque. The fault is that the joint is blocked, turned the wrong
        way, runs away, or was pushed away.
        """
        passed, self._stamp = min(max(stamp - self._stamp, 0.0), MAX_READING_GAP), max(stamp, self._stamp)
        is_held = self.state in (ProgressState.WRONG_WAY, ProgressState.WATCHED)
        if is_held and abs(here - self._left_at) > WRONG_WAY:
            self._handle(ProgressEvent.RUN_AWAY)
            self._blocked_at = here
            message = f"{self.title}: runs away from {self._left_at:.2f} rad, where it is held"
            self.blocked = self.blocked or message
            return message
        if self.state is ProgressState.LIMP or self.blocked:
            return ""
        error = self._goal - here
        loaded = abs(load) >= FULL_LOAD
        if abs(error) <= (LOADED_TOLERANCE if loaded and self.state is ProgressState.MOVING else TOLERANCE):
            self._near_goal_for += passed
            if self._near_goal_for >= SETTLE_TIME:
                self._handle(ProgressEvent.ARRIVE)
                self._settled = self._goal
                self._restart()
            return ""
        self._near_goal_for = 0.0
        self._advance(here, 1 if error > 0 else -1, passed)
        if self.state is not ProgressState.MOVING:
            return self._pushed_away(here)
        away = (self._front - here) * self._direction
        if away > WRONG_WAY and stamp - self._front_at >= WRONG_WAY_AFTER:
            self._left_at = here
            self._handle(ProgressEvent.TURN_WRONG)
            return self._give_up(here, f"turned the wrong way, from {self._front:.2f} to {here:.2f} rad", load)
        if self._stall_share >= 1.0:
            self._handle(ProgressEvent.BLOCK)
            return self._give_up(here, f"at {here:.2f} rad for {self._stalled_for:.1f} s: blocked?", load)
        return ""

    def _handle(self, event: ProgressEvent) -> None:
        self.state = TRANSITIONS.get((self.state, event), self.state)

    def _advance(self, here: float, direction: int, passed: float) -> None:
        """Update the progress of the joint at position ``here``.

        ``direction`` (1 or -1) leads to the goal; ``passed`` is the time in seconds since the last reading.
        """
        if direction != self._direction:
            self._direction, self._front, self._front_at, self._mark = direction, here, self._stamp, here
        if (here - self._front) * direction > 0:
            self._front, self._front_at = here, self._stamp
        enough = min(PROGRESS_STEP, max(RESOLUTION, MIN_SPEED_SHARE * self._speed * BLOCKED_AFTER))
        if (self._front - self._mark) * direction >= enough:
            self._mark, self._stalled_for, self._stall_share = self._front, 0.0, 0.0
            return
        self._stalled_for += passed
        self._stall_share += passed / max(BLOCKED_AFTER, 4 * RESOLUTION / max(self._speed, RESOLUTION))

    def _pushed_away(self, here: float) -> str:
        """Return a message if a joint at rest is pushed away from its goal; else an empty string.

        The message is returned once; it can come again after the joint has been back at its goal.
        """
        if self._stall_share < 1.0 or self._pushed:
            return ""
        self._pushed = True
        return f"{self.title}: holds {self._goal:.2f} rad, but is at {here:.2f} rad: pushed away, or overloaded?"

    def _give_up(self, here: float, reason: str, load: float) -> str:
        self._blocked_at = here
        load_text = f"; load {abs(load):.0%}".replace("%", " %") if load else ""
        self.blocked = f"{self.title}: commanded {self._goal:.2f} rad, {reason}{load_text}"
        return self.blocked

    def _restart(self) -> None:
        """Drop the measured progress; the next reading is the first one."""
        self._direction, self._pushed = 0, False
        self._near_goal_for = self._stalled_for = self._stall_share = 0.0
