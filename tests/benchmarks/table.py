"""Ratios measured side by side in one process: in turn, many times over, the median of each pair."""

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Row:
    """One comparison: seconds per call of ours and theirs, their ratio, and the bound it is to keep (None: none)."""

    name: str
    ours: float
    theirs: float
    ratio: float
    bound: float | None = None

    def as_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        bound = "" if self.bound is None else f"   (at most {self.bound:g}{'' if self.ratio <= self.bound else ' !'})"
        return f"{self.name:<44} {_time(self.ours):>10} {_time(self.theirs):>10} {self.ratio:8.3f}{bound}"


def compare(
    name: str,
    ours: Callable[[], object],
    theirs: Callable[[], object],
    *,
    calls: int = 100,
    rounds: int = 15,
    bound: float | None = None,
) -> Row:
    """Time ``calls`` calls of each in turn, ``rounds`` times; the ratio is the median of the rounds' ratios."""
    ours()
    theirs()
    pairs = [(_timed(ours, calls), _timed(theirs, calls)) for _ in range(rounds)]
    return Row(
        name,
        statistics.median(mine for mine, _ in pairs),
        statistics.median(other for _, other in pairs),
        statistics.median(mine / other for mine, other in pairs),
        bound,
    )


def _timed(work: Callable[[], object], calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        work()
    return (time.perf_counter() - start) / calls


def _time(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.2f} {unit}"
    return f"{seconds * 1e9:.0f} ns"
