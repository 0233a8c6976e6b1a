"""Probabilities of camera delay and stamp jitter: a grid of Kalman filters.

A picture is stamped ``t + d + j``: exposure time, delay, jitter. The background gives the turn of the camera since the
first picture of a chain; the recorded poses give its direction at ``stamp - d``. Their difference is called the level.
It is constant if ``d`` is the true delay, with two exceptions: it drifts as a random walk, since errors of the
background add up, and the jitter shifts it by the turn rate times ``j``. The grid has a cell for each pair of a delay
and a jitter. Each cell filters one level, and the likelihood of its innovations weighs the cell (Harvey, "Forecasting,
Structural Time Series Models and the Kalman Filter", 1989, section 3.4).

- The variance of a cell grows with its jitter and with the turn rate under its delay. So a delay under which the camera
  seems to stand still, or to turn more evenly, gets no advantage (errors in variables).
- A constant turn shifts the levels of all delays alike. It has information about the jitter, but not about the delay.
- A change of the delay is detected by the odds of "changed just now" to "unchanged" (CUSUM: Page, 1954).
"""

from math import pi, radians, sqrt

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

DELAY_STEP = 0.01
"""Seconds between two neighbouring camera delays of ``GRID``."""

GRID: Floats = np.arange(-0.12, 0.2701, DELAY_STEP)
"""Camera delays for which probabilities are computed, in seconds; shape (40,), dtype float64.

A negative delay is a time stamp before the exposure.
"""

JITTERS: Floats = np.array([0.0, 0.004, 0.008, 0.014, 0.022])
"""Jitters for which probabilities are computed: standard deviations of time stamps in seconds; shape (5,), float64."""

JITTER_PRIOR: Floats = np.array([0.3, 0.25, 0.2, 0.15, 0.1])
"""Prior probabilities of ``JITTERS``; shape (5,), dtype float64."""

FLOW_NOISE = radians(0.12)
"""Error of the turn measured by the background between two pictures: radians, one sigma."""

FLOW_SCALE = 0.1
"""Relative error of the turn measured by the background, one sigma.

It is the error of the camera's angle of view, which is known to a few per cent.
"""

POSE_NOISE = radians(0.1)
"""Error of a recorded pose of the camera: radians, one sigma."""

POSE_SCALE = 0.05
"""Error of a recorded pose relative to the camera's turn since the picture before, one sigma."""

OUTLIER_SHARE = 0.03
"""Prior share of pictures that fit no delay: a wrong stamp, or a person who walks by close to the camera."""

OUTLIER_RANGE = radians(20)
"""Width in radians of the uniform distribution that is assumed for pictures that fit no delay."""

LIKELIHOOD_EXPONENT = 0.8
"""Exponent of the likelihood of a picture; it is below 1, since the errors of successive pictures are correlated."""

MEMORY_PICTURES = 150
"""Number of informative pictures after which the weight of an old one has decayed to a third, because clocks drift."""

CHANGE_ODDS = 0.001
"""Prior odds, at any picture, that the camera delay has just changed."""

CHANGE_WEIGHT = 5.0
"""Weight of a possible change of the delay when its uncertainty is computed.

It is above 1, since it costs more to trust a wrong delay than to doubt a right one.
"""

MIN_RATE_CHANGE = radians(5)
"""Smallest change of the camera's turn rate (rad/s) from which a picture has information about the delay.

It is the difference between the highest and the lowest turn rate within the 0.39 s that the delays of ``GRID`` span.
"""

STEP_RATE_CHANGE = 40.0
"""Factor by which recorded poses that change in steps increase ``MIN_RATE_CHANGE``, in 1/s.

The width of the steps in radians, times this factor, is added to ``MIN_RATE_CHANGE`` (rad/s): steps look like changes
of the turn rate, even at a constant rate.
"""

RATE_WINDOW = 0.04
"""Standard deviation in seconds of the averaging window for turn rates."""

UNRECORDED_LIKELIHOOD_SHARE = 0.8
"""Likelihood of a camera delay that cannot be tested yet, as a share of the average likelihood.

A delay cannot be tested while the camera pose at the time that it implies is not recorded. The share is below 1, so
that the weight of an untested delay falls slowly.
"""

MAX_POSE_AGE = 0.05
"""Seconds that a base or a head takes to report a pose."""

MIN_WEIGHT = 1e-12
"""Smallest probability of a pair of jitter and delay, so that none is excluded for ever."""

_PAD = 8
"""Number of delays by which the grid is extended at each end.

A normal distribution of jitters around the first or the last delay needs this much room.
"""

_BEYOND: Floats = np.arange(1.0, _PAD + 1)


def _kernel(deviation: float) -> Floats:
    """Return normalised weights of a normal distribution around each delay of ``GRID``.

    ``deviation`` is its standard deviation in seconds. The shape is (40, 40 + 2 * 8), dtype float64: 8 more delays at
    each end of the grid.
    """
    apart = DELAY_STEP * (np.arange(len(GRID))[:, None] + _PAD - np.arange(len(GRID) + 2 * _PAD)[None, :])
    weights = np.exp(-((apart / max(deviation, DELAY_STEP / 10)) ** 2) / 2)
    kernel: Floats = weights / weights.sum(axis=1, keepdims=True)
    return kernel


_JITTER_KERNELS: Floats = np.concatenate([_kernel(float(jitter)) for jitter in JITTERS])
_RATE_KERNEL: Floats = (_kernel(RATE_WINDOW)[4:] - _kernel(RATE_WINDOW)[:-4]) / (4 * DELAY_STEP)


class DelayGrid:
    """Probabilities of all pairs of jitter and delay: ``weights``, of shape (5, 40), dtype float64.

    ``prior`` are unnormalised prior probabilities of the delays, of the shape of ``GRID``. ``change_odds`` are the odds
    that the delay has just changed; ``has_changed`` is True for the one picture at which a change is accepted.
    ``is_informative`` is True if the newest picture had information about the delay. Angles are in radians.
    """

    def __init__(self, prior: Floats) -> None:
        self._prior = JITTER_PRIOR[:, None] * prior / prior.sum()
        self.weights = self._prior.copy()
        self._weights_after_change = CHANGE_ODDS * self._prior  # weights after a change
        self.change_odds = CHANGE_ODDS
        self.has_changed = self.is_informative = False
        self._image_yaw = 0.0
        self.yaws = np.zeros_like(GRID)
        self._level = np.zeros_like(self.weights)
        self._variance = np.full_like(self.weights, POSE_NOISE**2)
        self._innovation = np.zeros_like(self.weights)

    def start_chain(self, yaws: Floats) -> None:
        """Start a chain: consecutive pictures, between which the turns of the camera are added up.

        ``yaws`` are the directions of the camera for the first picture, in radians: one for each delay of ``GRID``.
        """
        self.yaws, self._image_yaw = yaws, float(yaws[len(yaws) // 2])
        mean, variance, _ = self._smooth()
        self._level, self._variance = self._image_yaw - mean, variance + POSE_NOISE**2
        self._innovation = np.zeros_like(self.weights)

    def update(self, image_turn: float, yaws: Floats, unrecorded: Flags | None = None) -> None:
        """Process the next picture: the turn measured by the background, and the camera's direction for each delay.

        ``yaws`` are these directions. ``unrecorded`` is True for each delay whose pose is not recorded yet; these are
        the first delays of ``GRID``. For them the direction is extrapolated.
        """
        if unrecorded is not None and unrecorded.any():
            yaws = _extrapolate(yaws, int(unrecorded.sum()))
        turns = yaws - self.yaws
        self.yaws, self._image_yaw = yaws, self._image_yaw + image_turn
        mean, variance, rate_change = self._smooth()
        self.is_informative = rate_change
        predicted = self._variance + FLOW_NOISE**2 + (FLOW_SCALE * image_turn) ** 2
        total = predicted + variance + POSE_NOISE**2 + (POSE_SCALE * turns) ** 2
        off = self._image_yaw - mean - self._level
        density = (1 - OUTLIER_SHARE) * np.exp(off**2 / total / -2) / np.sqrt(2 * pi * total)
        likelihood = density + OUTLIER_SHARE / OUTLIER_RANGE
        fits = density / likelihood
        gain = fits * predicted / total
        self._level = self._level + gain * off
        # After an outlier the level is open: the next picture tells whether it has shifted, or the stamp was wrong.
        self._variance = predicted * (1 - gain) + (1 - fits) * off**2
        self._innovation = np.sign(off) * np.sqrt(np.maximum(off**2 - 4 * total, 0.0))
        if unrecorded is not None and unrecorded.any():
            likelihood = np.where(
                unrecorded, UNRECORDED_LIKELIHOOD_SHARE * (likelihood * self.weights).sum(), likelihood
            )
        if not self.is_informative:
            average = (likelihood * self.weights).sum(axis=1, keepdims=True) / self.weights.sum(axis=1, keepdims=True)
            likelihood = np.broadcast_to(average, likelihood.shape)
        self._update_weights(likelihood**LIKELIHOOD_EXPONENT)

    def doubt(self, delay: float) -> float:
        """Return how uncertain the camera's direction for the newest picture is, assuming the delay ``delay``.

        In radians, one sigma.
        """
        weights = self.weights.sum(axis=0) + CHANGE_WEIGHT * self._weights_after_change.sum(axis=0)
        off = self.yaws - np.interp(delay, GRID, self.yaws)
        row = int(self.weights.sum(axis=1).argmax())
        surprise = float(np.interp(delay, GRID, self._innovation[row]))
        return sqrt(float(weights @ off**2 / weights.sum()) + surprise**2)

    def _update_weights(self, likelihood: Floats) -> None:
        """Multiply the weights of all cells by ``likelihood``.

        There is one set of weights for an unchanged delay, and one for a delay that has just changed. A change is
        accepted when it is more likely than no change.
        """
        weights = (self.weights ** (1 - 1 / MEMORY_PICTURES) if self.is_informative else self.weights) * likelihood
        evidence = weights.sum()
        self.weights, self._weights_after_change = (
            np.maximum(weights / evidence, MIN_WEIGHT),
            self._weights_after_change * likelihood / evidence,
        )
        self.change_odds = float(self._weights_after_change.sum())
        self.has_changed = self.change_odds > 1
        if self.has_changed:
            self.weights = self._weights_after_change / self.change_odds
        if self.has_changed or self.change_odds < CHANGE_ODDS:
            self._weights_after_change, self.change_odds = CHANGE_ODDS * self._prior, CHANGE_ODDS

    def _smooth(self) -> tuple[Floats, Floats, bool]:
        """Return mean and variance of the yaw in each cell, of shape (5, 40), and whether the turn rate has changed.

        Poses may change in steps, as those of servos that take whole degrees. The size of the steps is estimated from
        the second differences of the yaws, and added to the variance.
        """
        yaws = self.yaws - self._image_yaw
        before, after = (yaws[0] - yaws[3]) / 3 * _BEYOND[::-1], (yaws[-1] - yaws[-4]) / 3 * _BEYOND
        padded = np.concatenate([yaws[0] + before, yaws, yaws[-1] + after])
        bends = np.zeros_like(padded)
        bends[1:-1] = padded[2:] - 2 * padded[1:-1] + padded[:-2]
        columns = np.stack([padded, padded**2, bends**2], axis=1)
        mean, square, bent = (_JITTER_KERNELS @ columns).T.reshape(3, *self.weights.shape)
        steps = bent[-1]
        least = MIN_RATE_CHANGE + STEP_RATE_CHANGE * sqrt(float(steps.mean()))
        rate_change = float(np.ptp(_RATE_KERNEL @ padded)) >= least
        return mean + self._image_yaw, np.maximum(square - mean**2, 0.0) + steps, rate_change


def find_unrecorded(yaws: Floats, newest: float, times: Floats, now: float) -> Flags:
    """Return which delays of ``GRID`` need a pose of the camera that is not recorded yet, as an array of its shape.

    ``yaws`` are the directions at ``times``, one for each delay; if the pose at a time is not recorded yet, its
    direction is ``newest``, the newest recorded yaw. A camera at rest has that direction, too. So only times within the
    last ``MAX_POSE_AGE`` seconds before ``now`` count as not recorded.
    """
    found: Flags = np.logical_and.accumulate((yaws == newest) & (times > now - MAX_POSE_AGE))
    return found


def _extrapolate(yaws: Floats, missing: int) -> Floats:
    """Return ``yaws`` with the first ``missing`` ones replaced by the straight line through the next ones."""
    first = min(missing, len(yaws) - 4)
    found = yaws.copy()
    found[:first] = yaws[first] + (yaws[first] - yaws[first + 3]) / 3 * np.arange(first, 0, -1)
    return found
