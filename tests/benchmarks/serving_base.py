"""What the driver's own thread costs that serves a Kobuki, 50 reports a second, while somebody drives it.

The base is behind its pseudo-terminal in a process of its own. An FTDI adapter hands a report over in more pieces than
that, about seven with its latency timer at 1 ms: then the thread wakes up more often.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import suppress

from drivers.api import Velocity
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.kobuki.driver import kobuki_base
from drivers.kobuki.wire import BAUD
from drivers.transport.link import SerialLink
from tests.benchmarks.table import Row
from tests.missions.lone_base import lone_base

WATCHED = 5.0
"""Seconds for which the thread is watched."""
TICK = 0.05
"""Seconds between two commands, as a mission gives them."""


def rows() -> Iterator[Row]:
    """Yield the share of a core, and how many reports that is for."""
    with lone_base() as lone:
        share, rate = serve(lone.port)
    yield Row("the thread that serves the base: its share of a core", share, 1.0, share, 0.03)
    yield Row("the reports that it takes, beside 50 a second", 1 / rate, 1 / 50, rate / 50)


def serve(port: str) -> tuple[float, float]:
    """Drive the base behind ``port``; return the share of a core, and the reports a second."""
    clock, pause = SystemClock(), threading.Event()
    base = kobuki_base(SerialLink("base", port, BAUD), clock)
    base.open()
    try:
        while not base.health().online:
            pause.wait(TICK)
        (thread,) = (each for each in threading.enumerate() if each.name == "link base")
        processor = time.pthread_getcpuclockid(thread.ident or 0)
        reports, busy, start = base.health().counters["frames"], time.clock_gettime(processor), time.perf_counter()
        while (passed := time.perf_counter() - start) < WATCHED:
            with suppress(NotConnected):  # where this machine stops for a while, the base seems to be silent
                base.drive(Velocity(0.2, 0.5))
            pause.wait(TICK)
        busy = time.clock_gettime(processor) - busy
        return busy / passed, (base.health().counters["frames"] - reports) / passed
    finally:
        base.close()
