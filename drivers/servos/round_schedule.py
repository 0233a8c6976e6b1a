"""Schedule of an arm driver's rounds, and its share of the bus time."""

from math import ceil, inf

STATISTICS_WINDOW = 1.0
"""Seconds over which the statistics are averaged."""

EARLY_PERIODS = 1 / 2
"""Periods by which a reading may be early, so that it belongs to the nearest round.

A reading is stamped on arrival, a few milliseconds into its round. Without this tolerance, each next one would be a
whole period late.
"""


class RoundSchedule:
    """Absolute schedule of rounds at ``rate`` (Hz), as far as they can be kept, with statistics.

    ``rounds`` counts them; ``achieved_rate`` (Hz) and ``utilisation`` of the bus (0..1) are those of the last full
    window.
    """

    def __init__(self, rate: float) -> None:
        self.rounds = 0
        self.achieved_rate = 0.0
        self.utilisation = 0.0
        self._period = 1 / rate
        self._next = 0.0
        self._window = (0.0, 0, 0.0)  # start time, and the rounds and seconds of use until then

    def restart(self, now: float, busy: float) -> None:
        """Restart the schedule after a pause. ``busy`` is the total busy time (s) of the bus."""
        self._next = now
        self._window = (now, self.rounds, busy)

    def end_round(self, now: float, busy: float, not_before: float = -inf) -> float:
        """End a round; return the seconds to the next one, at least a tenth of a period for other users of the bus.

        Rounds before about ``not_before`` are skipped.
        """
        self.rounds += 1
        began, rounds, used = self._window
        if (passed := now - began) >= STATISTICS_WINDOW:
            self.achieved_rate, self.utilisation = (self.rounds - rounds) / passed, (busy - used) / passed
            self._window = (now, self.rounds, busy)
        self._next += self._period
        if now - self._next > self._period:  # too late to catch up
            self._next = now
        if not_before > self._next:
            self._next += max(ceil((not_before - self._next) / self._period - EARLY_PERIODS), 0) * self._period
        return max(self._next - now, self._period / 10)
