"""Where a base will be when the next command acts: by what it was told and has not done yet."""

import math

from behaviours.tracking.lag import Lag, Turning

LONGEST = 1.0
"""Seconds to look ahead at most: what lies beyond is of no use."""

STEP = 0.02
"""Seconds of one step of the reckoning: base drivers renew their command as often."""


class Ahead:
    """Foretells how a base will stand that begins what it is told ``lag.seconds`` later.

    It approaches each turn rate that it was told at ``acceleration`` (rad/s^2), like the ramps of its driver.
    """

    def __init__(self, lag: Lag, *, acceleration: float) -> None:
        self._lag = lag
        self._acceleration = acceleration

    def at(self, time: float, known: Turning) -> Turning:
        """Return how it will stand and turn at ``time``, from how it did when that was last known."""
        now, heading, rate = known.stamp, known.heading, known.rate
        if time < now:
            return Turning(heading - rate * (now - time), rate, time)
        time = min(time, now + LONGEST)
        while now < time:
            step = min(STEP, time - now)
            change = self._lag.told(now - self._lag.seconds, rate) - rate
            change = math.copysign(min(abs(change), self._acceleration * step), change)
            heading += (rate + change / 2) * step
            rate += change
            now += step
        return Turning(heading, rate, time)
