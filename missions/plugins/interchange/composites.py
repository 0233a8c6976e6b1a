"""Translation of control nodes of BehaviorTree.CPP that need several words of a mission, such as Switch2."""

from collections.abc import Callable

from missions.plugins.interchange.blackboard import constant_value, entry_of
from missions.plugins.interchange.context import TreeContext, fail_again, set_step
from missions.plugins.interchange.foreign_trees import normal_form
from missions.plugins.interchange.mission_text import Computed, MissionStep, PlainExpression, wrapped
from missions.plugins.interchange.node_kinds import CONDITION_ATTRIBUTES, END_ATTRIBUTES
from missions.plugins.interchange.report import DIFFERS, LOST
from missions.plugins.interchange.scripts import FLAG, NUMBER, Formula, as_condition, number_text, text_formula
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import is_pointer


def parallel(tree: TreeContext, element: Element, kind: str) -> MissionStep:
    """Return a Parallel node as a ``parallel``, with the counts of successes and failures that have an effect."""
    count = len(element.children)
    success = tree.port(element, kind, "success_count")
    all_succeed = success == "-1" or success == str(count)
    step = tree.add_name(
        MissionStep("parallel", tree.children(element, "success" if success == "-1" else "running")), element
    )
    needed = _count(tree, step, element, "success_count", success, count)
    if not all_succeed and needed != count:
        step.keys["success_count"] = Computed(needed) if isinstance(needed, str) else needed
    failures = _count(tree, step, element, "failure_count", tree.port(element, kind, "failure_count"), count)
    if isinstance(failures, str):
        step.keys["failure_count"] = Computed(failures)
    elif failures > 1:
        possible = count - needed + 1 if isinstance(needed, int) else count
        if failures <= possible:
            step.keys["failure_count"] = failures
        elif possible > 1:
            step.keys["failure_count"] = "all"
    return step


def _count(tree: TreeContext, step: MissionStep, element: Element, port: str, value: str, count: int) -> int | str:
    """Return the count in a ``port`` of a Parallel node: a number from 1 to ``count``, or the name of a variable.

    ``value`` is the port's text; a negative number counts from the end, so -1 means all children. ``count`` is the
    number of children.
    """
    if is_pointer(value):
        name = tree.pointer(value, port)
        step.reads += (name,)
        return name
    number = constant_value(value)
    whole = int(number) if isinstance(number, int | float) and not isinstance(number, bool) else count
    whole = count + whole + 1 if whole < 0 else whole
    if not 1 <= whole <= count:
        tree.report.add(DIFFERS, element, f"{port} is {value}, which its {count} children cannot reach")
    return min(max(whole, 1), count)


def parallel_all(tree: TreeContext, element: Element, kind: str) -> MissionStep:
    """Return a ParallelAll node as a ``parallel`` that ends when all children have ended."""
    count = len(element.children)
    step = tree.add_name(MissionStep("parallel", tree.children(element, "success")), element)
    step.keys["wait_for_all"] = True
    failures = _count(tree, step, element, "max_failures", tree.port(element, kind, "max_failures"), count)
    if isinstance(failures, str):
        step.keys["failure_count"] = Computed(failures)
    elif failures > 1:
        step.keys |= {"success_count": count - failures + 1, "failure_count": failures}
    return step


def choice(word: str) -> Callable[[TreeContext, Element, str], MissionStep | None]:
    """Return the function that translates an IfThenElse or WhileDoElse node to the switch ``word``.

    The first child of the node is the condition. If it is a script, the switch evaluates its expression. Any other
    condition runs before the switch, and a variable stores whether it has succeeded. The function returns None unless
    the node has two or three children.
    """

    def translate(tree: TreeContext, element: Element, kind: str) -> MissionStep | None:
        return _choice(tree, element, kind, word)

    return translate


def _choice(tree: TreeContext, element: Element, kind: str, word: str) -> MissionStep | None:
    if len(element.children) not in (2, 3):
        return None
    first, *others = element.children
    branches = dict(zip(("true", "false"), (tree.node(each, "success", kind) for each in others), strict=False))
    formula = _plain_condition(tree, first)
    if formula is not None:
        test = as_condition(formula)
        step = MissionStep(
            word, {"on": PlainExpression(test.text), "cases": branches}, reads=tree.variables_of(formula)
        )
        step.comments += first.comments
        if label := first.attributes.get("name"):
            step.comments.append(f"on: {label}")
        return tree.add_name(step, element)
    holds = tree.fresh_name(first, kind, "holds")
    condition = tree.node(first, "failure", kind)
    test_step = MissionStep(
        "selector",
        [MissionStep("sequence", [condition, set_step({holds: True})]), set_step({holds: False})],
    )
    selection = MissionStep(word, {"on": PlainExpression(holds), "cases": branches}, reads=(holds,))
    return tree.add_name(MissionStep(word.replace("switch", "sequence"), [test_step, selection]), element)


def _plain_condition(tree: TreeContext, element: Element) -> Formula | None:
    """Return the expression of a ScriptCondition node; None for other nodes, and with assignments or conditions."""
    kind, _ = normal_form(element, tree.project)
    if kind != "ScriptCondition" or any(
        name in (*CONDITION_ATTRIBUTES, *END_ATTRIBUTES) for name in element.attributes
    ):
        return None
    script = tree.script(element, element.attributes.get("code", ""))
    return script.condition if script is not None and not script.assignments else None


MAX_CASE_LENGTH = 500
"""Maximum characters of a case of a Switch node; a branch with a longer case is left out, with a remark."""


def switch(tree: TreeContext, element: Element, kind: str) -> MissionStep:
    """Return a Switch2 to Switch6 node as a ``reactive_switch`` over the values of its ``variable`` port."""
    variable = tree.port(element, kind, "variable")
    children = tree.children(element, "success")
    reads: tuple[str, ...] = ()
    if is_pointer(variable):
        entry = entry_of(variable)
        on, of_kind = tree.variable(entry), tree.kinds.get(entry)
        reads = (on,)
    else:
        on, of_kind = text_formula(variable).text, None
    cases: dict[str, object] = {}
    for number, child in enumerate(children[: _case_count(tree, element)], start=1):
        case = tree.port(element, kind, f"case_{number}") or element.attributes.get(f"case_{number}", "")
        key = _case_key(case, of_kind)
        if key in cases or not case or len(case) > MAX_CASE_LENGTH:
            tree.report.add(LOST, element, f"case_{number} is empty, repeated or too long", kind)
        else:
            cases[key] = child
    value: dict[str, object] = {"on": PlainExpression(on), "cases": cases}
    if len(children) > _case_count(tree, element):
        value["default"] = children[-1]
    if not cases:
        return tree.add_outer_name(children[-1] if "default" in value else MissionStep("fail", "no case"), element)
    return tree.add_name(MissionStep("reactive_switch", value, reads=reads), element)


def _case_count(tree: TreeContext, element: Element) -> int:
    kind, _ = normal_form(element, tree.project)
    declared = int(kind.removeprefix("Switch")) if kind.removeprefix("Switch").isdigit() else len(element.children)
    return min(declared, len(element.children))


def _case_key(case: str, kind: str | None) -> str:
    word = case.strip()
    if kind == FLAG:
        return {"1": "true", "0": "false"}.get(word, word.lower())
    return number_text(float(word)) if kind == NUMBER and isinstance(constant_value(word), int | float) else word


def sequence_with_memory(tree: TreeContext, element: Element, kind: str) -> MissionStep:
    """Return a SequenceWithMemory node as a ``sequence`` that continues at the child that failed at the last run.

    A variable holds the number of this child.
    """
    place = tree.fresh_name(element, "sequence", "step")
    tree.initial[place] = 1
    steps = list[MissionStep]()
    children = tree.children(element, "success")
    for number, child in enumerate(children, start=1):
        here = f"{place} == {number}"
        steps.append(wrapped(child, "if", PlainExpression(here), reads=(place,)))
        following = number + 1 if number < len(children) else 1
        steps.append(wrapped(set_step({place: following}), "if", PlainExpression(here), reads=(place,)))
    if tree.tree.version == 3:
        tree.report.add(DIFFERS, element, "a halt keeps its place here, as in version 4", kind)
    return tree.add_name(MissionStep("sequence", steps), element)


def try_catch(tree: TreeContext, element: Element, kind: str) -> MissionStep | None:
    """Return a TryCatch node as a ``selector``: if another child fails, the last child runs, and the node fails.

    None if the node has fewer than two children.
    """
    if len(element.children) < 2:
        return None
    *tried, caught = tree.children(element, "success")
    body = tried[0] if len(tried) == 1 else MissionStep("sequence", tried)
    if tree.port(element, kind, "catch_on_halt") == "true":
        tree.report.add(DIFFERS, element, "the last child does not run after a halt", kind)
    failed = MissionStep("sequence", [caught, fail_again()])
    return tree.add_name(MissionStep("selector", [body, failed]), element)
