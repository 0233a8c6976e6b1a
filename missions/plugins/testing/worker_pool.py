"""Plays many cases, or whatever else takes long, at a time, each in a process that has nothing else to do."""

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import TypeVar

import cv2

from missions.plugins.testing.case_verdict import CaseVerdict, play
from missions.plugins.testing.suite import Case
from missions.plugins.testing.worker_lifetime import end_with_parent

T = TypeVar("T")
R = TypeVar("R")

PROCESS_ENDED = "its process came to an end: a behaviour held a tick for good, or ended it"


def core_count() -> int:
    """Return how many processes can really run at a time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def play_all(cases: Sequence[Case], *, jobs: int) -> Generator[CaseVerdict, None, None]:
    """Play ``cases`` in up to ``jobs`` processes, and yield each verdict as soon as it is there. See ``run_parallel``."""
    return run_parallel(play, cases, lambda case: CaseVerdict(case, error=PROCESS_ENDED), jobs=jobs)


def run_parallel(
    work: Callable[[T], R], items: Sequence[T], on_lost: Callable[[T], R], *, jobs: int
) -> Generator[R, None, None]:
    """Do ``work`` with each of some ``things`` in up to ``jobs`` processes; yield what comes of each when it is there.

    Once the generator is closed, or interrupted, all that is being done ends at once. What ends its process takes down
    those beside it; they are done again, each alone, so that it is clear which it was: of that comes ``gone``.
    """
    lost: list[T] = []
    others = active_children()
    with _make_pool(min(jobs, len(items))) as pool:
        with _ignore_interrupts():
            playing = {pool.submit(work, thing): thing for thing in items}
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
    for thing in lost:
        yield _run_alone(work, thing, on_lost)


def _run_alone(work: Callable[[T], R], thing: T, on_lost: Callable[[T], R]) -> R:
    with _make_pool(1) as pool:
        with _ignore_interrupts():
            playing = pool.submit(work, thing)
        try:
            return playing.result()
        except BrokenProcessPool:
            return on_lost(thing)


def _make_pool(jobs: int) -> ProcessPoolExecutor:
    # Spawned, not forked: a fork would take over locks of threads that it does not have.
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_prepare)


def _prepare() -> None:
    """Prepare a process that is one of several: OpenCV has no cores to itself, and its parent may be killed."""
    end_with_parent()
    cv2.setNumThreads(1)


@contextmanager
def _ignore_interrupts() -> Iterator[None]:
    """Have processes that begin meanwhile not hear Ctrl-C: it is for this one, which then ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
