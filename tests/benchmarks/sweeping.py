"""How a sweep's speed per core holds from one worker process to two. Means nothing on a machine that is busy."""

from collections.abc import Iterator

from config.library import DEFAULT_WORLD, find_file
from config.yaml_nodes import read_source
from missions.plugins.testing.sweep.processes import run_here
from missions.plugins.testing.sweep.sweep import SweepPlan
from missions.plugins.testing.sweep.variation import ValueRange, Variation
from missions.plugins.testing.sweep.worlds import plain_world
from tests.benchmarks.table import Row, compare

RUNS = 50
"""Runs for each worker: enough that what it takes to start one does not count."""


def rows() -> Iterator[Row]:
    """Yield one row: two workers with twice the runs against one, which would take as long on cores of their own."""
    world = plain_world(read_source(find_file("worlds", DEFAULT_WORLD)))
    far = Variation("person.distance", "m", ValueRange(0.6, 3.0))
    sweep = SweepPlan("greet", world, DEFAULT_WORLD, variations=(far,))

    def one() -> None:
        assert len(list(run_here(sweep, range(RUNS), 1))) == RUNS

    def two() -> None:
        assert len(list(run_here(sweep, range(2 * RUNS), 2))) == 2 * RUNS

    # At least 80 % of the speed per core: at most 1.25 times the time.
    yield compare(f"sweep, {RUNS} greets for each of two workers", two, one, calls=1, rounds=5, bound=1.25)
