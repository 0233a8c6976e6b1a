"""Probabilities of camera delays and of the jitter of the stamps: a grid of Kalman filters.

A picture is stamped ``t + d + j``: exposure time, delay, jitter. The background tells how far the camera has turned
since the first picture of a chain; the recorded poses tell where it looked at ``stamp - d``. Their difference, the
level, is constant under the true delay, except for a random walk (errors of the background add up) and for the jitter,
which shows as turn rate times ``j``. So each cell of the grid filters one level, and the likelihood of its innovations
weighs the cell (Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter", 1989, section 3.4).

- The variance of a cell grows with its jitter and with the turn rate under its delay. A delay under which the camera
  seems to stand still, or to turn more evenly, is therefore not preferred for that (errors in variables).
- A constant turn shifts the levels of all delays alike. It tells the jitter, and no delay.
- A change of the delay is found by the odds of "changed a moment ago" to "unchanged" (CUSUM: Page, 1954).
"""

from math import pi, radians, sqrt

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

DELAY_STEP = 0.01
"""Seconds between two delays of the grid."""

GRID: Floats = np.arange(-0.12, 0.2701, DELAY_STEP)
"""The delays of the grid, in seconds; shape (40,), dtype float64. Below 0 a picture is stamped before its exposure."""

JITTERS: Floats = np.array([0.0, 0.004, 0.008, 0.014, 0.022])
"""Standard deviations of the stamps in seconds; shape (5,), dtype float64."""

JITTER_PRIOR: Floats = np.array([0.3, 0.25, 0.2, 0.15, 0.1])
"""Their probabilities before anything is measured; shape (5,), dtype float64."""

FLOW_NOISE = radians(0.12)
"""Error of the turn that the background tells between two pictures: radians, one sigma."""

FLOW_SCALE = 0.1
"""Error of that turn as a share of it, one sigma: the angle of view is known to some per cent."""

POSE_NOISE = radians(0.1)
"""Error of a recorded pose: radians, one sigma."""

POSE_SCALE = 0.05
"""Error of a recorded pose as a share of the turn since the picture before, one sigma."""

OUTLIER_SHARE = 0.03
"""Share of pictures that fit no delay: a wrong stamp, or a person who walks by close in front of the camera."""

OUTLIER_RANGE = radians(20)
"""Radians over which the innovations of such pictures are spread evenly."""

LIKELIHOOD_EXPONENT = 0.8
"""Exponent of the likelihoods: the errors of successive pictures are not independent."""

MEMORY_PICTURES = 150
"""Pictures that tell something after which evidence has faded to a third: clocks drift."""

CHANGE_ODDS = 0.001
"""Odds that the delay has changed, as long as the pictures say nothing about it."""

CHANGE_WEIGHT = 5.0
"""Weight of a possible change in the doubt: believing a wrong delay costs more than doubting a right one."""

MIN_RATE_CHANGE = radians(5)
"""Change of the turn rate (rad/s) within the span of the grid from which on a picture tells something of the delay."""

STEP_RATE_CHANGE = 40.0
"""How much more it must be for poses in steps: rad/s for each radian of their roughness."""

RATE_WINDOW = 0.04
"""Standard deviation in seconds of the window in which turn rates are averaged."""

UNRECORDED_LIKELIHOOD_SHARE = 0.8
"""Likelihood of a delay whose poses are not recorded yet, as a share of the average: such delays fade."""

MAX_POSE_AGE = 0.05
"""Seconds that a base or a head takes at most to report a pose."""

MIN_WEIGHT = 1e-12
"""Least probability of a cell."""

_PAD = 8
"""Cells beyond each end of the grid, for the tails of the jitter."""

_BEYOND: Floats = np.arange(1.0, _PAD + 1)


def _kernel(deviation: float) -> Floats:
    """Return the weights of a normal distribution over delays; shape (40, 40 + 2 * 8), dtype float64."""
    apart = DELAY_STEP * (np.arange(len(GRID))[:, None] + _PAD - np.arange(len(GRID) + 2 * _PAD)[None, :])
    weights = np.exp(-((apart / max(deviation, DELAY_STEP / 10)) ** 2) / 2)
    kernel: Floats = weights / weights.sum(axis=1, keepdims=True)
    return kernel


_JITTER_KERNELS: Floats = np.concatenate([_kernel(float(jitter)) for jitter in JITTERS])
_RATE_KERNEL: Floats = (_kernel(RATE_WINDOW)[4:] - _kernel(RATE_WINDOW)[:-4]) / (4 * DELAY_STEP)


class DelayGrid:
    """Filters all delays at once. ``weights`` are probabilities of shape (5, 40): jitter, delay; dtype float64.

    ``prior`` are those of the delays before anything is measured, of the shape of ``GRID``, up to a factor.
    ``change_odds`` are the odds that the delay has just changed; ``has_changed`` is true for one picture once they win.
    ``is_informative`` says whether the newest picture told something of the delay. Angles are in radians.
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
        """Start a chain of pictures; under each delay of ``GRID`` the first one looks to one of ``yaws``."""
        self.yaws, self._image_yaw = yaws, float(yaws[len(yaws) // 2])
        mean, variance, _ = self._smooth()
        self._level, self._variance = self._image_yaw - mean, variance + POSE_NOISE**2
        self._innovation = np.zeros_like(self.weights)

    def update(self, image_turn: float, yaws: Floats, unrecorded: Flags | None = None) -> None:
        """Take in the next picture: the background has ``turned``, and each delay means one of ``yaws``.

        ``unrecorded`` marks the delays whose poses are later than the newest recorded pose; those come first in
        ``GRID``. There the turn is assumed to go on.
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
        """Return how far off (one sigma) the pose is that ``delay`` means for the newest picture."""
        weights = self.weights.sum(axis=0) + CHANGE_WEIGHT * self._weights_after_change.sum(axis=0)
        off = self.yaws - np.interp(delay, GRID, self.yaws)
        row = int(self.weights.sum(axis=1).argmax())
        surprise = float(np.interp(delay, GRID, self._innovation[row]))
        return sqrt(float(weights @ off**2 / weights.sum()) + surprise**2)

    def _update_weights(self, likelihood: Floats) -> None:
        """Weigh the cells, without and with a recent change of the delay; change over when that is likelier."""
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

        Poses in steps, as of servos that know whole degrees, are uncertain by about a step: their bends tell.
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
    """Return which of ``GRID``'s delays mean a pose that is not recorded yet: they come first, and have the newest yaw.

    ``yaws`` belong to ``times``; ``newest`` is the newest recorded yaw. A camera that stands still has that yaw, too,
    so only the last ``MAX_POSE_AGE`` seconds before ``now`` count.
    """
    found: Flags = np.logical_and.accumulate((yaws == newest) & (times > now - MAX_POSE_AGE))
    return found


def _extrapolate(yaws: Floats, missing: int) -> Floats:
    """Return ``yaws`` with the first ``missing`` ones on the straight line through those that follow."""
    first = min(missing, len(yaws) - 4)
    found = yaws.copy()
    found[:first] = yaws[first] + (yaws[first] - yaws[first + 3]) / 3 * np.arange(first, 0, -1)
    return found
