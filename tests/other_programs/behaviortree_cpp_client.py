"""Ticks trees of BehaviorTree.CPP, by its Python bindings.

Standard input is a JSON list of trees: ``xml``, the ``outcomes`` of each leaf by its name, one letter each time that
it is ticked, over and over, and how many ``ticks``; ``clocked`` are the leaves that give a letter for each tick of the
root instead, and are not told of. Standard output is a JSON list of what happened: for each tick the status of the
root, the leaves that were ticked, in order, with their outcomes, and the leaves that were halted.

``main`` is the tree to tick, by default "Main". With ``entries``, names of the blackboard, the tree is ticked until it
ends, and a last item of its list holds their values. A tree with ``nodes``, the roles of its custom nodes by ID, is
only parsed: its list is empty.
"""

import json
import sys
from collections.abc import Collection, Mapping
from typing import Any

from behaviortreepy import BehaviorTreeFactory, NodeStatus

STATUSES = {"R": NodeStatus.RUNNING, "S": NodeStatus.SUCCESS, "F": NodeStatus.FAILURE}


class Leaves:
    """The leaves of one tree: each gives its outcomes in turn, and what happens to it is written down."""

    def __init__(self, outcomes: Mapping[str, str], clocked: Collection[str]) -> None:
        self._outcomes = outcomes
        self._clocked = clocked
        self.number = 0
        self._given = dict.fromkeys(outcomes, 0)
        self.ticked: list[str] = []
        self.halted: list[str] = []

    def tick(self, node: Any) -> Any:
        """Give the next outcome."""
        name = node.name()
        if name in self._clocked:
            return STATUSES[self._outcomes[name][self.number % len(self._outcomes[name])]]
        outcome = self._outcomes[name][self._given[name] % len(self._outcomes[name])]
        self._given[name] += 1
        self.ticked.append(f"{name} {outcome}")
        return STATUSES[outcome]

    def halt(self, node: Any) -> None:
        """Write it down."""
        self.halted.append(node.name())


def played(tree: Mapping[str, Any]) -> list[list[Any]]:
    """Tick one tree."""
    factory = BehaviorTreeFactory()
    if "nodes" in tree:
        register_nodes(factory, tree["nodes"])
        factory.register_behavior_tree_from_text(tree["xml"])
        return []
    leaves = Leaves(tree["outcomes"], tree.get("clocked", ()))
    factory.register_simple_stateful_action("Probe", leaves.tick, leaves.tick, leaves.halt)
    factory.register_behavior_tree_from_text(tree["xml"])
    root = factory.create_tree(tree.get("main", "Main"))
    told = []
    for leaves.number in range(tree["ticks"]):
        leaves.ticked, leaves.halted = [], []
        status = root.tick_exactly_once()
        told.append([status.name, leaves.ticked, sorted(leaves.halted)])
        if "entries" in tree and status != NodeStatus.RUNNING:
            break
    if "entries" in tree:
        board = root.root_blackboard()
        told.append([entry_value(board, name) for name in tree["entries"]])
    return told


def register_nodes(factory: Any, nodes: Mapping[str, str]) -> None:
    """Register custom nodes without ports; the bindings have no custom control nodes."""
    for name, role in nodes.items():
        if role == "Decorator":
            factory.register_simple_decorator(name, lambda _, status: status)
        elif role == "Condition":
            factory.register_simple_condition(name, lambda _: NodeStatus.SUCCESS)
        else:
            factory.register_simple_action(name, lambda _: NodeStatus.SUCCESS)


def entry_value(board: Any, name: str) -> Any:
    """Return an entry of the blackboard, None if it is not set."""
    for read in (board.get_double, board.get_string):
        try:
            return read(name)
        except (RuntimeError, ValueError):
            continue
    return None


if __name__ == "__main__":
    json.dump([played(tree) for tree in json.load(sys.stdin)], sys.stdout)
