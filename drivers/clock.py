"""Time, handed in: the one place that reads the machine's clock."""

import time
from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    """Seconds that never run backwards, from an arbitrary zero."""

    def now(self) -> float:
        """Return the time in seconds."""
        ...


class SystemClock:
    """The machine's monotonic clock, from 0 at the moment when this object was made."""

    def __init__(self) -> None:
        self._zero = time.monotonic()

    def now(self) -> float:
        """Return the seconds since it was made: every stamp of a run in real time is on this scale."""
        return time.monotonic() - self._zero


class ManualClock:
    """A clock that stands still until it is advanced: for tests and for simulated time."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        """Return the time that ``advance`` has brought it to."""
        return self._now

    def advance(self, seconds: float) -> float:
        """Move on by ``seconds`` and return the new time. Raises ValueError for a step backwards."""
        if seconds < 0:
            raise ValueError(f"a clock cannot go back by {-seconds} s")
        self._now += seconds
        return self._now

    def advance_to(self, time: float) -> None:
        """Move on to ``time``, exactly; a time that is over changes nothing."""
        self._now = max(self._now, time)


def unix_time_ns() -> int:
    """Return the time of day in nanoseconds since 1970, as messages of other programs are stamped."""
    return time.time_ns()


def time_of_day() -> datetime:
    """Return the time of day, in UTC: to say when something was, never to measure how long it took."""
    return datetime.now(UTC)
