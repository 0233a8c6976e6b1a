"""Where a base will be when the next command acts: by what it was told and has not done yet."""

import math
from collections import deque
from dataclasses import dataclass

LONGEST = 1.0
"""Seconds to look ahead at most: what lies beyond is of no use."""

STEP = 0.02
"""Seconds of one step of the reckoning: base drivers renew their command as often."""


@dataclass(frozen=True, slots=True)
class Turning:
    """How the base stood, and turned, at ``stamp``: ``heading`` in radians (odometry frame), ``rate`` in rad/s."""

    heading: float
    rate: float
    stamp: float


class Ahead:
    """Foretells how a base will stand that begins what it is told ``lag`` seconds later.

    It approaches each turn rate that it was told at ``acceleration`` (rad/s^2), like the ramps of its driver.
    """

    def __init__(self, *, lag: float, acceleration: float) -> None:
        self._lag = lag
        self._acceleration = acceleration
        self._told: deque[tuple[float, float]] = deque()

    def tell(self, now: float, rate: float) -> None:
        """The base was told at ``now`` to turn at ``rate`` rad/s from then on."""
        self._told.append((now + self._lag, rate))
        while len(self._told) > 1 and self._told[1][0] <= now - LONGEST:
            self._told.popleft()

    def forget(self) -> None:
        """Somebody else has told it other things since."""
        self._told.clear()

    def at(self, time: float, known: Turning) -> Turning:
        """Return how it will stand and turn at ``time``, from how it did when that was last known."""
        now, heading, rate = known.stamp, known.heading, known.rate
        if time < now:
            return Turning(heading - rate * (now - time), rate, time)
        time = min(time, now + LONGEST)
        while now < time:
            step = min(STEP, time - now)
            change = self._goal(now, rate) - rate
            change = math.copysign(min(abs(change), self._acceleration * step), change)
            heading += (rate + change / 2) * step
            rate += change
            now += step
        return Turning(heading, rate, time)

    def _goal(self, time: float, rate: float) -> float:
        """Return the turn rate that is in force at ``time``; that which it has where nothing is known."""
        return next((told for begin, told in reversed(self._told) if begin <= time), rate)
