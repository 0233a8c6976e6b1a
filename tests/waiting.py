"""Waiting in real time for what another thread or program will do."""

from collections.abc import Callable
from threading import Event

from drivers.clock import SystemClock


def wait_until(holds: Callable[[], object], seconds: float = 60.0) -> None:
    """Poll until ``holds`` is true; fail the test after ``seconds``, which are many: machines are shared."""
    clock, pause = SystemClock(), Event()
    while not holds():
        assert clock.now() < seconds, f"it did not come true within {seconds:g} s"
        pause.wait(0.01)
