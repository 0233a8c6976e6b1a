"""Runs that are merged within a tick: they lead to the same states, by the same scripts, as if none were merged."""

from collections.abc import Mapping
from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drivers.clock import ManualClock
from missions.language.plan import Plan
from missions.library.shipped import load_mission
from missions.plugins.verify.explore import PROVED, StateSpace
from missions.plugins.verify.model import MissionModel
from missions.plugins.verify.rule_monitor import TimeOver, Violation
from missions.plugins.verify.tick_merging import TickMerger
from missions.plugins.verify.verdicts import verify
from tests.missions.testing.verify import test_against_brute_force as brute
from tests.missions.testing.verify.exploring import plan_of

BOUND = 400


def explored(plan: Plan) -> StateSpace:
    space = StateSpace(MissionModel(plan), BOUND)
    space.explore()
    return space


def found(space: StateSpace) -> Mapping[str, object]:
    """Return all that verdicts and traces are made of; nodes by their keys."""
    return {
        "states": [
            (place.kind, place.predecessor, place.script, place.successors, place.completes_round)
            for place in space.places
        ],
        "violations": {
            rule: (message(first.violation), first.place, first.script, first.halted)
            for rule, first in space.violations.items()
        },
        "facts": {
            (fact.node.key,) if isinstance(fact, TimeOver) else getattr(fact, "key", fact) for fact in space.facts
        },
    }


def message(violation: Violation) -> tuple[str, str]:
    return violation.message, violation.node.key


def compare(plan: Plan) -> tuple[int, int]:
    """Compare an exploration with one that merges nothing; return the transitions of both."""
    merged = explored(plan)
    with patch.object(TickMerger, "start", lambda _: None):
        whole = explored(plan)
    if whole.is_complete:
        assert found(merged) == found(whole)
    return merged.transitions, whole.transitions


LEAF = st.sampled_from(
    (
        "look: 0 deg",
        "drive: 1 m",
        "face_seen: 1 s",
        "dark: 20 %",
        "bumped",
        "check: battery.percent < 30",
        "wait_until: face.seen or base.bumper",
        "set: {n: 1}",
        "set: {n: '${n + 1}'}",
        "say: '${n}'",
        "check: n == 1",
        "listen: {for: [yes]}",
        "wait: 1 s",
    )
)
MODIFIERS = (
    *brute.MODIFIERS,
    *brute.TIMES,
    "while: base.bumper",
    "if: range.ahead < 1 m",
    "until: battery.percent > 30 and face.seen",
    "once: ${n}",
    "finally: {listen: {for: [no]}}",
)


def more(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    lists = st.lists(children, min_size=2, max_size=3).map(lambda nodes: ", ".join(f"{{{node}}}" for node in nodes))
    return [
        *brute.waiting(children),
        *brute.listing(children),
        *brute.cleaning(children),
        *brute.ordering(children),
        *brute.drawing(children),
        st.builds("{}: [{}]".format, st.sampled_from((*brute.COMPOSITES, "random_selector")), lists),
    ]


@settings(max_examples=60)
@example("parallel: [{bumped}, {sequence: [{drive: 1 m}, {bumped}], finally: {listen: {for: [no]}}}, {bumped}]")
@example("reactive_selector: [{sequence: [{bumped}, {drive: 1 m}]}, {drive: 2 m, finally: {listen: {for: [no]}}}]")
@given(brute.trees(MODIFIERS, LEAF, more))
def test_merged_runs_lead_to_the_same_states_by_the_same_scripts(tree: str) -> None:
    try:
        plan = plan_of(f"{{sequence: [{{set: {{n: 0}}}}, {{{tree}}}]}}")
    except ValueError:
        return
    compare(plan)


@pytest.mark.parametrize("name", ["greet_everybody", "look_away", "shake_hands"])
def test_merging_leaves_a_shipped_mission_as_it_was(name: str) -> None:
    merged, whole = compare(load_mission(name))
    assert merged <= whole


def test_ways_to_the_same_failure_are_followed_once() -> None:
    steps = ", ".join("{drive: 1 m}" for _ in range(8))
    after = ", ".join("{say: Hi, on_failure: succeed}, {turn: 9 deg}" for _ in range(3))
    merged, whole = compare(plan_of(f"selector: [{{sequence: [{steps}]}}, {{sequence: [{after}]}}]"))
    assert merged < whole / 2


def test_draws_after_several_ways_to_the_same_situation_are_made_once() -> None:
    ways = "sequence: [{drive: 1 m}, {turn: 9 deg}, {arc: {radius: 1 m, angle: 9 deg}}], on_failure: succeed"
    drawn = "random_selector: [{look: 9 deg}, {nod: 1}, {say: a}]"
    for weights in ("", ", weights: [1, 2, 1]", ", weights: '${w}'"):
        found = plan_of(f"sequence: [{{{ways}}}, {{{drawn}{weights}}}]", params="{w: {type: list, of: number}}")
        merged, whole = compare(found)
        assert merged < whole / 1.5, weights


COOLDOWNS = """
reactive_selector:
  - sequence: [bumped, {drive: 30 cm}]
    cooldown: 5 s
  - sequence: [face_seen, nod]
    cooldown: 3 s
  - wait: 2 s
repeat: forever
"""


def test_a_cooldown_that_is_over_is_like_one_that_has_not_begun() -> None:
    report = verify(plan_of(COOLDOWNS), ManualClock())
    assert report.outcome == PROVED
    assert report.states < 100


def test_variables_that_no_cleanup_reads_do_not_count_in_a_halt() -> None:
    steps = ", ".join(f"{{face_seen: 1 s, as: v{place}, on_failure: succeed}}" for place in range(4))
    reads = ", ".join(f"{{check: v{place} == 1, on_failure: succeed}}" for place in range(4))
    unset = ", ".join(f"v{place}: 0" for place in range(4))
    tree = "sequence: [{{set: {{{}}}}}, {{sequence: [{}, {{gesture: hello}}, {}]{}}}]"
    light = verify(plan_of(tree.format(unset, steps, reads, ", finally: {listen: {for: [no]}}")), ManualClock())
    heavy = verify(
        plan_of(tree.format(unset, steps, reads, ", finally: {listen: {for: [no]}, if: v0 == v1 and v2 == v3}")),
        ManualClock(),
    )
    assert light.outcome == heavy.outcome == PROVED
    assert light.states < heavy.states


TUTORIAL = Path(__file__).parent / "tutorial_seven.yaml"


def test_a_tree_with_many_ways_to_fail_is_proved_in_few_steps() -> None:
    """It has 413 states and 86 548 transitions if no runs are merged and all outcomes are distinguished."""
    report = verify(load_mission(str(TUTORIAL)), ManualClock())
    assert report.outcome == PROVED
    assert "each of its 37 nodes can be reached" in str(report)
    assert report.states < 300
    assert report.transitions < 7_000
