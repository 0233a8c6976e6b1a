"""Clocks, passed as arguments; the only module that reads the machine's clock."""

import time
from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    """Monotonic clock in seconds, with an arbitrary zero."""

    def now(self) -> float:
        """Return the time in seconds."""
        ...


class SystemClock:
    """Monotonic clock of the machine, with its zero at the creation of this object."""

    def __init__(self) -> None:
        self._zero = time.monotonic()

    def now(self) -> float:
        """Return the seconds since this clock was created: the time scale of all stamps of a run in real time."""
        return time.monotonic() - self._zero


class ProcessClock:
    """Clock of the CPU time that this process has used since the creation of this object.

    Other programs on the same computer do not affect it.
    """

    def __init__(self) -> None:
        self._zero = time.process_time()

    def now(self) -> float:
        """Return the CPU time in seconds."""
        return time.process_time() - self._zero


class ManualClock:
    """Fake clock that only moves when it is advanced: for tests and for simulated time."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def advance(self, seconds: float) -> float:
        """Advance by ``seconds`` and return the new time. Raises ValueError for a negative step."""
        if seconds < 0:
            raise ValueError(f"a clock cannot go back by {-seconds} s")
        self._now += seconds
        return self._now

    def advance_to(self, time: float) -> None:
        """Advance to exactly ``time``; ignored if it is in the past."""
        self._now = max(self._now, time)


def unix_time_ns() -> int:
    """Return the time of day in nanoseconds since 1970, for messages to other programs."""
    return time.time_ns()


def time_of_day() -> datetime:
    """Return the time of day in UTC: to date an event, never to measure a duration."""
    return datetime.now(UTC)
