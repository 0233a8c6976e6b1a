"""A limit on the time of a piece of work, for a process whose main thread does nothing else."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class TimeLimitError(BaseException):
    """A piece of work takes too long. What handles all errors of the work must not handle this one."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TimeLimitError in what is done within, once so many seconds are over; without a limit beside other threads.

    Only the main thread can be interrupted so, and it may have no other use for SIGALRM.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(*_: object) -> None:
        raise TimeLimitError

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
