"""How long it takes from an event to the leaf that waits for it, against a bare thread that waits for a flag."""

import statistics
import threading
import time
from collections.abc import Callable, Iterator

from py_trees.common import Status

from behaviours.leaf import RUNNING, Leaf
from behaviours.run import RunState
from drivers.clock import SystemClock
from missions.executive.executive import Executive
from missions.executive.stream import EventStream
from tests.benchmarks.table import Row

WAKES = 300
PAUSE = 0.003
"""Seconds between two wakes, which fall anywhere between two scheduled ticks."""


class Listener(Leaf):
    """Notes when it is ticked."""

    heard = 0.0

    def update(self) -> Status:
        self.heard = time.perf_counter()
        return RUNNING


def rows() -> Iterator[Row]:
    """Yield the median delay of both."""
    ours, theirs = statistics.median(_through_the_executive()), statistics.median(_bare())
    yield Row("from an event to the leaf (median)", ours, theirs, ours / theirs)


def _through_the_executive() -> list[float]:
    leaf = Listener("listener")
    leaf.run = RunState(SystemClock())
    executive = Executive(leaf, leaf.run, EventStream(), rate=1.0)
    loop = threading.Thread(target=executive.loop)
    loop.start()
    try:
        return _delays(leaf.run.wake, lambda: leaf.heard)
    finally:
        executive.stop("measured")
        loop.join()


def _bare() -> list[float]:
    flag, ending, heard = threading.Event(), threading.Event(), [0.0]

    def wait() -> None:
        while not ending.is_set():
            if flag.wait(1.0):
                flag.clear()
                heard[0] = time.perf_counter()

    thread = threading.Thread(target=wait)
    thread.start()
    try:
        return _delays(flag.set, lambda: heard[0])
    finally:
        ending.set()
        flag.set()
        thread.join()


def _delays(wake: Callable[[], None], heard: Callable[[], float]) -> list[float]:
    found = []
    for _ in range(WAKES):
        time.sleep(PAUSE)
        start = time.perf_counter()
        wake()
        while heard() < start:
            time.sleep(0.0)
        found.append(heard() - start)
    return found
