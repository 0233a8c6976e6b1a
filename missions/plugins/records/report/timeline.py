"""Timeline of the leaves in a recorded run: a row per leaf, with a bar for each run of the leaf."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from missions.executive.events import NodeChanged
from missions.trees.drawing import ACTIVE, Status, TreeBox, TreeDrawing
from missions.trees.states import STATUSES

MAX_BARS = 400
"""Number of parts into which a row of the timeline is divided; bars that fit together into one part are merged."""


@dataclass(frozen=True, slots=True)
class Bar:
    """A bar of the timeline: a run of a leaf from ``start`` to ``end`` (s); equal if the leaf returned at once.

    ``outcome`` is the result of the run: "idle" if it was interrupted, "running" if it still ran at the end of the
    record. Time in which the leaf was suspended is included. ``count`` is the number of runs merged into the bar; its
    outcome is a failure if any of them failed.
    """

    start: float
    end: float
    outcome: Status
    reason: str = ""
    count: int = 1


@dataclass(frozen=True, slots=True)
class Lane:
    """A row of the timeline: a leaf and its runs; ``submission`` is the name of its sub-mission, if any."""

    box: TreeBox
    submission: str
    bars: Sequence[Bar]

    @property
    def busy_seconds(self) -> float:
        """Total running time of the leaf (s)."""
        return sum(bar.end - bar.start for bar in self.bars)


def leaf_lanes(
    drawing: TreeDrawing, changes: Iterable[NodeChanged], last: Mapping[str, NodeChanged], end: float
) -> list[Lane]:
    """Return a row of the timeline for each leaf that was ticked, in the order of the tree.

    ``changes`` are the status changes of all nodes, ``last`` is the final change of each node by key, and ``end`` is
    the end of the record (s).
    """
    by_node: dict[str, list[NodeChanged]] = {}
    for change in changes:
        by_node.setdefault(change.node, []).append(change)
    return [
        Lane(box, within, _bars_of(by_node[box.key], last[box.key].reason, end))
        for box, within in _walk_leaves(drawing.root, "")
        if box.key in by_node
    ]


def merge_bars(bars: Sequence[Bar], span: float) -> list[Bar]:
    """Return the bars for a timeline of ``span`` seconds, with indistinguishable neighbours merged."""
    found: list[Bar] = []
    for bar in bars:
        last = found[-1] if found else None
        if last is None or bar.end - last.start > span / MAX_BARS:
            found.append(bar)
        else:
            outcome: Status = "failure" if "failure" in (last.outcome, bar.outcome) else bar.outcome
            reason = last.reason if last.outcome == outcome else bar.reason
            found[-1] = replace(last, end=bar.end, outcome=outcome, reason=reason, count=last.count + 1)
    return found


def count_outcomes(bars: Sequence[Bar]) -> Mapping[Status, int]:
    """Return the number of ``bars`` by outcome."""
    counts: dict[Status, int] = {}
    for bar in bars:
        counts[bar.outcome] = counts.get(bar.outcome, 0) + 1
    return counts


def _walk_leaves(box: TreeBox, submission: str) -> Iterable[tuple[TreeBox, str]]:
    if not box.children:
        yield box, submission
    for child in box.children:
        yield from _walk_leaves(child, box.mission or submission)


def _bars_of(changes: Sequence[NodeChanged], last_reason: str, end: float) -> list[Bar]:
    bars: list[Bar] = []
    since: float | None = None
    for change in changes:
        status = STATUSES[change.status]
        if status in ACTIVE:
            since = change.t if since is None else since
        elif status != "idle" or since is not None:
            bars.append(Bar(change.t if since is None else since, change.t, status, change.reason))
            since = None
    if since is not None:
        bars.append(Bar(since, end, "running", last_reason))
    return bars
