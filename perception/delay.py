"""Camera delay, estimated from the shift of the background while the head or the base turns.

Webcams stamp a picture tens of milliseconds after its exposure. The delay depends on the model, and stamps jitter.
Between two pictures the background shifts by the turn of the camera; people in front of it have no effect. For each
possible delay, the recorded poses of head and base give the turn between the two exposures. The most likely delay is
the one under which both agree best over all pairs of pictures so far (``perception.delay_grid``). A lag of servos
behind their recorded pose has the same effect, and is included in the delay.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from math import hypot, radians

import numpy as np

from drivers.api.fast_dataclass import dataclass
from perception.api import Frame, Gaze, Image
from perception.delay_grid import CHANGE_ODDS, DELAY_STEP, GRID, JITTERS, DelayGrid, Flags, Floats, find_unrecorded
from perception.exposure_clock import MAX_DELAY, MIN_DELAY, Exposure, ExposureClock
from perception.geometry import Pinhole
from perception.image_preparation import GreyImage
from perception.levelling import level_columns
from perception.scene_motion import find_shift

PRIOR_SPREAD = 0.1
"""Uncertainty of the camera delay before it is learnt: seconds, one sigma."""

MIN_TURN = radians(0.4)
"""Smallest turn of the camera in radians from which a pair of pictures has information about the delay."""

PROBE_INDICES = [0, len(GRID) // 2, len(GRID) - 1]
"""Indices of three delays in ``GRID``: the first, middle and last.

The camera counts as turning if the poses recorded at these three delays before a time stamp differ.
"""

MAX_PAIR_INTERVAL = 0.3
"""Largest time in seconds between the two pictures of a pair.

After a longer time, the pictures show too little of the same background.
"""

GRID_MARGIN = 0.02
"""Margin in seconds at the start of ``GRID``: an estimated delay within this margin is not used.

The true delay may then be smaller than any delay of ``GRID``.
"""

MAX_USABLE_SPREAD = 0.02
"""Largest uncertainty of an estimated camera delay that is used: seconds, one sigma."""

MAX_STORABLE_SPREAD = 0.015
"""Largest uncertainty of a camera delay that may be stored, including the jitter: seconds, one sigma."""

MAX_JITTER = 0.008
"""Standard deviation of time stamps in seconds above which the camera delay is not stored."""

CONTRADICTION_WINDOW, CONTRADICTION_PROBABILITY = 0.025, 0.01
"""Seconds around a delay, and their total probability, below which the delay is contradicted."""

MIN_INFORMATIVE_PAIRS, MIN_COMPARED_PAIRS = 12, 40
"""Smallest number of pairs with information about the delay, and of all pairs (a constant turn shows only the jitter).
"""

CLEAR_DEVIATIONS, MIN_CORRECTION_SHARE = 3.0, 0.1
"""Standard deviations from which on a new estimate replaces the old one; and else the least share per pair.

Early estimates rest on few pairs, and a delay that wanders makes targets seem to move.
"""

MAX_KNOWN_SPREAD = 0.005
"""Largest uncertainty of a camera delay that is known well enough: seconds, one sigma.

Learning then pauses, and the delay is only checked every ``MAX_REST`` seconds.
"""

MAX_STEADY_JITTER = 0.005
"""Largest jitter of time stamps, in seconds, at which the camera delay may be known well enough.

Learning then pauses, and the delay is only checked every ``MAX_REST`` seconds.
"""

MIN_CHECKED_PAIRS = 20
"""Number of pairs of pictures that must confirm the camera delay before learning pauses for ``MAX_REST``."""

ONSET_OFFSETS: Floats = np.array([-0.06, 0.0, 0.1])
"""Times of three camera poses, in seconds before an exposure (negative: after it); shape (3,), float64.

The poses show whether a turn has just begun: the camera has turned more after the exposure than before it.
"""

MAX_WATCHED_PICTURES = 2
"""Number of pictures that are compared at the start of a camera turn even while learning pauses.

A delay that has changed shows first at the start of a turn.
"""

SUSPICION_ODDS = 20 * CHANGE_ODDS
"""Odds of a changed delay above which the known delay may be wrong, so that learning goes on."""

MAX_REST = 8.0
"""Seconds for which learning of the camera delay pauses once the delay is known and confirmed."""


class CameraDelay:
    """Estimate of the delay from exposure to stamp: ``seconds``, with the uncertainty ``spread`` (one sigma).

    ``jitter`` is the standard deviation of the stamps in seconds, as far as known. ``informative_pairs`` counts the
    pairs of pictures with information about the delay. ``initial`` is used until an estimate is good enough. ``doubt``
    is the uncertainty of the camera's direction for the newest picture: radians, one sigma. ``is_distrusted`` is True
    from the detection of a changed delay until the new delay is estimated.
    """

    def __init__(self, initial: float = 0.0) -> None:
        self._grid = DelayGrid(np.exp(((GRID - initial) / PRIOR_SPREAD) ** 2 / -2))
        self._checked_pairs = self._compared_pairs = 0
        self._informative_pairs_since_change = 0  # as the name says, for the estimate after a change
        self.informative_pairs = 0
        self.seconds, self.spread = initial, PRIOR_SPREAD
        self.jitter = self.doubt = 0.0
        self.is_distrusted = False

    @property
    def is_known(self) -> bool:
        """True if the delay is certain enough to be stored.

        Its ``spread`` must be within ``MAX_STORABLE_SPREAD``, delay and jitter must be plausible, and it must not be
        distrusted. At least ``MIN_INFORMATIVE_PAIRS`` pairs of pictures must have had information about it.
        """
        possible = MIN_DELAY <= self.seconds <= MAX_DELAY and self.jitter <= MAX_JITTER
        return (
            self.spread <= MAX_STORABLE_SPREAD
            and possible
            and self.informative_pairs >= MIN_INFORMATIVE_PAIRS
            and not self.is_distrusted
        )

    @property
    def is_suspected(self) -> bool:
        """True if the newest pictures suggest that the delay has changed."""
        return self._grid.change_odds > SUSPICION_ODDS or self.is_distrusted

    def contradicts(self, seconds: float) -> bool:
        """Return whether the pictures rule out the delay ``seconds``."""
        near = np.abs(GRID - seconds) <= CONTRADICTION_WINDOW
        return self.is_distrusted or float(self._grid.weights[:, near].sum()) < CONTRADICTION_PROBABILITY

    def start_chain(self, yaws: Floats) -> None:
        """Start a chain: consecutive pictures, between which the turns of the camera are added up.

        ``yaws`` are the directions of the camera for the first picture, in radians: one for each delay of ``GRID``.
        """
        self._grid.start_chain(yaws)
        self.doubt = 0.0

    def learn(
        self, image_turn: float, pose_turns: Floats, yaws: Floats | None = None, unrecorded: Flags | None = None
    ) -> bool:
        """Process the next picture, and return True if the delay needs no learning for a while.

        ``image_turn`` is the turn of the camera since the picture before, measured by the background. ``pose_turns`` is
        the same turn by the recorded poses, one for each delay of ``GRID``. ``yaws`` are the directions of the camera
        for this picture, one for each delay; if None, ``pose_turns`` are added to the directions for the picture
        before. All are in radians. ``unrecorded`` is as for ``DelayGrid.update``.

        The delay needs no learning once it is known within ``MAX_KNOWN_SPREAD``, the jitter is at most
        ``MAX_STEADY_JITTER``, and ``MIN_CHECKED_PAIRS`` pairs have confirmed the delay.
        """
        yaws = self._grid.yaws + pose_turns if yaws is None else yaws
        if max(abs(image_turn), float(np.abs(pose_turns).max())) < MIN_TURN:
            self.start_chain(yaws)
            return False
        self._grid.update(image_turn, yaws, unrecorded)
        self.informative_pairs += self._grid.is_informative
        self._compared_pairs += 1
        self._checked_pairs += 1
        self._estimate()
        if self.is_suspected:
            self._checked_pairs = 0
        return (
            self._checked_pairs >= MIN_CHECKED_PAIRS
            and self.spread <= MAX_KNOWN_SPREAD
            and self.jitter <= MAX_STEADY_JITTER
        )

    def require_check(self) -> None:
        """Require ``MIN_CHECKED_PAIRS`` new pairs before ``learn`` returns True again."""
        self._checked_pairs = 0

    def _estimate(self) -> None:
        """Update the estimate of delay and jitter from their probabilities in the ``DelayGrid``."""
        weights = self._grid.weights.sum(axis=0)
        self.jitter = float(self._grid.weights.sum(axis=1) @ JITTERS)
        mean = float(weights @ GRID)
        deviation = float(np.sqrt(weights @ (GRID - mean) ** 2 + DELAY_STEP**2 / 12))
        self._informative_pairs_since_change = (
            0 if self._grid.has_changed else self._informative_pairs_since_change + self._grid.is_informative
        )
        relearnt = deviation <= MAX_USABLE_SPREAD and self._informative_pairs_since_change >= MIN_INFORMATIVE_PAIRS
        self.is_distrusted = self._grid.has_changed or (self.is_distrusted and not relearnt)
        off, usable = mean - self.seconds, float(GRID[0]) + GRID_MARGIN <= mean <= MAX_DELAY
        few = self._compared_pairs < MIN_COMPARED_PAIRS or self.informative_pairs < MIN_INFORMATIVE_PAIRS
        self.spread = hypot(deviation, self.jitter)
        if few or self.is_distrusted or not usable or self.jitter > MAX_JITTER:
            self.spread = max(self.spread, MAX_USABLE_SPREAD)
        if usable and abs(off) > CLEAR_DEVIATIONS * deviation:
            self.seconds = mean
        elif usable and deviation <= MAX_USABLE_SPREAD:
            self.seconds += off * min(1.0, max(MIN_CORRECTION_SHARE, (off / (CLEAR_DEVIATIONS * deviation)) ** 2))
        self.doubt = self._grid.doubt(self.seconds)


@dataclass(frozen=True, slots=True)
class ExposedFrame:
    """A ``perception.api.Frame`` whose stamp is the time of the exposure, in seconds on the run's clock."""

    image: Image
    stamp: float


@dataclass(frozen=True, slots=True)
class _TurnPicture:
    """A picture taken while the camera turned: its time ``stamp``, and a possible yaw for each possible camera delay.

    ``yaws`` has, for each delay in ``GRID``, the yaw (radians) that the camera had at the exposure if this delay is the
    true one. ``picture`` returns the picture with columns of equal angle (see ``perception.levelling``), computed at
    the first call.
    """

    stamp: float
    yaws: Floats
    picture: Callable[[], GreyImage]


class ExposureEstimator:
    """Estimates the exposure time of each frame, and learns ``delay`` while the camera turns.

    ``gaze(time)`` returns the direction of the camera, the newest one for a later time, or None if unknown. ``now``
    returns the present time. A pose of the last few hundredths of a second may not be recorded yet; such poses are only
    detected with ``now``.
    """

    def __init__(
        self, gaze: Callable[[float], Gaze | None], delay: CameraDelay, now: Callable[[], float] | None = None
    ) -> None:
        self.delay = delay
        self._gaze = gaze
        self._now = now
        self._previous: _TurnPicture | None = None
        self._is_chained = False
        self._rest_from = self._rest_until = -np.inf
        self._watched_pictures = 0
        self._clock = ExposureClock()
        self._exposure = Exposure(0.0, 0.0)

    @property
    def is_comparing(self) -> bool:
        """True if the next frame will be compared with the one before, so that it must not be skipped."""
        return self._previous is not None

    def expose(self, frame: Frame, camera: Pinhole) -> Frame:
        """Return ``frame`` with the time of its exposure, which increases from frame to frame."""
        self._learn_from(frame, camera)
        now = None if self._now is None else self._now()
        self._exposure = self._clock.expose(frame.stamp, self.delay.seconds, now)
        return ExposedFrame(frame.image, self._exposure.stamp)

    def gaze(self) -> Gaze | None:
        """Return the direction of the camera at the exposure of the newest frame, with its doubt.

        The frame's own stamp may be later: stamps always increase, even if a correction of the delay moves an exposure
        to a time before the previous frame's stamp.
        """
        found = self._gaze(self._exposure.time)
        doubt = max(self._exposure.doubt, self.delay.doubt if self._is_chained else 0.0)
        return None if found is None else replace(found, doubt=doubt)

    def _learn_from(self, frame: Frame, camera: Pinhole) -> None:
        """Compare a picture with the one before, and learn the delay from both.

        It does nothing if neither picture was taken in a turn, or if the delay needs no learning.
        """
        before, self._previous = self._previous, None
        if before is not None and not 0 < frame.stamp - before.stamp <= MAX_PAIR_INTERVAL:
            before = None
        chained, self._is_chained = self._is_chained, False
        turning = self._is_turning(frame.stamp)
        if not (turning or before is not None) or self._is_resting(frame.stamp):
            return
        yaws = self._yaws(frame.stamp, GRID)
        if yaws is None:
            return
        now = _TurnPicture(frame.stamp, yaws, cache(partial(level_columns, frame.image, camera)))
        if turning:
            self._previous = now
        if before is not None:
            self._compare(before, now, camera, chained=chained)

    def _is_resting(self, stamp: float) -> bool:
        """Return whether a comparison is unnecessary: the delay is known, and no turn has just begun."""
        if not self._rest_from <= stamp < self._rest_until:  # a clock that was set back also ends a rest
            return False
        yaws = self._yaws(stamp, self.delay.seconds + ONSET_OFFSETS)
        if yaws is not None and abs(yaws[0] - yaws[1]) - abs(yaws[1] - yaws[2]) >= MIN_TURN:
            self._watched_pictures = 0
        self._watched_pictures += 1
        return self._watched_pictures > MAX_WATCHED_PICTURES

    def _compare(self, before: _TurnPicture, now: _TurnPicture, camera: Pinhole, *, chained: bool) -> None:
        """Learn from two pictures, one of them taken in a turn.

        ``chained`` is True if ``before`` was compared with its own predecessor; otherwise a new chain starts.
        """
        one, other = before.picture(), now.picture()
        moved = find_shift(one, other) if one.shape == other.shape else None
        if moved is None:
            return
        if not chained:
            self.delay.start_chain(before.yaws)
        self._is_chained = True
        # If the picture moves to the right, the camera has turned to the left.
        turned = moved[0] * camera.field_of_view / other.shape[1]
        if self.delay.learn(turned, now.yaws - before.yaws, now.yaws, self._find_unrecorded(now)):
            self.delay.require_check()
            self._rest_from, self._rest_until = now.stamp, now.stamp + MAX_REST
            self._watched_pictures = MAX_WATCHED_PICTURES
        elif self.delay.is_suspected:
            self._rest_until = -np.inf

    def _find_unrecorded(self, picture: _TurnPicture) -> Flags | None:
        newest = None if self._now is None else self._gaze(picture.stamp - float(GRID[0]) + MAX_PAIR_INTERVAL)
        if newest is None or self._now is None:
            return None
        return find_unrecorded(picture.yaws, newest.yaw, picture.stamp - GRID, self._now())

    def _is_turning(self, stamp: float) -> bool:
        """Return whether the camera turned around ``stamp``, judged by a few recorded poses.

        To compare all poses would take longer.
        """
        yaws = self._yaws(stamp, GRID[PROBE_INDICES])
        return yaws is not None and float(np.ptp(yaws)) >= MIN_TURN

    def _yaws(self, stamp: float, delays: Floats) -> Floats | None:
        found = [self._gaze(stamp - delay) for delay in delays]
        return None if None in found else np.array([gaze.yaw for gaze in found if gaze is not None])
