"""Prediction of a target's motion, weighted by past prediction errors, and of the state of a base.

Three models predict one angle; y is the angle when last seen, r its rate, m its slow mean, h the time ahead:

- walk: the straight line through as many of the last samples as fit one, so that it is steady while a person walks on
  and quick when they turn (adaptive windowing after Janabi-Sharifi, Hayward and Chen, 2000); y + r h, with the rate of
  the filter, if hardly any fit;
- swing: y + a r h + b (m - y), with a and b by least squares. For a swing of angular frequency w that is exact, with
  a = sin(wh) / (wh) and b = 1 - cos(wh). The limits of head or base decide how wide a swing is followed;
- rest: m, for motion that cannot be predicted.

Each model is weighted by its errors of the last seconds; a walk is the prior. A motion back and forth that is too fast
for head or base is followed in part, from the middle of its range.

The state of a base is predicted from the commands that it has received but not yet carried out.
"""

from collections import deque
from itertools import pairwise
from math import exp, pi, radians

from behaviours.tracking.lag_estimator import LagEstimator, TurnState, ramp
from drivers.api.fast_dataclass import dataclass

MEAN_TIME = 2.0
"""Seconds over which the slow mean of a target's angle is formed, and for which samples are kept."""

LINE_DURATIONS = (0.7, 0.5, 0.35, 0.25)
"""Durations in seconds of the past samples to which a line is fitted; the longest that fits is used."""

MIN_LINE_PICTURES = 4
"""Minimum number of pictures for a line through the samples; with fewer, the rate of the tracking filter is better."""

LINE_TOLERANCE = radians(0.5)
"""Maximum distance of samples from a fitted line in radians: of the newest one, and of nine of ten samples."""

START_THRESHOLDS = radians(0.4), radians(8)
"""Thresholds that show that a target at rest sets off; older samples are then dropped.

They are the deviation of the angle from the line (radians), and of the filter's rate from the line's slope (rad/s).
"""

MIN_STANDING_TIME, MAX_CAMERA_MOTION = 0.4, radians(0.6)
"""Seconds for which the target must have stood, and radians within which the camera stands.

The target must have stood within ``LINE_TOLERANCE``. Otherwise the camera may have moved, at another time than its
stamps say.
"""

KEPT_EXPERIENCE_SHARE = 0.1
"""Share of the past prediction errors that still counts after a target has set off.

If it were 0, a model with large errors would count as good each time that a target starts again.
"""

MEMORY_TIME = 1.5
"""Seconds after which the weight of a model's past errors has decayed to a third."""

EVIDENCE_SCALE = 4e-4
"""Ridge parameter of the fit of a swing: it is added to the sums of squares of the samples, in rad^2.

If a sum is as large as this parameter, the fit is half-way between the models walk and swing.
"""

SURPRISE_ERROR = radians(1.5)
"""Prediction error in radians above which a sample counts less, because none of the models predicted it."""

NOISE_FLOOR = 20 * radians(0.5) ** 2
"""Sum of squared prediction errors in rad^2 below which a difference between models is taken for noise."""

MODEL_PENALTIES = (1.0, 2.0, 1.5)
"""Factors of the errors of the models walk, swing and rest: a model must be better by its factor for the same weight.
"""

INITIAL_MODEL_ERRORS = (1.0, 3.0, 3.0)
"""Initial errors of the models walk, swing and rest, as multiples of NOISE_FLOOR."""

MIN_SWING_RATIO = 1.5
"""Ratio of path to range of a target's motion above which it counts as back and forth.

Above it, the share of the motion that is followed falls to the share that head or base can follow.
"""

ACCELERATION_SHARE = 0.7
"""Share of the acceleration of head or base that following a swing may use."""


@dataclass(frozen=True, slots=True)
class _PastSample:
    """State of a target at the time ``stamp``: ``angle``, ``rate`` and slow ``mean`` (radians, rad/s).

    ``level`` and ``slope`` are those of the line through the last samples; ``looks`` is the direction of the camera.
    """

    stamp: float
    angle: float
    rate: float
    mean: float
    level: float
    slope: float
    looks: float


class MotionPredictor:
    """Predicts one angle of one target in radians.

    ``acceleration`` (rad/s^2) is that of the head or base which follows the target.
    """

    def __init__(self, acceleration: float) -> None:
        self._acceleration = acceleration
        self._past: deque[_PastSample] = deque()
        self._reset()

    def _reset(self) -> None:
        self._past.clear()
        self._since = 0.0
        self._sums = [0.0] * 6
        self._off_line = self._middle = 0.0
        self._trust, self._pull, self._share = 1.0, 0.0, 1.0
        self._weights = [1.0, 0.0, 0.0]

    def predict(
        self, stamp: float, angle: float, rate: float, ahead: float, camera: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[float, float]:
        """Return (angle, rate) ``ahead`` seconds after ``stamp``, given ``angle`` and ``rate`` at ``stamp``.

        ``camera`` are two directions of the camera in radians: at the stamp, and now. All rates are in rad/s.
        """
        if not self._past or stamp > self._past[-1].stamp:
            self._add_picture(stamp, angle, rate, ahead, camera)
        now = self._past[-1]
        walk, swing, rest = self._weights
        back = now.mean - angle
        swing_angle = angle + self._trust * rate * ahead + self._pull * back
        swing_rate = (1.0 - self._pull) * rate + (2 * self._trust * self._pull / ahead * back if ahead > 0 else 0.0)
        line = now.level + now.slope * (stamp - now.stamp + ahead)
        predicted_angle = walk * line + swing * swing_angle + rest * now.mean
        predicted_rate = walk * now.slope + swing * swing_rate
        return self._middle + self._share * (predicted_angle - self._middle), self._share * predicted_rate

    def _add_picture(self, stamp: float, angle: float, rate: float, ahead: float, camera: tuple[float, float]) -> None:
        """Add a sample, and score the predictions made ``ahead`` seconds before."""
        span = stamp - self._past[-1].stamp if self._past else 0.0
        if span > MEAN_TIME:
            self._reset()
        mean = angle
        if self._past:
            self._since += span
            before = self._past[-1].mean
            mean = before + (angle - before) * min(1.0, span / min(self._since, MEAN_TIME))
            if self._has_set_off(stamp, angle, rate, camera):
                self._past.clear()
                self._sums = [KEPT_EXPERIENCE_SHARE * old for old in self._sums]
                self._off_line *= KEPT_EXPERIENCE_SHARE
                self._fit()
        fade = exp(-span / MEMORY_TIME)
        self._past.append(_PastSample(stamp, angle, rate, mean, *self._line(stamp, angle, rate), camera[0]))
        while stamp - self._past[0].stamp > MEAN_TIME:
            self._past.popleft()
        self._limit()
        then = min(self._past, key=lambda past: abs(stamp - ahead - past.stamp))
        if then.stamp < stamp:
            self._judge(then, angle - then.angle, stamp - then.stamp, fade)

    def _has_set_off(self, stamp: float, angle: float, rate: float, camera: tuple[float, float]) -> bool:
        """Return True if a target that stood still has just left its line, seen by a camera that stands still."""
        before = self._past[-1]
        off = angle - before.level - before.slope * (stamp - before.stamp)
        if (
            abs(off) < START_THRESHOLDS[0]
            or abs(rate - before.slope) < START_THRESHOLDS[1]
            or stamp - self._past[0].stamp < MIN_STANDING_TIME
        ):
            return False
        recent = [(past.angle, past.looks) for past in self._past if stamp - past.stamp <= MIN_STANDING_TIME]
        angles, looked = zip(*recent, (before.angle, before.looks), strict=True)
        looked = *looked, *camera
        return bool(max(angles) - min(angles) < 2 * LINE_TOLERANCE and max(looked) - min(looked) < MAX_CAMERA_MOTION)

    def _line(self, stamp: float, angle: float, rate: float) -> tuple[float, float]:
        """Return value and slope, at ``stamp``, of the straight line through the last samples that lie on one.

        If too few samples lie on a line, they are ``angle`` and ``rate``.
        """
        for window in LINE_DURATIONS:
            recent = [(past.stamp - stamp, past.angle) for past in self._past if stamp - past.stamp < window]
            recent.append((0.0, angle))
            if len(recent) < MIN_LINE_PICTURES:
                break
            time, level = (sum(column) / len(recent) for column in zip(*recent, strict=True))
            slope = sum((t - time) * (y - level) for t, y in recent) / sum((t - time) ** 2 for t, _ in recent)
            level -= slope * time
            beside = sum(abs(y - level - slope * t) > LINE_TOLERANCE for t, y in recent)
            if beside <= len(recent) // 10 and abs(angle - level) <= LINE_TOLERANCE:
                return level, slope
        return angle, rate

    def _limit(self) -> None:
        """Update the middle of a motion back and forth, and the share of the motion that head or base can follow."""
        angles = [past.angle for past in self._past]
        low, high, time = min(angles), max(angles), self._past[-1].stamp - self._past[0].stamp
        self._middle = (low + high) / 2
        path = sum(abs(after - before) for before, after in pairwise(angles))
        if time <= 0 or path <= MIN_SWING_RATIO * (high - low):
            self._share = 1.0
            return
        # A swing by A at w goes a way of 2 A w / pi a second, and takes the acceleration A w^2.
        needed = (high - low) / 2 * (pi * path / (high - low) / time) ** 2
        followed = min(1.0, max(0.0, 1.25 * ACCELERATION_SHARE * self._acceleration / needed - 0.25))
        self._share = 1.0 - min(1.0, path / (high - low) - MIN_SWING_RATIO) * (1.0 - followed)

    def _judge(self, then: _PastSample, went: float, time: float, fade: float) -> None:
        """Update the errors of each model by the motion of ``went`` radians in ``time`` seconds.

        ``then`` is the sample at the begin of the motion. ``fade`` is the factor by which older errors count less.
        """
        by_rate, by_mean = then.rate * time, then.mean - then.angle
        off_line = went - (then.level + then.slope * time - then.angle)
        errors = (off_line, went - self._trust * by_rate - self._pull * by_mean, went - by_mean)
        weight = 1 / (1 + min(map(abs, errors)) ** 2 / SURPRISE_ERROR**2)
        new = (by_rate * by_rate, by_rate * by_mean, by_mean * by_mean, by_rate * went, by_mean * went, went * went)
        self._sums = [old * fade + weight * product for old, product in zip(self._sums, new, strict=True)]
        self._off_line = self._off_line * fade + weight * off_line**2
        self._fit()

    def _fit(self) -> None:
        """Update the best swing, the share of it that is followed, and the weights of the models."""
        rr, rm, mm, rw, mw, ww = self._sums
        # Ridge regression towards a walk: a = 1, b = 0.
        more_rr, more_mm, more_rw = rr + EVIDENCE_SCALE, mm + EVIDENCE_SCALE, rw + EVIDENCE_SCALE
        determinant = more_rr * more_mm - rm * rm
        a = self._trust = min(max((more_rw * more_mm - mw * rm) / determinant, -1.0), 1.0)
        b = self._pull = min(max((more_rr * mw - rm * more_rw) / determinant, 0.0), 2.0)
        swing = ww + a * a * rr + b * b * mm + 2 * a * b * rm - 2 * a * rw - 2 * b * mw
        costs = (self._off_line, swing, ww - 2 * mw + mm)
        found = zip(costs, MODEL_PENALTIES, INITIAL_MODEL_ERRORS, strict=True)
        weights = [
            (NOISE_FLOOR / (max(cost, 0.0) * penalty + NOISE_FLOOR * doubt)) ** 4 for cost, penalty, doubt in found
        ]
        self._weights = [weight / sum(weights) for weight in weights]


MAX_LOOKAHEAD = 1.0
"""Maximum seconds for which the state of a base is predicted."""

STEP = 0.02
"""Step of the prediction in seconds, equal to the interval at which base drivers resend their command."""


class BasePredictor:
    """Predicts the state of a base that starts each command ``lag.seconds`` late.

    The base approaches each commanded turn rate at ``lag.acceleration``, with the ramps of its driver.
    """

    def __init__(self, lag: LagEstimator) -> None:
        self._lag = lag

    def at(self, time: float, known: TurnState) -> TurnState:
        """Return heading and turn rate at ``time``, predicted from the last known state ``known``."""
        now, heading, rate = known.stamp, known.heading, known.rate
        if time < now:
            return TurnState(heading - rate * (now - time), rate, time)
        time = min(time, now + MAX_LOOKAHEAD)
        while now < time:
            step = min(STEP, time - now)
            command = self._lag.command_at(now + step / 2 - self._lag.seconds, rate)
            after = ramp(rate, command, self._lag.acceleration * step)
            heading += (rate + after) / 2 * step
            rate = after
            now += step
        return TurnState(heading, rate, time)
