"""Merging of runs within a tick: of several ways to the same situation, only the first is followed to the end.

The choices of a tick are a tree: if a leaf can fail in one of five steps, all that comes next would be explored five
times. So before a leaf is ticked, the situation is compared with those of earlier runs from the same state; and before
the order of a random composite is drawn.

This is exact, since the following decide the rest of a tick, and all of them are compared: the fields of all nodes, the
variables, the times, the monitors, and the sensors that may be read again. The nodes that are being ticked are the
ancestors of the leaf. The local variables of their methods follow from the place of the leaf and from the fields of
nodes, since each node is ticked at most once in a tick, and its status is published before the next one is ticked.
Leaves in a ``finally`` are left out: they are ticked while other nodes halt, which have an end in a local variable.

Scripts are enumerated in lexical order, so the run that goes on is the one whose script is reported anyway. A run that
breaks a rule is never merged.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from behaviours.node import Node
from behaviours.run import RunState
from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.rule_monitor import RuleMonitor
from missions.plugins.verify.snapshot import Snapshots
from missions.plugins.verify.symbolic_time import SymbolicClock

if TYPE_CHECKING:
    from missions.plugins.verify.model import ScopeSnapshots


MAX_COMPARISONS = 32
"""Comparisons in one run of a tick. Further ones are made only at each power of two, so the cost stays linear.

Each costs in proportion to the nodes. It is exact to leave one out, since the run is then only followed further.
"""


class RunMergedError(Exception):
    """The run has come to a situation of an earlier run from the same state; nothing new can follow."""


class TickMerger:
    """Finds situations within a tick that an earlier run from the same state has reached.

    ``readers`` are the nodes that read each report of a sensor.
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        run: RunState,
        oracle: Oracle,
        watch: RuleMonitor,
        timing: SymbolicClock,
        snapshots: Snapshots,
        scopes: "ScopeSnapshots",
        readers: Mapping[str, Sequence[Node]],
    ) -> None:
        self._run, self._oracle, self._watch, self._timing = run, oracle, watch, timing
        self._snapshots, self._scopes, self._readers = snapshots, scopes, readers
        places = {node: place for place, node in enumerate(nodes)}
        self._begun = {node: frozenset(places[each] for each in _begun_nodes(node)) for node in nodes}
        self._ticking = {node: frozenset((node, *_ancestors(node))) for node in nodes}
        self._seen: set[object] | None = None
        self._checked = 0
        self._comparisons = 0

    def start(self) -> None:
        """Begin to explore a state: forget the situations after earlier states, and merge runs from now on."""
        self._seen = set()

    def stop(self) -> None:
        """Follow every run to its end, as in the replay of a trace."""
        self._seen = None

    def begin_run(self) -> None:
        """Begin a run from the state."""
        self._checked = self._comparisons = 0

    def visit(self, node: Node, drawn_from: Sequence[Node] = ()) -> None:
        """Compare the situation before a tick of a leaf, or before a composite draws the order of its children.

        ``drawn_from`` are the children that can be drawn. Raises RunMergedError if an earlier run has reached the
        situation.
        """
        choices = len(self._oracle.choices)
        if choices == self._checked or self._seen is None or self._oracle.follows_script or self._watch.violations:
            return
        self._checked = choices
        self._comparisons += 1
        if self._comparisons > MAX_COMPARISONS and self._comparisons.bit_count() > 1:
            return
        situation = self._situation(node), tuple(drawn_from)
        if situation in self._seen:
            raise RunMergedError
        self._seen.add(situation)

    def _situation(self, node: Node) -> object:
        """Return everything that determines the rest of the tick, in hashable form."""
        ticking, watch = self._begun[node], self._watch
        rows, instants = self._snapshots.take(ticking)
        return (
            node,
            rows,
            self._snapshots.marks(ticking),
            self._snapshots.stopped_in(self._run.tick),
            self._timing.zone.project(instants),
            self._scopes.changes(),
            self._relevant_reports(node),
            self._oracle.all_sensors_report,
            watch.happened,
            watch.moving,
            watch.completed_round,
        )

    def _relevant_reports(self, node: Node) -> frozenset[object]:
        """Return the reports that were read in this tick and may be read again, by a node whose tick is not over."""
        ticking, tick = self._ticking[node], self._run.tick
        return frozenset(
            (key, reports)
            for key, reports in self._oracle.reports.items()
            if any(reader.visited_tick != tick or reader in ticking for reader in self._readers[key[0]])
        )


def _begun_nodes(node: Node) -> Iterator[Node]:
    """Yield the nodes whose tick has begun at a visit of ``node``: the nodes around it, and a composite itself."""
    if node.children:
        yield node
    yield from _ancestors(node)


def _ancestors(node: Node) -> Iterator[Node]:
    above = node.parent
    while isinstance(above, Node):
        yield above
        above = above.parent
