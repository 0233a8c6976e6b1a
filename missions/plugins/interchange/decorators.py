"""Translation of decorators of BehaviorTree.CPP and MoveIt Pro that need more than one word of a mission."""

from missions.plugins.interchange.blackboard import constant_value
from missions.plugins.interchange.context import SkipAs, TreeContext, fail_again, quantity, remark_of, set_step
from missions.plugins.interchange.mission_text import (
    Computed,
    MissionStep,
    PlainExpression,
    Verbatim,
    wrapped,
)
from missions.plugins.interchange.node_kinds import ForeignKind
from missions.plugins.interchange.report import DIFFERS, LOST
from missions.plugins.interchange.scripts import as_condition, number_text, text_formula
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import is_pointer


def measured(
    tree: TreeContext, element: Element, kind: str, known: ForeignKind, child: MissionStep
) -> MissionStep | None:
    """Return the child of a decorator with a modifier whose value is the number in a port, such as ``retry: 3``.

    ``known.port`` is the port, a count or a time in milliseconds.
    """
    text = tree.port(element, kind, known.port)
    if is_pointer(text):
        name = tree.pointer(text, known.port)
        value: object = Verbatim(f'"${{{name}}} {known.unit}"') if known.unit else Computed(name)
        return wrapped(child, known.word, value, remark_of(element, child), (name,))
    number = constant_value(text)
    if isinstance(number, bool | str):
        tree.report.add(LOST, element, f"{known.port} is '{text}', which is not a number", kind)
        return child
    if known.unit:
        if number <= 0:
            return child  # neither a time limit nor a delay
        return wrapped(child, known.word, quantity(number / 1000, "s"), remark_of(element, child))
    if number == 0:
        tree.report.add(DIFFERS, element, f"{known.port} is 0: it ends at once here, as there", kind)
        return MissionStep("succeed" if kind == "Repeat" else "fail", comments=child.comments)
    count = "forever" if number < 0 else int(number)
    if count == 1 and kind == "Repeat":
        return child
    return wrapped(child, known.word, Verbatim(str(count)), remark_of(element, child))


def run_once(tree: TreeContext, element: Element, kind: str, skip_as: SkipAs) -> MissionStep:
    """Return the child of a RunOnce node, with ``once`` or with a variable that says that it has run."""
    child = tree.node(element.children[0], skip_as, kind)
    if not tree.tree.is_main:
        tree.report.add(DIFFERS, element, "runs once in each run of its mission, not once for ever", kind)
    if tree.port(element, kind, "then_skip").lower() in ("false", "0"):
        return wrapped(child, "once", True, remark_of(element, child))
    done = tree.fresh_name(element, "run_once", "done")
    tree.initial[done] = False
    tried = MissionStep("sequence", [child, set_step({done: True})])
    failed = MissionStep("sequence", [set_step({done: True}), fail_again()])
    step = tree.add_name(MissionStep("selector", [tried, failed]), element)
    return wrapped(step, "if", PlainExpression(f"not {done}"), reads=(done,))


def precondition(tree: TreeContext, element: Element, kind: str, skip_as: SkipAs) -> MissionStep | None:
    """Return a Precondition node: its child, and the condition of its ``if`` port, which is evaluated at the start.

    The ``else`` port decides whether a false condition skips the child, succeeds, fails, or waits. None if missions
    cannot express the condition.
    """
    formula = tree.condition(element, tree.port(element, kind, "if"))
    if formula is None:
        return None
    child = tree.node(element.children[0], skip_as, kind)
    otherwise, reads = tree.port(element, kind, "else").upper(), tree.variables_of(formula)
    if otherwise == "SKIPPED":
        return wrapped(child, "if", PlainExpression(formula.text), remark_of(element, child), reads)
    if otherwise == "SUCCESS":
        cases = {
            "on": PlainExpression(as_condition(formula).text),
            "cases": {"true": child},
            "default": MissionStep("succeed"),
        }
        return tree.add_name(MissionStep("switch", cases, reads=reads), element)
    word = "wait_until" if otherwise == "RUNNING" else "check"
    return tree.add_name(
        MissionStep("sequence", [MissionStep(word, PlainExpression(formula.text), reads=reads), child]), element
    )


def loop(tree: TreeContext, element: Element, kind: str, skip_as: SkipAs) -> MissionStep | None:
    """Return a LoopInt, LoopBool, LoopDouble or LoopString node as a ``for_each`` over its ``queue`` port.

    None if its ``value`` port names no blackboard entry, or the queue is an empty constant.
    """
    queue, value = tree.port(element, kind, "queue"), tree.port(element, kind, "value")
    if tree.port(element, kind, "if_empty").upper() not in ("SUCCESS", ""):
        tree.report.add(DIFFERS, element, "an empty list succeeds", kind)
    if not is_pointer(value):
        return None
    return _for_each(tree, element, kind, queue.removeprefix("json:"), value, "", skip_as)


def _for_each(
    tree: TreeContext, element: Element, kind: str, queue: str, value: str, number: str, skip_as: SkipAs
) -> MissionStep | None:
    reads: tuple[str, ...] = ()
    if is_pointer(queue):
        name = tree.pointer(queue, "queue")
        among: object = PlainExpression(name)
        reads = (name,)
    else:
        items = [constant_value(each) for each in queue.strip("[] ").replace(",", ";").split(";") if each.strip()]
        if not items:
            return None
        among = items
    member = tree.pointer(value, "value")
    fields: dict[str, object] = {"in": among, "as": member}
    sets = [member]
    if is_pointer(number):
        fields["number"] = tree.pointer(number, "index")
        sets.append(str(fields["number"]))
    fields["do"] = tree.node(element.children[0], skip_as, kind)
    return tree.add_name(MissionStep("for_each", fields, reads=reads, sets=tuple(sets)), element)


def for_each_of_vector(tree: TreeContext, element: Element, kind: str, skip_as: SkipAs) -> MissionStep | None:
    """Return a ForEach or ForEachUntilSuccess node of MoveIt Pro as a ``for_each`` over its ``vector_in`` port.

    To end at the first success, both the ``for_each`` and its child are inverted. None if its ``out`` port names no
    blackboard entry, or the vector is an empty constant.
    """
    among, member, number = (tree.port(element, kind, port) for port in ("vector_in", "out", "index"))
    if not is_pointer(member):
        return None
    step = _for_each(tree, element, kind, among, member, number, skip_as)
    if step is None or kind == "ForEach":
        return step
    fields = step.value
    if isinstance(fields, dict) and isinstance(fields["do"], MissionStep):  # ends at the first success
        fields["do"] = wrapped(fields["do"], "invert", True)
    return wrapped(step, "invert", True)


def blackboard_check(tree: TreeContext, element: Element, kind: str, skip_as: SkipAs) -> MissionStep:
    """Return the child of a BlackboardCheck node; it runs while the ports ``value_A`` and ``value_B`` are equal."""
    child = tree.node(element.children[0], skip_as, kind)
    sides = list[str]()
    reads: tuple[str, ...] = ()
    for port in ("value_A", "value_B"):
        value = tree.port(element, kind, port)
        if is_pointer(value):
            sides.append(tree.pointer(value, port))
            reads += (sides[-1],)
        else:
            sides.append(_constant_formula(value, as_text=kind == "BlackboardCheckString"))
    if tree.port(element, kind, "return_on_mismatch").upper() == "SUCCESS":
        return wrapped(child, "until", PlainExpression(" != ".join(sides)), remark_of(element, child), reads)
    return wrapped(child, "while", PlainExpression(" == ".join(sides)), remark_of(element, child), reads)


def _constant_formula(value: str, *, as_text: bool) -> str:
    constant = value if as_text else constant_value(value)
    if isinstance(constant, bool):
        return "true" if constant else "false"
    return text_formula(constant).text if isinstance(constant, str) else number_text(float(constant))
