"""Waiting in real time for what another thread or program will do."""

from collections.abc import Callable
from threading import Event

from drivers.clock import SystemClock

SHARE = 0.1
"""How much later than need be it may be noticed that something has come true, as a share of the time until then."""


def wait_until(holds: Callable[[], object], seconds: float = 60.0, *, pause: float = 0.1) -> None:
    """Poll until ``holds`` is true; fail the test after ``seconds``, which are many: machines are shared.

    The longer it waits the less often it looks, for looking costs what others wait for; ``pause`` is the longest time
    between two looks, in seconds. Whoever commands something in ``holds`` gives a short one.
    """
    clock, event = SystemClock(), Event()
    while not holds():
        waited = clock.now()
        assert waited < seconds, f"it did not come true within {seconds:g} s"
        event.wait(min(pause, max(0.002, SHARE * waited)))
