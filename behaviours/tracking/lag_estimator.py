"""How long a base takes to begin what it is told, learnt from how it turned.

For each lag that may be, the base is reckoned to approach what it was told that long ago, by its ramps. The likeliest
lag is the one under which this agrees with the turn rates that the base reported: a grid filter after Bayes.
"""

import math
from collections import deque
from collections.abc import Sequence

from drivers.api.fast_dataclass import dataclass

LAG_GRID = tuple(step * 0.02 for step in range(26))
"""The lags that may be, in seconds."""

PRIOR_SIGMA = 0.1
"""Seconds, one sigma: how far a lag may be from what it was believed to be."""

TURN_RATE_SIGMA = 0.1
"""rad/s, one sigma: how exactly a reported turn rate agrees with a reckoned one."""

MIN_RATE_SPREAD = 0.05
"""rad/s: where all lags mean nearly the same turn rate, nothing can be learnt."""

MAX_SQUARED_ERROR = 9.0
"""A squared difference, in sigmas, counts no more than this: a person, a reflex or a wall has moved the base."""

REPORT_WEIGHT = 0.3
"""The weight of a report: those that follow each other within 20 ms do not err independently."""

MEMORY_REPORTS = 500
"""Reports after which evidence has faded to a third."""

HISTORY_DURATION = 1.0
"""Seconds for which is kept what a base was told."""

MAX_REPORT_GAP = 0.3
"""Seconds between two reports: after more, the reckoning begins afresh."""


TURN_ACCELERATION = 3.5
"""rad/s^2: how quickly a base changes its turn, unless told otherwise; the 200 degrees/s^2 of the robot files."""

BRAKING_FACTOR = 1.2
"""How much harder than it speeds up a base slows down: as its driver has it."""


NO_COMMAND = (-math.inf, 0.0)
"""When what was never told was told."""


@dataclass(frozen=True, slots=True)
class TurnState:
    """How the base stood, and turned, at ``stamp``: ``heading`` in radians (odometry frame), ``rate`` in rad/s.

    It is ``reported`` by the base, or only reckoned.
    """

    heading: float
    rate: float
    stamp: float
    reported: bool = True


class LagEstimator:
    """The commands of a base, and how many ``seconds`` it takes to begin one; ``spread`` says how surely (one sigma).

    ``acceleration`` (rad/s^2) is how quickly the base changes its turn. ``command_at`` is what the lag is believed to be.
    ``learnt`` says whether that is more than a guess, ``reports`` from how many it was learnt here.
    """

    def __init__(self, seconds: float = 0.0, acceleration: float = TURN_ACCELERATION) -> None:
        self.acceleration = acceleration
        self.reports = 0
        self._rates = [0.0] * len(LAG_GRID)
        self._commands: deque[tuple[float, float]] = deque()
        self._last_state: TurnState | None = None
        self.set_prior(seconds, learnt=False)

    def set_prior(self, seconds: float, *, learnt: bool) -> None:
        """Begin with a lag of ``command_at`` seconds, a guess or ``learnt`` before."""
        self.seconds, self.spread, self.learnt = seconds, PRIOR_SIGMA, learnt
        self._costs = [((lag - seconds) / PRIOR_SIGMA) ** 2 for lag in LAG_GRID]

    def add_command(self, now: float, rate: float) -> None:
        """The base was told at ``now`` to turn at ``rate`` rad/s from then on."""
        self._commands.append((now, rate))
        while len(self._commands) > 1 and self._commands[1][0] <= now - HISTORY_DURATION:
            self._commands.popleft()

    def forget_commands(self) -> None:
        """Somebody else has told it other things since: what it does next is not known."""
        self._commands.clear()
        self._last_state = None

    def command_at(self, time: float, default: float) -> float:
        """Return the turn rate that was the newest told at ``time``; ``otherwise`` before any was."""
        return next((rate for when, rate in reversed(self._commands) if when <= time), default)

    def learn(self, state: TurnState) -> None:
        """Take in how the base turned at a time; what it did not report itself teaches nothing."""
        before = self._last_state
        if not state.reported or (before is not None and state.stamp <= before.stamp):
            return
        self._last_state = state
        follows = before is not None and state.stamp - before.stamp <= MAX_REPORT_GAP
        if before is None or not follows or not self._commands or self._commands[0][0] > before.stamp - LAG_GRID[-1]:
            self._rates = [state.rate] * len(LAG_GRID)
            return
        span = state.stamp - before.stamp
        most, means = self.acceleration * span, list(self._rates)
        newest = reversed(self._commands)  # a longer lag asks for an older time, so one walk through them finds all
        when, told = next(newest)
        for number, lag in enumerate(LAG_GRID):
            time = state.stamp - lag - span / 2
            while when > time:
                when, told = next(newest, NO_COMMAND)
            rate = self._rates[number]
            self._rates[number] = ramp(rate, rate if when == -math.inf else told, most)
            means[number] = (rate + self._rates[number]) / 2
        if max(means) - min(means) >= MIN_RATE_SPREAD:
            # How far it turned, not how fast: what a base reports of its rate is older than its heading.
            self._update_costs(means, (state.heading - before.heading) / span)

    def _update_costs(self, rates: Sequence[float], reported: float) -> None:
        """Count for each lag how far its turn rate is from the one that was reported."""
        self.reports += 1
        self.learnt = True
        for number, rate in enumerate(rates):
            off = min(((rate - reported) / TURN_RATE_SIGMA) ** 2, MAX_SQUARED_ERROR)
            self._costs[number] = self._costs[number] * (1 - 1 / MEMORY_REPORTS) + REPORT_WEIGHT * off
        least = min(self._costs)
        weights = [math.exp((least - cost) / 2) for cost in self._costs]
        pairs = list(zip(weights, LAG_GRID, strict=True))
        self.seconds = sum(weight * lag for weight, lag in pairs) / sum(weights)
        variance = sum(weight * (lag - self.seconds) ** 2 for weight, lag in pairs) / sum(weights)
        self.spread = math.sqrt(variance + LAG_GRID[1] ** 2 / 12)


def ramp(rate: float, setpoint: float, max_change: float) -> float:
    """Return the turn rate of a base on its way to the one that it was ``command_at``, ``most`` nearer to it."""
    change = setpoint - rate
    max_change *= BRAKING_FACTOR if change * rate < 0 else 1.0
    return rate + math.copysign(min(abs(change), max_change), change)
