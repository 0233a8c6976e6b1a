"""Two people who cross, as rendered: the benchmark's scenes, a few of them."""

from tests.benchmarks.crossing import crossing, kept


def test_crossing_people_keep_their_ids() -> None:
    assert sum(kept(crossing(seed)) for seed in (2, 4, 6, 11)) >= 3
