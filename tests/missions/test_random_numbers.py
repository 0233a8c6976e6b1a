"""``random`` in expressions: from the seed of the run, within its bounds, and the same again from a record."""

from collections.abc import Mapping
from pathlib import Path
from random import Random

import pytest

from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import InvalidFileError
from config.library import DEFAULT_ROBOT, find_file
from config.units import Quantity
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.executive.events import VariableSet
from missions.language.expressions import ExpressionError, parse
from missions.library.drivers import load_robot
from missions.library.shipped import load_mission
from missions.plugins.records.replay.rerun import rerun
from missions.plugins.verify.explore import PROVED, REFUTED
from missions.plugins.verify.random_bounds import truth_values
from missions.request import RunRequest
from tests.missions.records.replay.past import past_of
from tests.missions.testing.verify.exploring import explored, outcome, plan_of

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


def test_verify_takes_a_stored_draw_for_unknown() -> None:
    tree = "sequence: [{set: {n: '${random(0, 1)}'}}, {say: a, if: n < 0.5}, {drive: 1 m, if: n > 0.5}]"
    assert outcome(tree, "can: succeed") == PROVED
    assert outcome(tree, "never: drive after say") == REFUTED
