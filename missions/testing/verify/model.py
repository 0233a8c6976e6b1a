"""The model: a mission's own nodes over stand-ins for its leaves, whose whole state can be taken and put back."""

from collections.abc import Iterable, Iterator, MutableSequence
from dataclasses import dataclass, replace
from itertools import permutations
from random import Random
from typing import Any

from py_trees.common import Status

from behaviours.leaf import FAILURE, SUCCESS
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import SENSOR_TIMEOUT, NodeByNode, Run
from missions.executive.build import build
from missions.executive.modifiers import Repeat
from missions.executive.timed import ASKED_AGAIN, Hold, Timeout
from missions.language.kinds import STATE
from missions.language.plan import Plan
from missions.testing.verify.abstract import abstract, durations, missing
from missions.testing.verify.alike import tell_fewer_apart
from missions.testing.verify.choices import Oracle
from missions.testing.verify.guesses import UNKNOWN, Sensed
from missions.testing.verify.instants import Timing
from missions.testing.verify.mocks import StandIn, WaitStandIn
from missions.testing.verify.monitors import Following, follow
from missions.testing.verify.readers import readers
from missions.testing.verify.scopes import Scopes
from missions.testing.verify.snapshot import Row, Rows, Snapshots
from missions.testing.verify.watch import Watch
from missions.testing.verify.zone import Rows as Times
from missions.testing.verify.zone import loosened

ORDERS = 5
"""Children of a random composite up to which all their orders are tried; of more, only some, and that is told."""


@dataclass(frozen=True, slots=True)
class State:
    """All that decides how a run goes on: the nodes' fields, live variables, what monitors remember, and the times."""

    rows: Rows
    variables: tuple[Row, ...]
    happened: tuple[bool, ...]
    moving: frozenset[str]
    times: Times


class Model:
    """A mission ready to be explored. ``sampled`` says that not every order of a random composite is tried."""

    def __init__(self, plan: Plan, sensor_timeout: float = SENSOR_TIMEOUT) -> None:
        self.oracle = Oracle()
        self.watch = Watch(self.oracle)
        self.timing = Timing(self.oracle)
        self.run = Run(self.timing)
        self.run.sensor_timeout = sensor_timeout
        self.shuffler = self.run.random = Shuffler(self.oracle)
        self.run.observer = NodeByNode(self.watch.changed)
        self.run.variables.update({part: Sensed(self.oracle, part) for part in STATE})
        self.run.variables.update(dict.fromkeys(missing(plan), UNKNOWN))
        tree = abstract(plan.tree, self.oracle, self.watch, plan.tree.names)
        self.root = build(replace(plan, tree=tree), self.run, lambda _: Robot())
        self.nodes = list(_walk(self.root))
        self.monitors: tuple[Following, ...] = tuple(follow(promise, self.nodes) for promise in plan.properties)
        tell_fewer_apart(self.nodes, self.monitors)
        self.watch.follow([node for node in self.nodes if isinstance(node, StandIn)])
        self.watch.monitors = self.monitors
        self.watch.rounds = frozenset(node.child for node in self.nodes if isinstance(node, Repeat) and _endless(node))
        self.watch.timed = {
            node: _when_over(node) for node in self.nodes if isinstance(node, Timeout | Hold | WaitStandIn)
        }
        self.watch.reads = readers(plan.tree, self.nodes)
        self._snapshots = Snapshots(self.nodes, self.timing)
        self._scopes = Scopes(tree, self.nodes, self.run.variables)
        self._seconds = sorted({*durations(plan.tree), sensor_timeout, ASKED_AGAIN})

    def tick(self) -> None:
        """Tick once."""
        self.run.tick += 1
        self.root.execute_tick()
        self.watch.after_tick()

    def halt(self) -> bool:
        """Tell the tree to halt, or ask it again; True once it is at rest."""
        self.run.tick += 1
        return self.root.halt()

    def state(self) -> State:
        """Take the present state, in a form in which states that have the same future are equal."""
        rows, instants = self._snapshots.take()
        times = self.timing.zone.later(instants)
        return State(rows, self._scopes.take(rows), self.watch.happened, self.watch.moving, times)

    def put(self, state: State) -> None:
        """Put a state back, and begin a step from it."""
        self.timing.set(state.times)
        self._snapshots.put(state.rows)
        for node in self.nodes:
            node.suspension = None
        self._scopes.put(state.variables)
        self.watch.begin(state.happened, state.moving)

    def coarser(self, state: State) -> State:
        """Return ``state`` with less known about its times."""
        return replace(state, times=loosened(state.times, self._seconds))


class Shuffler(Random):
    """Where the order of a random composite comes from: a choice among all orders, as far as they are few."""

    def __init__(self, oracle: Oracle) -> None:
        super().__init__(0)
        self._oracle = oracle
        self.sampled = False

    def shuffle(self, x: MutableSequence[Any]) -> None:
        """Put ``x`` into one of its orders."""
        before = list(x)
        if len(before) <= ORDERS:
            orders = [list(order) for order in permutations(before)]
        else:
            self.sampled = True
            orders = [before[place:] + before[:place] for place in range(len(before))]
        x[:] = self._oracle.choose(orders, _order)


def _order(children: Iterable[Any]) -> str:
    return f"the order is {', '.join(child.name for child in children)}"


def _endless(node: Repeat) -> bool:
    return node.value.template is None and node.value.constant is None


def _when_over(node: Node) -> Status:
    return FAILURE if isinstance(node, Timeout) else SUCCESS


def _walk(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        if isinstance(child, Node):
            yield from _walk(child)
