"""Summary of many runs: success rate, times, and causes of failure."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import sqrt
from operator import eq

import numpy as np

from missions.plugins.testing.sweep.variation import DrawnValue, SweepRow, ValueRange, Variation

# How often runs succeed for each part of the range of what was varied.

# A success rate, and how far it can be trusted.

Z95 = 1.959963984540054
"""Standard normal quantile at 97.5 %, for 95 % intervals."""


def wilson(successes: int, runs: int) -> tuple[float, float]:
    """Return the 95 % interval of a success rate: Wilson's score interval, (0, 1) without a run.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927), 209-212. It
    stays within 0..1 and holds for rates near the ends, where the usual p +- 1.96 s does not.
    """
    if runs == 0:
        return 0.0, 1.0
    share, z2 = successes / runs, Z95**2
    middle = (share + z2 / (2 * runs)) / (1 + z2 / runs)
    half = Z95 * sqrt(share * (1 - share) / runs + z2 / (4 * runs**2)) / (1 + z2 / runs)
    # At the ends the formula gives 0 and 1 but for rounding.
    return (0.0 if successes == 0 else middle - half), (1.0 if successes == runs else middle + half)


@dataclass(frozen=True, slots=True)
class Rate:
    """Success rate of a sweep: number of successes in ``runs``."""

    successes: int
    runs: int

    @property
    def share(self) -> float:
        """Share of successes, 0 without a run."""
        return self.successes / self.runs if self.runs else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the share of successes."""
        return wilson(self.successes, self.runs)


RANGE_BIN_COUNT = 5
"""Number of bins into which the range of a varied parameter is cut."""

MAX_UNCUT_RANGE = 10
"""Largest count of whole numbers in a range that is not cut: each number has its own bin."""

Pairs = Sequence[tuple[DrawnValue, SweepRow]]
"""Runs of a sweep, each with its value of one varied parameter."""


@dataclass(frozen=True, slots=True)
class Bin:
    """Runs whose parameter lies in one part of its range, or has one value.

    ``low`` and ``high`` are the limits of the bin on an axis: numbers, or the index of a word in the list of values.
    """

    label: str
    low: float
    high: float
    rate: Rate


def bin_runs(variation: Variation, pairs: Pairs) -> list[Bin]:
    """Return the bins of a variation, with the runs in each."""
    values = variation.values
    if not isinstance(values, ValueRange):
        return _bin_per_value(variation, list(dict.fromkeys(values.values)), pairs)
    low, high = values.low, values.high
    if isinstance(low, int) and isinstance(high, int) and high - low < MAX_UNCUT_RANGE:
        return _bin_per_value(variation, list(range(low, high + 1)), pairs)
    edges = [low + (high - low) * part / RANGE_BIN_COUNT for part in range(RANGE_BIN_COUNT)] + [float(high)]
    return [
        Bin(f"{a:.4g} to {b:.4g}", a, b, _rate(pairs, _range_test(a, b, last=b == high))) for a, b in pairwise(edges)
    ]


def _bin_per_value(variation: Variation, values: Sequence[DrawnValue], pairs: Pairs) -> list[Bin]:
    return [
        Bin(variation.text(value), place, place + 1, _rate(pairs, partial(eq, value)))
        for place, value in enumerate(values)
    ]


def _range_test(low: float, high: float, *, last: bool) -> Callable[[DrawnValue], bool]:
    """Return the test for values from ``low`` to below ``high``; for the ``last`` bin, up to and including ``high``."""

    def within(value: DrawnValue) -> bool:
        return not isinstance(value, str) and (low <= value < high or (last and value == high))

    return within


def _rate(pairs: Pairs, holds: Callable[[DrawnValue], bool]) -> Rate:
    found = [row for value, row in pairs if holds(value)]
    return Rate(sum(row.result == "success" for row in found), len(found))


MAX_WORST_RUNS = 5
"""Number of worst runs that are reported."""

_NUMBER = re.compile(r"[-+]?[0-9]+(?:\.[0-9]+)?(?:e[-+]?[0-9]+)?")


def cause_of(row: SweepRow) -> str:
    """Return the reason of a failed run, without its numbers, which differ between runs; empty for a success."""
    if row.result == "success":
        return ""
    reason = _NUMBER.sub("#", row.reason.partition("\n")[0])
    return f"error: {reason}" if row.result == "error" else reason or row.result


@dataclass(frozen=True, slots=True)
class RunTimes:
    """Statistics of the simulated seconds that successful runs took."""

    median: float
    p5: float
    p95: float
    longest: float


@dataclass(frozen=True, slots=True)
class Cause:
    """Cause of failures: the number of runs that failed for it, and the first of these runs."""

    text: str
    runs: int
    seed: int


@dataclass(frozen=True, slots=True)
class Summary:
    """Summary of all rows of a sweep. The keys of ``bins`` are titles of variations."""

    rate: Rate
    times: RunTimes | None
    causes: tuple[Cause, ...]
    bins: dict[str, tuple[Bin, ...]]
    worst: tuple[SweepRow, ...]


def summarise(rows: Sequence[SweepRow], variations: Sequence[Variation]) -> Summary:
    """Return the summary of ``rows``, which are sorted by seed."""
    good = [row.seconds for row in rows if row.result == "success"]
    return Summary(
        Rate(len(good), len(rows)),
        _times(good),
        _causes(rows),
        {
            variation.title: tuple(bin_runs(variation, [(row.values[place], row) for row in rows]))
            for place, variation in enumerate(variations)
            if not variation.is_single
        },
        _worst(rows),
    )


def _causes(rows: Sequence[SweepRow]) -> tuple[Cause, ...]:
    """Return the causes of failures, most frequent first.

    Runs whose reasons differ only in their numbers have one cause. Its text has the numbers only if they are equal in
    all these runs.
    """
    found: dict[str, list[SweepRow]] = {}
    for row in rows:
        if text := cause_of(row):
            found.setdefault(text, []).append(row)
    by_count = sorted(found.items(), key=lambda item: (-len(item[1]), item[0]))
    return tuple(Cause(_cause_text(text, rows), len(rows), rows[0].seed) for text, rows in by_count)


def _cause_text(text: str, rows: Sequence[SweepRow]) -> str:
    reasons = {row.reason for row in rows}
    return next(iter(reasons)) if len(reasons) == 1 and rows[0].result != "error" and rows[0].reason else text


def _times(seconds: Sequence[float]) -> RunTimes | None:
    if not seconds:
        return None
    p5, median, p95 = (float(each) for each in np.quantile(seconds, [0.05, 0.5, 0.95]))
    return RunTimes(median, p5, p95, max(seconds))


def _worst(rows: Sequence[SweepRow]) -> tuple[SweepRow, ...]:
    """Return the most informative runs: one of each cause, the longest failures first, then the slowest successes."""
    order = {"error": 0, "failure": 1, "unfinished": 1, "success": 2}
    rows = sorted(rows, key=lambda row: (order[row.result], -row.seconds, row.seed))
    firsts = {cause_of(row): row for row in reversed(rows) if cause_of(row)}
    leading = [row for row in rows if firsts.get(cause_of(row)) is row]
    return tuple([*leading, *(row for row in rows if row not in leading)][:MAX_WORST_RUNS])
