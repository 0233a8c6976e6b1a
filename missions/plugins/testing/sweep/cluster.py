"""A sweep over a Dask cluster, for more runs than one machine can do. Needs the extra ``cluster``."""

from collections.abc import Generator, Sequence

from distributed import Client, Future, KilledWorker, as_completed

from drivers.errors import NotConnected
from missions.plugins.testing.sweep.processes import Work, chunks, dead
from missions.plugins.testing.sweep.sweep import Sweep, run_some
from missions.plugins.testing.sweep.variation import Row

START_TIMEOUT = 15.0
"""Seconds that the scheduler and its first worker have to answer."""


def run_on_cluster(
    address: str, sweep: Sweep, seeds: Sequence[int], *, work: Work = run_some, patience: float = START_TIMEOUT
) -> Generator[Row]:
    """Yield a row for every seed, in the order in which they are done, from the workers of the cluster at ``address``.

    The rows are those of ``run_here``. Dask gives the work of a worker that died to others; the seeds that were lost
    with several are run again one by one, and those that kill their workers again get a row that says so.
    Close the iterator to stop: what was not begun is taken back.
    Raises NotConnected when nobody answers there.
    """
    with _connected(address, patience) as client:
        workers = max(1, sum(client.nthreads().values()))
        given = {_submit(client, work, sweep, chunk): chunk for chunk in chunks(seeds, workers)}
        suspects: list[int] = []
        try:
            for future in as_completed(given, loop=client.loop):
                if isinstance(future.exception(), KilledWorker):
                    suspects += given[future]
                else:
                    yield from future.result()
        finally:
            client.cancel(list(given))
        for seed in sorted(suspects):  # one at a time: some have only waited beside the one that kills
            future = _submit(client, work, sweep, [seed])
            yield from [dead(sweep, seed)] if isinstance(future.exception(), KilledWorker) else future.result()


def _connected(address: str, patience: float) -> Client:
    hint = f"start one with `dask scheduler`, and workers with `dask worker {address} --nthreads 1`"
    try:
        client = Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError) as error:
        raise NotConnected(f"dask: no scheduler answers at {address}: {error}", hint=hint) from error
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError as error:
        client.close()
        raise NotConnected(f"dask: the scheduler at {address} has no worker", hint=hint) from error
    return client


def _submit(client: Client, work: Work, sweep: Sweep, chunk: Sequence[int]) -> Future:
    # Not pure: what was asked for in an earlier sweep is run again, for the files may have changed since.
    return client.submit(work, sweep, list(chunk), pure=False)
