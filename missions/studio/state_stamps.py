"""Stamps of the states that a run sends, by which it knows how old the state behind a drive command is."""

from collections import OrderedDict
from collections.abc import Callable
from secrets import randbits

from drivers.clock import Clock

STAMP_BITS = 53
"""Bits of a stamp: JavaScript has no larger whole numbers."""

KEPT_TIME = 10.0
"""Seconds for which the age of a stamp is known."""

MAX_KEPT_STAMPS = 1024


class StateStamps:
    """Draws a stamp for each state, and remembers when it was issued. For one thread.

    Stamps are drawn by chance, not counted: a client cannot name one that it has not received. Only this clock is
    read, so that clocks of clients do not matter.
    """

    def __init__(self, clock: Clock, draw: Callable[[], int] = lambda: randbits(STAMP_BITS)) -> None:
        self._clock, self._draw = clock, draw
        self._issued: OrderedDict[int, float] = OrderedDict()

    def issue(self) -> int:
        """Return the stamp of a state that is sent now."""
        now = self._clock.now()
        while self._issued and (len(self._issued) >= MAX_KEPT_STAMPS or now - self._oldest > KEPT_TIME):
            self._issued.popitem(last=False)
        stamp = self._draw()
        while stamp in self._issued:
            stamp = self._draw()
        self._issued[stamp] = now
        return stamp

    def issued_at(self, stamp: int) -> float | None:
        """Return when a stamp was issued, by the clock of this run; None for one unknown or forgotten."""
        return self._issued.get(stamp)

    @property
    def _oldest(self) -> float:
        return next(iter(self._issued.values()))
