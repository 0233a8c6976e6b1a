"""Schedule of the rounds in which an arm driver reads its servos, and statistics of the use of the bus."""

from math import ceil, inf

STATISTICS_WINDOW = 1.0
"""Seconds over which the achieved rate and the utilisation of the bus are averaged."""

EARLY_PERIODS = 1 / 2
"""Time by which a joint may be read before it is due, as a share of the period between two rounds of readings.

A reading is stamped on arrival, a few milliseconds into its round. Without this tolerance, the next reading of the same
joint would be taken a whole period late.
"""


class RoundSchedule:
    """Schedule of the rounds in which servos are read, at ``rate`` (Hz), with statistics.

    Rounds begin at fixed times as long as each ends before the next. ``rounds`` is the number of rounds so far.
    ``achieved_rate`` (Hz), and ``utilisation`` of the bus (share of time, 0..1), are averages over the last full
    ``STATISTICS_WINDOW``.
    """

    def __init__(self, rate: float) -> None:
        self.rounds = 0
        self.achieved_rate = 0.0
        self.utilisation = 0.0
        self._period = 1 / rate
        self._next = 0.0
        self._window = (0.0, 0, 0.0)  # start time, and the rounds and seconds of use until then

    def restart(self, now: float, busy: float) -> None:
        """Restart the schedule at time ``now``, after a pause; ``busy`` is the busy time of the bus so far (s)."""
        self._next = now
        self._window = (now, self.rounds, busy)

    def end_round(self, now: float, busy: float, not_before: float = -inf) -> float:
        """End a round at time ``now``; return the seconds to the next one.

        At least a tenth of a period remains for other users of the bus. ``busy`` is the total busy time of the bus (s).
        ``not_before`` is the time at which the next joint is due: rounds that would begin more than half a period
        before it are skipped.
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
