"""Where a base will be when the next command acts: by what it was told and has not done yet."""

from behaviours.tracking.lag import Lag, Turning, ramped

MAX_LOOKAHEAD = 1.0
"""Seconds to look ahead at most: what lies beyond is of no use."""

STEP = 0.02
"""Seconds of one step of the reckoning: base drivers renew their command as often."""


class Ahead:
    """Foretells how a base will stand that begins what it is told ``lag.seconds`` later.

    It approaches each turn rate that it was told at ``lag.acceleration``, by the ramps of its driver.
    """

    def __init__(self, lag: Lag) -> None:
        self._lag = lag

    def at(self, time: float, known: Turning) -> Turning:
        """Return how it will stand and turn at ``time``, from how it did when that was last known."""
        now, heading, rate = known.stamp, known.heading, known.rate
        if time < now:
            return Turning(heading - rate * (now - time), rate, time)
        time = min(time, now + MAX_LOOKAHEAD)
        while now < time:
            step = min(STEP, time - now)
            told = self._lag.told(now + step / 2 - self._lag.seconds, rate)
            after = ramped(rate, told, self._lag.acceleration * step)
            heading += (rate + after) / 2 * step
            rate = after
            now += step
        return Turning(heading, rate, time)
