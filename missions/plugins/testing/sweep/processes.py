"""Runs a sweep in worker processes, one for each core, and handles workers that die."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from missions.plugins.testing.sweep.sweep import SweepPlan, run_seeds
from missions.plugins.testing.sweep.variation import SweepRow
from missions.plugins.testing.worker_lifetime import end_with_parent

MAX_CHUNK_SEEDS = 8
"""Maximum number of seeds that a worker gets at a time: large to load the mission rarely, small for steady progress."""

CHUNKS_PER_WORKER = 2
"""Number of chunks of seeds that are submitted at a time for each worker: one running and one queued."""

WORKER_DIED = "the worker process died in this run"
"""Failure reason in the row of a run that killed its worker process."""

Chunk = Sequence[int]
Work = Callable[[SweepPlan, Chunk], list[SweepRow]]


def split_seeds(seeds: Chunk, workers: int) -> list[Chunk]:
    """Split ``seeds`` into chunks small enough to keep all workers busy to the end."""
    size = max(1, min(MAX_CHUNK_SEEDS, len(seeds) // (4 * workers)))
    return [seeds[start : start + size] for start in range(0, len(seeds), size)]


def run_here(sweep: SweepPlan, seeds: Chunk, workers: int, *, work: Work = run_seeds) -> Generator[SweepRow]:
    """Yield a row for every seed, in order of completion, from ``workers`` processes.

    After a worker has died, all seeds that were submitted and have no row run again one by one. A seed whose worker
    dies again gets a row with that reason. Close the iterator to stop: the workers end at once.
    """
    waiting = deque(split_seeds(seeds, workers))
    while waiting:
        lost: list[int] = []
        yield from _run_pooled(sweep, waiting, lost, workers, work)
        yield from _run_one_by_one(sweep, lost, work)


def _run_pooled(
    sweep: SweepPlan, waiting: deque[Chunk], lost: list[int], workers: int, work: Work
) -> Iterator[SweepRow]:
    """Run the ``waiting`` chunks of seeds in a pool of worker processes, and yield the rows.

    If a worker dies, stop, and add all seeds that were submitted but have no row to ``lost``.
    """
    running: dict[Future[list[SweepRow]], Chunk] = {}
    with _worker_pool(min(workers, len(waiting))) as pool:
        try:
            while waiting or running:
                while waiting and len(running) < CHUNKS_PER_WORKER * workers:
                    running[_submit(pool, work, sweep, waiting[0])] = waiting[0]
                    waiting.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    rows = future.result()
                    del running[future]
                    yield from rows
        except BrokenProcessPool:
            lost += sorted(seed for chunk in running.values() for seed in chunk)


def _run_one_by_one(sweep: SweepPlan, seeds: Sequence[int], work: Work) -> Iterator[SweepRow]:
    """Run each seed alone in one worker, which is replaced after a seed kills it."""
    waiting = deque(seeds)
    while waiting:
        with _worker_pool(1) as pool:
            try:
                while waiting:
                    yield from _submit(pool, work, sweep, [waiting[0]]).result()
                    waiting.popleft()
            except BrokenProcessPool:
                yield dead_worker_row(sweep, waiting.popleft())


def dead_worker_row(sweep: SweepPlan, seed: int) -> SweepRow:
    """Return the row of a run that killed its worker."""
    return SweepRow(seed, sweep.draw(seed), "error", WORKER_DIED, 0.0, 0)


@contextmanager
def _worker_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Provide a pool of workers; an exception, such as Ctrl-C, ends them at once."""
    others = set(multiprocessing.active_children())
    # Not forked: a fork would copy locks held by other threads.
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"), initializer=end_with_parent)
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()  # any other signal, a run would take as its own
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _submit(pool: ProcessPoolExecutor, work: Work, sweep: SweepPlan, chunk: Chunk) -> Future[list[SweepRow]]:
    """Submit a chunk of seeds to the pool, which may start a new worker process for it."""
    with _defer_interrupts():
        return pool.submit(_exit_on_interrupt, work, sweep, chunk)


def _exit_on_interrupt(work: Work, sweep: SweepPlan, chunk: Chunk) -> list[SweepRow]:
    """Do the work in a worker process; a Ctrl-C ends the process.

    Otherwise a Ctrl-C would end only the present run, and the worker would go on with its next seed.
    """
    try:
        return work(sweep, chunk)
    except KeyboardInterrupt:
        os._exit(1)


@contextmanager
def _defer_interrupts() -> Iterator[None]:
    """Make processes that are started in the context ignore Ctrl-C.

    If Ctrl-C is pressed meanwhile, KeyboardInterrupt is raised in this process at the end of the context.
    """
    pending: list[int] = []
    ours = threading.current_thread() is threading.main_thread()  # no other hears of it
    handler = signal.signal(signal.SIGINT, lambda number, _: pending.append(number)) if ours else None
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # as it is in what is started now
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        if ours:
            signal.signal(signal.SIGINT, handler)
    if pending:
        raise KeyboardInterrupt
