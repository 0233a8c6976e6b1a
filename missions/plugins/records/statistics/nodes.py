"""Statistics of each node of a recorded tree (success rate, duration), from its status changes.

A record does not contain all ticks: it lacks those in which a node returns the same status again, and does not tell
whether a halted node was ticked earlier in the same tick. Both are inferred from the composites and modifiers above the
node. While a halt waits for a ``finally`` that takes several ticks, the nodes around it count as ticked.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from missions.executive.events import SKIPPED, NodeChanged, plain_status
from missions.executive.tick_record import TickRecord
from missions.language.nodes import AT_ONCE, COMPOSITES, FINALLY, MODIFIERS
from missions.plugins.records.statistics.figures import NodeFigures, NodeLabel
from missions.trees.drawing import ACTIVE, TreeBox, TreeDrawing

REACTIVE_COMPOSITES: Mapping[str, str] = {word: kind.passes for word, kind in COMPOSITES.items() if kind.reactive}
"""Composites that begin with their first child at every tick.

The value is the status of a child after which the next child is ticked.
"""

ALWAYS_TICKING = frozenset(word for word, kind in MODIFIERS.items() if kind.child_ticks == "always")
"""Modifiers (decorators) that tick their node whenever they are ticked, and may return another status than the node."""

SOMETIMES_TICKING = frozenset(word for word, kind in MODIFIERS.items() if kind.child_ticks == "sometimes")
"""Modifiers (decorators) that, when ticked, either tick their node and return its status, or do not tick it."""


ENDED = ("success", "failure", SKIPPED)
"""Statuses of a node that has ended."""


class _Node(NamedTuple):
    """A node of a recorded tree, with its parent, and the keys of the siblings before and after it."""

    place: NodeLabel
    parent: "_Node | None"
    earlier_siblings: Sequence[str]
    later_siblings: Sequence[str]


@dataclass(slots=True)
class _Tally:
    """Statistics of one node while the record is read: ticks, results and durations of the node's runs."""

    status: str = "idle"
    since: float = 0.0
    ticks: int = 0
    ends: dict[str, int] = field(default_factory=lambda: {"success": 0, "failure": 0, "idle": 0})
    durations: list[float] = field(default_factory=list)

    def on_status(self, status: str, t: float) -> None:
        """Update the statistics for a new ``status`` of the node at time ``t`` (s)."""
        ran = self.status in ACTIVE
        if status in ACTIVE:
            self.since = self.since if ran else t
        elif ran or status != "idle":
            self.end(status, t - self.since if ran else 0.0)
        self.status = status

    def end(self, status: str, seconds: float) -> None:
        """Count a run of the node that ended with ``status`` after ``seconds``."""
        self.ends[plain_status(status)] += 1
        self.durations.append(seconds)

    def figures(self, until: float) -> NodeFigures:
        """Return the statistics of the node at the end ``until`` of the record (s)."""
        left = [max(0.0, until - self.since)] if self.status in ACTIVE else []
        ends = self.ends
        times = np.asarray([*self.durations, *left], dtype=np.float64)
        return NodeFigures(self.ticks, ends["success"], ends["failure"], ends["idle"], len(left), times)


def node_figures(
    drawing: TreeDrawing,
    changes: Sequence[NodeChanged],
    tick_records: Sequence[TickRecord],
    *,
    start: float,
    until: float,
) -> Mapping[NodeLabel, NodeFigures]:
    """Return the statistics of each node; nodes that the drawing lacks are included by kind and name.

    ``changes`` and ``tick_records`` are in order of time. ``start`` is the start of the record (s), ``until`` its end.
    A run of a node that began earlier counts from ``start``.
    """
    nodes = {node.place.key: node for node in _walk_nodes(drawing.root, None, (), ())}
    for change in changes:
        place = NodeLabel(change.node, change.kind, change.name, "", change.line)
        nodes.setdefault(change.node, _Node(place, None, (), ()))
    tallies = {key: _Tally() for key in nodes}
    doubtful = [node for node in nodes.values() if _may_be_ticked_again(node)]
    cleanups = tuple(f"{key}.2" for key, node in nodes.items() if node.place.kind == FINALLY)
    running: set[str] = set()
    for moment, news in _group_by_tick(changes, tick_records):
        ran, touched = set(running), set[str]()
        for change in news:
            tallies[change.node].on_status(change.status, max(change.t, start))
            (running.add if change.status in ACTIVE else running.discard)(change.node)
            if change.status != "idle":
                touched.add(change.node)
        touched |= running
        if moment is not None and moment.kind == "tick":
            halted = ran - touched
            touched |= {
                key for key in nodes if key in halted and _was_ticked_before_halt(nodes[key], tallies, touched, halted)
            }
            _count_tick(tallies, touched, doubtful)
        elif moment is not None and moment.kind == "halt":
            _count_tick(tallies, {key for key in touched if key.startswith(cleanups)}, ())
    return {node.place: tallies[key].figures(until) for key, node in nodes.items()}


def _walk_nodes(box: TreeBox, parent: _Node | None, before: Sequence[str], after: Sequence[str]) -> Iterator[_Node]:
    """Yield the modifiers of a box of the tree drawing, the box, and all nodes below it, parents first."""
    for badge in box.badges:
        title = f"{badge.kind}: {badge.text}".removesuffix(": ")
        parent = _Node(NodeLabel(badge.key, badge.kind, title, box.file, badge.line), parent, before, after)
        before = after = ()
        yield parent
    node = _Node(NodeLabel(box.key, box.kind, box.title, box.file, box.line), parent, before, after)
    yield node
    keys = [child.badges[0].key if child.badges else child.key for child in box.children]
    own = sum(key.startswith(f"{box.key}.") for key in keys)  # the others belong to `recover` and `finally`
    for number, child in enumerate(box.children):
        siblings = (keys[:number], keys[number + 1 : own]) if number < own else ((), ())
        yield from _walk_nodes(child, node, *siblings)


def _may_be_ticked_again(node: _Node) -> bool:
    """Return whether a node that has ended may be ticked again in the same run of its parent."""
    above = node.parent
    return above is not None and (
        above.place.kind in REACTIVE_COMPOSITES
        or above.place.kind == "hold"
        or (above.place.kind in ALWAYS_TICKING | SOMETIMES_TICKING and _may_be_ticked_again(above))
    )


def _group_by_tick(
    changes: Sequence[NodeChanged], tick_records: Sequence[TickRecord]
) -> Iterator[tuple[TickRecord | None, Sequence[NodeChanged]]]:
    """Yield each tick record with the status changes of its tick.

    Before the first and after the last, yield None with the changes outside of all ticks.
    """
    at = 0
    while at < len(changes) and (not tick_records or changes[at].tick < tick_records[0].tick):
        at += 1
    yield None, changes[:at]
    for moment, following in pairwise((*tick_records, None)):
        if moment is None:
            continue
        begun = at
        while at < len(changes) and _is_in_tick(changes[at], moment, following):
            at += 1
        yield moment, changes[begun:at]
    yield None, changes[at:]


def _is_in_tick(change: NodeChanged, tick_record: TickRecord, following: TickRecord | None) -> bool:
    """Return whether a status change belongs to the tick of ``tick_record``.

    The tick number alone does not tell: the final halt of a run may have the number of the last tick.
    """
    return change.tick <= tick_record.tick and (
        following is None or following.tick > tick_record.tick or change.t < following.t
    )


def _count_tick(tallies: Mapping[str, _Tally], touched: set[str], doubtful: Sequence[_Node]) -> None:
    """Count a tick of each of the ``touched`` nodes, whose statuses show that they were ticked.

    ``doubtful`` nodes may have been ticked again with the same result; if so, they are counted and added to
    ``touched``.
    """
    for node in doubtful:
        key = node.place.key
        tally = tallies[key]
        if key not in touched and tally.status in ENDED and _was_ticked_again(node, tallies, touched):
            tally.end(tally.status, 0.0)
            touched.add(key)
    for key in touched:
        tallies[key].ticks += 1


def _was_ticked_before_halt(node: _Node, tallies: Mapping[str, _Tally], touched: set[str], halted: set[str]) -> bool:
    """Return whether a node that was halted in the current tick had been ticked earlier in this tick.

    ``touched`` and ``halted`` are the keys of the nodes ticked and halted in the tick.
    """
    while node.parent is not None and node.parent.place.key in halted:  # an ancestor halted all of these
        node = node.parent
    if node.parent is None or node.parent.place.key not in touched:
        return False
    ended = ("success", "failure")  # later siblings of the child that ended it were not ticked
    return node.parent.place.kind in AT_ONCE and any(
        key in touched and tallies[key].status in ended for key in node.later_siblings
    )


def _was_ticked_again(node: _Node, tallies: Mapping[str, _Tally], touched: set[str]) -> bool:
    """Return whether a node whose result has not changed was ticked again in the current tick.

    A record does not say so; it is inferred from the parent and the earlier siblings. ``touched`` are the keys of the
    nodes that are known to have been ticked in this tick.
    """
    if node.parent is None or node.parent.place.key not in touched:
        return False
    above = node.parent.place
    if above.kind in REACTIVE_COMPOSITES:
        leads_on = (REACTIVE_COMPOSITES[above.kind], SKIPPED)
        return all(key in touched and tallies[key].status in leads_on for key in node.earlier_siblings)
    return above.kind in ALWAYS_TICKING or tallies[above.key].status == tallies[node.place.key].status
