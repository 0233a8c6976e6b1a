"""How far a target's motion can be foreseen, learnt from how well it could be so far; and where a base will be.

Three models foretell one angle; y is the angle when last seen, r its rate, m its slow mean, h the time ahead:

- walk: the straight line through as many of the last moments as are on one, so that it is steady while somebody walks
  on and quick when he turns (adaptive windowing after Janabi-Sharifi, Hayward and Chen, 2000); y + r h, with the rate
  of the filter, where hardly any are;
- swing: y + a r h + b (m - y), with a and b by least squares. For a swing of angular frequency w that is exact, with
  a = sin(wh) / (wh) and b = 1 - cos(wh). How wide a swing is followed depends on what head or base are able to;
- rest: m, for what cannot be foreseen.

Each counts by how well it foretold the last seconds; a walk is what is believed before. What comes and goes faster than
head or base are able to is followed by a share only, from the middle of its way.

A base will be where it was told to go and has not been yet, when the next command acts.
"""

from collections import deque
from itertools import pairwise
from math import exp, pi, radians

from behaviours.tracking.lag_estimator import LagEstimator, TurnState, ramp
from drivers.api.fast_dataclass import dataclass

MEAN_TIME = 2.0
"""Seconds over which the slow mean is formed, and for which the past is kept."""

LINE_DURATIONS = (0.7, 0.5, 0.35, 0.25)
"""Seconds of the past that a straight line is put through: the longest that fits."""

MIN_LINE_PICTURES = 4
"""Pictures that a line takes; through fewer the filter's rate is the better one."""

LINE_TOLERANCE = radians(0.5)
"""Radians that each may be beside it, the newest and nine of ten."""

START_THRESHOLDS = radians(0.4), radians(8)
"""Radians by which the angle is beside the line before, and rad/s by which the filter's rate is, of one who sets off.
No line is made of what was before any more."""

MIN_STANDING_TIME, MAX_CAMERA_MOTION = 0.4, radians(0.6)
"""Seconds for which he must have stood, within ``LINE_TOLERANCE``, and radians within which the camera stood, and is to stand.
Otherwise it may be the camera that has set off, at another time than is believed."""

KEPT_EXPERIENCE_SHARE = 0.1
"""The share that counts on of what was learnt of one who sets off: where he is foretold badly again and again, trust in
what is foretold must not return each time."""

MEMORY_TIME = 1.5
"""Seconds after which experience has faded to a third."""

EVIDENCE_SCALE = 4e-4
"""rad^2: how much evidence moves the belief half-way from a walk to a swing."""

SURPRISE_ERROR = radians(1.5)
"""Radians: what no model foretold counts the less the farther it is beyond this; it says nothing about any."""

NOISE_FLOOR = 20 * radians(0.5) ** 2
"""rad^2: errors below this, over the samples that are remembered, are noise and do not tell models apart."""

MODEL_PENALTIES = (1.0, 2.0, 1.5)
"""How many times better than a walk each model must foretell to count as much: walk, swing, rest."""

INITIAL_MODEL_ERRORS = (1.0, 3.0, 3.0)
"""Before anything was foretold, the errors of each model count as so many times FLOOR."""

MIN_SWING_RATIO = 1.5
"""How many times as far as it got something must have gone to count as coming and going; a time more, and it does."""

ACCELERATION_SHARE = 0.7
"""The share of the acceleration of head or base that following a swing may take."""


@dataclass(frozen=True, slots=True)
class _PastSample:
    """A target at a time: its angle and rate, its slow mean, and the line through the last moments (radians, rad/s).

    ``looks`` is where the camera looked.
    """

    stamp: float
    angle: float
    rate: float
    mean: float
    level: float
    slope: float
    looks: float


class MotionPredictor:
    """Foretells one angle of one target, in radians. ``acceleration`` (rad/s^2) is what head or base are able to."""

    def __init__(self, acceleration: float) -> None:
        self._acceleration = acceleration
        self._past: deque[_PastSample] = deque()
        self._reset()

    def _reset(self) -> None:
        """Know nothing of the target."""
        self._past.clear()
        self._since = 0.0
        self._sums = [0.0] * 6
        self._off_line = self._middle = 0.0
        self._trust, self._pull, self._share = 1.0, 0.0, 1.0
        self._weights = [1.0, 0.0, 0.0]

    def predict(
        self, stamp: float, angle: float, rate: float, ahead: float, camera: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[float, float]:
        """Return (angle, rate) as they will be ``ahead`` seconds after ``stamp``, when the target was as told.

        ``camera`` is where the camera looked then, and where it is to look by now (radians).
        """
        if not self._past or stamp > self._past[-1].stamp:
            self._add_picture(stamp, angle, rate, ahead, camera)
        now = self._past[-1]
        walk, swing, rest = self._weights
        back = now.mean - angle
        swung = angle + self._trust * rate * ahead + self._pull * back
        turned = (1.0 - self._pull) * rate + (2 * self._trust * self._pull / ahead * back if ahead > 0 else 0.0)
        line = now.level + now.slope * (stamp - now.stamp + ahead)
        there = walk * line + swing * swung + rest * now.mean
        going = walk * now.slope + swing * turned
        return self._middle + self._share * (there - self._middle), self._share * going

    def _add_picture(self, stamp: float, angle: float, rate: float, ahead: float, camera: tuple[float, float]) -> None:
        """Take in a new picture, and judge by it what was foretold ``ahead`` seconds before."""
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
        """Say whether the target stood, before a camera that stands, and has just left the line that it was on."""
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
        """Return the straight line through the last moments that are on one: its value now, and its slope."""
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
        """Find how much can be followed of what comes and goes."""
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
        """Count how well each model foretold that it ``went`` so far in ``time`` seconds."""
        by_rate, by_mean = then.rate * time, then.mean - then.angle
        off_line = went - (then.level + then.slope * time - then.angle)
        errors = (off_line, went - self._trust * by_rate - self._pull * by_mean, went - by_mean)
        weight = 1 / (1 + min(map(abs, errors)) ** 2 / SURPRISE_ERROR**2)
        new = (by_rate * by_rate, by_rate * by_mean, by_mean * by_mean, by_rate * went, by_mean * went, went * went)
        self._sums = [old * fade + weight * product for old, product in zip(self._sums, new, strict=True)]
        self._off_line = self._off_line * fade + weight * off_line**2
        self._fit()

    def _fit(self) -> None:
        """Find the swing that fits best, how much of it can be followed, and what each model counts."""
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
"""Seconds to look ahead at most: what lies beyond is of no use."""

STEP = 0.02
"""Seconds of one step of the reckoning: base drivers renew their command as often."""


class BasePredictor:
    """Foretells how a base will stand that begins what it is told ``lag.seconds`` later.

    It approaches each turn rate that it was told at ``lag.acceleration``, by the ramps of its driver.
    """

    def __init__(self, lag: LagEstimator) -> None:
        self._lag = lag

    def at(self, time: float, known: TurnState) -> TurnState:
        """Return how it will stand and turn at ``time``, from how it did when that was last known."""
        now, heading, rate = known.stamp, known.heading, known.rate
        if time < now:
            return TurnState(heading - rate * (now - time), rate, time)
        time = min(time, now + MAX_LOOKAHEAD)
        while now < time:
            step = min(STEP, time - now)
            told = self._lag.command_at(now + step / 2 - self._lag.seconds, rate)
            after = ramp(rate, told, self._lag.acceleration * step)
            heading += (rate + after) / 2 * step
            rate = after
            now += step
        return TurnState(heading, rate, time)
