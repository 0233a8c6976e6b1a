"""Translation of pre- and postconditions, which are attributes of a node such as ``_skipIf`` and ``_onSuccess``."""

from collections.abc import Mapping

from missions.plugins.interchange.context import (
    SkipAs,
    TreeContext,
    copies,
    fail_again,
    set_step,
    take_comments,
    wrap_in,
)
from missions.plugins.interchange.mission_text import MissionStep, PlainExpression, wrapped
from missions.plugins.interchange.node_kinds import CONDITION_ATTRIBUTES, END_ATTRIBUTES
from missions.plugins.interchange.report import LOST
from missions.plugins.interchange.scripts import FLAG, LOGIC, Formula, as_condition, negate
from missions.plugins.interchange.xml_reader import Element

NEVER_FAILS = ("wait", "succeed", "set")
"""Words of mission leaves that the translation writes by itself and that never fail."""


def with_conditions(tree: TreeContext, element: Element, step: MissionStep, skip_as: SkipAs) -> MissionStep:
    """Return ``step`` inside the steps and modifiers that stand for the pre- and postconditions of its XML node.

    ``skip_as`` is how the parent treats a skipped child.
    """
    codes = {
        name: element.attributes[name]
        for name in (*CONDITION_ATTRIBUTES, *END_ATTRIBUTES)
        if name in element.attributes
    }
    if not codes:
        return step
    conditions = {name: tree.condition(element, codes[name]) for name in CONDITION_ATTRIBUTES if name in codes}
    if (success := conditions.get("_successIf")) is not None:
        check = MissionStep("check", PlainExpression(success.text), reads=tree.variables_of(success))
        step = wrap_in(step, "selector", [check, step])
    if (failure := conditions.get("_failureIf")) is not None:
        check = MissionStep("check", PlainExpression(negate(failure).text), reads=tree.variables_of(failure))
        step = wrap_in(step, "sequence", [check, step])
    step = _with_ends(tree, element, step, codes)
    if (running := conditions.get("_while")) is not None:
        step = _limit_by_condition(tree, step, running, skip_as)
    if (skip := conditions.get("_skipIf")) is not None:
        runs = negate(skip)
        for other in (success, failure):
            if other is not None:  # they are evaluated before it
                runs = Formula(
                    f"{runs.within(LOGIC + 1)} or {other.within(LOGIC + 1)}",
                    FLAG,
                    (*runs.reads, *other.reads),
                    LOGIC,
                )
        if skip.text != "false":
            step = wrapped(step, "if", PlainExpression(runs.text), reads=tree.variables_of(runs))
    return step


def _limit_by_condition(tree: TreeContext, step: MissionStep, running: Formula, skip_as: SkipAs) -> MissionStep:
    """Return a step that runs only while the condition ``running`` is true, as with the attribute ``_while``.

    When the condition is false, the step ends with the result that its parent treats like a skipped child; ``skip_as``
    says which. With "running", the step waits instead.
    """
    reads = tree.variables_of(running)
    if skip_as != "running":
        stops = ("until", negate(running)) if skip_as == "success" else ("while", running)
        step = wrapped(step, stops[0], PlainExpression(stops[1].text), reads=reads)
        return wrapped(step, "if", PlainExpression(running.text), reads=reads)
    idle = MissionStep("wait_until", PlainExpression("false"))
    cases: dict[str, object] = {
        "on": PlainExpression(as_condition(running).text),
        "cases": {"true": step, "false": idle},
    }
    return MissionStep("reactive_switch", cases, comments=take_comments(step), reads=reads)


def _with_ends(tree: TreeContext, element: Element, step: MissionStep, codes: Mapping[str, str]) -> MissionStep:
    """Return a step followed by the scripts that its XML node runs after a success, a failure, any end, or a halt.

    ``codes`` has the code of each script by its attribute, such as ``_onSuccess``.
    """
    scripts = {name: _end_steps(tree, element, codes[name]) for name in END_ATTRIBUTES if name in codes}
    always = scripts.get("_post", [])
    after_success = [*scripts.get("_onSuccess", []), *always]
    after_failure = [*scripts.get("_onFailure", []), *copies(always)]
    comments = take_comments(step)
    may_fail = step.word not in NEVER_FAILS or len(step.keys.keys() - {"name"}) > 0
    if after_success:
        step = MissionStep("sequence", [step, *after_success])
    halted = scripts.get("_onHalted", [])
    if not halted:
        if after_failure and may_fail:
            step = MissionStep("selector", [step, MissionStep("sequence", [*after_failure, fail_again()])])
        step.comments = comments
        return step
    runs = tree.fresh_name(element, element.tag, "runs")
    tree.initial[runs] = False
    if may_fail:
        failed = MissionStep("sequence", [set_step({runs: False}), *after_failure, fail_again()])
        step = MissionStep("selector", [step, failed])
    # Only a halt leaves the variable true.
    step = MissionStep("sequence", [set_step({runs: True}), step, set_step({runs: False})], comments=comments)
    cleanup = halted[0] if len(halted) == 1 else MissionStep("sequence", halted)
    return wrapped(step, "finally", wrapped(cleanup, "if", PlainExpression(runs), reads=(runs,)))


def _end_steps(tree: TreeContext, element: Element, code: str) -> list[MissionStep]:
    script = tree.script(element, code)
    if script is None:
        tree.report.add(LOST, element, f"the script '{code}'")
        return []
    return tree.set_steps(script.assignments)
