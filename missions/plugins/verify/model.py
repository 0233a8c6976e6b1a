"""The model: a mission's own nodes over stand-ins for its leaves, whose whole state can be taken and put back."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, MutableSequence, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from random import Random
from typing import Any

from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import SENSOR_TIMEOUT, NodeByNode, Run
from missions.executive.at_once import Parallel
from missions.executive.build import Scope, build
from missions.executive.modifiers import ASKED_AGAIN, Hold, Invert, OnFailure, OnSuccess, Repeat, Timeout
from missions.executive.parent import Modifier, Parent
from missions.executive.submission import Submission
from missions.language.expressions import Value
from missions.language.for_each import Members, own_steps
from missions.language.kinds import STATE
from missions.language.nodes import FOR_EACH, MISSION, MODIFIERS, SWITCHES
from missions.language.plan import Plan, Step
from missions.language.reading import surely_read
from missions.language.unset import catches
from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.guesses import (
    MAX_COUNT,
    TWICE,
    UNKNOWN,
    Anything,
    Guess,
    Many,
    Sensed,
    Several,
    asks_sensor,
    widened,
)
from missions.plugins.verify.instants import Rows as Times
from missions.plugins.verify.instants import Some, Timing, loosened
from missions.plugins.verify.live import live_while_running
from missions.plugins.verify.mocks import StandIn, WaitStandIn, outcomes, stand_in, waits
from missions.plugins.verify.snapshot import Row, Rows, Snapshots, frozen, thawed
from missions.plugins.verify.watch import Following, Watch, follow

# From a checked plan to one whose leaves are stand-ins and whose unknown values are choices.

TIMES = frozenset(word for word, kind in MODIFIERS.items() if kind.value == "duration")
COUNTS = frozenset(word for word, kind in MODIFIERS.items() if kind.value == "count")

OTHERWISE = "anything else"
"""What a ``switch`` finds that is none of its cases."""


def abstract(step: Step, oracle: Oracle, watch: Watch, names: frozenset[str]) -> Step:
    """Return ``step``, and all below it, for a model that asks ``oracle`` and is followed by ``watch``.

    ``names`` are the variables that something sets in its mission.
    """
    inner = step.children[0].names if step.kind == MISSION else names
    children = tuple(abstract(child, oracle, watch, inner) for child in step.children)
    if step.leaf is not None:
        return replace(step, leaf=stand_in(step, oracle, watch), arguments=_arguments(step, step.leaf, oracle, names))
    returns = {name: _stored(value, oracle) for name, value in step.returns.items()}
    arguments = {name: _setting(step, value, oracle) for name, value in step.arguments.items()}
    return replace(step, children=children, arguments=arguments, returns=returns)


def _arguments(step: Step, leaf: type[Leaf], oracle: Oracle, names: frozenset[str]) -> dict[str, Value]:
    """Return the arguments that matter: what a leaf stores, and what can keep one from starting that cannot fail."""
    if leaf.open_ended:
        return {name: _stored(replace(value, convert=None), oracle) for name, value in step.arguments.items()}
    if any(outcome.status is FAILURE for outcome in outcomes(step)):
        asked = {name: value for name, value in step.arguments.items() if surely_read(value) & names or _senses(value)}
        return {f"argument_{name}": replace(_guess(value, oracle), asked=True) for name, value in asked.items()}
    computed = {name: value for name, value in step.arguments.items() if value.template is not None}
    return {f"argument_{name}": _guess(value, oracle) for name, value in computed.items()}


def _senses(value: Value) -> bool:
    """Say whether a value is computed from what a sensor reports."""
    return value.template is not None and any(map(asks_sensor, value.template.reads))


def _setting(step: Step, value: Value, oracle: Oracle) -> Value:
    """Return what a modifier, a switch or a sub-mission is given."""
    if step.kind == MISSION:
        return _stored(value, oracle)
    if step.kind in COUNTS:
        return _count(value, oracle)
    if step.kind == FOR_EACH:
        return _members(value, oracle)
    if value.template is None:
        return value
    if step.kind in TIMES:
        return Guess(template=value.template, oracle=oracle, options=(Some.of(oracle),), blind=True)
    if step.kind in SWITCHES:
        return _guess(value, oracle, *dict.fromkeys(step.cases), OTHERWISE)
    if step.kind == "once":
        return _guess(value, oracle, Anything(oracle))
    if step.kind == "parallel":
        return _guess(value, oracle, *range(1, len(step.children) + 1))
    return _guess(value, oracle, True, False)


def _guess(value: Value, oracle: Oracle, *options: object) -> Guess:
    return Guess(
        template=value.template,
        convert=value.convert,
        constant=value.constant,
        oracle=oracle,
        options=options or (UNKNOWN,),
    )


def _stored(value: Value, oracle: Oracle) -> Value:
    if value.template is None:
        return value
    return Guess(template=value.template, convert=value.convert, oracle=oracle, kept=widened)


def _count(value: Value, oracle: Oracle) -> Value:
    many = Many.of(oracle, TWICE)
    if value.template is None:
        return Value(many) if isinstance(value.constant, int) and value.constant > MAX_COUNT else value
    return Guess(
        template=value.template,
        convert=value.convert,
        oracle=oracle,
        options=(Many.of(oracle, 0),),
        kept=lambda found: many if isinstance(found, int) and found > MAX_COUNT else found,
    )


def _members(value: Value, oracle: Oracle) -> Value:
    many = Several((UNKNOWN,), Many.of(oracle, TWICE))

    def kept(found: object) -> object:
        return many if isinstance(found, Members) and found.count > MAX_COUNT else found

    if value.template is None:
        return Value(kept(value.constant))
    unknown = Several((UNKNOWN,), Many.of(oracle, 0))
    return Guess(
        template=value.template,
        convert=value.convert,
        oracle=oracle,
        options=(unknown,),
        kept=kept,
    )


def durations(tree: Step) -> frozenset[float]:
    """Return the times that a run can wait for, in seconds."""
    found = set()
    for step in tree.walk():
        value = step.arguments.get("value")
        if step.kind in TIMES and value is not None and isinstance(value.constant, float):
            found.add(value.constant)
        if step.leaf is not None and step.leaf.halting is not Leaf.halting:
            found.add(step.leaf.halt_limit)
        seconds = waits(step)
        if seconds is not None:
            found.add(seconds)
    return frozenset(found)


def missing(plan: Plan) -> frozenset[str]:
    """Return the params that only a caller can give, and that this one did not."""
    reads = {
        read.name
        for step in own_steps(plan.tree)
        for value in step.arguments.values()
        if value.template is not None
        for read in value.template.reads
    }
    return frozenset(reads - plan.params.keys() - plan.tree.names - STATE.keys())


# Runs that nobody can tell apart: of many of them one is explored, so that a mission with many leaves stays small.
#
# Two cases, both exact. Where a modifier above a leaf takes success and failure for the same, one of the two will do.
# And in a ``parallel``, of leaves that keep nothing, wait for nothing and stop at once, it does not matter which ends
# before which, since until the parallel ends each of them might as well have gone on: all but the first of them,
# their ``leader``, go on while it does, and end in the tick in which it has. For every run there is such a run in
# which each node around them does the same in the same tick (a partial-order reduction, with one representative of
# all orders).

_SAME = {OnFailure: SUCCESS, OnSuccess: FAILURE}
"""The modifiers for which success and failure are the same, and what they make of both."""


def tell_fewer_apart(nodes: Sequence[Node], monitors: Sequence[Following]) -> None:
    """Let the stand-ins among ``nodes`` leave out what comes to the same, as far as no monitor asks for them."""
    asked = frozenset[Node]().union(*(monitor.subject | monitor.other | monitor.counts for monitor in monitors))
    for node in nodes:
        if type(node) in _SAME:
            leaf = _leaf_of(node, asked)
            if leaf is not None and leaf.keep_as is None:
                leaf.ends_alike = True
    for node in nodes:
        if isinstance(node, Parallel) and not node.counts:
            free = [
                leaf for child in node.members if (leaf := _leaf_of(child, asked)) is not None and _is_free(child, leaf)
            ]
            for leaf in free[1:]:
                leaf.leader = free[0]


def _leaf_of(node: Node, asked: frozenset[Node]) -> StandIn | None:
    """Return the leaf of which ``node`` makes something each time that it ends, and keeps nothing; None if not so."""
    while isinstance(node, Invert | OnFailure | OnSuccess) and node not in asked:
        node = node.child
    return node if type(node).__base__ is StandIn and isinstance(node, StandIn) and node not in asked else None


def _is_free(child: Node, leaf: StandIn) -> bool:
    """Say whether a leaf keeps nothing, stops at once, and may go on as well as end, so that ``child`` succeeds."""
    statuses = {outcome.status for outcome in leaf.outcomes}
    if leaf.sensor:  # it fails by itself once that is silent for too long
        return False
    can = {RUNNING} <= statuses and SUCCESS in {_made_of(child, status) for status in statuses - {RUNNING}}
    return can and leaf.keep_as is None and not (leaf.computed or leaf.lingers) and leaf.stops


def _made_of(node: Node, status: object) -> object:
    """Return what the modifiers from ``node`` on make of the status of the leaf within."""
    if not isinstance(node, Modifier):
        return status
    below = _made_of(node.child, status)
    return _SAME.get(type(node)) or (FAILURE if below is SUCCESS else SUCCESS)


# Which nodes read variables that must have been set, so that a run that comes to them too early is found.


def readers(tree: Step, nodes: Sequence[Node]) -> Mapping[Node, frozenset[str]]:
    """Return for each node the variables that it reads when it starts, as far as something in its mission sets them.

    Those whose failure does no harm are left out.
    """
    read = dict(_reads(tree, "1", tree.names))
    return {node: names for node in nodes if (names := read.get(node.key))}


def _reads(step: Step, key: str, names: frozenset[str]) -> Iterator[tuple[str, frozenset[str]]]:
    """Yield the variables by the keys of their nodes."""
    if step.kind not in TIMES:
        yield key, frozenset[str]().union(*map(surely_read, step.arguments.values())) & names
    inner = step.children[0].names if step.kind == MISSION else names
    for place, child in enumerate(step.children, start=1):
        if not catches(step, child):
            yield from _reads(child, f"{key}.{place}", inner)


# The variables of a mission, and of those inside it, as far as they decide anything yet.


class Scopes:
    """Takes and puts back variables: ``variables`` of the mission itself, whose ``nodes`` were built from ``tree``."""

    def __init__(self, tree: Step, nodes: Sequence[Node], variables: Scope) -> None:
        self._nodes = nodes
        self._scopes = (variables, *(node.inner for node in nodes if isinstance(node, Submission)))
        self._live = live_while_running(tree)
        self._live_in: dict[Rows, tuple[frozenset[str] | None, ...]] = {}

    def take(self, rows: Rows) -> tuple[Row, ...]:
        """Return what is live of each scope; ``rows`` stand for the state that the nodes are in."""
        if rows not in self._live_in:
            self._live_in[rows] = self._live_now()
        each = zip(self._scopes, self._live_in[rows], strict=True)
        return tuple(frozen(scope if live is None else _only(scope, live)) for scope, live in each)

    def put(self, kept: Sequence[Row]) -> None:
        """Give every scope what was taken of it, and nothing else."""
        for scope, row in zip(self._scopes, kept, strict=True):
            scope.clear()
            scope.update(thawed(row))

    def _live_now(self) -> tuple[frozenset[str] | None, ...]:
        """Return the variables of each scope that are live; None for all, before the start and while a halt goes on."""
        halting = any(isinstance(node, Parent) and node.ending is not None for node in self._nodes)
        if halting or self._nodes[0].status is not RUNNING:
            return (None,) * len(self._scopes)
        live: dict[int, set[str]] = defaultdict(set)
        for node in self._nodes:
            if node.status is RUNNING:
                live[id(node.scope)] |= self._live[node.key]
        return tuple(frozenset(live[id(scope)]) for scope in self._scopes)


def _only(scope: Scope, names: frozenset[str]) -> Mapping[str, object]:
    return {name: scope[name] for name in names if name in scope}


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
