"""Simulated time: it jumps from one thing that is due to the next, as fast as the machine allows."""

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count

from drivers.clock import ManualClock

TimedAction = Callable[[], object]
"""Something that is done when its time has come; it reads the time from the clock."""


def never_stop() -> bool:
    """Do not stop early."""
    return False


class Timeline:
    """A clock, and what is to happen when on it. For one thread.

    What falls due at the same time is done in the order in which it was asked for, so two runs are alike.
    """

    def __init__(self) -> None:
        self.clock = ManualClock()
        self._queue: list[tuple[float, int, TimedAction]] = []
        self._order = count()

    def call_at(self, time: float, action: TimedAction) -> None:
        """Do ``action`` at ``time`` (seconds); at once, with the next step, if that is over."""
        heappush(self._queue, (time, next(self._order), action))

    def call_every(self, period: float, action: TimedAction, *, start: float | None = None) -> None:
        """Do ``action`` every ``period`` seconds for ever, from ``start`` or now on, on an absolute schedule."""
        begin = self.clock.now() if start is None else start
        times = count()

        def again() -> None:
            action()
            self.call_at(begin + next(times) * period, again)

        self.call_at(begin + next(times) * period, again)

    def run_until(self, until: float, stop: Callable[[], bool] = never_stop) -> None:
        """Let time pass to ``until``, doing what falls due by then; less far once ``stop`` says so."""
        clock, due = self.clock, self._queue
        while due and due[0][0] <= until:
            time, _, action = heappop(due)
            clock.advance_to(time)
            action()
            if stop():
                return
        clock.advance_to(until)
