"""Figures of runs for people, as tables, and for programs, as JSON and CSV."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

from missions.cli.printable import in_columns
from missions.plugins.records.statistics.figures import NodeFigures, Place, Spread, Stats, spread

NODES = ("node", "line", "ticks", "runs", "success", "failure", "halted", "total s", "median s", "95 % s")
DELAYS = ("", "count", "median ms", "95 % ms", "99 % ms", "longest ms")
WIRES = ("on the wire", "count", "mean ms", "longest ms")
COUNTS = ("counted", "number")

LEFT = frozenset({"node", "", "on the wire", "counted"})
"""The columns of words."""

COLUMNS = (
    *("mission", "robot", "simulate", "records", "key", "kind", "node", "file", "line"),
    *("ticks", "runs", "success", "failure", "halted", "unended", "seconds", "median", "p95", "p99", "longest"),
)
"""The columns of the CSV: times in seconds, empty for a node that never ran."""


def lines_of(stats: Stats) -> Iterator[str]:
    """Yield the figures of runs of one kind as lines for a terminal."""
    kind = stats.kind
    simulated = f", simulated ({kind.simulate})" if kind.simulate else ""
    records = "1 record" if stats.records == 1 else f"{stats.records} records"
    results = ", ".join(f"{count} {result}" for result, count in stats.results.items())
    yield f"{kind.mission} on {kind.robot}{simulated}: {records} ({results})"
    late = "" if kind.simulate == "fast" else f", {stats.overruns} missed since one before took too long"
    yield f"{stats.seconds:.1f} s, {stats.ticks} ticks{late}"
    yield ""
    yield from _table(NODES, [_node_row(place, node) for place, node in _in_order(stats)])
    yield from _table(DELAYS, [_delay_row(name, spread(times)) for name, times in stats.delays.items()])
    yield from _table(
        WIRES,
        [
            (f"{device}: {what.replace('_', ' ')}", str(wire.count), _ms(wire.mean), _ms(wire.longest))
            for (device, what), wire in stats.wires.items()
        ],
    )
    counted = ((f"{device}: {name}", count) for (device, name), count in stats.counts.items())
    yield from _table(COUNTS, [(name, str(count)) for name, count in counted if count])


def as_json(stats: Stats) -> Mapping[str, object]:
    """Return the same for programs; times in seconds."""
    return {
        **stats.kind._asdict(),
        "records": stats.records,
        "results": dict(stats.results),
        "seconds": stats.seconds,
        "ticks": stats.ticks,
        "overruns": stats.overruns,
        "nodes": [
            {
                **place._asdict(),
                **{name: getattr(node, name) for name in ("ticks", "runs", "success", "failure", "halted", "unended")},
                "seconds": node.seconds,
                "lasted": asdict(spread(node.lasted)) if node.runs else None,
            }
            for place, node in _in_order(stats)
        ],
        "delays": {name: asdict(spread(times)) for name, times in stats.delays.items()},
        "wires": [
            {"device": device, "what": what, **asdict(wire), "mean": wire.mean}
            for (device, what), wire in stats.wires.items()
        ],
        "counts": [{"device": device, "what": what, "count": count} for (device, what), count in stats.counts.items()],
    }


def as_csv(found: Sequence[Stats]) -> str:
    """Return a line for each node of each kind of run, under their headings."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for stats in found:
        for place, node in _in_order(stats):
            lasted = spread(node.lasted) if node.runs else None
            writer.writerow(
                (
                    *(*stats.kind, stats.records, *place, node.ticks, node.runs),
                    *(node.success, node.failure, node.halted, node.unended, node.seconds),
                    *((lasted.median, lasted.p95, lasted.p99, lasted.longest) if lasted else [""] * 4),
                )
            )
    return out.getvalue()


def _in_order(stats: Stats) -> list[tuple[Place, NodeFigures]]:
    return sorted(stats.nodes.items(), key=lambda item: (item[0].order, item[0]))


def _node_row(place: Place, node: NodeFigures) -> tuple[str, ...]:
    depth = "  " * (len(place.order) - 1)  # in the place of its key
    counts = (node.ticks, node.runs, node.success, node.failure, node.halted)
    times = ("", "", "")
    if node.runs:
        lasted = spread(node.lasted)
        times = (f"{node.seconds:.2f}", f"{lasted.median:.2f}", f"{lasted.p95:.2f}")
    return (depth + place.title, str(place.line or ""), *map(str, counts), *times)


def _delay_row(name: str, found: Spread) -> tuple[str, ...]:
    return (name, str(found.count), *map(_ms, (found.median, found.p95, found.p99, found.longest)))


def _ms(seconds: float) -> str:
    return f"{seconds * 1000:.2f}"


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield a table and an empty line; nothing without rows."""
    if rows:
        yield from in_columns(headings, rows, left=LEFT).splitlines()
        yield ""
