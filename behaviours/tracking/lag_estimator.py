"""Estimator of the command lag of a base, from its reported turns.

For each candidate lag, the turn rate is simulated from the delayed commands with the base's ramps. The likeliest lag is
the one whose simulation agrees with the reported turn rates: a Bayesian grid filter.
"""

import math
from collections import deque
from collections.abc import Sequence

from drivers.api.fast_dataclass import dataclass

LAG_GRID = tuple(step * 0.02 for step in range(26))
"""Candidate values, in seconds, for the command lag of a base."""

PRIOR_SIGMA = 0.1
"""Standard deviation in seconds of the command lag before anything has been learnt."""

TURN_RATE_SIGMA = 0.1
"""Standard deviation in rad/s of the difference between reported and simulated turn rates."""

MIN_RATE_SPREAD = 0.05
"""Smallest difference in rad/s between the simulated turn rates of the candidates from which a report is used.

Below it, all candidate lags explain the report equally well.
"""

MAX_SQUARED_ERROR = 9.0
"""Largest squared error of a turn rate, in squared standard deviations, that counts against a candidate lag.

An error can also come from a person, a reflex or a wall that has moved the base.
"""

REPORT_WEIGHT = 0.3
"""Weight of one report of the base; it is below 1, since the errors of reports within 20 ms are not independent."""

MEMORY_REPORTS = 500
"""Number of reports after which the weight of an old report has decayed to a third."""

HISTORY_DURATION = 1.0
"""Seconds for which the commands sent to the base are stored."""

MAX_REPORT_GAP = 0.3
"""Maximum seconds between two reports before the simulation restarts."""


TURN_ACCELERATION = 3.5
"""Default turn acceleration in rad/s^2; the 200 degrees/s^2 of the robot files."""

BRAKING_FACTOR = 1.2
"""Ratio of a base's deceleration to its acceleration, as in the base's driver."""


NO_COMMAND = (-math.inf, 0.0)
"""Time and turn rate that stand for a missing command."""


@dataclass(frozen=True, slots=True)
class TurnState:
    """State of a base at the time ``stamp``: heading (radians, odometry frame) and turn rate (rad/s).

    ``reported`` is True for a state that the base reported, False for one that was predicted.
    """

    heading: float
    rate: float
    stamp: float
    reported: bool = True


class LagEstimator:
    """Estimates the ``seconds`` from a command to its effect; ``spread`` is the standard deviation.

    ``acceleration`` (rad/s^2) is the base's turn acceleration. ``learnt`` is False while the lag is a guess;
    ``reports`` is the number of reports used.
    """

    def __init__(self, seconds: float = 0.0, acceleration: float = TURN_ACCELERATION) -> None:
        self.acceleration = acceleration
        self.reports = 0
        self._rates = [0.0] * len(LAG_GRID)
        self._commands: deque[tuple[float, float]] = deque()
        self._last_state: TurnState | None = None
        self.set_prior(seconds, learnt=False)

    def set_prior(self, seconds: float, *, learnt: bool) -> None:
        """Reset to a lag of ``seconds``, a guess or ``learnt`` in an earlier run."""
        self.seconds, self.spread, self.learnt = seconds, PRIOR_SIGMA, learnt
        self._costs = [((lag - seconds) / PRIOR_SIGMA) ** 2 for lag in LAG_GRID]

    def add_command(self, now: float, rate: float) -> None:
        """Add a command: the turn rate (rad/s) that was sent at ``now``."""
        self._commands.append((now, rate))
        while len(self._commands) > 1 and self._commands[1][0] <= now - HISTORY_DURATION:
            self._commands.popleft()

    def forget_commands(self) -> None:
        """Drop the commands, because another source has commanded the base since."""
        self._commands.clear()
        self._last_state = None

    def command_at(self, time: float, default: float) -> float:
        """Return the turn rate of the newest command sent at ``time`` or before; ``default`` if there is none."""
        return next((rate for when, rate in reversed(self._commands) if when <= time), default)

    def learn(self, state: TurnState) -> None:
        """Update the estimate with a state that the base has reported; predicted states are ignored."""
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
        when, command = next(newest)
        for number, lag in enumerate(LAG_GRID):
            time = state.stamp - lag - span / 2
            while when > time:
                when, command = next(newest, NO_COMMAND)
            rate = self._rates[number]
            self._rates[number] = ramp(rate, rate if when == -math.inf else command, most)
            means[number] = (rate + self._rates[number]) / 2
        if max(means) - min(means) >= MIN_RATE_SPREAD:
            # How far it turned, not how fast: what a base reports of its rate is older than its heading.
            self._update_costs(means, (state.heading - before.heading) / span)

    def _update_costs(self, rates: Sequence[float], reported: float) -> None:
        """Add the error of each candidate's turn rate in ``rates`` to its cost, and update the estimate."""
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
    """Return the turn rate after a step from ``rate`` towards ``setpoint``, by at most ``max_change`` (all in rad/s).

    Braking may change the rate by ``BRAKING_FACTOR`` times as much.
    """
    change = setpoint - rate
    max_change *= BRAKING_FACTOR if change * rate < 0 else 1.0
    return rate + math.copysign(min(abs(change), max_change), change)
