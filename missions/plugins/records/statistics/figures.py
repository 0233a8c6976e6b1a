"""Statistics of runs as plain values.

Each single duration and delay is stored, so that the quantiles of several runs together are exact.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Times = npt.NDArray[np.float64]
"""Durations or delays in seconds, float64, shape (n,)."""

NO_TIMES: Times = np.empty(0)


class RunKind(NamedTuple):
    """Kind of a run: mission, robot, and kind of simulation ("" for hardware)."""

    mission: str
    robot: str
    simulate: str


MAX_KEY_DIGITS = 9
"""Number of digits from which on a number in a node key, such as "1.2", is taken for damaged data."""


class NodeLabel(NamedTuple):
    """A node of a tree: key, kind, title, file and line."""

    key: str
    kind: str
    title: str
    file: str
    line: int

    @property
    def sort_key(self) -> tuple[int, ...]:
        """Sort key in the order of the file; invalid keys come first."""
        parts = self.key.split(".")
        return tuple(map(int, parts)) if all(part.isdecimal() and len(part) < MAX_KEY_DIGITS for part in parts) else ()


@dataclass(frozen=True, slots=True)
class TimeQuantiles:
    """Number, quantiles (median, 95 %, 99 %) and maximum of durations or delays, in seconds."""

    count: int
    median: float
    p95: float
    p99: float
    longest: float


@dataclass(frozen=True, slots=True)
class NodeFigures:
    """Statistics of a node: ticks, results of its runs, and their durations.

    ``unended`` counts runs that were still going at the end of the record; ``durations`` includes them.
    """

    ticks: int = 0
    success: int = 0
    failure: int = 0
    halted: int = 0
    unended: int = 0
    durations: Times = field(default_factory=lambda: NO_TIMES)

    @property
    def runs(self) -> int:
        """Number of runs of the node, with any result."""
        return self.success + self.failure + self.halted + self.unended

    @property
    def seconds(self) -> float:
        """Total running time of the node (s)."""
        return float(self.durations.sum())


@dataclass(frozen=True, slots=True)
class WireFigures:
    """Statistics of an operation on a bus: count, total time and longest time (s)."""

    count: int
    seconds: float
    longest: float

    @property
    def mean(self) -> float:
        """Mean time of an operation (s); 0 without operations."""
        return self.seconds / self.count if self.count else 0.0


@dataclass(frozen=True, slots=True)
class Stats:
    """Statistics of one or more runs of the same kind.

    ``seconds`` and ``ticks`` are totals. ``overruns`` are ticks missed because an earlier tick took too long.
    ``delays`` are lists of single delays (s) by name, ``wires`` the bus statistics by device and operation, and
    ``counts`` all other device counters.
    """

    kind: RunKind
    records: int
    results: Mapping[str, int]
    seconds: float
    ticks: int
    overruns: int
    nodes: Mapping[NodeLabel, NodeFigures]
    delays: Mapping[str, Times]
    wires: Mapping[tuple[str, str], WireFigures]
    counts: Mapping[tuple[str, str], int]


def time_quantiles(times: Times) -> TimeQuantiles:
    """Return the quantiles of times; there must be at least one time."""
    median, p95, p99 = (float(each) for each in np.quantile(times, [0.5, 0.95, 0.99]))
    return TimeQuantiles(len(times), median, p95, p99, float(times.max()))


def merge_stats(found: Iterable[Stats]) -> Sequence[Stats]:
    """Return the statistics merged by kind of run, in order of first appearance."""
    by_kind: dict[RunKind, Stats] = {}
    for stats in found:
        before = by_kind.get(stats.kind)
        by_kind[stats.kind] = stats if before is None else _merge_two(before, stats)
    return tuple(by_kind.values())


def _merge_two(one: Stats, other: Stats) -> Stats:
    return replace(
        one,
        records=one.records + other.records,
        results=Counter(one.results) + Counter(other.results),
        seconds=one.seconds + other.seconds,
        ticks=one.ticks + other.ticks,
        overruns=one.overruns + other.overruns,
        nodes={
            place: _merge_nodes(one.nodes.get(place, NodeFigures()), other.nodes.get(place, NodeFigures()))
            for place in dict.fromkeys((*one.nodes, *other.nodes))
        },
        delays={
            name: np.concatenate((one.delays.get(name, NO_TIMES), other.delays.get(name, NO_TIMES)))
            for name in dict.fromkeys((*one.delays, *other.delays))
        },
        wires={
            name: _merge_wires([stats.wires[name] for stats in (one, other) if name in stats.wires])
            for name in dict.fromkeys((*one.wires, *other.wires))
        },
        counts={
            name: one.counts.get(name, 0) + other.counts.get(name, 0)
            for name in dict.fromkeys((*one.counts, *other.counts))
        },
    )


def _merge_nodes(one: NodeFigures, other: NodeFigures) -> NodeFigures:
    return NodeFigures(
        one.ticks + other.ticks,
        one.success + other.success,
        one.failure + other.failure,
        one.halted + other.halted,
        one.unended + other.unended,
        np.concatenate((one.durations, other.durations)),
    )


def _merge_wires(wires: Sequence[WireFigures]) -> WireFigures:
    return WireFigures(
        sum(each.count for each in wires),
        sum(each.seconds for each in wires),
        max(each.longest for each in wires),
    )
