"""Plays many cases at a time, each in a process that has nothing else to do."""

import os
import signal
import threading
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context

import cv2

from missions.testing.play import Verdict, play
from missions.testing.suite import Case

GONE = "its process came to an end: a behaviour held a tick for good, or ended it"


def cores() -> int:
    """Return how many processes can really run at a time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def play_all(cases: Sequence[Case], *, jobs: int) -> Generator[Verdict, None, None]:
    """Play ``cases`` in up to ``jobs`` processes, and yield each verdict as soon as it is there.

    Once the generator is closed, or interrupted, all that is being played ends at once. A case whose process ends
    itself takes down those beside it; they are played again, each alone, so that it is clear which it was.
    """
    lost: list[Case] = []
    others = active_children()
    with _pool(min(jobs, len(cases))) as pool:
        with _deaf():
            playing = {pool.submit(play, case): case for case in cases}
        try:
            for future in as_completed(playing):
                if isinstance(future.exception(), BrokenProcessPool):
                    lost.append(playing[future])
                else:
                    yield future.result()
        except BaseException:  # nobody waits for what is left, and it may take long
            pool.shutdown(wait=False, cancel_futures=True)
            for process in active_children():
                if process not in others:
                    process.kill()  # a run would take any other signal for its own
            raise
    for case in lost:
        yield _alone(case)


def _alone(case: Case) -> Verdict:
    with _pool(1) as pool:
        with _deaf():
            playing = pool.submit(play, case)
        try:
            return playing.result()
        except BrokenProcessPool:
            return Verdict(case, error=GONE)


def _pool(jobs: int) -> ProcessPoolExecutor:
    # Spawned, not forked: a fork would take over locks of threads that it does not have.
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_prepare)


def _prepare() -> None:
    """Prepare a process that is one of several: OpenCV has no cores to itself."""
    cv2.setNumThreads(1)


@contextmanager
def _deaf() -> Iterator[None]:
    """Have processes that begin meanwhile not hear Ctrl-C: it is for this one, which then ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
