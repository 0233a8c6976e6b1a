"""How late a camera stamps its pictures, found from how the background shifts while the head or the base turns.

Webcams stamp a picture tens of milliseconds after its exposure, each model by another time, and not always by the same:
stamps jitter. Between two pictures the background shifts by as much as the camera turned, whatever people do in front
of it. For each delay that may be, the recorded poses of head and base say how far the camera turned between the two
exposures. The likeliest delay is the one under which both agree over all pairs of pictures so far (``delay_grid``).
What servos lag behind their recorded pose counts as delay, too: it has the same effect, and the same cure.
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
"""Seconds, one sigma: how far a delay may be from what it was believed to be."""

MIN_TURN = radians(0.4)
"""Radians: from a pair of pictures between which all delays mean nearly the same turn, nothing can be learnt."""

PROBE_INDICES = [0, len(GRID) // 2, len(GRID) - 1]
"""The delays of ``GRID`` whose poses tell whether the camera turns."""

MAX_PAIR_INTERVAL = 0.3
"""Seconds between two pictures at most: after more, they show too little of the same."""

GRID_MARGIN = 0.02
"""Seconds: a delay this close to an end of ``GRID`` may be any beyond it, and is not used."""

MAX_USABLE_SPREAD = 0.02
"""Seconds, one sigma, within which a delay must be known to count."""

MAX_STORABLE_SPREAD = 0.015
"""Seconds, one sigma, within which a delay must be known to be stored, its jitter counted in."""

MAX_JITTER = 0.008
"""Standard deviation in seconds from which on stamps are too irregular for that."""

CONTRADICTION_WINDOW, CONTRADICTION_PROBABILITY = 0.025, 0.01
"""Seconds around a delay, and the probability of these below which it is contradicted."""

MIN_INFORMATIVE_PAIRS, MIN_COMPARED_PAIRS = 12, 40
"""Pairs of pictures that must have told something of the delay, and pairs in all: a constant turn tells the jitter."""

CLEAR_DEVIATIONS, MIN_CORRECTION_SHARE = 3.0, 0.1
"""Standard deviations by which the likeliest delay must be off what counts to count at once. What is less clear counts
by and by, at least by this share a pair: the first pairs are few, and a delay that wanders is a target that moves."""

MAX_KNOWN_SPREAD = 0.005
"""Seconds, one sigma, within which a delay is known well enough to be checked now and then only."""

MAX_STEADY_JITTER = 0.005
"""Seconds, one sigma, by which stamps may jitter that are left alone."""

MIN_CHECKED_PAIRS = 20
"""Pairs of pictures that must bear it out first."""

ONSET_OFFSETS: Floats = np.array([-0.06, 0.0, 0.1])
"""Seconds before an exposure at which poses tell whether the camera has just started to turn; shape (3,), float64."""

MAX_WATCHED_PICTURES = 2
"""Pictures that are compared during a rest each time it does: there a changed delay shows first."""

SUSPICION_ODDS = 20 * CHANGE_ODDS
"""Odds of a change that end a rest."""

MAX_REST = 8.0
"""Seconds from a check that bears a delay out to the next one."""


class CameraDelay:
    """How many ``seconds`` after its exposure a picture is stamped; ``spread`` is the uncertainty, one sigma.

    ``jitter`` is the standard deviation of the stamps in seconds, as far as learnt. ``informative_pairs`` counts the pairs of
    pictures that told something of the delay. ``told`` is the value before that; it counts until another is known.
    ``doubt`` is how far off the pose is that ``seconds`` means for the newest picture: radians, one sigma.
    ``is_distrusted`` says that the delay has changed and is being learnt anew.
    """

    def __init__(self, initial: float = 0.0) -> None:
        self._grid = DelayGrid(np.exp(((GRID - initial) / PRIOR_SPREAD) ** 2 / -2))
        self._checked_pairs = self._compared_pairs = 0
        self._informative_pairs_since_change = 0  # pairs that told something
        self.informative_pairs = 0
        self.seconds, self.spread = initial, PRIOR_SPREAD
        self.jitter = self.doubt = 0.0
        self.is_distrusted = False

    @property
    def is_known(self) -> bool:
        """Whether it is known well enough to be stored: within ``MAX_STORABLE_SPREAD``, physically possible, from enough pairs."""
        possible = MIN_DELAY <= self.seconds <= MAX_DELAY and self.jitter <= MAX_JITTER
        return (
            self.spread <= MAX_STORABLE_SPREAD
            and possible
            and self.informative_pairs >= MIN_INFORMATIVE_PAIRS
            and not self.is_distrusted
        )

    @property
    def is_suspected(self) -> bool:
        """Whether the newest pictures hint at another delay."""
        return self._grid.change_odds > SUSPICION_ODDS or self.is_distrusted

    def contradicts(self, seconds: float) -> bool:
        """Say whether the pictures have shown that the delay is another than ``seconds``."""
        near = np.abs(GRID - seconds) <= CONTRADICTION_WINDOW
        return self.is_distrusted or float(self._grid.weights[:, near].sum()) < CONTRADICTION_PROBABILITY

    def start_chain(self, yaws: Floats) -> None:
        """Start a chain of pictures with one that looks to one of ``yaws`` (radians) under each delay of ``GRID``."""
        self._grid.start_chain(yaws)
        self.doubt = 0.0

    def learn(
        self, image_turn: float, pose_turns: Floats, yaws: Floats | None = None, unrecorded: Flags | None = None
    ) -> bool:
        """Take in the next picture: since the one before, the background says ``turned``, each delay one of ``turns``.

        All in radians; ``turns`` has the shape of ``GRID``. ``yaws`` are where the picture looks under each delay;
        without them a chain starts from rest. ``unrecorded`` is as for ``DelayGrid.update``. Say whether the delay is
        known well enough to be left alone for a while: within ``MAX_KNOWN_SPREAD``, borne out by ``MIN_CHECKED_PAIRS`` pairs.
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
        """Require ``MIN_CHECKED_PAIRS`` pairs anew before the delay is left alone again."""
        self._checked_pairs = 0

    def _estimate(self) -> None:
        """Draw the likeliest delay from the evidence."""
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
    """A picture with the time of its exposure, in seconds on the run's clock: a ``perception.api.Frame``."""

    image: Image
    stamp: float


@dataclass(frozen=True, slots=True)
class _TurnPicture:
    """What is kept of a picture that was taken in a turn: its stamp, the yaw under each delay, the picture itself.

    It is levelled once it is compared, which not all are.
    """

    stamp: float
    yaws: Floats
    picture: Callable[[], GreyImage]


class ExposureEstimator:
    """Gives each frame the time of its exposure, and learns ``delay`` while the camera turns.

    ``gaze(time)`` tells where the camera looked, and the newest for a later time; None where that is not known.
    ``now`` tells the time; without it, poses are taken to be recorded at once.
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
        """Whether the next frame is to be compared with the newest."""
        return self._previous is not None

    def expose(self, frame: Frame, camera: Pinhole) -> Frame:
        """Return ``frame`` with the time of its exposure, later than that of the frame before it."""
        self._learn_from(frame, camera)
        now = None if self._now is None else self._now()
        self._exposure = self._clock.expose(frame.stamp, self.delay.seconds, now)
        return ExposedFrame(frame.image, self._exposure.stamp)

    def gaze(self) -> Gaze | None:
        """Return where the camera looked at the exposure of the newest frame, with the doubt about it.

        That is another time than its stamp where a correction of the delay would have put that before the last one.
        """
        found = self._gaze(self._exposure.time)
        doubt = max(self._exposure.doubt, self.delay.doubt if self._is_chained else 0.0)
        return None if found is None else replace(found, doubt=doubt)

    def _learn_from(self, frame: Frame, camera: Pinhole) -> None:
        """Compare a picture with the one before it, if either was taken in a turn, and there is something to learn."""
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
        """Say whether a picture of a turn need not be compared: the delay is known, and the turn goes on evenly."""
        if not self._rest_from <= stamp < self._rest_until:  # a clock that was set back ends a rest, too
            return False
        yaws = self._yaws(stamp, self.delay.seconds + ONSET_OFFSETS)
        if yaws is not None and abs(yaws[0] - yaws[1]) - abs(yaws[1] - yaws[2]) >= MIN_TURN:
            self._watched_pictures = 0
        self._watched_pictures += 1
        return self._watched_pictures > MAX_WATCHED_PICTURES

    def _compare(self, before: _TurnPicture, now: _TurnPicture, camera: Pinhole, *, chained: bool) -> None:
        """Learn from two pictures, of which at least one was taken in a turn; ``chained`` to the pair before it."""
        one, other = before.picture(), now.picture()
        moved = find_shift(one, other) if one.shape == other.shape else None
        if moved is None:
            return
        if not chained:
            self.delay.start_chain(before.yaws)
        self._is_chained = True
        # What moves to the right in a picture was turned away from to the left.
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
        """Whether the camera turned about then, by a few of its poses: all of them would cost more."""
        yaws = self._yaws(stamp, GRID[PROBE_INDICES])
        return yaws is not None and float(np.ptp(yaws)) >= MIN_TURN

    def _yaws(self, stamp: float, delays: Floats) -> Floats | None:
        found = [self._gaze(stamp - delay) for delay in delays]
        return None if None in found else np.array([gaze.yaw for gaze in found if gaze is not None])
