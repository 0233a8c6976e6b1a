"""Follower of a target with head and base: from predicted offsets to the next commands, by rules. Pure arithmetic.

The rules set the turn rate of the head's aim, and the follower integrates it into a goal. It aims at the predicted
position of the target at the time when the command takes effect, so the head does not lag behind a walking person or a
turning base. The rules for the base take the pan angle of the head as input: the head leads, the base follows. The base
of a robot without a head turns towards the target itself.
"""

import math
from typing import Protocol

from behaviours.tracking.fuzzy import EDGE, ERROR, PAN, RATE, ControlLaw, RuleBases
from behaviours.tracking.lag_estimator import LagEstimator, TurnState
from behaviours.tracking.motion_prediction import BasePredictor, MotionPredictor
from drivers.api import HeadLimits, HeadPose
from drivers.api.fast_dataclass import dataclass
from perception.api import Face, Percept

# How far off a target is, in two ways: where it will be when a command acts, or as the newest picture shows it.


@dataclass(frozen=True, slots=True)
class Offset:
    """Angles (radians) by which a target is to the left of the aim and below it, and their rates (rad/s).

    The aim is the direction in which the head is to look.
    """

    left: float = 0.0
    down: float = 0.0
    left_rate: float = 0.0
    down_rate: float = 0.0


class OffsetSource(Protocol):
    """Source of the offset of a target from the aim: a prediction, or the newest picture."""

    def offset(self, target: Percept, *, time: float, base: TurnState, aim: HeadPose) -> Offset:
        """Return the offset of the target from ``aim`` at ``time``, for a base in the state ``base``.

        ``aim`` is in the robot's frame, radians.
        """
        ...


class PredictedOffset:
    """Offset from the aim to the target's predicted position. Its rates are those of the target, not of the robot.

    ``acceleration`` (rad/s^2) is the limit of head or base.
    """

    def __init__(self, acceleration: float) -> None:
        self._acceleration = acceleration
        self._id: int | None = None
        self._yaw = self._pitch = MotionPredictor(acceleration)

    def offset(self, target: Percept, *, time: float, base: TurnState, aim: HeadPose) -> Offset:
        if target.id != self._id:
            self._id, self._yaw, self._pitch = (
                target.id,
                MotionPredictor(self._acceleration),
                MotionPredictor(self._acceleration),
            )
        ahead = time - target.stamp
        across = target.yaw - target.bearing, base.heading + aim.pan
        down = target.pitch - target.elevation, aim.tilt
        yaw, yaw_rate = self._yaw.predict(target.stamp, target.yaw, target.yaw_rate, ahead, across)
        pitch, pitch_rate = self._pitch.predict(target.stamp, target.pitch, target.pitch_rate, ahead, down)
        # The remainder takes the shorter way round to a target behind.
        bearing = math.remainder(yaw - base.heading, math.tau)
        return Offset(bearing - aim.pan, pitch - aim.tilt, yaw_rate - base.rate, pitch_rate)


class PictureOffset:
    """Offset from the camera's axis in the newest picture; its rates are the change since the picture before.

    The rates are in rad/s.
    """

    def __init__(self) -> None:
        self._newest: tuple[int, float, Offset] | None = None

    def offset(self, target: Percept, *, time: float, base: TurnState, aim: HeadPose) -> Offset:
        del time, base, aim
        found = Offset(target.bearing, target.elevation)
        if self._newest is not None:
            number, stamp, before = self._newest
            if number == target.id and stamp == target.stamp:
                return before
            since = target.stamp - stamp
            if number == target.id and since > 0:
                rates = (found.left - before.left) / since, (found.down - before.down) / since
                found = Offset(found.left, found.down, *rates)
        self._newest = target.id, target.stamp, found
        return found


__all__ = ["FollowCommand", "Follower", "RuleBases", "TurnState"]

MAX_STEP_TIME = 0.1
"""Maximum seconds that one step counts, so that the head does not jump after a late tick."""

RESTART_TIMEOUT = 0.5
"""Seconds without a step after which a ``Follower`` starts again from the head's pose, since it may have been moved."""

HEAD_LAG = 0.01
"""Seconds from a head command to its effect: servos need some milliseconds per degree."""

ON_TARGET_ANGLE = math.radians(1)
"""Radians within which a head counts as on target: servos that take whole degrees stand no closer."""

MAX_STANDING_TURN_RATE = math.radians(5)
"""Turn rate of the base in rad/s above which the head's goal is not moved ahead to catch up with the target.

A turning base helps to catch up, but by an amount that is unknown until its command lag has been learnt.
"""


@dataclass(frozen=True, slots=True)
class FollowCommand:
    """Command of a ``Follower``: pose for the head (radians) and turn rate for the base (rad/s)."""

    head: HeadPose
    turn: float


class Follower:
    """Follows one target with head and base. Call ``step`` at every tick while there is a target.

    ``limits`` are the head's, None without a head; ``max_turn`` is in rad/s, 0 without a base. ``lag`` estimates the
    command lag of the base and is updated; by default, a new estimator is used.
    """

    def __init__(
        self,
        rules: RuleBases,
        *,
        limits: HeadLimits | None,
        max_turn: float,
        lag: LagEstimator | None = None,
    ) -> None:
        self._rules = rules
        self._limits = limits
        self._max_turn = max_turn
        self._lag = LagEstimator() if lag is None else lag
        self._base_predictor = BasePredictor(self._lag)
        self._acceleration = self._lag.acceleration if limits is None else limits.acceleration
        self._offset_source: OffsetSource = PredictedOffset(self._acceleration)
        self._by_edge = any(law is not None and EDGE in law.inputs for law in (rules.pan, rules.base, rules.turn))
        self._goal = HeadPose(0.0, 0.0)
        self._last = -math.inf

    def step(self, now: float, target: Percept, *, head: HeadPose, base: TurnState) -> FollowCommand:
        """Return the command that follows ``target`` at time ``now``.

        ``head`` is the pose last sent, used in the first step and after a pause. ``base`` is the last known state of
        the base, in the target's odometry frame. Raises ValueError for values that are not finite; the goal is
        unchanged then.
        """
        yaw, pitch = target.predict(now)
        if not all(map(math.isfinite, (yaw, pitch, target.bearing, target.elevation, base.heading, base.rate))):
            raise ValueError(
                f"follow: not finite: target at {yaw}, {pitch}; base at {base.heading}, turning {base.rate}"
            )
        self._lag.learn(base)
        elapsed = now - self._last
        if elapsed > RESTART_TIMEOUT:
            self._restart(head)
        span = min(max(elapsed, 0.0), MAX_STEP_TIME)
        self._last = max(now, self._last)
        known = {EDGE: target.box.x} if isinstance(target, Face) else {}
        if EDGE not in known and self._by_edge:
            raise ValueError(f"follow: the rules go by '{EDGE}', which is not known of this {type(target).__name__}")
        if self._limits is None:
            turn = self._turn(now, target, base, span, known)
        else:
            turn = self._look(now, target, head, base, span, known, self._limits)
        turn = min(max(turn, -self._max_turn), self._max_turn)
        self._lag.add_command(now, turn)
        return FollowCommand(self._goal, turn)

    def _restart(self, head: HeadPose) -> None:
        self._goal = HeadPose(0.0, 0.0) if self._limits is None else self._limits.clamp(head)
        self._lag.forget_commands()
        self._offset_source = PredictedOffset(self._acceleration) if self._rules.predict else PictureOffset()

    def _turn(self, now: float, target: Percept, base: TurnState, span: float, known: dict[str, float]) -> float:
        """Return the turn rate (rad/s) of a base without a head.

        ``span`` are the seconds since the last step, ``known`` the inputs of the rules that are known already, by name.
        """
        # A turn rate is in force until the next one: what counts is the middle of that time.
        time = now + self._lag.seconds + span / 2
        there = self._base_predictor.at(time, base)
        off = self._offset_source.offset(target, time=time, base=there, aim=self._goal)
        # The rate is the target's own: the base is to take it up, not to take itself for a target.
        rate = off.left_rate + (there.rate if self._rules.predict else 0.0)
        return _law_output(self._rules.turn, {**known, ERROR: off.left, RATE: rate})

    def _look(
        self,
        now: float,
        target: Percept,
        head: HeadPose,
        base: TurnState,
        span: float,
        known: dict[str, float],
        limits: HeadLimits,
    ) -> float:
        """Advance the head's goal for the time ``now``, and return the turn rate of the base in rad/s.

        ``span`` are the seconds since the last step, ``known`` the inputs of the rules that are known already, by name.
        """
        rules, goal = self._rules, self._goal
        # A head has come to its goal for the most part of the time until the next one: it is meant for the middle.
        time = now + HEAD_LAG - span / 2
        there = self._base_predictor.at(time, base)
        off = self._offset_source.offset(target, time=time, base=there, aim=goal)
        left = goal.pan + off.left - head.pan if abs(there.rate) < MAX_STANDING_TURN_RATE else 0.0
        below = goal.tilt + off.down - head.tilt
        across = {**known, ERROR: off.left + _lead(off.left_rate, left, limits), RATE: off.left_rate}
        down = {ERROR: off.down + _lead(off.down_rate, below, limits), RATE: off.down_rate}
        if not rules.predict:
            across[ERROR], down[ERROR] = off.left, off.down
        pan, tilt = self._stride(rules.pan, across, span, limits), self._stride(rules.tilt, down, span, limits)
        self._goal = limits.clamp(HeadPose(goal.pan + pan, goal.tilt + tilt))
        return _law_output(rules.base, {**across, PAN: self._goal.pan})

    def _stride(self, law: ControlLaw | None, known: dict[str, float], span: float, limits: HeadLimits) -> float:
        """Return how far (radians) the aim moves in ``span`` seconds, but not beyond the target's predicted position.

        ``known`` are the inputs of the control ``law``. The bound keeps the head from oscillating about a predicted
        target, however steep the rules and slow the ticks are.
        """
        stride = min(max(_law_output(law, known), -limits.speed), limits.speed) * span
        if not self._rules.predict:
            return stride
        reach = known[ERROR] + known[RATE] * span
        return min(max(stride, min(reach, 0.0)), max(reach, 0.0))


def _law_output(law: ControlLaw | None, known: dict[str, float]) -> float:
    """Return the output of a control law, or 0 without a law."""
    return 0.0 if law is None else law(known)


def _lead(rate: float, behind: float, limits: HeadLimits) -> float:
    """Return how far (radians) the goal of a head must be ahead of a target that moves at ``rate`` (rad/s).

    ``behind`` (radians) is how far the head has to go to the target. A head brakes before its goal. So the goal is
    placed beyond the target, such that the head moves with the target once it has caught up.
    """
    trail = rate * abs(rate) / (2 * limits.acceleration)
    if rate * behind <= 0.0:
        return trail
    closing = math.sqrt(2 * limits.acceleration * max(0.0, abs(behind) - ON_TARGET_ANGLE))
    speed = min(abs(rate) + closing, limits.speed)
    return trail + math.copysign(max(0.0, speed**2 - rate**2 - closing**2) / (2 * limits.acceleration), rate)
