"""When the driver of an arm goes round, and how much of its wire's time that takes."""

from math import ceil, inf

STATISTICS_WINDOW = 1.0
"""Seconds over which the figures are taken."""

EARLY_PERIODS = 1 / 2
"""Periods of the schedule by which what is due may be early: its round is the nearest one. A reading is stamped when it
has come, a few milliseconds into its round; what was always late would be read a whole period late each time."""


class RoundSchedule:
    """Keeps rounds on an absolute schedule of ``rate`` (Hz), as far as they can be; counts what came of it.

    ``rounds`` is their number, ``achieved_rate`` (Hz) their rate and ``utilisation`` that of the time that the wire was in use
    (0..1), both over the last full window.
    """

    def __init__(self, rate: float) -> None:
        self.rounds = 0
        self.achieved_rate = 0.0
        self.utilisation = 0.0
        self._period = 1 / rate
        self._next = 0.0
        self._window = (0.0, 0, 0.0)  # when it began, and the rounds and the seconds of use until then

    def restart(self, now: float, busy: float) -> None:
        """Begin anew, as after a pause. ``busy`` is for how long (s) the wire has been in use, in all."""
        self._next = now
        self._window = (now, self.rounds, busy)

    def end_round(self, now: float, busy: float, not_before: float = -inf) -> float:
        """End a round; return the seconds until the next: at least a little, for others want the wire too.

        There is nothing to be done before about ``until``: that leaves rounds of the schedule out.
        """
        self.rounds += 1
        began, rounds, used = self._window
        if (passed := now - began) >= STATISTICS_WINDOW:
            self.achieved_rate, self.utilisation = (self.rounds - rounds) / passed, (busy - used) / passed
            self._window = (now, self.rounds, busy)
        self._next += self._period
        if now - self._next > self._period:  # too late to be made up for
            self._next = now
        if not_before > self._next:
            self._next += max(ceil((not_before - self._next) / self._period - EARLY_PERIODS), 0) * self._period
        return max(self._next - now, self._period / 10)
