"""What a second of simulated time costs, against a second."""

import time
from collections.abc import Iterator
from typing import Literal

import cv2

from missions.request import RunRequest
from missions.runner import Runner
from tests.benchmarks.table import Row

ROUNDS = 5


def rows() -> Iterator[Row]:
    """Yield the cost of greeting with eyes that know the truth, and with eyes that search pictures."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield _row("truth", bound=1 / 100)
        yield _row("pixels", bound=1 / 5)
    finally:
        cv2.setNumThreads(before)


def _row(eyes: Literal["truth", "pixels"], *, bound: float) -> Row:
    spent, simulated = zip(*(_greet(eyes, seed) for seed in range(ROUNDS)), strict=True)
    share = sum(spent) / sum(simulated)
    return Row(f"a second of greet, eyes: {eyes}", share, 1.0, share, bound)


def _greet(eyes: Literal["truth", "pixels"], seed: int) -> tuple[float, float]:
    """Return the seconds that a run took, and the seconds that passed in it."""
    runner = Runner(RunRequest("greet", simulate="fast", eyes=eyes, seed=seed))
    start = time.perf_counter()
    seconds = runner.run().seconds
    return time.perf_counter() - start, seconds
