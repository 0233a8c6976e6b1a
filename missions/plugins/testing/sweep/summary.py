"""What many runs say together: how often they succeed, how long that takes, and why the others fail."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from missions.plugins.testing.sweep.bins import Bin, Rate, bins
from missions.plugins.testing.sweep.variation import Row, Variation

WORST = 5
"""How many of the worst runs are told of."""

_NUMBER = re.compile(r"[-+]?[0-9]+(?:\.[0-9]+)?(?:e[-+]?[0-9]+)?")


def cause(row: Row) -> str:
    """Return why a run did not succeed, without the numbers in which runs differ; empty for a success."""
    if row.result == "success":
        return ""
    reason = _NUMBER.sub("#", row.reason.partition("\n")[0])
    return f"error: {reason}" if row.result == "error" else reason or row.result


@dataclass(frozen=True, slots=True)
class Times:
    """Simulated seconds of the runs that succeeded."""

    median: float
    p5: float
    p95: float
    longest: float


@dataclass(frozen=True, slots=True)
class Cause:
    """Why some runs did not succeed: how many, and the first of them."""

    text: str
    runs: int
    seed: int


@dataclass(frozen=True, slots=True)
class Summary:
    """What all rows say together. ``bins`` are by the title of a variation."""

    rate: Rate
    times: Times | None
    causes: tuple[Cause, ...]
    bins: dict[str, tuple[Bin, ...]]
    worst: tuple[Row, ...]


def summarise(rows: Sequence[Row], variations: Sequence[Variation]) -> Summary:
    """Return the summary of ``rows``, which are in the order of their seeds."""
    good = [row.seconds for row in rows if row.result == "success"]
    return Summary(
        Rate(len(good), len(rows)),
        _times(good),
        _causes(rows),
        {
            variation.title: tuple(bins(variation, [(row.values[place], row) for row in rows]))
            for place, variation in enumerate(variations)
            if not variation.is_single
        },
        _worst(rows),
    )


def _causes(rows: Sequence[Row]) -> tuple[Cause, ...]:
    """Return the causes, most frequent first; with their numbers where all runs have the same."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        if text := cause(row):
            found.setdefault(text, []).append(row)
    by_count = sorted(found.items(), key=lambda item: (-len(item[1]), item[0]))
    return tuple(Cause(_words(text, rows), len(rows), rows[0].seed) for text, rows in by_count)


def _words(text: str, rows: Sequence[Row]) -> str:
    reasons = {row.reason for row in rows}
    return next(iter(reasons)) if len(reasons) == 1 and rows[0].result != "error" and rows[0].reason else text


def _times(seconds: Sequence[float]) -> Times | None:
    if not seconds:
        return None
    p5, median, p95 = (float(each) for each in np.quantile(seconds, [0.05, 0.5, 0.95]))
    return Times(median, p5, p95, max(seconds))


def _worst(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Return the runs to look at first: one of each cause, those that took longest, then the slowest successes."""
    order = {"error": 0, "failure": 1, "unfinished": 1, "success": 2}
    rows = sorted(rows, key=lambda row: (order[row.result], -row.seconds, row.seed))
    firsts = {cause(row): row for row in reversed(rows) if cause(row)}
    leading = [row for row in rows if firsts.get(cause(row)) is row]
    return tuple([*leading, *(row for row in rows if row not in leading)][:WORST])
