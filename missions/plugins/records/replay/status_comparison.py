"""Compare recorded and current node statuses, tick by tick, up to the first difference (divergence)."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import zip_longest

from behaviours.node import Node
from missions.executive.events import Event, NodeChanged, plain_status, status_word
from missions.trees.drawing import TreeDrawing

# Pairing of recorded and current nodes of a mission that may have changed.


@dataclass(frozen=True, slots=True)
class NodePlace:
    """A node or modifier of a behaviour tree, and its place in the mission file.

    It has a key, kind, name, file and line. The name of a modifier is empty.
    """

    key: str
    kind: str
    name: str
    file: str
    line: int
    is_leaf: bool = False

    @property
    def identity(self) -> tuple[str, str]:
        """Kind and name, which identify a node even if it has moved to another place in the tree."""
        return self.kind, self.name

    def __str__(self) -> str:
        named = f"{self.kind} '{self.name}'" if self.name not in ("", self.kind) else self.kind
        return f"{named} ({self.key})"


def node_places(drawing: TreeDrawing) -> tuple[NodePlace, ...]:
    """Return the places of all nodes of a tree in the order of the mission file, the root first."""
    places = []
    for box in drawing.root.walk():
        places += [NodePlace(badge.key, badge.kind, "", box.file, badge.line) for badge in box.badges]
        places.append(NodePlace(box.key, box.kind, box.name, box.file, box.line, is_leaf=not box.children))
    return tuple(places)


def pair_nodes(recorded: Sequence[NodePlace], current: Sequence[NodePlace]) -> Mapping[str, str]:
    """Return the current node key for each recorded node key; nodes that only one tree has are left out.

    The trees are compared as two sequences of nodes. So if a node was inserted, removed or put into a composite, the
    others still match. A node with only its name changed counts as the same node.
    """
    pairs: dict[str, str] = {}
    matcher = SequenceMatcher(
        None, [each.identity for each in recorded], [each.identity for each in current], autojunk=False
    )
    for what, begin, end, start, stop in matcher.get_opcodes():
        if what == "equal" or (what == "replace" and end - begin == stop - start):
            both = zip(recorded[begin:end], current[start:stop], strict=True)
            pairs.update((old.key, new.key) for old, new in both if old.kind == new.kind)
    return pairs


IDLE = "idle"
"""Status of a node before its first change."""


@dataclass(frozen=True, slots=True)
class NodeStatus:
    """A status of a node, and the reason that the node gives for it."""

    status: str
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.status} ({self.reason})" if self.reason else self.status


@dataclass(frozen=True, slots=True)
class StatusDifference:
    """A node whose status differs from the record: tick, time (s), and the node's place in each tree."""

    tick: int
    t: float
    recorded_place: NodePlace
    current_place: NodePlace
    recorded: NodeStatus
    current: NodeStatus


class StatusComparison:
    """Compares the status ``changes`` in a record with those of the current tree, tick by tick.

    It is called with each event of the current tree. ``recorded`` is the drawing of the recorded tree, ``current`` that
    of the current tree, whose root node is ``root``. Nodes that only one of the trees has are not compared.
    ``reworded_count`` is the number of equal statuses with different reasons; ``first_reworded`` is the first of these.
    """

    def __init__(self, changes: Iterable[NodeChanged], recorded: TreeDrawing, current: TreeDrawing, root: Node) -> None:
        self.reworded_count = 0
        self.first_reworded: StatusDifference | None = None
        self._recorded_places = {place.key: place for place in node_places(recorded)}
        self._current_places = {place.key: place for place in node_places(current)}
        self._order = {key: number for number, key in enumerate(self._recorded_places)}
        self.pairs = pair_nodes(tuple(self._recorded_places.values()), tuple(self._current_places.values()))
        self._old_keys = {new: old for old, new in self.pairs.items()}
        self._nodes = {node.key: node for node in root.iterate() if isinstance(node, Node)}
        self._recorded_changes: dict[int, list[NodeChanged]] = defaultdict(list)
        for change in changes:
            self._recorded_changes[change.tick].append(change)
        self._current_changes: list[NodeChanged] = []
        self._last_states: dict[str, NodeStatus] = {}

    def __call__(self, event: Event) -> None:
        """Collect a status change of the current tree."""
        if isinstance(event, NodeChanged):
            self._current_changes.append(event)

    def finish_tick(self, tick: int, t: float) -> StatusDifference | None:
        """Compare all changes of a tick that ended at ``t`` (s); return the likely cause of a difference, or None."""
        recorded, current = (
            _states_by_node(self._recorded_changes.pop(tick, ())),
            _states_by_node(self._current_changes),
        )
        self._current_changes = []
        current = {self._old_keys[key]: states for key, states in current.items() if key in self._old_keys}
        recorded = {key: states for key, states in recorded.items() if key in self.pairs}
        different = []
        for key in {**recorded, **current}:
            recorded_states, current_states = recorded.get(key, []), current.get(key, [])
            if [state.status for state in recorded_states] != [state.status for state in current_states]:
                different.append(key)
            elif recorded_states != current_states:
                self._note_reworded(self._first_difference(key, recorded_states, current_states, tick, t))
        cause = min(
            different, key=lambda key: self._rank(key, recorded.get(key, []), current.get(key, [])), default=None
        )
        difference = (
            None
            if cause is None
            else self._first_difference(cause, recorded.get(cause, []), current.get(cause, []), tick, t)
        )
        self._last_states.update((key, states[-1]) for key, states in recorded.items())
        return difference

    def _first_difference(
        self, key: str, recorded: Sequence[NodeStatus], current: Sequence[NodeStatus], tick: int, t: float
    ) -> StatusDifference:
        """Return the first difference between a node's ``recorded`` and ``current`` statuses in a tick.

        If one of them has no change in this tick, its status is that of the tick before.
        """
        node = self._nodes[self.pairs[key]]
        stays = recorded[-1] if recorded else self._last_states.get(key, NodeStatus(IDLE))
        stands = NodeStatus(plain_status(status_word(node)), node.reason)
        both = [(was or stays, does or stands) for was, does in zip_longest(recorded, current)]
        # A different status takes precedence over a different reason.
        was, does = max(both, key=lambda pair: (pair[0].status != pair[1].status, pair[0] != pair[1]))
        return StatusDifference(tick, t, self._recorded_places[key], self._current_places[node.key], was, does)

    def _rank(self, key: str, recorded: Sequence[NodeStatus], current: Sequence[NodeStatus]) -> tuple[bool, bool, int]:
        """Return the sort key of a node's difference, of which the smallest is the likely cause.

        Nodes that did more than halt come first, then leaves, then nodes nearer to the root.
        """
        only_halted = all(state.status == IDLE for state in (*recorded, *current))
        return only_halted, not self._recorded_places[key].is_leaf, self._order[key]

    def _note_reworded(self, difference: StatusDifference) -> None:
        self.reworded_count += 1
        self.first_reworded = self.first_reworded or difference


def _states_by_node(changes: Iterable[NodeChanged]) -> dict[str, list[NodeStatus]]:
    """Return the status changes of each node by key, in order, with "skipped" replaced by "success".

    Older records do not tell the two apart.
    """
    found: dict[str, list[NodeStatus]] = defaultdict(list)
    for change in changes:
        found[change.node].append(NodeStatus(plain_status(change.status), change.reason))
    return found
