"""The figures of runs, as plain values. Every single time is kept, so that quantiles of several runs are true."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Times = npt.NDArray[np.float64]
"""Seconds, float64, shape (n,)."""

NO_TIMES: Times = np.empty(0)


class RunKind(NamedTuple):
    """What kind of run it was: of which mission, on which robot, and how simulated ("" for the real one)."""

    mission: str
    robot: str
    simulate: str


MAX_KEY_DIGITS = 9
"""Letters that no number of a node has."""


class NodeLabel(NamedTuple):
    """A node of a tree: its key, the word of its kind, what a person reads of it, and where it stands."""

    key: str
    kind: str
    title: str
    file: str
    line: int

    @property
    def sort_key(self) -> tuple[int, ...]:
        """By which nodes are in the order of the file; keys that no tree has come first."""
        parts = self.key.split(".")
        return tuple(map(int, parts)) if all(part.isdecimal() and len(part) < MAX_KEY_DIGITS for part in parts) else ()


@dataclass(frozen=True, slots=True)
class TimeQuantiles:
    """What many times have in common, in seconds."""

    count: int
    median: float
    p95: float
    p99: float
    longest: float


@dataclass(frozen=True, slots=True)
class NodeFigures:
    """What became of a node: in how many ticks it was at work, how its runs ended, and how long each of them took.

    ``unended`` counts the runs that the record does not see the end of; ``durations`` has these too, as far as they went.
    """

    ticks: int = 0
    success: int = 0
    failure: int = 0
    halted: int = 0
    unended: int = 0
    durations: Times = field(default_factory=lambda: NO_TIMES)

    @property
    def runs(self) -> int:
        """How often it was started."""
        return self.success + self.failure + self.halted + self.unended

    @property
    def seconds(self) -> float:
        """For how long it ran, in all."""
        return float(self.durations.sum())


@dataclass(frozen=True, slots=True)
class WireFigures:
    """How often something was done on a device's wire, how long that took in all, and the longest (s)."""

    count: int
    seconds: float
    longest: float

    @property
    def mean(self) -> float:
        """Seconds that it takes."""
        return self.seconds / self.count if self.count else 0.0


@dataclass(frozen=True, slots=True)
class Stats:
    """The figures of one run or of several of a kind.

    ``seconds`` and ``ticks`` are of all together, ``overruns`` the scheduled ticks that were missed since one before
    took too long. ``delays`` are single times by what they are of, ``wires`` by device and what is done there,
    ``counts`` what devices count besides.
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
    """Return what ``times``, one at least, have in common."""
    median, p95, p99 = (float(each) for each in np.quantile(times, [0.5, 0.95, 0.99]))
    return TimeQuantiles(len(times), median, p95, p99, float(times.max()))


def merge_stats(found: Iterable[Stats]) -> Sequence[Stats]:
    """Return the figures of the runs of each kind together, in the order in which the kinds come."""
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
