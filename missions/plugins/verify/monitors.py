"""Monitors: each follows one of a mission's properties along a run."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from behaviours.leaf import Leaf
from behaviours.node import Node
from missions.executive.parent import Modifier
from missions.language.plan import Property

if TYPE_CHECKING:
    from missions.plugins.verify.mocks import StandIn


@dataclass
class Following:
    """One property, with the leaves that its names stand for, and the nodes whose success counts.

    A name stands for every node of that name, and so for all the leaves below it; an actuator for the leaves that
    drive it. "Never A while B" and "without" ask which leaves run; "before" and "after" remember in ``happened`` that
    B has succeeded, "always eventually" that A has started.
    """

    promise: Property
    subject: frozenset[Leaf]
    other: frozenset[Leaf]
    counts: frozenset[Node]
    happened: bool = False

    @property
    def rule(self) -> str:
        """What it is called in verdicts: its text."""
        return self.promise.text

    def started(self, leaf: "StandIn", live: "Sequence[StandIn]") -> str:
        """Hear of a leaf that starts while ``live`` ones run; return what is broken, or nothing."""
        form = self.promise.form
        if form == "while":
            return self._overlap(leaf, live)
        if leaf not in self.subject:
            return ""
        if form == "eventually":
            self.happened = True
        elif form == "before" and not self.happened:
            return f"{leaf.place} starts, and {self.promise.other} has not succeeded"
        elif form == "after" and self.happened:
            return f"{leaf.place} starts, and {self.promise.other} has succeeded before"
        return ""

    def _overlap(self, leaf: "StandIn", live: "Sequence[StandIn]") -> str:
        """Return who runs at the same time as ``leaf`` and must not."""
        for mine, theirs in ((self.subject, self.other), (self.other, self.subject)):
            clash = next((other for other in live if other in theirs), None)
            if leaf in mine and clash is not None:
                return f"{leaf.place} starts while {clash.place} runs"
        return ""

    def succeeded(self, node: Node) -> None:
        """Hear of a node that has succeeded."""
        self.happened = self.happened or node in self.counts

    def rested(self, live: "Sequence[StandIn]") -> str:
        """Hear which leaves run after a tick; return what is broken, or nothing."""
        if self.promise.form != "without" or any(leaf in self.other for leaf in live):
            return ""
        alone = next((leaf for leaf in live if leaf in self.subject), None)
        return "" if alone is None else f"{alone.place} runs, and nothing of {self.promise.other} does"

    def stopped(self, live: Iterable[Leaf]) -> bool:
        """Say whether nothing of the subject runs."""
        return not any(leaf in self.subject for leaf in live)


def follow(promise: Property, nodes: Sequence[Node]) -> Following:
    """Return the monitor of a property of the tree that ``nodes`` are."""
    remembers = promise.form in ("before", "after")
    return Following(
        promise,
        _leaves(promise.subject, nodes),
        _leaves(promise.other, nodes),
        frozenset(_named(promise.other, nodes)) if remembers else frozenset(),
    )


def _named(name: str, nodes: Sequence[Node]) -> list[Node]:
    """Return the nodes that a name stands for: the behaviours themselves, not the modifiers that share their names."""
    nodes = [node for node in nodes if not isinstance(node, Modifier)]
    return [node for node in nodes if node.name == name or (isinstance(node, Leaf) and node.kind == name)]


def _leaves(name: str, nodes: Sequence[Node]) -> frozenset[Leaf]:
    """Return the leaves that a name stands for."""
    named = _named(name, nodes)
    return frozenset(
        leaf
        for leaf in nodes
        if isinstance(leaf, Leaf)
        and (name in leaf.drives or any(leaf.key == node.key or leaf.key.startswith(f"{node.key}.") for node in named))
    )
