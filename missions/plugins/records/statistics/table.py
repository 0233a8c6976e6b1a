"""Statistics of runs as terminal tables, JSON and CSV."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

from missions.cli.printable import format_columns
from missions.plugins.records.statistics.figures import NodeFigures, NodeLabel, Stats, TimeQuantiles, time_quantiles

NODE_COLUMNS = ("node", "line", "ticks", "runs", "success", "failure", "halted", "total s", "median s", "95 % s")
DELAY_COLUMNS = ("", "count", "median ms", "95 % ms", "99 % ms", "longest ms")
WIRE_COLUMNS = ("bus", "count", "mean ms", "longest ms")
COUNTER_COLUMNS = ("counter", "count")

LEFT_ALIGNED_COLUMNS = frozenset({"node", "", "bus", "counter"})
"""Columns of the statistics tables that hold text, and are aligned left."""

CSV_COLUMNS = (
    *("mission", "robot", "simulate", "records", "key", "kind", "node", "file", "line"),
    *("ticks", "runs", "success", "failure", "halted", "unended", "seconds", "median", "p95", "p99", "longest"),
)
"""Columns of the statistics as CSV; times are in seconds, and empty for a node that never ran."""


def lines_of(stats: Stats) -> Iterator[str]:
    """Yield the statistics of one kind of run as lines for a terminal."""
    kind = stats.kind
    simulated = f", simulated ({kind.simulate})" if kind.simulate else ""
    records = "1 record" if stats.records == 1 else f"{stats.records} records"
    results = ", ".join(f"{count} {result}" for result, count in stats.results.items())
    yield f"{kind.mission} on {kind.robot}{simulated}: {records} ({results})"
    late = "" if kind.simulate == "fast" else f", {stats.overruns} missed, since an earlier one took too long"
    yield f"{stats.seconds:.1f} s, {stats.ticks} ticks{late}"
    yield ""
    yield from _table(NODE_COLUMNS, [_node_row(place, node) for place, node in _sorted_nodes(stats)])
    yield from _table(DELAY_COLUMNS, [_delay_row(name, time_quantiles(times)) for name, times in stats.delays.items()])
    yield from _table(
        WIRE_COLUMNS,
        [
            (f"{device}: {what.replace('_', ' ')}", str(wire.count), _ms(wire.mean), _ms(wire.longest))
            for (device, what), wire in stats.wires.items()
        ],
    )
    counted = ((f"{device}: {name}", count) for (device, name), count in stats.counts.items())
    yield from _table(COUNTER_COLUMNS, [(name, str(count)) for name, count in counted if count])


def as_json(stats: Stats) -> Mapping[str, object]:
    """Return the statistics of one kind of run for JSON; times in seconds."""
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
                "lasted": asdict(time_quantiles(node.durations)) if node.runs else None,
            }
            for place, node in _sorted_nodes(stats)
        ],
        "delays": {name: asdict(time_quantiles(times)) for name, times in stats.delays.items()},
        "wires": [
            {"device": device, "what": what, **asdict(wire), "mean": wire.mean}
            for (device, what), wire in stats.wires.items()
        ],
        "counts": [{"device": device, "what": what, "count": count} for (device, what), count in stats.counts.items()],
    }


def as_csv(found: Sequence[Stats]) -> str:
    """Return the statistics as CSV: a line for each node of each kind of run."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for stats in found:
        for place, node in _sorted_nodes(stats):
            lasted = time_quantiles(node.durations) if node.runs else None
            writer.writerow(
                (
                    *(*stats.kind, stats.records, *place, node.ticks, node.runs),
                    *(node.success, node.failure, node.halted, node.unended, node.seconds),
                    *((lasted.median, lasted.p95, lasted.p99, lasted.longest) if lasted else [""] * 4),
                )
            )
    return out.getvalue()


def _sorted_nodes(stats: Stats) -> list[tuple[NodeLabel, NodeFigures]]:
    return sorted(stats.nodes.items(), key=lambda item: (item[0].sort_key, item[0]))


def _node_row(place: NodeLabel, node: NodeFigures) -> tuple[str, ...]:
    depth = "  " * (len(place.sort_key) - 1)  # indent by depth in the tree
    counts = (node.ticks, node.runs, node.success, node.failure, node.halted)
    times = ("", "", "")
    if node.runs:
        lasted = time_quantiles(node.durations)
        times = (f"{node.seconds:.2f}", f"{lasted.median:.2f}", f"{lasted.p95:.2f}")
    return (depth + place.title, str(place.line or ""), *map(str, counts), *times)


def _delay_row(name: str, found: TimeQuantiles) -> tuple[str, ...]:
    return (name, str(found.count), *map(_ms, (found.median, found.p95, found.p99, found.longest)))


def _ms(seconds: float) -> str:
    return f"{seconds * 1000:.2f}"


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a text table and an empty line; nothing without rows."""
    if rows:
        yield from format_columns(headings, rows, left=LEFT_ALIGNED_COLUMNS).splitlines()
        yield ""
