"""A sweep on a Dask cluster of this machine, and what came of it as JSON: a process for a test, for Dask keeps threads.

Usage: python -m tests.missions.testing.sweep.cluster FOLDER
"""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import dask
from distributed import LocalCluster

from drivers.errors import NotConnected
from missions.plugins.testing.sweep.cluster import run_on_cluster
from missions.plugins.testing.sweep.sweep import run_some
from tests.missions.testing.sweep import labour

RUNS = 12


def main() -> None:
    sweep = labour.glance(Path(sys.argv[1]))
    found: dict[str, object] = {}
    # A run that kills its worker is given up at once: to start others takes longest of all that is tested here.
    dask.config.set({"distributed.scheduler.allowed-failures": 0})
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        rows = run_on_cluster(cluster.scheduler_address, sweep, range(RUNS))
        found["cluster"] = sorted((asdict(row) for row in rows), key=lambda row: int(row["seed"]))
        given_up = run_on_cluster(cluster.scheduler_address, sweep, range(RUNS))
        found["first"] = next(given_up).seed
        given_up.close()
        killed = run_on_cluster(cluster.scheduler_address, sweep, range(4, 7), work=labour.deadly)
        found["killed"] = sorted((row.seed, row.result) for row in killed)
    try:
        next(run_on_cluster(cluster.scheduler_address, sweep, [0], patience=0.5))
    except NotConnected as error:
        found["gone"] = [str(error), error.hint]
    found["here"] = [asdict(row) for row in run_some(sweep, range(RUNS))]
    print(json.dumps(found))  # noqa: T201 - for the test that started it


if __name__ == "__main__":
    main()
