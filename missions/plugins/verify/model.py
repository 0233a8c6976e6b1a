"""Model of a mission: its own nodes with stand-ins for the leaves; its complete state can be saved and restored."""

import ast
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, MutableSequence, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from random import Random
from typing import Any

from py_trees.common import Status

from behaviours.basics import Check, WaitUntil
from behaviours.leaf import FAILURE, IDLE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import SENSOR_TIMEOUT, RunState
from missions.executive.build import Scope, build
from missions.executive.modifiers import (
    MAX_RETICK_INTERVAL,
    ForModifier,
    HoldModifier,
    InvertModifier,
    OnFailureModifier,
    OnSuccessModifier,
    TimeoutModifier,
)
from missions.executive.parallel import Parallel
from missions.executive.parent import Modifier, Parent
from missions.executive.submission import Submission
from missions.language.child_order import Weights
from missions.language.definite_assignment import catches_failure
from missions.language.expressions import Template, Value
from missions.language.for_each import ListMembers
from missions.language.kinds import STATE_KINDS
from missions.language.nodes import FAILURE_NAME, FINALLY, FOR_EACH, MISSION, MODIFIERS, SWITCHES
from missions.language.plan import Plan, Step
from missions.language.read_analysis import always_read_names
from missions.plugins.verify.abstract_values import (
    MAX_COUNT,
    MAX_MEMBERS,
    MIN_UNBOUNDED_ROUNDS,
    AbstractList,
    NondetSensor,
    NondetValue,
    TopValue,
    UnboundedCount,
    reads_sensor,
    syntax_trees,
    widen,
)
from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.live_variables import live_variables, names_read
from missions.plugins.verify.places import describe_node, place_text
from missions.plugins.verify.rule_monitor import PropertyMonitor, RuleMonitor, is_endless, make_monitor
from missions.plugins.verify.snapshot import Row, Rows, Snapshots, freeze, thaw
from missions.plugins.verify.stand_ins import StandIn, WaitStandIn, outcomes, report_of, stand_in_class, wait_seconds
from missions.plugins.verify.symbolic_time import Rows as Times
from missions.plugins.verify.symbolic_time import SymbolicClock, UnknownTime, extrapolate
from missions.plugins.verify.tick_merging import TickMerger
from missions.plugins.verify.unknown_values import UNKNOWN
from missions.plugins.verify.value_effects import ineffective_variables

# Abstraction of a checked plan: leaves become stand-ins, unknown values become choices.

DURATION_MODIFIERS = frozenset(word for word, kind in MODIFIERS.items() if kind.value == "duration")
COUNT_MODIFIERS = frozenset(word for word, kind in MODIFIERS.items() if kind.value == "count")

OTHER_CASE = "anything else"
"""Value of a ``switch`` that matches none of its cases."""


def abstract_step(
    step: Step, oracle: Oracle, watch: RuleMonitor, names: frozenset[str], main_file: str | None = None
) -> Step:
    """Return ``step`` and the steps below it in abstract form: stand-ins for leaves, abstract values for arguments.

    ``oracle`` makes their choices, and the monitor ``watch`` observes them. ``names`` are the variables that are set in
    the mission of the step. ``main_file`` is the file of the verified mission, by default that of the step.
    """
    main_file = step.source.name if main_file is None else main_file
    inner = step.children[0].variables if step.kind == MISSION else names
    children = tuple(abstract_step(child, oracle, watch, inner, main_file) for child in step.children)
    if step.leaf is not None:
        return replace(
            step,
            leaf=stand_in_class(step, oracle, watch),
            arguments=_abstract_arguments(step, step.leaf, oracle, names),
        )
    # Results are stored as they are: their conversion never fails.
    returns = {name: _abstract_stored(replace(value, convert=None), oracle) for name, value in step.returns.items()}
    label = f"'{step.kind}' {place_text(step.source.name, step.mark.line, main_file)}"
    arguments = {name: _abstract_setting(step, value, oracle, label) for name, value in step.arguments.items()}
    return replace(step, children=children, arguments=arguments, returns=returns)


def _abstract_arguments(step: Step, leaf: type[Leaf], oracle: Oracle, names: frozenset[str]) -> dict[str, Value]:
    """Return the abstract arguments of a leaf that matter for the exploration.

    They are the values that the leaf stores, and the values that can prevent its start.
    """
    if leaf.open_ended:
        return {name: _abstract_stored(replace(value, convert=None), oracle) for name, value in step.arguments.items()}
    if issubclass(leaf, Check | WaitUntil):
        return {name: _nondet_value(value, oracle, True, False) for name, value in step.arguments.items()}
    if any(outcome.status is FAILURE for outcome in outcomes(step)):
        relevant = {
            name: value
            for name, value in step.arguments.items()
            if always_read_names(value) & names or _reads_sensor(value)
        }
        return {
            f"argument_{name}": replace(_nondet_value(value, oracle), only_checked=True)
            for name, value in relevant.items()
        }
    computed = {name: value for name, value in step.arguments.items() if value.template is not None}
    return {
        f"argument_{name}": _nondet_value(_text_as_it_is(leaf, name, value), oracle) for name, value in computed.items()
    }


def _text_as_it_is(leaf: type[Leaf], name: str, value: Value) -> Value:
    """Return the value of an argument without its conversion if that only turns a text into a text."""
    takes_text = name in leaf.arguments and leaf.arguments[name].kind == "text"
    is_text = isinstance(value.template, Template) and len(value.template.parts) > 1
    return replace(value, convert=None) if takes_text and is_text else value


def _reads_sensor(value: Value) -> bool:
    return value.template is not None and any(map(reads_sensor, value.template.reads))


def _abstract_setting(step: Step, value: Value, oracle: Oracle, label: str) -> Value:
    """Return the abstract value of a setting of a modifier, a switch or a sub-mission; ``label`` is its node."""
    if step.kind == MISSION:
        return _abstract_stored(value, oracle)
    if step.kind in COUNT_MODIFIERS:
        return _abstract_count(value, oracle, label)
    if step.kind == FOR_EACH:
        return _abstract_members(value, oracle, label)
    if value.template is None:
        return value
    if step.kind in DURATION_MODIFIERS:
        return NondetValue(
            template=value.template, oracle=oracle, options=(UnknownTime.of(oracle, label),), never_computed=True
        )
    if step.kind in SWITCHES:
        return _nondet_value(value, oracle, *dict.fromkeys(step.cases), OTHER_CASE)
    if step.kind == "once":
        return _nondet_value(value, oracle, TopValue(oracle, label))
    if step.kind == "parallel":
        return _nondet_value(value, oracle, *range(1, len(step.children) + 1))
    if step.kind == "random_selector":
        return _nondet_value(value, oracle, *_unknown_weights(value, [child.name for child in step.children]))
    every_tick = step.kind in MODIFIERS and MODIFIERS[step.kind].every_tick
    return replace(_nondet_value(value, oracle, True, False), every_tick=every_tick)


class UnknownWeights(tuple[float, ...]):
    """Weights of which only is known which are above 0; as a text, they are the names of those children."""

    names: Sequence[str]

    def __str__(self) -> str:
        return f"above 0 for {', '.join(name for name, weight in zip(self.names, self, strict=True) if weight)}"


def _unknown_weights(value: Value, names: Sequence[str]) -> list[Weights]:
    """Return possible weights of children, one tuple for each set of children that can have a weight above 0.

    With more than ``MAX_ORDERED_CHILDREN`` children, return only equal weights.
    """
    if len(names) > MAX_ORDERED_CHILDREN:
        return [(1.0,) * len(names)]
    members: Sequence[ast.expr | None] = [None] * len(names)
    match syntax_trees(value):
        case [ast.List(elts=elements)] if len(elements) == len(names):
            members = elements
    known = [(float(bool(each.value)),) if isinstance(each, ast.Constant) else (0.0, 1.0) for each in members]
    found = [UnknownWeights(weights) for weights in product(*known) if any(weights)]
    for weights in found:
        weights.names = names
    return list(found)


def _nondet_value(value: Value, oracle: Oracle, *options: object) -> NondetValue:
    return NondetValue(
        template=value.template,
        convert=value.convert,
        constant=value.constant,
        oracle=oracle,
        options=options or (UNKNOWN,),
    )


def _abstract_stored(value: Value, oracle: Oracle) -> Value:
    if value.template is None:
        return value
    return NondetValue(template=value.template, convert=value.convert, oracle=oracle, abstraction=widen)


def _abstract_count(value: Value, oracle: Oracle, label: str) -> Value:
    many = UnboundedCount.of(oracle, MIN_UNBOUNDED_ROUNDS, label)
    if value.template is None:
        return Value(many) if isinstance(value.constant, int) and value.constant > MAX_COUNT else value
    return NondetValue(
        template=value.template,
        convert=value.convert,
        oracle=oracle,
        options=(UnboundedCount.of(oracle, 0, label),),
        abstraction=lambda found: many if isinstance(found, int) and found > MAX_COUNT else found,
    )


def _abstract_members(value: Value, oracle: Oracle, label: str) -> Value:
    many = AbstractList((UNKNOWN,), UnboundedCount.of(oracle, MIN_UNBOUNDED_ROUNDS, label))

    def abstract(found: object) -> object:
        return many if isinstance(found, ListMembers) and found.count > MAX_MEMBERS else found

    if value.template is None:
        return Value(abstract(value.constant))
    unknown = AbstractList((UNKNOWN,), UnboundedCount.of(oracle, 0, label))
    return NondetValue(
        template=value.template,
        convert=value.convert,
        oracle=oracle,
        options=(unknown,),
        abstraction=abstract,
    )


def durations(tree: Step) -> frozenset[float]:
    """Return all durations in seconds for which a run can wait."""
    found = set()
    for step in tree.walk():
        value = step.arguments.get("value")
        if step.kind in (*DURATION_MODIFIERS, FINALLY) and value is not None and isinstance(value.constant, float):
            found.add(value.constant)
        if step.leaf is not None and step.leaf.halting is not Leaf.halting:
            found.add(step.leaf.halt_limit)
        seconds = wait_seconds(step)
        if seconds is not None:
            found.add(seconds)
    return frozenset(found)


# Reduction of equivalent runs: one of each class is explored, so that many leaves give few states.
#
# Two cases, both exact. If a modifier above a leaf maps success and failure to the same status, one suffices.
# And in a ``parallel``, the order in which leaves end has no effect if they store nothing, wait for nothing and
# stop at once, since each might as well have run until the parallel ends. So all but the first of them,
# their ``leader``, run while it does, and end in the tick in which it ends. For every run there is such a run in
# which each node around them has the same status in the same tick (a partial-order reduction with one
# representative of all orders).

_MERGED_STATUS = {OnFailureModifier: SUCCESS, OnSuccessModifier: FAILURE}
"""Modifiers whose result does not depend on their child's success or failure, with that result."""


def reduce_equivalent_runs(nodes: Sequence[Node], monitors: Sequence[PropertyMonitor]) -> None:
    """Reduce the outcomes of stand-ins (partial-order reduction), so that fewer equivalent runs are explored.

    If success and failure of a leaf have the same effect, only success is kept. Independent leaves of a parallel end in
    the same tick. Leaves that a property monitor observes stay as they are.
    """
    observed = frozenset[Node]().union(*(monitor.observed for monitor in monitors))
    for node in nodes:
        if type(node) in _MERGED_STATUS:
            leaf = _reducible_leaf(node, observed)
            if leaf is not None and leaf.output_variable is None:
                leaf.merges_ends = True
    for node in nodes:
        if isinstance(node, Parallel) and not node.counts:
            free = [
                leaf
                for child in node.members
                if (leaf := _reducible_leaf(child, observed)) is not None and _is_independent(child, leaf)
            ]
            for leaf in free[1:]:
                leaf.leader = free[0]


def _reducible_leaf(node: Node, observed: frozenset[Node]) -> StandIn | None:
    """Return the stand-in below the modifiers of ``node``, if outcomes of it may be dropped; else None.

    Only modifiers that change nothing but the result are passed. None is returned if a property monitor observes the
    leaf or one of these modifiers.
    """
    while isinstance(node, InvertModifier | OnFailureModifier | OnSuccessModifier) and node not in observed:
        node = node.child
    return node if type(node).__base__ is StandIn and isinstance(node, StandIn) and node not in observed else None


def _is_independent(child: Node, leaf: StandIn) -> bool:
    """Return whether it does not matter when a leaf of a parallel ends, so that it may end together with another leaf.

    The leaf must store nothing, stop at once, and be able both to keep running and to end. One of its ends must make
    ``child``, the leaf with its modifiers, succeed.
    """
    statuses = {outcome.status for outcome in leaf.outcomes}
    if leaf.sensor:  # it fails by itself when the sensor is silent for too long
        return False
    can = {RUNNING} <= statuses and SUCCESS in {_modified_status(child, status) for status in statuses - {RUNNING}}
    return can and leaf.output_variable is None and not (leaf.computed or leaf.lingers) and leaf.stops


def _modified_status(node: Node, status: object) -> object:
    """Return the status of ``node``, a leaf or a modifier around one, when the leaf itself has ``status``."""
    if not isinstance(node, Modifier):
        return status
    below = _modified_status(node.child, status)
    return _MERGED_STATUS.get(type(node)) or (FAILURE if below is SUCCESS else SUCCESS)


# Nodes that read variables of their mission, to find runs that reach them before the variables are set.


def variable_readers(tree: Step, nodes: Sequence[Node]) -> Mapping[Node, frozenset[str]]:
    """Return for each node the variables of its mission that it certainly reads at its start, and so must be set.

    Nodes are left out if a node around them catches their failure, since an unset variable then does no harm.
    """
    read = dict(_read_variables(tree, "1", tree.variables))
    return {node: names for node in nodes if (names := read.get(node.key))}


def _read_variables(step: Step, key: str, names: frozenset[str]) -> Iterator[tuple[str, frozenset[str]]]:
    """Yield the key of each node with the variables that it reads at its start."""
    if step.kind not in DURATION_MODIFIERS:
        yield key, frozenset[str]().union(*map(always_read_names, step.arguments.values())) & names
    inner = step.children[0].variables if step.kind == MISSION else names
    for place, child in enumerate(step.children, start=1):
        if not catches_failure(step, child):
            yield from _read_variables(child, f"{key}.{place}", inner)


# Live variables of a mission and of its sub-missions.


class ScopeSnapshots:
    """Saves and restores the variables of a mission and its sub-missions.

    ``variables`` are those of the mission itself, ``nodes`` the nodes that were built from ``tree``. ``hidden`` are the
    variables of each scope whose values have no effect; they are stored as unknown.
    """

    def __init__(
        self, tree: Step, nodes: Sequence[Node], variables: Scope, hidden: Sequence[frozenset[str]] = ()
    ) -> None:
        self._nodes = nodes
        self._scopes = (variables, *(node.inner for node in nodes if isinstance(node, Submission)))
        self._live = live_variables(tree)
        self._hidden = hidden or (frozenset(),) * len(self._scopes)
        self._live_in: dict[Rows, tuple[frozenset[str] | None, ...]] = {}
        self._live_in_cleanups = self._cleanup_variables()
        self._restored: tuple[Scope, ...] = ()
        self._restored_from: Sequence[Row] | None = None

    def take(self, rows: Rows) -> tuple[Row, ...]:
        """Return the live variables of each scope; ``rows`` is the state of the nodes at this time."""
        if rows not in self._live_in:
            self._live_in[rows] = self._live_now()
        each = zip(self._scopes, self._live_in[rows], self._hidden, strict=True)
        return tuple(freeze(_select(scope, live, hidden)) for scope, live, hidden in each)

    def changes(self) -> object:
        """Return the variables that differ from those restored last, in hashable form."""
        each = zip(self._scopes, self._restored, self._hidden, strict=True)
        return tuple(_differences(scope, before, hidden) for scope, before, hidden in each)

    def restore(self, rows: Sequence[Row]) -> None:
        """Restore the variables of every scope from ``rows``; variables that are not in ``rows`` are removed."""
        if rows is not self._restored_from:
            self._restored, self._restored_from = tuple(map(thaw, rows)), rows
        for scope, restored in zip(self._scopes, self._restored, strict=True):
            scope.clear()
            scope.update(restored)

    def _live_now(self) -> tuple[frozenset[str] | None, ...]:
        """Return, for each scope, the variables that the run may still read.

        It is None for all variables: before the start of the run, and while a node halts. In a halt of the whole
        mission, only the cleanups of ``finally`` read variables.
        """
        root = self._nodes[0]
        if isinstance(root, Parent) and root.ending is IDLE:
            return self._live_in_cleanups
        halting = any(isinstance(node, Parent) and node.ending is not None for node in self._nodes)
        if halting or self._nodes[0].status is not RUNNING:
            return (None,) * len(self._scopes)
        live: defaultdict[int, set[str]] = defaultdict(set)
        for node in self._nodes:
            if node.status is RUNNING:
                live[id(node.scope)] |= self._live.running[node.key]
                if isinstance(node, Parent) and not _has_running_member(node):
                    self._add_live_at_start(node, live)
        return tuple(frozenset(live[id(scope)]) for scope in self._scopes)

    def _cleanup_variables(self) -> tuple[frozenset[str], ...]:
        """Return, for each scope, the variables that nodes in a ``finally`` may read."""
        live: defaultdict[int, set[str]] = defaultdict(set)
        for node in self._nodes:
            if node.in_finally:
                live[id(node.scope)] |= self._live.running[node.key] | self._live.before[node.key]
                if isinstance(node, Submission):
                    live[id(node.inner)].update(names_read(node.returns.values()))
        return tuple(frozenset(live[id(scope)]) for scope in self._scopes)

    def _add_live_at_start(self, node: Parent, live: defaultdict[int, set[str]]) -> None:
        """Add to ``live`` the variables that a running node with no running member, or its members, read at start.

        Such a node may wait for a sensor before it or a member starts; a sub-mission may also wait for the sensors of
        its results. ``live`` has the variables by the ``id`` of their scope.
        """
        live[id(node.scope)].update(self._live.before[node.key])
        for member in node.members:
            live[id(member.scope)].update(self._live.before[member.key])
        if isinstance(node, Submission):
            live[id(node.inner)].update(names_read(node.returns.values()))


def _has_running_member(node: Parent) -> bool:
    return not node.unstarted and any(member.status is RUNNING for member in node.members)


def _select(scope: Scope, names: frozenset[str] | None, hidden: frozenset[str]) -> Mapping[str, object]:
    """Return the variables with these names, all if None; those that are ``hidden`` are unknown."""
    chosen = scope if names is None else names & scope.keys()
    return {name: UNKNOWN if name in hidden else scope[name] for name in chosen}


def _differences(scope: Scope, before: Scope, hidden: frozenset[str]) -> object:
    """Return the variables of ``scope`` that are others than ``before``, and the names that are missing."""
    changed = {
        name: UNKNOWN if name in hidden else value
        for name, value in scope.items()
        if name not in before or (before[name] is not value and name not in hidden)
    }
    gone = frozenset(before.keys() - scope.keys())
    return (freeze(changed), gone) if changed or gone else ()


def sensor_readers(tree: Step, nodes: Sequence[Node]) -> Mapping[str, Sequence[Node]]:
    """Return the nodes that read each report of a sensor; the steps of ``tree`` must be abstract."""
    steps = dict(steps_by_key(tree))
    readers: defaultdict[str, list[Node]] = defaultdict(list)
    for node in nodes:
        step = steps[node.key]
        values = (*step.arguments.values(), *step.returns.values())
        sensors = {sensor for value in values if isinstance(value, NondetValue) for sensor in value.sensors}
        if isinstance(node, StandIn) and node.sensor:
            sensors.add(node.report)
        for sensor in sensors:
            readers[sensor].append(node)
    return readers


def steps_by_key(step: Step, key: str = "1") -> Iterator[tuple[str, Step]]:
    """Yield each step of a tree with the key of its node."""
    yield key, step
    for place, child in enumerate(step.children, start=1):
        yield from steps_by_key(child, f"{key}.{place}")


MAX_ORDERED_CHILDREN = 5
"""Maximum number of children of a random composite for which all orders are explored; beyond, only some are."""


@dataclass(frozen=True, slots=True)
class ModelState:
    """Everything that determines the future of a run: node fields, live variables, monitor memory, and times."""

    rows: Rows
    variables: tuple[Row, ...]
    happened: tuple[bool, ...]
    moving: frozenset[str]
    times: Times


class MissionModel:
    """Executable model of a mission: ticks and halts it, and saves and restores its complete state."""

    def __init__(self, plan: Plan, sensor_timeout: float = SENSOR_TIMEOUT) -> None:
        self.oracle = Oracle()
        self.watch = RuleMonitor(self.oracle)
        self.timing = SymbolicClock(self.oracle)
        self.run = RunState(self.timing)
        self.run.sensor_timeout = sensor_timeout
        self.shuffler = self.run.random = Shuffler(self.oracle)
        self.run.observer = self.watch
        self.run.variables.update({part: NondetSensor(self.oracle, part) for part in STATE_KINDS})
        self.run.variables.update(dict.fromkeys((*plan.missing_params, FAILURE_NAME), UNKNOWN))
        tree = abstract_step(plan.tree, self.oracle, self.watch, plan.tree.variables)
        self.root = build(replace(plan, tree=tree), self.run, lambda _: Robot())
        self.nodes = list(_walk(self.root))
        self.monitors: tuple[PropertyMonitor, ...] = tuple(
            make_monitor(promise, self.nodes) for promise in plan.properties
        )
        reduce_equivalent_runs(self.nodes, self.monitors)
        steps = dict(steps_by_key(plan.tree))
        for node in self.nodes:
            if isinstance(node, StandIn):
                node.report = report_of(steps[node.key], node.key)
        self.watch.set_leaves([node for node in self.nodes if isinstance(node, StandIn)])
        self.watch.monitors = self.monitors
        self.watch.rounds = frozenset(node.child for node in self.nodes if is_endless(node))
        self.watch.timed_nodes = {
            node: _status_when_over(node)
            for node in self.nodes
            if isinstance(node, ForModifier | HoldModifier | WaitStandIn)
        }
        self.watch.reads = variable_readers(plan.tree, self.nodes)
        self._snapshots = Snapshots(self.nodes, self.timing)
        hidden = ineffective_variables(tree, plan.params, plan.missing_params)
        self._scopes = ScopeSnapshots(tree, self.nodes, self.run.variables, hidden)
        self.merger = TickMerger(
            self.nodes,
            self.run,
            self.oracle,
            self.watch,
            self.timing,
            self._snapshots,
            self._scopes,
            sensor_readers(tree, self.nodes),
        )
        for leaf in self.watch.leaves:
            leaf.merger = None if leaf.in_finally else self.merger
        self.shuffler.merger = self.merger
        self._seconds = sorted({*durations(plan.tree), sensor_timeout, MAX_RETICK_INTERVAL})

    def tick(self) -> None:
        """Tick the tree of the mission once."""
        self.run.tick += 1
        self.root.execute_tick()
        self.watch.check_tick()

    def halt(self) -> bool:
        """Halt the tree, or continue a halt; return whether it is at rest."""
        self.run.tick += 1
        return self.root.halt()

    def state(self) -> ModelState:
        """Return the present state in canonical form: states with the same future are equal."""
        rows, instants = self._snapshots.take()
        times = self.timing.zone.advance(instants)
        return ModelState(rows, self._scopes.take(rows), self.watch.happened, self.watch.moving, times)

    def instants(self) -> list[int]:
        """Return the instants of the present state, in its order, as indices in the zone of the last step."""
        return list(self._snapshots.take()[1])

    def restore(self, state: ModelState) -> None:
        """Restore a state, and begin a step from it."""
        self.timing.set(state.times)
        self._snapshots.restore(state.rows)
        self._scopes.restore(state.variables)
        self.watch.begin(state.happened, state.moving)

    def coarsen(self, state: ModelState) -> ModelState:
        """Return ``state`` with coarser time bounds, so that fewer states differ only in time."""
        return replace(state, times=extrapolate(state.times, self._seconds))


class Shuffler(Random):
    """Random source of random composites: the oracle of the exploration chooses the order of the children.

    It chooses among all orders, or among some if there are more than ``MAX_ORDERED_CHILDREN`` children. ``merger`` is
    called before the first choice of an order.
    """

    merger: TickMerger | None = None

    def __init__(self, oracle: Oracle) -> None:
        super().__init__(0)
        self._oracle = oracle
        self.is_sampled = False
        self._rest: list[Any] = []  # children that are not drawn yet

    def shuffle(self, x: MutableSequence[Any]) -> None:
        """Reorder ``x`` in place, in an order that the oracle of the exploration chooses."""
        before = list(x)
        self._merge(before)
        if len(before) <= MAX_ORDERED_CHILDREN:
            orders = [list(order) for order in permutations(before)]
        else:
            self.is_sampled = True
            orders = [before[place:] + before[:place] for place in range(len(before))]
        x[:] = self._oracle.choose(orders, _describe_order)

    def choices(self, population: Any, *args: Any, **options: Any) -> list[Any]:
        """Return one member of ``population``: a choice, or the first if there are too many."""
        del args, options
        if len(population) > MAX_ORDERED_CHILDREN:
            self.is_sampled = True
            return [population[0]]
        if population != self._rest:
            self._merge(population)
        drawn = self._oracle.choose(population, _describe_next)
        self._rest = [child for child in population if child is not drawn]
        return [drawn]

    def _merge(self, children: Sequence[Any]) -> None:
        """End this run if an earlier one has come to this draw of ``children`` in the same situation."""
        composite = children[0].parent
        if self.merger is not None and not composite.in_finally:
            self.merger.visit(composite, children)


def _describe_next(child: Any) -> str:
    return f"{describe_node(child)} is drawn next"


def _describe_order(children: Iterable[Any]) -> str:
    return f"the order is {', '.join(map(describe_node, children))}"


def _status_when_over(node: Node) -> Status:
    return FAILURE if isinstance(node, TimeoutModifier) else SUCCESS


def _walk(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        if isinstance(child, Node):
            yield from _walk(child)
