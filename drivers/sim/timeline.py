"""Simulated time: a clock and a schedule of actions, run as fast as the machine allows."""

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count

from drivers.clock import ManualClock

TimedAction = Callable[[], object]
"""Callback in the schedule of simulated time; it reads the time from the clock."""


def never_stop() -> bool:
    """Return False: do not stop early."""
    return False


class Timeline:
    """A simulated clock with a schedule of actions. For one thread.

    Actions at the same time run in the order in which they were scheduled, so runs are reproducible.
    """

    def __init__(self) -> None:
        self.clock = ManualClock()
        self._queue: list[tuple[float, int, TimedAction]] = []
        self._order = count()

    def call_at(self, time: float, action: TimedAction) -> None:
        """Schedule ``action`` at ``time`` seconds; a time in the past means the next step."""
        heappush(self._queue, (time, next(self._order), action))

    def call_every(self, period: float, action: TimedAction, *, start: float | None = None) -> None:
        """Schedule ``action`` every ``period`` seconds for ever, first at ``start``, or now if that is None.

        The times are multiples of the period after the first call, so that delays do not add up.
        """
        begin = self.clock.now() if start is None else start
        times = count()

        def again() -> None:
            action()
            self.call_at(begin + next(times) * period, again)

        self.call_at(begin + next(times) * period, again)

    def run_until(self, until: float, stop: Callable[[], bool] = never_stop) -> None:
        """Advance the clock to ``until`` and run the actions that are due; end earlier once ``stop`` returns True."""
        clock, due = self.clock, self._queue
        while due and due[0][0] <= until:
            time, _, action = heappop(due)
            clock.advance_to(time)
            action()
            if stop():
                return
        clock.advance_to(until)
