"""``random`` in expressions: from the seed of the run, within its bounds, and the same again from a record."""

from collections.abc import Mapping
from pathlib import Path
from random import Random

import pytest
from py_trees.common import Status

from behaviours.basics import Succeed
from behaviours.leaf import Leaf
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import InvalidFileError
from config.library import DEFAULT_ROBOT, find_file
from config.units import Quantity
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.executive.events import VariableSet
from missions.language.draws import repeated_draw_hints
from missions.language.expressions import ExpressionError, parse
from missions.language.plan import Step
from missions.library.drivers import load_robot
from missions.library.shipped import load_mission
from missions.plugins.records.replay.rerun import rerun
from missions.plugins.verify.explore import PROVED, REFUTED
from missions.plugins.verify.unknown_values import truth_values
from missions.request import RunRequest
from tests.missions.records.replay.past import past_of
from tests.missions.testing.verify.exploring import explored, outcome, outcomes, plan_of

MISSION = """\
mission: chance
tree:
  sequence:
    - set: {way: "${random(1 m, 2 m)}", chance: "${random(0, 1)}"}
    - wait: ${random(100 ms, 300 ms)}
    - say: Hello
      if: random(0, 1) < 0.5
    - say: Good day
      if: chance < 0.5
  repeat: 10
"""


def numbers(text: str, *, seed: int = 0, count: int = 200, scope: Mapping[str, object] | None = None) -> list[object]:
    """Return the values of several evaluations of an expression."""
    known = {"random": Random(seed), **(scope or {})}  # noqa: S311 - a test needs no security
    expression = parse(text)
    return [expression.evaluate(known) for _ in range(count)]


def test_numbers_are_within_their_bounds_and_differ() -> None:
    found = numbers("random(2, 5)")
    floats = [number for number in found if isinstance(number, float)]
    assert len(set(floats)) == len(found)
    assert 2 <= min(floats) < 2.1
    assert 4.9 < max(floats) <= 5


def test_number_between_quantities_has_their_dimension() -> None:
    (found,) = numbers("random(20 cm, 1 m)", count=1)
    assert isinstance(found, Quantity)
    assert found.dimension == "length"
    assert 0.2 <= found <= 1.0
    assert numbers("random(1 m, 1 m)", count=1) == [1.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("random(2, 1)", "random: 2 is above 1"),
        ("random(1 m, 2 s)", "cannot draw between a length and a duration"),
        ("random(name, 2)", "cannot calculate with the text 'a'"),
        ("random(-1e308, 1e308)", "a number out of range"),
    ],
)
def test_bounds_that_do_not_fit_are_refused(text: str, message: str) -> None:
    with pytest.raises(ExpressionError, match=message):
        numbers(text, scope={"name": "a"})


@pytest.mark.parametrize("text", ["random()", "random(1)", "random(1, 2, 3)"])
def test_random_needs_two_bounds(text: str) -> None:
    with pytest.raises(ExpressionError, match="'random' needs two values, such as"):
        parse(text)


def test_random_has_no_value_outside_a_run() -> None:
    with pytest.raises(ExpressionError, match="'random' has values only in the run of a mission"):
        parse("random(0, 1)").evaluate({})


def drawn(seed: int, folder: Path) -> list[object]:
    """Return the random numbers that a mission and its sub-mission store in one tick."""
    (folder / "inner.yaml").write_text(
        'mission: inner\ntree: {set: {x: "${random(0, 1)}"}}\nreturns: {x: x, y: "random(1, 2)"}\n'
    )
    path = folder / "outer.yaml"
    path.write_text('mission: outer\ntree:\n  sequence:\n    - mission: inner\n    - set: {z: "${random(0, 1)}"}\n')
    run = RunState(ManualClock(), seed=seed)
    root = build(load_mission(str(path)), run, lambda _: Robot())
    root.execute_tick()
    return [run.variables[name] for name in "xyz"]


def test_missions_and_sub_missions_draw_from_the_seed_of_the_run(tmp_path: Path) -> None:
    assert drawn(3, tmp_path) == drawn(3, tmp_path)
    assert len({*drawn(3, tmp_path), *drawn(4, tmp_path)}) == 6


def test_record_is_decided_again_with_the_same_numbers(tmp_path: Path) -> None:
    path = tmp_path / "chance.yaml"
    path.write_text(MISSION)
    past = past_of(RunRequest(str(path), simulate="fast", seed=7))
    assert not [event for event in past.events if isinstance(event, VariableSet) and event.name == "random"]
    robot = load_robot(find_file("robots", DEFAULT_ROBOT))
    assert rerun(past, load_mission(str(path), complete=True), robot, seed=7).is_identical
    assert not rerun(past, load_mission(str(path), complete=True), robot, seed=8).is_identical


def test_default_of_a_param_cannot_be_random() -> None:
    with pytest.raises(InvalidFileError, match="the default of param 'p' cannot be calculated"):
        plan_of("succeed", params="{p: '${random(0, 1)}'}")


@pytest.mark.parametrize(
    ("condition", "possible"),
    [
        ("random(0, 1) < 0.5", {True, False}),
        ("random(2, 3) > 1", {True}),
        ("random(2, 3) <= 1", {False}),
        ("not random(2, 3) >= 2", {False}),
        ("1 - random(2, 3) < 0", {True}),
        ("-random(2, 3) * 2 > -3", {False}),
        ("random(x, 9) > 4", {True}),
        ("random(unknown, 9) > 4", {True, False}),
        ("random(0, 1) < 2 and random(0, 1) < 0.5", {True, False}),
        ("random(0, 1) < 2 and random(0, 1) > 2", {False}),
        ("random(0, 1) > 2 or random(0, 1) > 3", {False}),
        ("random(0, 1) < 2 or face.seen", {True}),
        ("random(0, 1) == 0.5", {True, False}),
        ("abs(random(0, 1)) < 2", {True, False}),
        ("0 < random(1, 2) < 3", {True, False}),
    ],
)
def test_truth_values_of_a_condition_follow_from_its_bounds(condition: str, possible: set[bool]) -> None:
    assert truth_values(parse(condition).tree, {"x": 5}) == possible


def test_verify_explores_both_outcomes_of_a_draw() -> None:
    tree = "sequence: [{say: a, if: 'random(0, 1) < 0.5'}, {drive: 1 m, if: 'random(0, 1) > 0.5'}]"
    assert outcome(tree, "never: drive after say") == REFUTED
    assert outcome(tree, "never: drive without say") == REFUTED


def test_verify_knows_what_a_draw_cannot_be() -> None:
    tree = "sequence: [{say: a}, {drive: 1 m, if: 'random(1, 2) > 2.5'}]"
    found = [finding.fault.message for verdict in explored(tree).verdicts for finding in verdict.findings]
    assert found == ["'drive' is never reached"]


@pytest.mark.parametrize(
    ("tree", "fails"),
    [
        ("wait: '${random(1 s, 2 s)}'", False),
        ("sequence: [{set: {t: '${random(1 s, 2 s)}'}}, {wait: '${t}'}]", False),
        ("sequence: [{set: {t: '${random(1 s, 2 s)}'}}, {set: {t: '${2 * t + 1 s}'}}, {wait: '${t}'}]", False),
        ("sequence: [{set: {low: 3 s}}, {wait: '${random(low, 2 * low)}'}]", False),
        ("log: 'rolled ${round(random(1, 7) // 1)}'", False),
        ("log: 'rolled ${1 / random(1, 7)}'", False),
        ("wait: '${max(0 s, random(-1 s, 2 s))}'", False),
        ("log: a, repeat: '${round(random(1, 3))}'", False),
        ("check: 'random(n, 3) > 0'", False),
        ("wait: '${random(-1 s, 2 s)}'", True),
        ("sequence: [{set: {t: '${random(-1 s, 2 s)}'}}, {wait: '${t}'}]", True),
        ("sequence: [{set: {t: '${random(1 s, 2 s)}'}}, {wait: '${t - 1.5 s}'}]", True),
        ("log: 'rolled ${1 / random(-1, 7)}'", True),
        ("log: 'rolled ${random(n, 1)}'", True),
        ("log: a, repeat: '${round(random(-1, 3))}'", True),
        ("check: 'random(n, 3) > 2'", True),
    ],
)
def test_verify_keeps_a_draw_within_its_bounds(tree: str, fails: bool) -> None:
    found = explored(f"{{sequence: [{{set: {{n: 2}}}}, {{{tree}}}]}}", "can: fail", "can: succeed")
    assert outcomes(found)["can: fail"] == (PROVED if fails else REFUTED)
    assert outcomes(found)["can: succeed"] == PROVED


def test_verify_knows_the_bounds_of_a_growing_number_for_some_rounds_only() -> None:
    tree = "sequence: [{set: {n: 0}}, {set: {n: '${n + random(1, 2)}'}, retry: 2, repeat: forever, until: n > 5}]"
    found = explored(tree, "can: succeed")
    assert found.outcome == PROVED
    assert found.states < 40


def test_verify_takes_a_stored_draw_for_unknown() -> None:
    tree = "sequence: [{set: {n: '${random(0, 1)}'}}, {say: a, if: n < 0.5}, {drive: 1 m, if: n > 0.5}]"
    assert outcome(tree, "can: succeed") == PROVED
    assert outcome(tree, "never: drive after say") == REFUTED


# --- places where a number that changes, or has decimals, has no meaning ----------------------------------------------

AGAIN = "would give another number each time the node is about to start"
DECIMALS = "gives a number with decimals"


@pytest.mark.parametrize(
    ("tree", "message", "way_out"),
    [
        ("log: a, repeat: '${random(1, 4)}'", f"'repeat': 'random' {DECIMALS}", "write ${round(random(1, 4))}"),
        ("drive: 1 m, retry: '${1 + random(1, 4)}'", DECIMALS, "write ${round(1 + random(1, 4))}"),
        ("parallel: [{log: a}, {log: b}], success_count: '${random(1, 2)}'", DECIMALS, "${round(random(1, 2))}"),
        ("led: {colour: red, number: '${random(1, 2)}'}", DECIMALS, "write ${round(random(1, 2))}"),
        ("switch: {on: 'random(1, 2)', cases: {1: {log: a}}, default: {log: b}}", "equals no case", "write round("),
        ("sequence: [{drive: 1 m, once: 'random(0, 1)'}], repeat: 2", f"'once': 'random' {AGAIN}", "${random(0, 1)}"),
        ("sequence: [{drive: 1 m, once: '${round(random(0, 1))}'}], repeat: 2", AGAIN, "${random(0, 1)}"),
        ("drive: 1 m, cooldown: '${random(1 s, 4 s)}'", AGAIN, "{number: \"${random(1 s, 4 s)}\"}"),
        ("drive: 1 m, while: 'random(0, 1) > 0.5'", "would give another number at every tick", "${random(0, 1)}"),
        ("wait_until: 'x > 1 - random(0, 1)'", "would give another number at every tick", "${random(0, 1)}"),
    ],
)  # fmt: skip
def test_random_without_a_meaning_in_its_place_is_an_error(tree: str, message: str, way_out: str) -> None:
    with pytest.raises(InvalidFileError) as error:
        plan_of(f"{{{tree}}}", params="{x: 1}")
    assert message in str(error.value)
    assert way_out in str(error.value)
    assert len(error.value.diagnostics) == 1


MEANINGFUL = [
    "log: a, repeat: '${round(random(1, 4))}'",
    "log: a, repeat: '${random(1, 4) // 1}'",
    "drive: 1 m, retry: '${round(random(1, 4))}'",
    "drive: 1 m, timeout: '${random(1 s, 4 s)}'",
    "drive: 1 m, delay: '${random(1 s, 4 s)}'",
    "switch: {on: 'round(random(1, 2))', cases: {1: {log: a}, 2: {say: b}}}",
    "switch: {on: 'random(1, 2) < 1.5', cases: {true: {log: a}, false: {say: b}}}",
]


@pytest.mark.parametrize("tree", MEANINGFUL)
def test_verify_proves_what_check_allows(tree: str) -> None:
    report = explored(f"{{{tree}}}", "can: succeed")
    assert {str(verdict.outcome) for verdict in report.verdicts} == {PROVED}
    assert repeated_draw_hints(plan_of(f"{{{tree}}}").tree) == []


@pytest.mark.parametrize("tree", MEANINGFUL)
def test_random_settings_never_fail_a_run(tree: str) -> None:
    for seed in range(20):
        run = RunState(ManualClock(), seed=seed)
        root = build(plan_of(f"{{{tree}}}"), run, lambda _: Robot(), substitute=succeeding)
        for _ in range(6):
            run.clock.advance(5.0)  # type: ignore[attr-defined]
            run.tick += 1
            if root.execute_tick() is not Status.RUNNING:
                break
        assert root.status is Status.SUCCESS, root.reason


def succeeding(step: Step, leaf: Leaf | None) -> Leaf | None:
    """Return a leaf that succeeds, in place of each leaf."""
    return leaf if leaf is None else Succeed(step.name)


CHANCE = "check: 'random(0, 1) < 0.1'"


@pytest.mark.parametrize(
    ("tree", "node"),
    [
        (f"reactive_selector: [{{sequence: [bumped, {{{CHANCE}}}, {{say: a}}]}}, {{drive: 1 m}}]", "reactive_selector"),
        ("reactive_selector: [{say: a, if: 'random(0, 1) < 0.1'}, {drive: 1 m}]", "reactive_selector"),
        (f"reactive_sequence: [{{selector: [bumped, {{{CHANCE}}}]}}, {{drive: 1 m}}]", "reactive_sequence"),
        (f"wait_for: {{{CHANCE}}}", "wait_for"),
        (f"{CHANCE}, hold: 1 s", "hold"),
    ],
)
def test_condition_that_draws_at_every_tick_gets_a_hint(tree: str, node: str) -> None:
    (hint,) = repeated_draw_hints(plan_of(f"{{{tree}}}").tree)
    assert hint.message.endswith(f"'random' gives another number at every tick, since '{node}' evaluates it again")
    way_out = 'such as set: {number: "${random(0, 1)}"}, and read that here'
    assert hint.suggestion == f"store a number before '{node}', {way_out}"


@pytest.mark.parametrize(
    "tree",
    [
        f"sequence: [{{{CHANCE}}}, {{drive: 1 m}}]",
        f"reactive_selector: [{{sequence: [bumped, {{say: a}}, {{{CHANCE}}}]}}, {{drive: 1 m}}]",
        f"reactive_selector: [{{say: a, if: face.seen}}, {{sequence: [{{{CHANCE}}}, {{drive: 1 m}}]}}]",
        f"reactive_selector: [{{{CHANCE}, once: true}}, {{drive: 1 m}}]",
        "reactive_selector: [{sequence: [bumped, {say: '${random(0, 1)}'}]}, {drive: 1 m}]",
    ],
)
def test_condition_that_draws_once_gets_no_hint(tree: str) -> None:
    assert repeated_draw_hints(plan_of(f"{{{tree}}}").tree) == []
