"""From a checked plan to the nodes that are ticked."""

from collections.abc import Callable, Mapping
from functools import partial

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from config.units import UNITS
from missions.executive.composites import COMPOSITES
from missions.executive.for_each import SWITCHES, ForEach
from missions.executive.modifiers import MODIFIERS
from missions.executive.parent import Parent
from missions.executive.submission import Submission
from missions.language.expressions import Value, as_quantity
from missions.language.kinds import kind_of_type
from missions.language.nodes import FOR_EACH, MISSION
from missions.language.plan import Plan, Step

RobotFor = Callable[[Node], Robot]
"""Gives a leaf the robot that it sees: one that knows in whose name a command is sent."""

Substitute = Callable[[Step, Leaf | None], Leaf | None]
"""Given a step, and its leaf where it is one, returns what is to stand in its place; None: it is built as it is."""

Scope = dict[str, object]


def keep_leaf(step: Step, leaf: Leaf | None) -> Leaf | None:
    """Put nothing in the place of anything."""
    del step
    return leaf


def build(plan: Plan, run: RunState, robot_for: RobotFor, *, substitute: Substitute = keep_leaf) -> Node:
    """Build the tree of ``plan``. The root's key is "1", its children's "1.1", "1.2" and so on.

    What ``run.variables`` holds already (the robot's state) can be read in the mission and in all inside it.
    """
    builder = TreeBuilder(run, robot_for, dict(run.variables), substitute)
    run.variables.update(plan.params)
    return builder.build(plan.tree, "1", run.variables)


NODES: Mapping[str, type[Parent]] = {
    **COMPOSITES,
    **SWITCHES,
    **MODIFIERS,
    FOR_EACH: ForEach,
    MISSION: Submission,
}
"""The classes that are ticked, by the words of their kinds."""


class TreeBuilder:
    """Builds nodes for one run. ``lasting`` are the variables that every mission of the run can read."""

    def __init__(
        self, run: RunState, robot_for: RobotFor, shared_variables: Scope, substitute: Substitute = keep_leaf
    ) -> None:
        self._run = run
        self._substitute = substitute
        self._robot_for = robot_for
        self._shared_variables = shared_variables

    def build(self, step: Step, key: str, scope: Scope) -> Node:
        """Build a step and all below it; ``scope`` are the variables of its mission."""
        inner = dict(self._shared_variables) if step.kind == MISSION else scope
        whole = None if step.leaf is not None or step.kind in MODIFIERS else self._substitute(step, None)
        if whole is not None:
            whole.output_variable = step.output_variable
            return self._set_position(whole, step, key, scope)
        children = [self.build(child, f"{key}.{place}", inner) for place, child in enumerate(step.children, start=1)]
        return self._set_position(self._node(step, children, inner), step, key, scope)

    def _set_position(self, node: Node, step: Step, key: str, scope: Scope) -> Node:
        """Tell a node where it stands, and give it what it needs to run."""
        node.key, node.kind, node.line, node.file = key, step.kind, step.mark.line, step.source.name
        node.run, node.scope = self._run, scope
        if isinstance(node, Leaf):
            node.robot = self._robot_for(node)
        return node

    def _node(self, step: Step, children: list[Node], inner: Scope) -> Node:
        if step.leaf is not None:
            leaf = step.leaf(step.name)
            return _set_arguments(self._substitute(step, leaf) or leaf, step, inner)
        return NODES[step.kind].from_step(step, children, inner)


def _set_arguments(leaf: Leaf, step: Step, scope: Scope) -> Leaf:
    """Set the arguments that are known now; leave the rest to be filled each time that the leaf starts."""
    leaf.output_variable = step.output_variable
    kind = None if step.leaf is None else kind_of_type(step.leaf.output_type)
    if isinstance(kind, str) and kind in UNITS:
        leaf.output_converter = partial(as_quantity, kind=kind)
    if leaf.open_ended:
        leaf.computed = {name: _resolver(value, scope) for name, value in step.arguments.items()}
        return leaf
    declared = {} if step.leaf is None else step.leaf.arguments
    for name, value in step.arguments.items():
        if value.template is None:
            setattr(leaf, declared[name].attribute if name in declared else name, value.constant)
    leaf.computed = {
        name: _resolver(value, scope) for name, value in step.arguments.items() if value.template is not None
    }
    return leaf


def _resolver(value: Value, scope: Scope) -> Callable[[], object]:
    return lambda: value.resolve(scope)
