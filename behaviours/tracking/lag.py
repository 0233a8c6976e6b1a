"""How long a base takes to begin what it is told, learnt from how it turned.

For each lag that may be, the base is reckoned to approach what it was told that long ago, by its ramps. The likeliest
lag is the one under which this agrees with the turn rates that the base reported: a grid filter after Bayes.
"""

import math
from collections import deque
from collections.abc import Sequence

from drivers.api.quick import dataclass

GRID = tuple(step * 0.02 for step in range(26))
"""The lags that may be, in seconds."""

BELIEVED = 0.1
"""Seconds, one sigma: how far a lag may be from what it was believed to be."""

MEASURED = 0.1
"""rad/s, one sigma: how exactly a reported turn rate agrees with a reckoned one."""

LEAST = 0.05
"""rad/s: where all lags mean nearly the same turn rate, nothing can be learnt."""

OUTLIER = 9.0
"""A squared difference, in sigmas, counts no more than this: a person, a reflex or a wall has moved the base."""

WEIGHT = 0.3
"""The weight of a report: those that follow each other within 20 ms do not err independently."""

MEMORY = 500
"""Reports after which evidence has faded to a third."""

HISTORY_DURATION = 1.0
"""Seconds for which is kept what a base was told."""

LONGEST_GAP = 0.3
"""Seconds between two reports: after more, the reckoning begins afresh."""


TURN_ACCELERATION = 3.5
"""rad/s^2: how quickly a base changes its turn, unless told otherwise; the 200 degrees/s^2 of the robot files."""

BRAKING = 1.2
"""How much harder than it speeds up a base slows down: as its driver has it."""


NEVER = (-math.inf, 0.0)
"""When what was never told was told."""


@dataclass(frozen=True, slots=True)
class Turning:
    """How the base stood, and turned, at ``stamp``: ``heading`` in radians (odometry frame), ``rate`` in rad/s.

    It is ``reported`` by the base, or only reckoned.
    """

    heading: float
    rate: float
    stamp: float
    reported: bool = True


class Lag:
    """The commands of a base, and how many ``seconds`` it takes to begin one; ``spread`` says how surely (one sigma).

    ``acceleration`` (rad/s^2) is how quickly the base changes its turn. ``told`` is what the lag is believed to be.
    ``learnt`` says whether that is more than a guess, ``reports`` from how many it was learnt here.
    """

    def __init__(self, told: float = 0.0, acceleration: float = TURN_ACCELERATION) -> None:
        self.acceleration = acceleration
        self.reports = 0
        self._rates = [0.0] * len(GRID)
        self._told: deque[tuple[float, float]] = deque()
        self._known: Turning | None = None
        self.believe(told, learnt=False)

    def believe(self, told: float, *, learnt: bool) -> None:
        """Begin with a lag of ``told`` seconds, a guess or ``learnt`` before."""
        self.seconds, self.spread, self.learnt = told, BELIEVED, learnt
        self._costs = [((lag - told) / BELIEVED) ** 2 for lag in GRID]

    def tell(self, now: float, rate: float) -> None:
        """The base was told at ``now`` to turn at ``rate`` rad/s from then on."""
        self._told.append((now, rate))
        while len(self._told) > 1 and self._told[1][0] <= now - HISTORY_DURATION:
            self._told.popleft()

    def forget(self) -> None:
        """Somebody else has told it other things since: what it does next is not known."""
        self._told.clear()
        self._known = None

    def told(self, time: float, otherwise: float) -> float:
        """Return the turn rate that was the newest told at ``time``; ``otherwise`` before any was."""
        return next((rate for when, rate in reversed(self._told) if when <= time), otherwise)

    def learn(self, known: Turning) -> None:
        """Take in how the base turned at a time; what it did not report itself teaches nothing."""
        before = self._known
        if not known.reported or (before is not None and known.stamp <= before.stamp):
            return
        self._known = known
        follows = before is not None and known.stamp - before.stamp <= LONGEST_GAP
        if before is None or not follows or not self._told or self._told[0][0] > before.stamp - GRID[-1]:
            self._rates = [known.rate] * len(GRID)
            return
        span = known.stamp - before.stamp
        most, means = self.acceleration * span, list(self._rates)
        newest = reversed(self._told)  # a longer lag asks for an older time, so one walk through them finds all
        when, told = next(newest)
        for number, lag in enumerate(GRID):
            time = known.stamp - lag - span / 2
            while when > time:
                when, told = next(newest, NEVER)
            rate = self._rates[number]
            self._rates[number] = ramped(rate, rate if when == -math.inf else told, most)
            means[number] = (rate + self._rates[number]) / 2
        if max(means) - min(means) >= LEAST:
            # How far it turned, not how fast: what a base reports of its rate is older than its heading.
            self._weigh(means, (known.heading - before.heading) / span)

    def _weigh(self, rates: Sequence[float], reported: float) -> None:
        """Count for each lag how far its turn rate is from the one that was reported."""
        self.reports += 1
        self.learnt = True
        for number, rate in enumerate(rates):
            off = min(((rate - reported) / MEASURED) ** 2, OUTLIER)
            self._costs[number] = self._costs[number] * (1 - 1 / MEMORY) + WEIGHT * off
        least = min(self._costs)
        weights = [math.exp((least - cost) / 2) for cost in self._costs]
        pairs = list(zip(weights, GRID, strict=True))
        self.seconds = sum(weight * lag for weight, lag in pairs) / sum(weights)
        variance = sum(weight * (lag - self.seconds) ** 2 for weight, lag in pairs) / sum(weights)
        self.spread = math.sqrt(variance + GRID[1] ** 2 / 12)


def ramped(rate: float, told: float, most: float) -> float:
    """Return the turn rate of a base on its way to the one that it was ``told``, ``most`` nearer to it."""
    change = told - rate
    most *= BRAKING if change * rate < 0 else 1.0
    return rate + math.copysign(min(abs(change), most), change)
