"""Live variables: what is merged decides nothing, and what decides something is never merged."""

from collections.abc import Mapping
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours.leaf import Leaf
from drivers.clock import ManualClock
from missions.language.nodes import MISSION
from missions.language.plan import Plan, Step
from missions.library.shipped import load_mission
from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.explore import PROVED, REFUTED, StateSpace
from missions.plugins.verify.live_variables import LiveVariables, live_variables, names_read
from missions.plugins.verify.model import MissionModel, abstract_step
from missions.plugins.verify.rule_monitor import RuleMonitor
from missions.plugins.verify.verdicts import MAX_STATES, RuleChecker, verify
from tests.missions.testing.verify.exploring import explored, outcome, outcomes, plan_of


def live_at(word: str, tree: str) -> set[str]:
    """What is live while the one leaf with this word, or the one node of this kind, runs after two were set."""
    step = abstract_step(
        plan_of(f"sequence: [{{set: {{a: 1, b: 2}}}}, {tree}]").tree, Oracle(), RuleMonitor(), frozenset()
    )
    live = live_variables(step).running
    (key,) = (key for key, each in keyed(step, "1").items() if each.kind == word)
    return set(live[key])


def keyed(step: Step, key: str) -> Mapping[str, Step]:
    found = {key: step}
    for place, child in enumerate(step.children, start=1):
        found |= keyed(child, f"{key}.{place}")
    return found


@pytest.mark.parametrize(
    ("tree", "live"),
    [
        ("{drive: 1 m}, {log: x, if: a == 1}", {"a"}),
        ("{drive: 1 m}, {set: {a: 3}}, {log: x, if: a == 1}", set()),
        ("{drive: 1 m}, {say: '${a}'}", set()),  # which can fail anyhow
        ("{drive: 1 m}, {log: '${a}'}", {"a"}),  # which fails only without it
        ("{selector: [{drive: 1 m}, {log: x, if: a == 1}]}", {"a"}),
        ("{drive: 1 m, on_failure: succeed}, {log: x, if: a == 1}", {"a"}),
        ("{drive: 1 m, invert: true}, {log: x, if: a == 1}", {"a"}),
        ("{sequence: [{log: x, if: a == 1}, {drive: 1 m}], repeat: 2}", {"a"}),
        ("{sequence: [{log: x, if: a == 1}, {drive: 1 m}], retry: 2}", {"a"}),
        ("{sequence: [{set: {a: 2}}, {drive: 1 m}], repeat: 2}", set()),
        ("{drive: 1 m, while: a == 1, until: b == 3}", set()),  # its modifiers know
        ("{face_seen: 1 s, as: a}, {drive: 1 m}, {log: x, if: a == 1}", {"a"}),
        ("{find_face: {}, as: a}, {log: x, if: a == 1}", set()),
        ("{find_face: {}, as: a, on_failure: succeed}, {log: x, if: a == 1}", {"a"}),
        ("{find_face: {}, as: a, invert: true}, {log: x, if: a == 1}", {"a"}),
        ("{sequence: [{log: x, if: a == 1}, {drive: 1 m}], hold: 1 s}", {"a"}),
        ("{random_sequence: [{drive: 1 m}, {log: x, if: a == 1}]}", {"a"}),
        ("{drive: 1 m}, {switch: {on: b, cases: {1: {log: '${a}'}}}}", {"a", "b"}),
    ],
)
def test_variable_is_live_if_possibly_read_before_set(tree: str, live: set[str]) -> None:
    assert live_at("find_face" if "find_face" in tree else "drive", tree) == live


@pytest.mark.parametrize(
    ("tree", "kind", "live"),
    [
        ("{drive: 1 m, while: a == 1}", "while", {"a"}),
        ("{drive: 1 m, until: a == 1}, {log: x, if: b == 1}", "until", {"a", "b"}),
        ("{selector: [{drive: 1 m, timeout: 1 s}, {log: '${a}'}]}", "timeout", {"a"}),
        (
            "{selector: [{sequence: [{drive: 1 m, on_failure: succeed}], timeout: 1 s}, {log: '${a}'}]}",
            "timeout",
            {"a"},
        ),
        (
            "{find_face: {}, as: a, until: b == 1}, {log: x, if: a == 1}",
            "until",
            {"a", "b"},
        ),
        ("{mission: greet_by_name}", "gesture", {"name"}),  # which it returns
        ("{log: '${a}', delay: 1 s}", "delay", {"a"}),
        (
            "{reactive_sequence: [{log: x, if: a == 1}, {drive: 1 m}]}",
            "reactive_sequence",
            {"a"},
        ),
    ],
)
def test_parent_keeps_variables_of_its_own_conditions(tree: str, kind: str, live: set[str]) -> None:
    assert live_at(kind, tree) == live


LATE: Mapping[str, str] = {
    "in the next round": "sequence: [{say: now, if: n == 2}, {drive: 1 m}, {set: {n: '${n + 1}'}}]\nrepeat: 3",
    "after a failure": "selector: [{sequence: [{set: {n: 2}}, {drive: 1 m}]}, {say: now, if: n == 2}]",
    "after its time is over": "selector: [{sequence: [{set: {n: 2}}, {drive: 1 m}], timeout: 1 s}, "
    "{say: now, if: n == 2}]",
    "beside another": "parallel: [{sequence: [{drive: 1 m}, {set: {n: 2}}]}, "
    "{sequence: [{look: 0 deg}, {say: now, if: n == 2}]}]",
    "ahead of what runs": "reactive_selector: [{sequence: [{set: {m: 0}}, {say: now, if: n == 2}, {fail: no}]}, "
    "{sequence: [{set: {n: 2}}, {drive: 1 m}]}]",
    "while it runs": "parallel: [{sequence: [{drive: 1 m}, {set: {n: 2}}, {turn: 90 deg}]}, "
    "{selector: [{look: 0 deg, while: n != 2}, {say: now, if: n == 2}]}]",
    "in any order": "random_sequence: [{sequence: [{drive: 1 m}, {set: {n: 2}}]}, {say: now, if: n == 2}]",
    "by a switch": "sequence: [{drive: 1 m}, {set: {n: 2}}, {look: 0 deg}, {switch: {on: n, cases: {2: {say: now}}}}]",
    "by a text": "sequence: [{set: {n: 2}}, {drive: 1 m}, {set: {m: '${n}'}}, {look: 0 deg}, {say: now, if: m == 2}]",
}
"""Trees that say something only where an ``n``, set to 2 while something goes on, is kept for when it is read."""


def late(where: str) -> str:
    """Such a tree, with an ``n`` that is set before it."""
    body = "\n".join(f"      {line}" for line in LATE[where].splitlines())
    return f"sequence:\n  - set: {{n: 0}}\n  - sequence:\n    -\n{body}"


@pytest.mark.parametrize("where", list(LATE))
def test_branch_on_a_variable_read_late_is_reached(where: str) -> None:
    assert explored(late(where)).outcome == PROVED


@pytest.mark.parametrize("where", list(LATE))
def test_fault_behind_a_variable_read_late_is_found(where: str) -> None:
    assert outcome(late(where), "never: say after set") == REFUTED


class Slow(Leaf):
    """Take a while to stop.

    Running until it succeeds.
    """

    tag = "slow"

    def halting(self) -> bool:
        return True


def test_variable_read_after_a_halt_is_kept() -> None:
    tree = """
sequence:
  - set: {n: 2}
  - selector:
      - parallel:
          - slow:
            on_failure: succeed
          - drive: 1 m
      - log: now
        if: n == 2
"""
    assert outcome(tree, "can: fail", leaves=[Slow]) == REFUTED


def test_a_param_is_not_lost_before_the_first_tick() -> None:
    plan = plan_of("log: now\nif: n > 3\n", "can: succeed", params="{n: {type: count}}")
    assert verify(plan, ManualClock()).outcome == PROVED


def test_states_that_differ_in_dead_variables_are_merged() -> None:
    found = "{set: {who: null, n: 1}}, {face_seen: 1 s, as: who, on_failure: succeed}"
    tree = f"sequence: [{found}, {{set: {{n: 2}}, if: who.id == 1}}"
    kept = f"{tree}, {{drive: 1 m}}, {{log: x, if: n == 1}}]"
    assert explored(f"{tree}, {{drive: 1 m}}]").states < explored(kept).states


def test_value_found_before_a_timeout_is_kept() -> None:
    early = """
selector:
  - sequence: [{set: {who: null}}, {find_face: {}, as: who, timeout: 1 s}]
  - sequence: [{log: "${who.distance}"}, {drive: 1 m}, {log: "${who.distance}"}, {say: now}]
"""
    assert explored(early).outcome == PROVED  # it says so only where it knows who that was


ROUNDS = """
sequence:
  - set: {t: 5 s}
  - selector:
      - sequence:
          - pretend: running
            timeout: 1 s
            retry: forever
        timeout: %s
      - say: over
"""


def test_unknown_duration_merges_states_and_may_end_at_any_tick() -> None:
    known, unknown = explored(ROUNDS % "5 s"), explored(ROUNDS % "${t}", "never: say after set")
    assert unknown.states < known.states
    assert outcomes(unknown)["never: say after set"] == REFUTED
    assert unknown.verdicts[1].outcome == PROVED  # each of its nodes can be reached


# Against an exploration that forgets nothing


def everything(tree: Step) -> LiveVariables:
    """All variables, of every node."""
    names = names_read(value for step in tree.walk() for value in (*step.arguments.values(), *step.returns.values()))
    stored = {step.output_variable for step in tree.walk() if step.output_variable is not None}
    stored |= {name for step in tree.walk() if step.leaf is not None for name in step.arguments}
    stored |= {name for step in tree.walk() if step.kind == MISSION for name in (*step.arguments, *step.returns)}
    each = dict.fromkeys(keyed(tree, "1"), names | stored)
    return LiveVariables(each, each)


def ways(plan: Plan) -> tuple[set[object], list[tuple[str, str]], dict[str, int], int]:
    """Which leaves can run at once, the verdicts, how many ticks it takes to each end, and in how many states."""
    space = StateSpace(MissionModel(plan), MAX_STATES)
    space.explore()
    assert space.is_complete
    seen: set[object] = {
        (each.kind, frozenset(leaf.key for leaf in each.live_leaves), each.happened) for each in space.places
    }
    verdicts = [(each.rule, each.outcome) for each in RuleChecker(space, plan).verdicts()]
    return seen, verdicts, {place.kind: place.depth for place in reversed(space.places)}, len(space.places)


def same_without_forgetting(plan: Plan) -> tuple[int, int]:
    """How many states there are with and without forgetting, after a check that no more than that differs."""
    *merged, fewer = ways(plan)
    with patch("missions.plugins.verify.model.live_variables", everything):
        *whole, more = ways(plan)
    assert merged == whole
    assert fewer <= more
    return fewer, more


LEAF = st.sampled_from(
    (
        "look: 0 deg",
        "set: {a: 1}",
        "set: {a: 2}",
        "set: {b: '${a}'}",
        "set: {a: '${b + 1}'}",
        "face_seen: 1 s, as: a",
        "log: '${a + b}'",
        "log: '${c}'",
        "set: {a: '${c}'}",
        "set: {b: '${d}'}",
    )
)
MODIFIERS = (
    "if: a == 1",
    "if: b == 2",
    "while: a != 2",
    "until: b == 1",
    "retry: 2",
    "repeat: 2",
    "invert: true",
    "on_failure: succeed",
    "on_success: fail",
    "once: true",
    "once: a",
    "on_running: succeed",
    "timeout: 1 s",
    "delay: 1 s",
    "hold: 1 s",
)
COMPOSITES = (
    "sequence",
    "selector",
    "reactive_sequence",
    "reactive_selector",
    "parallel",
    "race",
    "random_sequence",
    "random_selector",
)
LISTS = st.sampled_from(("[]", "[1, 2]", "[1, 2, 1, 2]", "'[a, b]'", "'[a, b, 1, 2]'", "a"))
COUNTS = ("failure_count: all", "wait_for_all: true", "failure_count: '${a}'")


def node(children: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    lists = st.lists(children, min_size=1, max_size=3).map(", ".join)
    composites = st.builds("{{{0}: [{1}]}}".format, st.sampled_from(COMPOSITES), lists)
    composites |= st.builds("{{parallel: [{0}], success_count: 1, {1}}}".format, lists, st.sampled_from(COUNTS))
    composites |= st.builds(
        "{{reactive_switch: {{on: a, cases: {{1: {0}}}, default: {1}}}}}".format, children, children
    )
    composites |= st.builds("{{for_each: {{in: {0}, as: c, number: d, do: {1}}}}}".format, LISTS, children)
    cleanups = children.map(lambda child: child.replace("look: 0 deg", "show: a"))
    composites |= st.builds("{{sequence: [{0}], retry: 3, recover: {1}}}".format, children, children)
    composites |= st.builds("{{sequence: [{0}], finally: {1}}}".format, children, cleanups)
    return st.builds("{{sequence: [{0}], {1}}}".format, children | composites, st.sampled_from(MODIFIERS)) | composites


@settings(max_examples=60)
@given(st.recursive(LEAF.map("{{{0}}}".format), node, max_leaves=6))
def test_forgetting_dead_variables_changes_no_verdict(tree: str) -> None:
    try:
        plan = plan_of(f"sequence: [{{set: {{a: 0, b: 0, c: 0, d: 0}}}}, {tree}, {{look: 1 deg, if: a == b}}]")
    except ValueError:  # what the checker refuses
        return
    same_without_forgetting(plan)


@pytest.mark.parametrize("name", ["greet_by_name", "greet_everybody", "dock", "say_goodbye", "look_around"])
def test_nothing_is_lost_of_a_shipped_mission(name: str) -> None:
    fewer, more = same_without_forgetting(load_mission(name))
    assert fewer <= more
