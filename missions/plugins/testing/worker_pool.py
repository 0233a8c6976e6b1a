"""Runs many cases, or other long work, in parallel in processes of their own."""

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

PROCESS_ENDED = "its process ended: a behaviour blocked a tick for ever, or ended the process"


def core_count() -> int:
    """Return the number of CPU cores available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def play_all(cases: Sequence[Case], *, jobs: int) -> Generator[CaseVerdict, None, None]:
    """Run the test ``cases`` in up to ``jobs`` processes; yield each verdict when it is ready. See ``run_parallel``."""
    return run_parallel(play, cases, lambda case: CaseVerdict(case, error=PROCESS_ENDED), jobs=jobs)


def run_parallel(
    work: Callable[[T], R], items: Sequence[T], on_lost: Callable[[T], R], *, jobs: int
) -> Generator[R, None, None]:
    """Call ``work`` for each of ``items`` in up to ``jobs`` processes; yield each result when it is ready.

    When the generator is closed or interrupted, all work ends at once. If one process dies, the unfinished work of all
    processes is lost. It is then repeated, each item in a process of its own. For an item whose process dies again, the
    result is ``on_lost(item)``.
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
        except BaseException:  # do not wait for the remaining work, which may take long
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
    """Initialise a worker: one thread for OpenCV, and an end with the parent, even if that is killed."""
    end_with_parent()
    cv2.setNumThreads(1)


@contextmanager
def _ignore_interrupts() -> Iterator[None]:
    """Make processes that are started in the context ignore Ctrl-C: this process handles it, and ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
