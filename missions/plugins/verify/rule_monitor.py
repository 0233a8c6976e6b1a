"""Monitor of one step of an exploration: which leaves start and end, and which rules and properties they violate."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeGuard

from py_trees.common import Status

from behaviours.leaf import FAILURE, IDLE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from missions.executive.modifiers import (
    ForModifier,
    InvertModifier,
    OnFailureModifier,
    OnRunningModifier,
    OnSuccessModifier,
    RepeatModifier,
    UntilModifier,
)
from missions.executive.parent import Modifier
from missions.executive.submission import Submission
from missions.language.nodes import MODIFIERS
from missions.language.plan import MissionProperty
from missions.plugins.verify.choices import Oracle

if TYPE_CHECKING:
    from missions.plugins.verify.stand_ins import StandIn


# Monitors: each checks one property of a mission along a run.


@dataclass
class PropertyMonitor:
    """Monitor of one property of a mission, such as "never A while B"; A and B are names of nodes or actuators.

    A node's name means the leaves below the nodes of that name, without their conditions; an actuator means the leaves
    that drive it. ``subject`` are the leaves of A, ``other`` the leaves of B. The success of a node in ``counts``
    counts as "B has succeeded", and so does that of a node in ``limits`` if it ends B early. Properties with "while"
    and "without" are checked on the running leaves. Those with "before" and "after" remember in ``happened`` that B has
    succeeded, and "always eventually" remembers that A has started.
    """

    promise: MissionProperty
    subject: frozenset[Leaf]
    other: frozenset[Leaf]
    counts: frozenset[Node]
    limits: frozenset[Node]
    happened: bool = False

    @property
    def rule(self) -> str:
        """Name in verdicts: the text of the property."""
        return self.promise.text

    def on_start(self, leaf: "StandIn", live_leaves: "Sequence[StandIn]") -> str:
        form = self.promise.form
        if form == "while":
            return self._overlap(leaf, live_leaves)
        if leaf not in self.subject:
            return ""
        if form == "eventually":
            self.happened = True
        elif form == "before" and not self.happened:
            return f"{leaf.label} starts, and {self.promise.other} has not succeeded"
        elif form == "after" and self.happened:
            return f"{leaf.label} starts, and {self.promise.other} has succeeded before"
        return ""

    def _overlap(self, leaf: "StandIn", live: "Sequence[StandIn]") -> str:
        """Return a violation text if the property forbids ``leaf`` to start while one of ``live`` runs, else ""."""
        for mine, theirs in ((self.subject, self.other), (self.other, self.subject)):
            clash = next((other for other in live if other in theirs), None)
            if leaf in mine and clash is not None:
                return f"{leaf.label} starts while {clash.label} runs"
        return ""

    @property
    def observed(self) -> frozenset[Node]:
        """All nodes on whose starts and ends the property depends."""
        return self.subject | self.other | self.counts | self.limits

    def on_success(self, node: Node) -> None:
        if not node.is_skipped:
            ended = node in self.limits and all(child.status is not SUCCESS for child in node.children)
            self.happened = self.happened or ended or node in self.counts

    def check_tick(self, live_leaves: "Sequence[StandIn]") -> str:
        if self.promise.form != "without" or any(leaf in self.other for leaf in live_leaves):
            return ""
        alone = next((leaf for leaf in live_leaves if leaf in self.subject), None)
        return "" if alone is None else f"{alone.label} runs, and nothing of {self.promise.other} does"

    def is_stopped(self, live: Iterable[Leaf]) -> bool:
        """Return whether none of the leaves named by the property's subject runs."""
        return not any(leaf in self.subject for leaf in live)


def make_monitor(promise: MissionProperty, nodes: Sequence[Node]) -> PropertyMonitor:
    """Return the monitor of a property of the tree with ``nodes``."""
    remembers = promise.form in ("before", "after")
    counts, limits = set[Node](), set[Node]()
    for node in _nodes_named(promise.other, nodes) if remembers else ():
        modifiers = _modifiers_around(node)
        counts.add(_counted_node(node, modifiers))
        limits.update(each for each in modifiers if isinstance(each, ENDS_EARLY))
    return PropertyMonitor(
        promise,
        _leaves_named(promise.subject, nodes),
        _leaves_named(promise.other, nodes),
        frozenset(counts),
        frozenset(limits - counts),
    )


CHANGES_RESULT = (InvertModifier, OnFailureModifier, OnSuccessModifier, OnRunningModifier)
"""Modifiers that may succeed though their node has not, or fail though it has succeeded."""

ENDS_EARLY = (ForModifier, UntilModifier)
"""Modifiers that end a running node with success."""


def _modifiers_around(node: Node) -> list[Modifier]:
    """Return the modifiers beside a node in the mission, from the innermost to the outermost."""
    found: list[Modifier] = []
    above = node.parent
    while isinstance(above, Modifier) and above.kind in MODIFIERS and node is above.child:
        found.append(above)
        node, above = above, above.parent
    return found


def _counted_node(node: Node, modifiers: Sequence[Modifier]) -> Node:
    """Return the node whose success means that ``node`` has succeeded with its ``modifiers``.

    It is the outermost modifier below the first that changes the result. Of a ``repeat: forever`` that nothing ends,
    each round counts.
    """
    for place, modifier in enumerate(modifiers):
        ends = any(isinstance(each, ENDS_EARLY) for each in modifiers[place:])
        if isinstance(modifier, CHANGES_RESULT) or (is_endless(modifier) and not ends):
            break
        node = modifier
    return node


def is_endless(node: Node) -> TypeGuard[RepeatModifier]:
    """Return whether a node is a ``repeat: forever``."""
    return isinstance(node, RepeatModifier) and node.value.template is None and node.value.constant is None


def _nodes_named(name: str, nodes: Sequence[Node]) -> list[Node]:
    """Return the nodes of a name: behaviours only, since their modifiers share the name."""
    nodes = [node for node in nodes if node.kind not in MODIFIERS]
    return [node for node in nodes if name in (node.name, _word_of(node))]


def _word_of(node: Node) -> str:
    """Return the word of a leaf, or the name of the mission that a node runs; empty for other nodes."""
    if isinstance(node, Submission):
        return node.mission
    return node.kind if isinstance(node, Leaf) else ""


def _leaves_named(name: str, nodes: Sequence[Node]) -> frozenset[Leaf]:
    """Return the leaves for which a name stands: those of an actuator, or below a node.

    The conditions below a node only decide whether it acts. They are left out, unless it has no other leaves.
    """
    found = {leaf for leaf in nodes if isinstance(leaf, Leaf) and name in leaf.drives}
    for node in _nodes_named(name, nodes):
        below = {leaf for leaf in node.iterate() if isinstance(leaf, Leaf)}
        found |= {leaf for leaf in below if not _is_condition(leaf)} or below
    return frozenset(found)


def _is_condition(leaf: Leaf) -> bool:
    """Return whether a leaf answers within a tick and does nothing else: by itself, or by its ``on_running``."""
    if any(isinstance(modifier, OnRunningModifier) for modifier in _modifiers_around(leaf)):
        return True
    return leaf.instant and not leaf.acts and not leaf.drives


EXCLUSIVE_ACTUATORS, REST_AFTER_END, VARIABLES_SET = "alone", "clean", "set"
"""Rules for every mission: one leaf per actuator, rest after a halt or an end, variables set before they are read."""


@dataclass(frozen=True, slots=True)
class Violation:
    """Violation of a rule or property by a node, with a message."""

    rule: str
    message: str
    node: Node


class TimeOver(NamedTuple):
    """Fact that the time of a node was over, so that it ended or halted."""

    node: Node


class Monitor(Protocol):
    """Monitor of one property along a run; ``happened`` is its only memory."""

    happened: bool

    @property
    def rule(self) -> str:
        """Name of the monitored property in verdicts."""
        ...

    def on_start(self, leaf: "StandIn", live_leaves: "Sequence[StandIn]") -> str:
        """Handle the start of a leaf while ``live_leaves`` run; return a violation text, or an empty one."""
        ...

    def on_success(self, node: Node) -> None:
        """Handle the success of a node, which may be the event that the property waits for."""
        ...

    def check_tick(self, live_leaves: "Sequence[StandIn]") -> str:
        """Check the leaves that run after a tick; return a violation text, or an empty one."""
        ...


@dataclass
class RuleMonitor:
    """Monitors one step of an exploration.

    It needs two facts of the steps before: the memory of each property monitor (``happened``), and the actuators that a
    halted leaf has left ``moving``. ``rounds`` are the nodes under a ``repeat: forever``; if one of them succeeds,
    ``completed_round`` is set. ``timed_nodes`` are the nodes that wait for a time, each with the status that it has
    when the time is over. ``facts`` are the nodes that the step has reached while all sensors reported, and a
    TimeOver for each timed node whose time was over. ``reads`` has, for each node, the variables that must be set when
    it starts. ``stand_ins`` caches the stand-in classes.
    """

    oracle: Oracle = field(default_factory=Oracle)
    leaves: "list[StandIn]" = field(default_factory=list)
    monitors: Sequence[Monitor] = ()
    rounds: frozenset[Node] = frozenset()
    timed_nodes: Mapping[Node, Status] = field(default_factory=dict)
    moving: frozenset[str] = frozenset()
    violations: list[Violation] = field(default_factory=list)
    changes: list[tuple[Node, Status]] = field(default_factory=list)
    facts: set[object] = field(default_factory=set)
    reads: Mapping[Node, frozenset[str]] = field(default_factory=dict)
    completed_round: bool = False
    stand_ins: "dict[object, type[StandIn]]" = field(default_factory=dict)
    _acting: "dict[StandIn, None]" = field(default_factory=dict)

    def set_leaves(self, leaves: "Sequence[StandIn]") -> None:
        """Set the leaves of the model that this monitor observes."""
        self.leaves = list(leaves)
        self._acting.clear()

    def begin(self, happened: Sequence[bool], moving: frozenset[str]) -> None:
        """Begin a step, given the memory of the monitors after the step before, and the actuators left moving."""
        self.moving = moving
        self.violations, self.changes, self.completed_round = [], [], False
        self.facts = set()
        self._acting = dict.fromkeys(leaf for leaf in self.live_leaves if leaf.drives)
        for monitor, remembered in zip(self.monitors, happened, strict=True):
            monitor.happened = remembered

    @property
    def happened(self) -> tuple[bool, ...]:
        """Memory of the property monitors: for each of them, whether its event has happened."""
        return tuple(monitor.happened for monitor in self.monitors)

    @property
    def live_leaves(self) -> "list[StandIn]":
        """Leaves that have started, and have neither ended nor come to rest."""
        return [leaf for leaf in self.leaves if leaf.is_acting]

    # --- called by the stand-ins and the nodes ------------------------------------------------------------------------

    def on_status(self, time: float, tick: int, node: Node, status: Status, reason: str) -> None:
        """Handle a node's new status (as a ``behaviours.run.NodeObserver``)."""
        del time, tick
        self.changes.append((node, status))
        if status is IDLE:
            return
        if self.oracle.all_sensors_report:
            self.facts.add(node)
        if status is RUNNING:
            return
        if self.timed_nodes.get(node) is status and not (
            isinstance(node, ForModifier) and any(child.status is status for child in node.children)
        ):
            self.facts.add(TimeOver(node))  # its time is over; it is not its child that has ended
        if status is FAILURE:
            if node in self.reads:
                self._check_reads(node, reason)
            return
        self.completed_round = self.completed_round or node in self.rounds
        for monitor in self.monitors:
            monitor.on_success(node)

    def on_reset(self, time: float, tick: int, nodes: Sequence[Node]) -> None:
        """Handle the reset of nodes (as a ``behaviours.run.NodeObserver``)."""
        del time, tick
        self.changes += [(node, IDLE) for node in nodes]

    def _check_reads(self, node: Node, reason: str) -> None:
        """Record a violation if a node has failed because a variable that it reads is not set."""
        for name in sorted(self.reads[node] - node.scope.keys()):
            if f"'{name}' is not set" in reason:
                self.violations.append(Violation(VARIABLES_SET, f"'{name}' is read here, but nothing has set it", node))

    def on_start(self, leaf: "StandIn") -> None:
        """Handle the start of a leaf: check the rules and properties about starts."""
        if self.oracle.all_sensors_report:
            self.facts.add(leaf)
        self.moving -= leaf.drives
        for other in [other for other in self._acting if other is not leaf]:
            if not other.is_acting:
                del self._acting[other]
                continue
            for part in sorted(leaf.drives & other.drives):
                self.violations.append(
                    Violation(EXCLUSIVE_ACTUATORS, f"{other.label} and {leaf.label} both drive the {part}", leaf)
                )
        if leaf.drives:
            self._acting[leaf] = None
        live = [other for other in self.live_leaves if other is not leaf] if self.monitors else []
        for monitor in self.monitors:
            self._add_broken(monitor, monitor.on_start(leaf, live), leaf)

    def on_left_moving(self, leaf: "StandIn") -> None:
        """Note that a halted leaf has left its actuators moving, because it does not stop them."""
        self.moving |= leaf.drives

    def add_violation(self, leaf: "StandIn", message: str) -> None:
        """Record a violation of the rule that a leaf is stopped once after each start; ``message`` describes it."""
        self.violations.append(Violation(REST_AFTER_END, f"{leaf.label} {message}", leaf))

    # --- after the step -----------------------------------------------------------------------------------------------

    def check_tick(self) -> None:
        """Record violations after a tick: leaves that were not stopped when they ended, and broken properties."""
        for leaf in self.leaves:
            if leaf.status is not RUNNING and (leaf.live or leaf.is_acting):
                self.add_violation(leaf, "was not stopped when it ended")
        live = self.live_leaves if self.monitors else []
        for monitor in self.monitors:
            broken = monitor.check_tick(live)
            self._add_broken(monitor, broken, next(iter(live), self.leaves[0]))

    def check_rest(self) -> None:
        """Record violations after the end of the tree or of a halt: leaves that still run, actuators that move."""
        for leaf in self.live_leaves:
            self.violations.append(Violation(REST_AFTER_END, f"{leaf.label} still runs", leaf))
        for part in sorted(self.moving):
            claimant = next(leaf for leaf in self.leaves if part in leaf.drives and not leaf.stops)
            self.violations.append(
                Violation(REST_AFTER_END, f"the {part} still moves: {claimant.label} leaves it to itself", claimant)
            )

    def _add_broken(self, monitor: Monitor, broken: str, node: Node) -> None:
        if broken:
            self.violations.append(Violation(monitor.rule, broken, node))
