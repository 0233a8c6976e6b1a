"""How late a camera stamps its pictures, found from how the background shifts while the head or the base turns.

Webcams stamp a picture tens of milliseconds after its exposure, and each model by another time. Between two pictures
the background shifts by as much as the camera turned, whatever people do in front of it. For each delay that may be,
the recorded poses of head and base say how far the camera turned between the two exposures. The likeliest delay is the
one under which both agree over all pairs of pictures so far: a grid filter after Bayes. What servos lag behind their
recorded pose counts as delay, too: it has the same effect, and the same cure.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from math import radians
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Frame, Gaze, Image
from perception.change import shift, small
from perception.geometry import Pinhole
from perception.light import Grey

Floats = npt.NDArray[np.float64]

GRID: Floats = np.arange(-0.1, 0.2501, 0.01)
"""The delays that may be, in seconds; shape (36,), dtype float64. Below 0 a picture is stamped before its exposure."""

BELIEVED = 0.1
"""Seconds, one sigma: how far a delay may be from what it was believed to be."""

MEASURED = radians(0.2)
"""Radians, one sigma: how exactly the shift of a background tells a turn."""

SCALE = 0.1
"""One sigma, as a share of a turn: what the angle of view is wrong by, and how far beside the straight line between two
recorded poses servos stand that know whole degrees. Where this is too little, a few pairs outvote all others."""

LEAST_TURN = radians(0.4)
"""Radians: from a pair of pictures between which all delays mean nearly the same turn, nothing can be learnt."""

PROBES = [0, len(GRID) // 2, len(GRID) - 1]
"""The delays of ``GRID`` whose poses tell whether the camera turns."""

LONGEST_PAIR = 0.3
"""Seconds between two pictures at most: after more, they show too little of the same."""

SURE = 0.02
"""Seconds, one sigma, within which a delay must be known to count."""

OUTLIER = 9.0
"""A squared difference, in sigmas, counts no more than this: somebody walked by close in front of the camera."""

MEMORY = 400
"""Pairs of pictures after which evidence has faded to a third, so that a delay that changes is learnt anew."""

CLEAR, SLOWEST = 3.0, 0.1
"""Standard deviations by which the likeliest delay must be off what counts to count at once. What is less clear counts
by and by, at least by this share a pair: the first pairs are few, and a delay that wanders is a target that moves."""

KNOWN = 0.005
"""Seconds, one sigma, within which a delay is known well enough to be checked now and then only."""

CHECK = 20
"""Pairs of pictures that make up a check: a third of a second of turning and more."""

REST = 4.0
"""Seconds from the first check that bears a delay out to the next one."""

LONGEST_REST = 8.0
"""Seconds from one that bears the same delay out again."""

REFUTED = 9.0
"""Twice the logarithm of a ratio of likelihoods: from here on a check prefers another delay, at three sigmas."""


class Delay:
    """How many ``seconds`` after its exposure a picture is stamped; ``spread`` says how surely (one sigma).

    ``pairs`` counts the pairs of pictures from which it was learnt. ``told`` is what it was believed to be before, and
    counts until more is sure: the first few pairs may well be wrong.
    """

    def __init__(self, told: float = 0.0) -> None:
        self._told = told
        self._cost = ((GRID - told) / BELIEVED) ** 2
        self._checking = np.zeros_like(GRID)
        self._checked = 0
        self.pairs = 0
        self.seconds, self.spread = told, BELIEVED

    def learn(self, turned: float, turns: Floats) -> bool:
        """Take in a pair of pictures: the background says ``turned``, each delay of ``GRID`` means one of ``turns``.

        All in radians; ``turns`` has the shape of ``GRID``. Say whether it is known well enough to be left alone for a
        while: within ``KNOWN``, and a whole check of the newest pairs bore it out.
        """
        if float(np.ptp(turns)) < LEAST_TURN:
            return False
        most = max(abs(turned), float(np.abs(turns).max()))
        variance = MEASURED**2 + (SCALE * most) ** 2
        cost = np.minimum((turns - turned) ** 2 / variance, OUTLIER)
        self._cost += cost
        self._cost *= 1 - 1 / MEMORY
        self.pairs += 1
        self._estimate()
        return self._check(cost)

    def _check(self, cost: Floats) -> bool:
        """Weigh the newest pairs by themselves; where they prefer another delay, the evidence from before them fades.

        Return whether a check has ended that leaves nothing to be learnt.
        """
        self._checking += cost
        self._checked += 1
        if self._checked < CHECK:
            return False
        newest, self._checking, self._checked = self._checking, np.zeros_like(GRID), 0
        if float(np.interp(self.seconds, GRID, newest) - newest.min()) < REFUTED:
            return self.spread <= KNOWN
        self._cost = self._cost / 3 + newest
        self._estimate()
        return False

    def _estimate(self) -> None:
        """Draw the likeliest delay from the evidence."""
        weights = np.exp((self._cost.min() - self._cost) / 2)
        weights /= weights.sum()
        mean = float(weights @ GRID)
        self.spread = float(np.sqrt(weights @ (GRID - mean) ** 2 + (GRID[1] - GRID[0]) ** 2 / 12))
        if self.spread > SURE:
            self.seconds = self._told
            return
        off = mean - self.seconds
        self.seconds += off * min(1.0, max(SLOWEST, (off / (CLEAR * self.spread)) ** 2))


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

    ``gaze(time)`` tells where the camera looked; None where that is not known.
    """

    def __init__(self, gaze: Callable[[float], Gaze | None], delay: Delay) -> None:
        self.delay = delay
        self._gaze = gaze
        self._before: _Turned | None = None
        self._last = -np.inf
        self._rest_from = self._rest_until = -np.inf
        self._borne_out = np.inf  # the delay that the newest check has

    @property
    def comparing(self) -> bool:
        """Whether the next frame is to be compared with the newest."""
        return self._before is not None

    def exposed(self, frame: Frame, camera: Pinhole) -> Frame:
        """Return ``frame`` with the time of its exposure, later than that of the frame before it."""
        self._learn(frame, camera)
        stamp = max(frame.stamp - self.delay.seconds, float(np.nextafter(self._last, np.inf)))
        self._last = max(self._last, stamp)
        return Exposed(frame.image, stamp)

    def _learn(self, frame: Frame, camera: Pinhole) -> None:
        """Compare a picture with the one before it, if either was taken in a turn, and there is something to learn."""
        before, self._before = self._before, None
        if before is not None and frame.stamp - before.stamp > LONGEST_PAIR:
            before = None
        if self._rest_from <= frame.stamp < self._rest_until:  # a clock that was set back ends a rest
            return
        turning = self._turning(frame.stamp)
        if not turning and before is None:
            return
        yaws = self._yaws(frame.stamp, GRID)
        if yaws is None:
            return
        now = _Turned(frame.stamp, yaws, cache(partial(level, frame.image, camera)))
        if turning:
            self._before = now
        if before is not None and float(np.ptp(turns := yaws - before.yaws)) >= LEAST_TURN:
            self._compare(before.picture(), now.picture(), turns, camera, frame.stamp)

    def _compare(self, before: Grey, now: Grey, turns: Floats, camera: Pinhole, stamp: float) -> None:
        """Learn from two pictures between which the camera has turned by one of ``turns``, each meant by a delay."""
        moved = shift(before, now) if before.shape == now.shape else None
        # What moves to the right in a picture was turned away from to the left.
        if moved is not None and self.delay.learn(moved[0] * camera.field_of_view / now.shape[1], turns):
            same = abs(self.delay.seconds - self._borne_out) <= KNOWN
            self._borne_out, self._rest_from = self.delay.seconds, stamp
            self._rest_until = stamp + (LONGEST_REST if same else REST)

    def _turning(self, stamp: float) -> bool:
        """Whether the camera turned about then, by a few of its poses: all of them would cost more."""
        yaws = self._yaws(stamp, GRID[PROBES])
        return yaws is not None and float(np.ptp(yaws)) >= LEAST_TURN

    def _yaws(self, stamp: float, delays: Floats) -> Floats | None:
        found = [self._gaze(stamp - delay) for delay in delays]
        return None if None in found else np.array([gaze.yaw for gaze in found if gaze is not None])


def level(image: Image, camera: Pinhole) -> Grey:
    """Return a small picture in grey levels in which each column is as many degrees wide as the next.

    In it a turn of the camera shifts everything alike; a lens shows more pixels of a degree at the sides of a picture.
    """
    picture = small(image)
    return cast(Grey, cv2.remap(picture, *_columns(camera, *picture.shape), cv2.INTER_LINEAR))


@lru_cache(maxsize=4)
def _columns(camera: Pinhole, height: int, width: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return from where (x, y) each pixel of a levelled picture is taken; two arrays of shape (height, width)."""
    angles = (0.5 - (np.arange(width) + 0.5) / width) * camera.field_of_view
    across = np.array([camera.pixel(float(angle), 0.0)[0] for angle in angles]) * width / camera.width - 0.5
    down = np.arange(height, dtype=np.float32)[:, None]
    return np.tile(across.astype(np.float32), (height, 1)), np.tile(down, (1, width))
