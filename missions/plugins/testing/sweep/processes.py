"""A sweep over the cores of this machine: a worker process for each, and what happens when one dies."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from missions.plugins.testing.sweep.sweep import Sweep, run_some
from missions.plugins.testing.sweep.variation import Row
from missions.plugins.testing.with_parent import end_with_parent

CHUNK = 8
"""Seeds that a worker gets at a time, at most: enough to read the mission rarely, few enough to see the sweep go on."""

AHEAD = 2
"""Chunks for each worker that are with the pool: one that it runs, and one that it takes next."""

DEAD = "the worker process died in this run"
"""The reason of a run that killed its worker."""

Chunk = Sequence[int]
Work = Callable[[Sweep, Chunk], list[Row]]


def chunks(seeds: Chunk, workers: int) -> list[Chunk]:
    """Cut ``seeds`` into pieces, small enough that all workers are busy to the end."""
    size = max(1, min(CHUNK, len(seeds) // (4 * workers)))
    return [seeds[start : start + size] for start in range(0, len(seeds), size)]


def run_here(sweep: Sweep, seeds: Chunk, workers: int, *, work: Work = run_some) -> Generator[Row]:
    """Yield a row for every seed, in the order in which they are done, from ``workers`` processes.

    When a worker dies, the seeds that were with the pool are run again one by one, and those that kill their worker
    again get a row that says so. Close the iterator to stop: the workers end at once.
    """
    waiting = deque(chunks(seeds, workers))
    while waiting:
        lost: list[int] = []
        yield from _pooled(sweep, waiting, lost, workers, work)
        yield from _one_by_one(sweep, lost, work)


def _pooled(sweep: Sweep, waiting: deque[Chunk], lost: list[int], workers: int, work: Work) -> Iterator[Row]:
    """Run what waits; once a worker has died, give up, and add the seeds that were with the pool to ``lost``."""
    running: dict[Future[list[Row]], Chunk] = {}
    with _pool(min(workers, len(waiting))) as pool:
        try:
            while waiting or running:
                while waiting and len(running) < AHEAD * workers:
                    running[_submit(pool, work, sweep, waiting[0])] = waiting[0]
                    waiting.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    rows = future.result()
                    del running[future]
                    yield from rows
        except BrokenProcessPool:
            lost += sorted(seed for chunk in running.values() for seed in chunk)


def _one_by_one(sweep: Sweep, seeds: Sequence[int], work: Work) -> Iterator[Row]:
    """Run seeds alone in one worker, with another after each that kills it."""
    waiting = deque(seeds)
    while waiting:
        with _pool(1) as pool:
            try:
                while waiting:
                    yield from _submit(pool, work, sweep, [waiting[0]]).result()
                    waiting.popleft()
            except BrokenProcessPool:
                yield dead(sweep, waiting.popleft())


def dead(sweep: Sweep, seed: int) -> Row:
    """Return the row of a run that killed its worker."""
    return Row(seed, sweep.draw(seed), "error", DEAD, 0.0, 0)


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Have some workers; whatever ends it but its own end, Ctrl-C above all, ends them at once."""
    others = set(multiprocessing.active_children())
    # Not forked: a fork takes along whatever threads have locked.
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"), initializer=end_with_parent)
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()  # any other signal, a run would take as its own
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _submit(pool: ProcessPoolExecutor, work: Work, sweep: Sweep, chunk: Chunk) -> Future[list[Row]]:
    """Hand on some work, which may start a worker."""
    with _undisturbed():
        return pool.submit(_mortal, work, sweep, chunk)


def _mortal(work: Work, sweep: Sweep, chunk: Chunk) -> list[Row]:
    """Do some work, and die of a signal that would otherwise only end one run."""
    try:
        return work(sweep, chunk)
    except KeyboardInterrupt:
        os._exit(1)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Start processes that never hear Ctrl-C, for this one is to end them; a Ctrl-C meanwhile is raised afterwards."""
    heard: list[int] = []
    ours = threading.current_thread() is threading.main_thread()  # no other hears of it
    handler = signal.signal(signal.SIGINT, lambda number, _: heard.append(number)) if ours else None
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # as it is in what is started now
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        if ours:
            signal.signal(signal.SIGINT, handler)
    if heard:
        raise KeyboardInterrupt
