"""Ticks trees of BehaviorTree.CPP, by its Python bindings.

Standard input is a JSON list of trees: ``xml``, the ``outcomes`` of each leaf by its name, one letter a tick, over and
over, and how many ``ticks``. Standard output is a JSON list of what happened: for each tick the status of the root, the
leaves that were ticked, in order, with their outcomes, and the leaves that were halted.
"""

import json
import sys
from collections.abc import Mapping
from typing import Any

from behaviortreepy import BehaviorTreeFactory, NodeStatus

STATUSES = {"R": NodeStatus.RUNNING, "S": NodeStatus.SUCCESS, "F": NodeStatus.FAILURE}


class Leaves:
    """The leaves of one tree: each gives its outcomes in turn, and what happens to it is written down."""

    def __init__(self, outcomes: Mapping[str, str]) -> None:
        self._outcomes = outcomes
        self._given = dict.fromkeys(outcomes, 0)
        self.ticked: list[str] = []
        self.halted: list[str] = []

    def tick(self, node: Any) -> Any:
        """Give the next outcome."""
        name = node.name()
        outcome = self._outcomes[name][self._given[name] % len(self._outcomes[name])]
        self._given[name] += 1
        self.ticked.append(f"{name} {outcome}")
        return STATUSES[outcome]

    def halt(self, node: Any) -> None:
        """Write it down."""
        self.halted.append(node.name())


def played(tree: Mapping[str, Any]) -> list[list[Any]]:
    """Tick one tree."""
    leaves = Leaves(tree["outcomes"])
    factory = BehaviorTreeFactory()
    factory.register_simple_stateful_action("Probe", leaves.tick, leaves.tick, leaves.halt)
    factory.register_behavior_tree_from_text(tree["xml"])
    root = factory.create_tree("Main")
    told = []
    for _ in range(tree["ticks"]):
        leaves.ticked, leaves.halted = [], []
        status = root.tick_exactly_once()
        told.append([status.name, leaves.ticked, sorted(leaves.halted)])
    return told


if __name__ == "__main__":
    json.dump([played(tree) for tree in json.load(sys.stdin)], sys.stdout)
