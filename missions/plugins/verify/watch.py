"""What is seen during a step: leaves that start and end, and whatever breaks a rule or a property."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from py_trees.common import Status

from behaviours.leaf import FAILURE, IDLE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from missions.executive.parent import Modifier
from missions.language.plan import Property
from missions.plugins.verify.choices import Oracle

if TYPE_CHECKING:
    from missions.plugins.verify.mocks import StandIn


# Monitors: each follows one of a mission's properties along a run.


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


ALONE, CLEAN, SET = "alone", "clean", "set"
"""The rules that hold for every mission: one to an actuator, all at rest after a halt, what is read has been set."""


@dataclass(frozen=True, slots=True)
class Breach:
    """A rule or property that was broken: which, in what words, and by which node."""

    rule: str
    what: str
    node: Node


class Monitor(Protocol):
    """Follows one property along a run; ``happened`` is all that it needs to remember."""

    happened: bool

    @property
    def rule(self) -> str:
        """What it is called in verdicts."""
        ...

    def started(self, leaf: "StandIn", live: "Sequence[StandIn]") -> str:
        """Hear of a leaf that starts while ``live`` ones run; return what is broken, or nothing."""
        ...

    def succeeded(self, node: Node) -> None:
        """Hear of a node that has succeeded."""
        ...

    def rested(self, live: "Sequence[StandIn]") -> str:
        """Hear which leaves run after a tick; return what is broken, or nothing."""
        ...


@dataclass
class Watch:
    """Follows one step, from the past that it is given: what monitors remember, and what was left moving.

    ``rounds`` are the nodes under a ``repeat: forever``: when one succeeds, ``went_round`` says so. ``timed`` are the
    nodes that wait for a time, each with the status that shows that it is over; ``over`` those of which it ever was.
    ``reached`` are the nodes that some run comes to while all sensors report.
    ``reads`` has the variables that nodes read when they start, and without which they fail. ``stand_ins`` are the
    classes of the leaves, by what these have in common.
    """

    oracle: Oracle = field(default_factory=Oracle)
    leaves: "list[StandIn]" = field(default_factory=list)
    monitors: Sequence[Monitor] = ()
    rounds: frozenset[Node] = frozenset()
    timed: Mapping[Node, Status] = field(default_factory=dict)
    moving: frozenset[str] = frozenset()
    breaches: list[Breach] = field(default_factory=list)
    changes: list[tuple[Node, Status]] = field(default_factory=list)
    reached: set[Node] = field(default_factory=set)
    reads: Mapping[Node, frozenset[str]] = field(default_factory=dict)
    over: set[Node] = field(default_factory=set)
    went_round: bool = False
    stand_ins: "dict[object, type[StandIn]]" = field(default_factory=dict)
    _acting: "dict[StandIn, None]" = field(default_factory=dict)

    def follow(self, leaves: "Sequence[StandIn]") -> None:
        """Take the leaves that are to be followed."""
        self.leaves = list(leaves)
        self._acting.clear()

    def begin(self, happened: Sequence[bool], moving: frozenset[str]) -> None:
        """Begin a step."""
        self.moving = moving
        self.breaches, self.changes, self.went_round = [], [], False
        self._acting = dict.fromkeys(leaf for leaf in self.live if leaf.drives)
        for monitor, remembered in zip(self.monitors, happened, strict=True):
            monitor.happened = remembered

    @property
    def happened(self) -> tuple[bool, ...]:
        """What the monitors remember."""
        return tuple(monitor.happened for monitor in self.monitors)

    @property
    def live(self) -> "list[StandIn]":
        """The leaves that have started, and have neither ended nor come to rest."""
        return [leaf for leaf in self.leaves if leaf.acting]

    # --- called by the stand-ins and the nodes ------------------------------------------------------------------------

    def changed(self, node: Node) -> None:
        """Hear of a node whose status has changed; the observer of the run."""
        self.changes.append((node, node.status))
        if node.status is not IDLE and self.oracle.all_report:
            self.reached.add(node)
        if self.timed.get(node) is node.status and all(child.status is not FAILURE for child in node.children):
            self.over.add(node)  # of a timeout: it is not the child that has failed
        if node.status is FAILURE:
            for name in sorted(self.reads.get(node, frozenset()) - node.scope.keys()):
                if f"'{name}' is not set" in node.feedback_message:
                    self.breaches.append(Breach(SET, f"'{name}' is read here, but nothing has set it", node))
        if node.status is SUCCESS:
            self.went_round = self.went_round or node in self.rounds
            for monitor in self.monitors:
                monitor.succeeded(node)

    def started(self, leaf: "StandIn") -> None:
        """Hear of a leaf that starts."""
        if self.oracle.all_report:
            self.reached.add(leaf)
        self.moving -= leaf.drives
        for other in [other for other in self._acting if other is not leaf]:
            if not other.acting:
                del self._acting[other]
                continue
            for part in sorted(leaf.drives & other.drives):
                self.breaches.append(Breach(ALONE, f"{other.place} and {leaf.place} both drive the {part}", leaf))
        if leaf.drives:
            self._acting[leaf] = None
        live = [other for other in self.live if other is not leaf] if self.monitors else []
        for monitor in self.monitors:
            self._note(monitor, monitor.started(leaf, live), leaf)

    def left_moving(self, leaf: "StandIn") -> None:
        """Hear of a leaf that was halted and stops nothing."""
        self.moving |= leaf.drives

    def wrong(self, leaf: "StandIn", what: str) -> None:
        """Hear of a leaf that was not started and ended once each."""
        self.breaches.append(Breach(CLEAN, f"{leaf.place} {what}", leaf))

    # --- after the step -----------------------------------------------------------------------------------------------

    def after_tick(self) -> None:
        """Look at what runs after a tick."""
        for leaf in self.leaves:
            if leaf.status is not RUNNING and (leaf.live or leaf.acting):
                self.wrong(leaf, "was not told to stop when it ended")
        live = self.live if self.monitors else []
        for monitor in self.monitors:
            broken = monitor.rested(live)
            self._note(monitor, broken, next(iter(live), self.leaves[0]))

    def at_rest(self) -> None:
        """Look at what is left once the tree has ended, or has come to rest after a halt."""
        for leaf in self.live:
            self.breaches.append(Breach(CLEAN, f"{leaf.place} still runs", leaf))
        for part in sorted(self.moving):
            claimant = next(leaf for leaf in self.leaves if part in leaf.drives and not leaf.stops)
            self.breaches.append(
                Breach(CLEAN, f"the {part} still moves: {claimant.place} leaves it to itself", claimant)
            )

    def _note(self, monitor: Monitor, broken: str, node: Node) -> None:
        if broken:
            self.breaches.append(Breach(monitor.rule, broken, node))
