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

from drivers.api.quick import dataclass
from perception.api import Frame, Gaze, Image
from perception.change import shift
from perception.delay_grid import CHANGE_ODDS, GRID, JITTERS, STEP, DelayGrid, Flags, Floats, find_unrecorded
from perception.exposure_clock import EARLIEST, LATEST, Exposure, ExposureClock
from perception.geometry import Pinhole
from perception.levelling import level
from perception.light import Grey

BELIEVED = 0.1
"""Seconds, one sigma: how far a delay may be from what it was believed to be."""

LEAST_TURN = radians(0.4)
"""Radians: from a pair of pictures between which all delays mean nearly the same turn, nothing can be learnt."""

PROBES = [0, len(GRID) // 2, len(GRID) - 1]
"""The delays of ``GRID`` whose poses tell whether the camera turns."""

LONGEST_PAIR = 0.3
"""Seconds between two pictures at most: after more, they show too little of the same."""

EDGE = 0.02
"""Seconds: a delay this close to an end of ``GRID`` may be any beyond it, and is not used."""

SURE = 0.02
"""Seconds, one sigma, within which a delay must be known to count."""

STORABLE = 0.015
"""Seconds, one sigma, within which a delay must be known to be stored, its jitter counted in."""

MAX_JITTER = 0.008
"""Standard deviation in seconds from which on stamps are too irregular for that."""

NEAR, IMPLAUSIBLE = 0.025, 0.01
"""Seconds around a delay, and the probability of these below which it is contradicted."""

FEWEST, SETTLED = 12, 40
"""Pairs of pictures that must have told something of the delay, and pairs in all: a constant turn tells the jitter."""

CLEAR, SLOWEST = 3.0, 0.1
"""Standard deviations by which the likeliest delay must be off what counts to count at once. What is less clear counts
by and by, at least by this share a pair: the first pairs are few, and a delay that wanders is a target that moves."""

KNOWN = 0.005
"""Seconds, one sigma, within which a delay is known well enough to be checked now and then only."""

STEADY = 0.005
"""Seconds, one sigma, by which stamps may jitter that are left alone."""

CHECK = 20
"""Pairs of pictures that must bear it out first."""

ONSET: Floats = np.array([-0.06, 0.0, 0.1])
"""Seconds before an exposure at which poses tell whether the camera has just started to turn; shape (3,), float64."""

WATCHED = 2
"""Pictures that are compared during a rest each time it does: there a changed delay shows first."""

SUSPECT = 20 * CHANGE_ODDS
"""Odds of a change that end a rest."""

LONGEST_REST = 8.0
"""Seconds from a check that bears a delay out to the next one."""


class Delay:
    """How many ``seconds`` after its exposure a picture is stamped; ``spread`` is the uncertainty, one sigma.

    ``jitter`` is the standard deviation of the stamps in seconds, as far as learnt. ``pairs`` counts the pairs of
    pictures that told something of the delay. ``told`` is the value before that; it counts until another is known.
    ``doubt`` is how far off the pose is that ``seconds`` means for the newest picture: radians, one sigma.
    ``distrusted`` says that the delay has changed and is being learnt anew.
    """

    def __init__(self, told: float = 0.0) -> None:
        self._grid = DelayGrid(np.exp(((GRID - told) / BELIEVED) ** 2 / -2))
        self._checked = self._compared = 0
        self._since_change = 0  # pairs that told something
        self.pairs = 0
        self.seconds, self.spread = told, BELIEVED
        self.jitter = self.doubt = 0.0
        self.distrusted = False

    @property
    def known(self) -> bool:
        """Whether it is known well enough to be stored: within ``STORABLE``, physically possible, from enough pairs."""
        possible = EARLIEST <= self.seconds <= LATEST and self.jitter <= MAX_JITTER
        return self.spread <= STORABLE and possible and self.pairs >= FEWEST and not self.distrusted

    @property
    def suspected(self) -> bool:
        """Whether the newest pictures hint at another delay."""
        return self._grid.change_odds > SUSPECT or self.distrusted

    def contradicts(self, seconds: float) -> bool:
        """Say whether the pictures have shown that the delay is another than ``seconds``."""
        near = np.abs(GRID - seconds) <= NEAR
        return self.distrusted or float(self._grid.weights[:, near].sum()) < IMPLAUSIBLE

    def begin(self, yaws: Floats) -> None:
        """Start a chain of pictures with one that looks to one of ``yaws`` (radians) under each delay of ``GRID``."""
        self._grid.begin(yaws)
        self.doubt = 0.0

    def learn(self, turned: float, turns: Floats, yaws: Floats | None = None, unrecorded: Flags | None = None) -> bool:
        """Take in the next picture: since the one before, the background says ``turned``, each delay one of ``turns``.

        All in radians; ``turns`` has the shape of ``GRID``. ``yaws`` are where the picture looks under each delay;
        without them a chain starts from rest. ``unrecorded`` is as for ``DelayGrid.update``. Say whether the delay is
        known well enough to be left alone for a while: within ``KNOWN``, borne out by ``CHECK`` pairs.
        """
        yaws = self._grid.yaws + turns if yaws is None else yaws
        if max(abs(turned), float(np.abs(turns).max())) < LEAST_TURN:
            self.begin(yaws)
            return False
        self._grid.update(turned, yaws, unrecorded)
        self.pairs += self._grid.tells
        self._compared += 1
        self._checked += 1
        self._estimate()
        if self.suspected:
            self._checked = 0
        return self._checked >= CHECK and self.spread <= KNOWN and self.jitter <= STEADY

    def recheck(self) -> None:
        """Require ``CHECK`` pairs anew before the delay is left alone again."""
        self._checked = 0

    def _estimate(self) -> None:
        """Draw the likeliest delay from the evidence."""
        weights = self._grid.weights.sum(axis=0)
        self.jitter = float(self._grid.weights.sum(axis=1) @ JITTERS)
        mean = float(weights @ GRID)
        deviation = float(np.sqrt(weights @ (GRID - mean) ** 2 + STEP**2 / 12))
        self._since_change = 0 if self._grid.changed else self._since_change + self._grid.tells
        relearnt = deviation <= SURE and self._since_change >= FEWEST
        self.distrusted = self._grid.changed or (self.distrusted and not relearnt)
        off, usable = mean - self.seconds, float(GRID[0]) + EDGE <= mean <= LATEST
        few = self._compared < SETTLED or self.pairs < FEWEST
        self.spread = hypot(deviation, self.jitter)
        if few or self.distrusted or not usable or self.jitter > MAX_JITTER:
            self.spread = max(self.spread, SURE)
        if usable and abs(off) > CLEAR * deviation:
            self.seconds = mean
        elif usable and deviation <= SURE:
            self.seconds += off * min(1.0, max(SLOWEST, (off / (CLEAR * deviation)) ** 2))
        self.doubt = self._grid.doubt(self.seconds)


@dataclass(frozen=True, slots=True)
class Exposed:
    """A picture with the time of its exposure, in seconds on the run's clock: a ``perception.api.Frame``."""

    image: Image
    stamp: float


@dataclass(frozen=True, slots=True)
class _Turned:
    """What is kept of a picture that was taken in a turn: its stamp, the yaw under each delay, the picture itself.

    It is levelled once it is compared, which not all are.
    """

    stamp: float
    yaws: Floats
    picture: Callable[[], Grey]


class Exposures:
    """Gives each frame the time of its exposure, and learns ``delay`` while the camera turns.

    ``gaze(time)`` tells where the camera looked, and the newest for a later time; None where that is not known.
    ``now`` tells the time; without it, poses are taken to be recorded at once.
    """

    def __init__(
        self, gaze: Callable[[float], Gaze | None], delay: Delay, now: Callable[[], float] | None = None
    ) -> None:
        self.delay = delay
        self._gaze = gaze
        self._now = now
        self._before: _Turned | None = None
        self._chained = False
        self._rest_from = self._rest_until = -np.inf
        self._watched = 0
        self._clock = ExposureClock()
        self._exposure = Exposure(0.0, 0.0)

    @property
    def comparing(self) -> bool:
        """Whether the next frame is to be compared with the newest."""
        return self._before is not None

    def exposed(self, frame: Frame, camera: Pinhole) -> Frame:
        """Return ``frame`` with the time of its exposure, later than that of the frame before it."""
        self._learn(frame, camera)
        now = None if self._now is None else self._now()
        self._exposure = self._clock.expose(frame.stamp, self.delay.seconds, now)
        return Exposed(frame.image, self._exposure.stamp)

    def gaze(self) -> Gaze | None:
        """Return where the camera looked at the exposure of the newest frame, with the doubt about it.

        That is another time than its stamp where a correction of the delay would have put that before the last one.
        """
        found = self._gaze(self._exposure.time)
        doubt = max(self._exposure.doubt, self.delay.doubt if self._chained else 0.0)
        return None if found is None else replace(found, doubt=doubt)

    def _learn(self, frame: Frame, camera: Pinhole) -> None:
        """Compare a picture with the one before it, if either was taken in a turn, and there is something to learn."""
        before, self._before = self._before, None
        if before is not None and not 0 < frame.stamp - before.stamp <= LONGEST_PAIR:
            before = None
        chained, self._chained = self._chained, False
        turning = self._turning(frame.stamp)
        if not (turning or before is not None) or self._resting(frame.stamp):
            return
        yaws = self._yaws(frame.stamp, GRID)
        if yaws is None:
            return
        now = _Turned(frame.stamp, yaws, cache(partial(level, frame.image, camera)))
        if turning:
            self._before = now
        if before is not None:
            self._compare(before, now, camera, chained=chained)

    def _resting(self, stamp: float) -> bool:
        """Say whether a picture of a turn need not be compared: the delay is known, and the turn goes on evenly."""
        if not self._rest_from <= stamp < self._rest_until:  # a clock that was set back ends a rest, too
            return False
        yaws = self._yaws(stamp, self.delay.seconds + ONSET)
        if yaws is not None and abs(yaws[0] - yaws[1]) - abs(yaws[1] - yaws[2]) >= LEAST_TURN:
            self._watched = 0
        self._watched += 1
        return self._watched > WATCHED

    def _compare(self, before: _Turned, now: _Turned, camera: Pinhole, *, chained: bool) -> None:
        """Learn from two pictures, of which at least one was taken in a turn; ``chained`` to the pair before it."""
        one, other = before.picture(), now.picture()
        moved = shift(one, other) if one.shape == other.shape else None
        if moved is None:
            return
        if not chained:
            self.delay.begin(before.yaws)
        self._chained = True
        # What moves to the right in a picture was turned away from to the left.
        turned = moved[0] * camera.field_of_view / other.shape[1]
        if self.delay.learn(turned, now.yaws - before.yaws, now.yaws, self._unrecorded(now)):
            self.delay.recheck()
            self._rest_from, self._rest_until = now.stamp, now.stamp + LONGEST_REST
            self._watched = WATCHED
        elif self.delay.suspected:
            self._rest_until = -np.inf

    def _unrecorded(self, picture: _Turned) -> Flags | None:
        newest = None if self._now is None else self._gaze(picture.stamp - float(GRID[0]) + LONGEST_PAIR)
        if newest is None or self._now is None:
            return None
        return find_unrecorded(picture.yaws, newest.yaw, picture.stamp - GRID, self._now())

    def _turning(self, stamp: float) -> bool:
        """Whether the camera turned about then, by a few of its poses: all of them would cost more."""
        yaws = self._yaws(stamp, GRID[PROBES])
        return yaws is not None and float(np.ptp(yaws)) >= LEAST_TURN

    def _yaws(self, stamp: float, delays: Floats) -> Floats | None:
        found = [self._gaze(stamp - delay) for delay in delays]
        return None if None in found else np.array([gaze.yaw for gaze in found if gaze is not None])
