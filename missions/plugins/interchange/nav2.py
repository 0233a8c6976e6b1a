"""Translation of control nodes and decorators of Nav2."""

from missions.plugins.interchange.blackboard import constant_value
from missions.plugins.interchange.context import SkipAs, TreeContext, quantity, remark_of, set_step
from missions.plugins.interchange.foreign_trees import normal_form
from missions.plugins.interchange.mission_text import Computed, MissionStep, PlainExpression, wrapped
from missions.plugins.interchange.node_kinds import KINDS
from missions.plugins.interchange.report import DIFFERS, LOST
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import is_pointer

PACED = ("RateController", "DistanceController", "SpeedController", "GoalUpdatedController")
"""Decorators of Nav2 that decide when a child of a PipelineSequence runs again, such as once a second."""


def pipeline(tree: TreeContext, element: Element, kind: str) -> MissionStep:
    """Return a PipelineSequence node as a ``race`` of its children.

    Each child starts when the one before it has succeeded, and all but the last are then repeated. The race ends with
    the last child.
    """
    if len(element.children) == 1:
        return tree.add_name(MissionStep("sequence", tree.children(element, "success")), element)
    flags = dict[str, object]()
    steps = list[MissionStep]()
    before = ""
    for child in element.children:
        is_last = child is element.children[-1]
        step, pause = _paced(tree, child, kind)
        if not is_last:
            flag = tree.fresh_name(child, child.tag, "ready")
            flags[flag] = False
            step = MissionStep("sequence", [*pause[0], step, set_step({flag: True}), *pause[1]])
            step.keys["repeat"] = "forever"
        if before:
            ready = MissionStep("wait_until", PlainExpression(before), reads=(before,))
            step = MissionStep("sequence", [ready, step])
        steps.append(step)
        before = flag if not is_last else before
    return MissionStep("sequence", [set_step(flags), tree.add_name(MissionStep("race", steps), element)])


Pause = tuple[list[MissionStep], list[MissionStep]]
"""Steps before each run of a child that is repeated, and the steps that wait until its next run."""


def _paced(tree: TreeContext, element: Element, parent: str) -> tuple[MissionStep, Pause]:
    """Return a child of a PipelineSequence without its pacing decorator, and the steps that replace the decorator."""
    kind, _ = normal_form(element, tree.project)
    if kind not in PACED or len(element.children) != 1:
        return tree.node(element, "success", parent), ([], [])
    tree.report.carried[kind] += 1
    inner = tree.node(element.children[0], "success", kind)
    inner.comments = [*element.comments, *inner.comments]
    if difference := KINDS[kind].difference:
        tree.report.add(DIFFERS, element, difference, kind)
    if kind == "DistanceController":
        return inner, _pause_of_distance(tree, element, kind)
    if kind == "GoalUpdatedController":
        goal = tree.pointer(tree.port(element, kind, "goal"), "goal")
        last = tree.names.fresh(f"last_{goal}")
        remember = MissionStep("set", {last: Computed(goal)}, reads=(goal,), sets=(last,))
        changed = MissionStep("wait_until", PlainExpression(f"{goal} != {last}"), reads=(goal, last))
        return inner, ([remember], [changed])
    rate = tree.port(element, kind, "hz" if kind == "RateController" else "max_rate")
    if is_pointer(rate):
        name = tree.pointer(rate, "hz")
        return inner, ([], [MissionStep("wait", Computed(f"1 s / {name}"), reads=(name,))])
    hertz = constant_value(rate)
    seconds = 1 / hertz if isinstance(hertz, int | float) and hertz > 0 else 0.1
    return inner, ([], [MissionStep("wait", quantity(seconds, "s"))])


def _pause_of_distance(tree: TreeContext, element: Element, kind: str) -> Pause:
    x, y = tree.names.fresh("start_x"), tree.names.fresh("start_y")
    distance = tree.port(element, kind, "distance")
    length = tree.pointer(distance, "distance") + " * 1 m" if is_pointer(distance) else f"{distance or '1.0'} m"
    moved = f"(base.x - {x}) * (base.x - {x}) + (base.y - {y}) * (base.y - {y})"
    remember = MissionStep("set", {x: Computed("base.x"), y: Computed("base.y")}, sets=(x, y))
    far = MissionStep("wait_until", PlainExpression(f"{moved} >= {length} * {length}"), reads=(x, y))
    return [remember], [far]


def recovery(tree: TreeContext, element: Element, kind: str) -> MissionStep | None:
    """Return a RecoveryNode as its first child with ``retry``, and the second child as its ``recover``.

    None unless the node has two children.
    """
    if len(element.children) != 2:
        return None
    tried, recovery = tree.children(element, "success")
    retries = tree.port(element, kind, "number_of_retries")
    reads: tuple[str, ...] = ()
    count: object = "forever"
    if is_pointer(retries):
        name = tree.pointer(retries, "number_of_retries")
        count, reads = Computed(f"{name} + 1"), (name,)
    elif isinstance(number := constant_value(retries), int | float):
        count = int(number) + 1
        if count < 2:
            tree.report.add(LOST, element.children[1], "never runs: number_of_retries is 0", kind)
            return tree.add_outer_name(tried, element)
    if "retry" in tried.keys or "recover" in tried.keys:
        tried = MissionStep("sequence", [tried])
    tried = wrapped(tried, "retry", count, remark_of(element, tried), reads)
    return tree.add_outer_name(wrapped(tried, "recover", recovery), element)


def non_blocking(tree: TreeContext, element: Element, kind: str) -> MissionStep:
    """Return a NonblockingSequence node as a ``parallel`` of its children."""
    tree.report.add(DIFFERS, element, "a child that has succeeded is not ticked again", kind)
    return tree.add_name(MissionStep("parallel", tree.children(element, "success")), element)


def pace_alone(tree: TreeContext, element: Element, kind: str, skip_as: SkipAs, parent: str) -> MissionStep:
    """Return the child of a RateController or similar decorator that is not in a PipelineSequence.

    The decorator is left out, because it runs its child at once after each start, as the mission does.
    """
    child = tree.node(element.children[0], skip_as, kind)
    if parent.startswith("Reactive") or kind == "GoalUpdatedController":
        tree.report.add(DIFFERS, element, "its pauses are not carried over: the child runs at every start", kind)
    child.comments = [f"{kind}: {element.attributes.get(KINDS[kind].port, '')}".rstrip(": "), *child.comments]
    return child


def single_trigger(tree: TreeContext, element: Element, kind: str, skip_as: SkipAs) -> MissionStep:
    """Return the child of a SingleTrigger node; it runs once, and later runs fail."""
    done = tree.fresh_name(element, "trigger", "done")
    tree.initial[done] = False
    first = MissionStep("check", PlainExpression(f"not {done}"), reads=(done,))
    child = tree.node(element.children[0], skip_as, kind)
    return tree.add_name(MissionStep("sequence", [first, set_step({done: True}), child]), element)
