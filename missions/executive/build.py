"""From a checked plan to the nodes that are ticked."""

from collections.abc import Callable

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import Run
from missions.executive.composites import COMPOSITES, adopt
from missions.executive.modifiers import MODIFIERS
from missions.language.plan import Plan, Step
from missions.language.values import Value

RobotFor = Callable[[Node], Robot]
"""Gives a leaf the robot that it sees: one that knows in whose name a command is sent."""


def build(plan: Plan, run: Run, robot_for: RobotFor) -> Node:
    """Build the tree of ``plan``. The root's key is "1", its children's "1.1", "1.2" and so on."""
    run.variables.update(plan.params)
    return _build(plan.tree, "1", run, robot_for)


def _build(step: Step, key: str, run: Run, robot_for: RobotFor) -> Node:
    children = [_build(child, f"{key}.{place}", run, robot_for) for place, child in enumerate(step.children, start=1)]
    node: Node
    if step.leaf is not None:
        node = leaf = step.leaf(step.name)
        _give(leaf, step, run)
    elif step.kind in MODIFIERS:
        node = MODIFIERS[step.kind](step.name, children[0], step.arguments["value"])
    else:
        node = composite = COMPOSITES[step.kind](step.name)
        adopt(composite, children)
    node.key, node.kind, node.line, node.run = key, step.kind, step.mark.line, run
    if isinstance(node, Leaf):
        node.robot = robot_for(node)
    return node


def _give(leaf: Leaf, step: Step, run: Run) -> None:
    """Set the arguments that are known now; leave the rest to be filled each time that the leaf starts."""
    leaf.keep_as = step.keep_as
    if leaf.open_ended:
        leaf.given = {name: _resolver(value, run) for name, value in step.arguments.items()}
        return
    for name, value in step.arguments.items():
        if value.template is None:
            setattr(leaf, name, value.constant)
    leaf.computed = {
        name: _resolver(value, run) for name, value in step.arguments.items() if value.template is not None
    }


def _resolver(value: Value, run: Run) -> Callable[[], object]:
    return lambda: value.resolve(run.variables)
