"""Ticks trees of BehaviorTree.CPP, by its Python bindings.

Standard input is a JSON list of trees: ``xml``, the ``outcomes`` of each leaf by its name, one letter each time that
it is ticked, over and over, and how many ``ticks``; ``clocked`` are the leaves that give a letter for each tick of the
root instead, and are not told of. Standard output is a JSON list of what happened: for each tick the status of the
root, the leaves that were ticked, in order, with their outcomes, and the leaves that were halted.
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
    leaves = Leaves(tree["outcomes"], tree.get("clocked", ()))
    factory = BehaviorTreeFactory()
    factory.register_simple_stateful_action("Probe", leaves.tick, leaves.tick, leaves.halt)
    factory.register_behavior_tree_from_text(tree["xml"])
    root = factory.create_tree("Main")
    told = []
    for leaves.number in range(tree["ticks"]):
        leaves.ticked, leaves.halted = [], []
        status = root.tick_exactly_once()
        told.append([status.name, leaves.ticked, sorted(leaves.halted)])
    return told


if __name__ == "__main__":
    json.dump([played(tree) for tree in json.load(sys.stdin)], sys.stdout)
