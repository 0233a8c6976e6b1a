"""Variables whose values have no effect: which they are, and that dropping their values changes no verdict."""

from collections.abc import Sequence
from unittest.mock import patch

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from missions.language.plan import Plan
from missions.library.shipped import load_mission
from missions.plugins.verify import model
from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.explore import StateSpace
from missions.plugins.verify.model import MissionModel, abstract_step
from missions.plugins.verify.rule_monitor import RuleMonitor
from missions.plugins.verify.value_effects import ineffective_variables
from missions.plugins.verify.verdicts import RuleChecker
from tests.missions.testing.verify import test_against_brute_force as brute
from tests.missions.testing.verify.exploring import plan_of


def ineffective(plan: Plan) -> Sequence[set[str]]:
    """Return the variables without effect that a mission, and each of its sub-missions, sets."""
    tree = abstract_step(plan.tree, Oracle(), RuleMonitor(), plan.tree.variables)
    missions = [plan.tree, *(step.children[0] for step in plan.tree.walk() if step.kind == "mission")]
    found = ineffective_variables(tree, plan.params)
    return [set(names & mission.variables) for names, mission in zip(found, missions, strict=True)]


@pytest.mark.parametrize(
    ("steps", "names"),
    [
        ("{set: {a: 1}}, {say: '${a}'}", {"a"}),
        ("{set: {a: 1}}, {notify: 'it is ${a}'}", {"a"}),
        ("{set: {a: 1}}, {log: '${a + 1}'}", set()),  # the calculation may fail
        ("{set: {a: 1}}, {check: a == 1}", set()),
        ("{set: {a: 1}}, {say: x, if: a == 1}", set()),
        ("{set: {a: 1}}, {say: x, repeat: '${a}'}", set()),
        ("{set: {a: 1}}, {set: {b: '${a + 1}'}}, {say: '${b}'}", {"a", "b"}),
        ("{set: {a: 1}}, {set: {b: '${a + 1}'}}, {check: b == 2}", set()),
        ("{set: {a: 1}}, {set: {b: '${a / 0.5}'}}, {say: '${b}'}", {"b"}),  # as a may be what cannot be divided
        ("{set: {a: 1 m}}, {set: {b: '${a + 1 m}'}}, {say: '${b}'}", {"b"}),  # only numbers are sure to add up
        ("{set: {a: 1}}, {set: {b: '${a}'}}, {say: '${b}'}", {"a", "b"}),
        ("{set: {a: 1}}, {set: {b: 'x${a}'}}, {say: '${b}'}", {"a", "b"}),
        ("{find_face: {}, as: a}, {say: '${a.id}'}", set()),  # always unknown
    ],
)
def test_a_variable_that_is_only_spoken_or_added_up_has_no_effect(steps: str, names: set[str]) -> None:
    assert ineffective(plan_of(f"sequence: [{steps}]")) == [names]


def test_a_sum_is_followed_into_and_out_of_a_sub_mission() -> None:
    outer, inner = ineffective(load_mission("patrol_and_report"))
    assert {"met", "greeted"} <= outer
    assert "words" in inner
    assert "greeted" not in inner  # it is compared there


def verdicts(plan: Plan) -> object:
    """Return the outcome of each rule, and the length of its shortest run; None for a space that is too large."""
    space = StateSpace(MissionModel(plan), 300)
    space.explore()
    if not space.is_complete:
        return None
    return [
        (verdict.rule, verdict.outcome, [finding.run and len(finding.run) for finding in verdict.findings])
        for verdict in RuleChecker(space, plan).verdicts()
    ]


LEAF = st.sampled_from(
    (
        "drive: 1 m",
        "face_seen: 1 s, as: n",
        "set: {n: 1}",
        "set: {n: '${m + 1}'}",
        "set: {m: '${n}'}",
        "set: {m: '${m + 1}'}",
        "set: {t: 'It is ${n}'}",
        "say: '${t}'",
        "notify: 'It is ${m}'",
        "log: '${n + m}'",
        "check: m == 2",
        "check: n == 1",
    )
)
MODIFIERS = (*brute.MODIFIERS, "if: m < 2", "until: n == 2", "once: ${t}", "repeat: 3")


@settings(max_examples=60)
@example("sequence: [{set: {m: '${m + 1}'}}, {drive: 1 m}], repeat: 3")
@example("sequence: [{set: {n: '${m + 1}'}}, {drive: 1 m}, {check: n == 1}], retry: 2")
@given(brute.trees(MODIFIERS, LEAF))
def test_dropped_values_change_no_verdict(tree: str) -> None:
    try:
        plan = plan_of(f"sequence: [{{set: {{n: 0, m: 0, t: x}}}}, {{{tree}}}]", "can: succeed", "can: fail")
    except ValueError:
        return
    dropped = verdicts(plan)
    with patch.object(model, "ineffective_variables", lambda *_: []):
        kept = verdicts(plan)
    assert kept is None or dropped == kept
