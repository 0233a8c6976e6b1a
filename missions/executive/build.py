"""Builds the tree of py_trees nodes of a mission from its checked plan."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import Diagnostic, InvalidFileError
from config.units import UNITS
from missions.executive.composites import COMPOSITES, InTurnSelector
from missions.executive.for_each import SWITCHES, ForEach
from missions.executive.modifiers import MODIFIERS, WaitFor
from missions.executive.parent import Parent
from missions.executive.state import BoundCondition
from missions.executive.submission import Submission
from missions.language.expressions import Value, as_quantity, reads_failure
from missions.language.inference import CONDITION_KIND
from missions.language.kinds import kind_of_type
from missions.language.nodes import (
    FAILURE_NAME,
    FINALLY,
    FOR_EACH,
    IN_TURN_SELECTOR,
    MISSION,
    WAIT_FOR,
    provides_failure,
)
from missions.language.operators import RANDOM
from missions.language.plan import Plan, Step, composite_kind
from missions.language.takeover import find_takeovers

RobotFor = Callable[[Leaf], Robot]
"""Function that returns the robot for a leaf; commands given through it are reported with the leaf's name."""

Substitute = Callable[[Step, Leaf | None], Leaf | None]
"""Function that may replace a step by a leaf of its own, such as a mock; it returns None to keep the step.

Its arguments are the step, and the leaf of the step, or None for a composite.
"""

Scope = dict[str, object]


def keep_leaf(step: Step, leaf: Leaf | None) -> Leaf | None:
    """Return None: build each step as the plan says, without a substitute."""
    del step
    return leaf


def build(plan: Plan, run: RunState, robot_for: RobotFor, *, substitute: Substitute = keep_leaf) -> Node:
    """Build the tree of ``plan``. The root's key is "1", its children's "1.1", "1.2" and so on.

    Variables that are in ``run.variables`` already (the robot's state) can be read in all missions of the run. Raises
    InvalidFileError for stub leaves without a substitute.
    """
    run.variables[RANDOM] = run.random
    builder = TreeBuilder(run, robot_for, dict(run.variables), substitute, find_takeovers(plan.tree))
    run.variables.update(plan.params)
    root = builder.build(plan.tree, "1", run.variables)
    if builder.stub_faults:
        raise InvalidFileError(builder.stub_faults)
    return root


NODES: Mapping[str, type[Parent]] = {
    **COMPOSITES,
    **SWITCHES,
    **MODIFIERS,
    FOR_EACH: ForEach,
    WAIT_FOR: WaitFor,
    MISSION: Submission,
}
"""Classes of all nodes with children, by their word in the mission language."""


class TreeBuilder:
    """Builds the nodes of one run; all missions of the run can read ``shared_variables``.

    ``takeovers`` is the result of ``find_takeovers`` for the whole tree.
    """

    def __init__(
        self,
        run: RunState,
        robot_for: RobotFor,
        shared_variables: Scope,
        substitute: Substitute,
        takeovers: Mapping[str, frozenset[str]],
    ) -> None:
        self._run = run
        self._substitute = substitute
        self._robot_for = robot_for
        self._shared_variables = shared_variables
        self._takeovers = takeovers
        self.stub_faults: list[Diagnostic] = []

    def build(
        self, step: Step, key: str, scope: Scope, failure: Scope | None = None, *, in_finally: bool = False
    ) -> Node:
        """Build a step and its children; ``scope`` holds the variables of its mission.

        ``failure`` holds the reason of the last failure around the step. A step ``in_finally`` must not move anything.
        """
        if failure is not None and step.reads_failure:
            bound = {name: _with_failure(value, failure) for name, value in step.arguments.items()}
            step = replace(step, arguments=bound)
        inner = dict(self._shared_variables) if step.kind == MISSION else scope
        whole = None if step.leaf is not None or step.kind in MODIFIERS else self._substitute(step, None)
        if whole is not None:
            whole.output_variable = step.output_variable
            whole.in_finally = in_finally
            return self._set_position(whole, step, key, scope)
        own_failure: Scope = {FAILURE_NAME: ""}
        is_read, children = False, []
        for place, child in enumerate(step.children):
            reads_own = provides_failure(step.kind, place)
            is_read = is_read or (reads_own and child.reads_failure)
            around = own_failure if reads_own else None if step.kind == MISSION else failure
            is_cleanup = in_finally or (step.kind == FINALLY and place > 0)
            children.append(self.build(child, f"{key}.{place + 1}", inner, around, in_finally=is_cleanup))
        node = self._node(step, children, inner)
        node.in_finally = in_finally
        if is_read and isinstance(node, Parent):
            node.failure = own_failure
        return self._set_position(node, step, key, scope)

    def _set_position(self, node: Node, step: Step, key: str, scope: Scope) -> Node:
        """Set the key, the place in the mission file, the run and the scope of a node; return the node."""
        node.key, node.kind, node.line, node.file = key, step.kind, step.mark.line, step.source.name
        node.run, node.scope = self._run, scope
        if isinstance(node, Leaf):
            node.robot = self._robot_for(node)
            node.takes_over = self._takeovers.get(key, node.takes_over)
        return node

    def _node(self, step: Step, children: list[Node], inner: Scope) -> Node:
        if step.leaf is not None:
            leaf = step.leaf(step.name)
            leaf = self._substitute(step, leaf) or leaf
            if leaf.stub:
                message = f"'{step.kind}' is a stub, which cannot run"
                hint = f"{leaf.stub}, or mock it in a test: given: [{step.kind}: succeeds], or [stubs: succeeds]"
                self.stub_faults.append(Diagnostic(step.source, step.mark, message, hint))
            return _set_arguments(leaf, step, inner)
        kind = InTurnSelector if composite_kind(step) is IN_TURN_SELECTOR else NODES[step.kind]
        return kind.from_step(step, children, inner)


def _set_arguments(leaf: Leaf, step: Step, scope: Scope) -> Leaf:
    """Set the constant arguments of a leaf; the others are computed each time it starts."""
    leaf.output_variable = step.output_variable
    kind = None if step.leaf is None else kind_of_type(step.leaf.output_type)
    if isinstance(kind, str) and kind in UNITS:
        leaf.output_converter = partial(as_quantity, kind=kind)
    if leaf.open_ended:
        leaf.computed = {name: _resolver(value, scope) for name, value in step.arguments.items()}
        return leaf
    declared = {} if step.leaf is None else step.leaf.arguments
    computed = {}
    for name, value in step.arguments.items():
        attribute = declared[name].attribute if name in declared else name
        if name in declared and declared[name].kind == CONDITION_KIND:
            setattr(leaf, attribute, BoundCondition(value, _condition_text(step.arguments_as_written[name]), scope))
        elif value.template is None:
            setattr(leaf, attribute, value.constant)
        else:
            computed[name] = _resolver(value, scope)
    leaf.computed = computed
    return leaf


def _with_failure(value: Value, failure: Scope) -> Value:
    """Return ``value``; if it reads the reason of a failure, it reads it from the scope ``failure``."""
    return replace(value, local_names=failure) if reads_failure(value) else value


def _condition_text(text: str) -> str:
    """Return a condition as written, without ``${}`` around it."""
    text = text.strip()
    return text[2:-1].strip() if text.startswith("${") and text.endswith("}") else text


def _resolver(value: Value, scope: Scope) -> Callable[[], object]:
    return lambda: value.resolve(scope)
