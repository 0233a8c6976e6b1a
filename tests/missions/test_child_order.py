"""Selectors with another order of their children: in turn, and by weights."""

from collections import Counter
from collections.abc import Iterator

import pytest

from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import InvalidFileError
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.plugins.verify.explore import PROVED, REFUTED
from missions.trees.drawing_builder import symbol_of
from tests.missions.testing.verify.exploring import explored, outcome, plan_of

DRAWS = 4_000


def draws(tree: str, *, seed: int = 0, count: int = DRAWS) -> Iterator[object]:
    """Yield the value of the variable ``x`` after each run of a tree that ends within a tick."""
    run = RunState(ManualClock(), seed=seed)
    root = build(plan_of(tree), run, lambda _: Robot())
    for _ in range(count):
        run.variables["x"] = None
        run.tick += 1
        root.execute_tick()
        yield run.variables["x"]


def test_children_are_drawn_in_proportion_to_their_weights() -> None:
    tree = "random_selector: [{set: {x: 1}}, {set: {x: 2}}, {set: {x: 3}}]\nweights: [6, 3, 1]"
    found = Counter(draws(tree))
    assert [found[x] / DRAWS for x in (1, 2, 3)] == pytest.approx([0.6, 0.3, 0.1], abs=0.03)


def test_weight_of_a_skipped_child_does_not_count() -> None:
    tree = "random_selector: [{set: {x: 1}}, {set: {x: 2}, if: false}, {set: {x: 3}}]\nweights: [2, 7, 1]"
    found = Counter(draws(tree))
    assert [found[x] / DRAWS for x in (1, 2, 3)] == pytest.approx([2 / 3, 0, 1 / 3], abs=0.03)


def test_weights_give_the_chances_of_what_is_left_after_a_failure() -> None:
    failing = "{sequence: [{set: {x: 2}}, fail]}"
    tree = f"random_selector: [{{set: {{x: 1}}}}, {failing}, {{set: {{x: 3}}}}]\nweights: [2, 1000000, 1]"
    found = Counter(draws(tree))
    assert [found[x] / DRAWS for x in (1, 2, 3)] == pytest.approx([2 / 3, 0, 1 / 3], abs=0.03)


def test_draws_by_weight_depend_on_the_seed_alone() -> None:
    tree = "random_selector: [{set: {x: 1}}, {set: {x: 2}}]\nweights: [1, 1]"
    assert list(draws(tree, seed=5, count=50)) == list(draws(tree, seed=5, count=50))
    assert list(draws(tree, seed=5, count=50)) != list(draws(tree, seed=6, count=50))


def test_each_child_has_its_turn() -> None:
    tree = "selector: [{set: {x: 1}}, {set: {x: 2}}, {set: {x: 3}}]\nin_turn: true"
    assert list(draws(tree, count=7)) == [1, 2, 3, 1, 2, 3, 1]


def test_verify_knows_whose_turn_it_is() -> None:
    tree = "selector: [{succeed: , name: A}, succeed, {succeed: , name: C}]\nin_turn: true\nrepeat: {}"
    assert outcome(tree.replace("{}", "2"), "never: C before A") == PROVED
    assert outcome(tree.replace("{}", "3"), "never: A after C") == PROVED
    assert outcome(tree.replace("{}", "4"), "never: A after C") == REFUTED


def test_verify_draws_no_child_without_a_chance() -> None:
    tree = "random_selector: [{say: a}, {drive: 1 m}]\nweights: [0, 1]"
    assert outcome(tree, "never: say before drive") == PROVED
    assert explored(tree).outcome == PROVED  # to be left out is the meaning of the weight 0


def test_verify_takes_unknown_weights_for_any() -> None:
    tree = (
        "sequence:\n"
        "  - set: {who: null}\n"
        "  - {find_face: {scans: 1}, as: who, on_failure: succeed}\n"
        "  - set: {chances: '${[1, 1 if who != null else 0]}'}\n"
        "  - {random_selector: [{say: a}, {drive: 1 m}], weights: '${chances}'}\n"
    )
    assert outcome(tree, "never: drive before say") == REFUTED
    assert outcome(tree, "never: say before drive") == REFUTED
    assert outcome(tree, "can: succeed") == PROVED


def test_hint_for_a_weight_from_a_param_is_followed_to_the_letter() -> None:
    tree = "random_selector: [{{say: a}}, {{say: b}}]\nweights: {}"
    with pytest.raises(InvalidFileError) as refused:
        plan_of(tree.format("['${a}', 2]"), params="{a: 3}")
    hint = '"${[a, 2]}"'
    assert f"write weights: {hint}" in str(refused.value)
    plan_of(tree.format(hint), params="{a: 3}")


def test_variable_of_one_alternative_may_be_unset_after_a_selector_in_turn() -> None:
    tree = "sequence: [{{selector: [{{sequence: [{{set: {{x: 1}}}}, fail]}}, succeed]{}}}, {{log: '${{x}}'}}]"
    plan_of(tree.format(""))
    with pytest.raises(InvalidFileError, match="'x' is read here, but it is not set"):
        plan_of(tree.format(", in_turn: true"))


def test_alternative_behind_one_that_never_fails_is_reached_in_turn() -> None:
    tree = "selector: [{wait: 1 s}, {log: b}]"
    with pytest.raises(InvalidFileError, match="'log' is never reached"):
        plan_of(tree)
    assert explored(f"{tree}\nin_turn: true\nrepeat: 2").outcome == PROVED


def test_selector_in_turn_has_a_symbol_of_its_own() -> None:
    plain, in_turn = plan_of("selector: [face_seen, stop]"), plan_of("selector: [face_seen, stop]\nin_turn: true")
    assert symbol_of(plain.tree) == "?"
    assert symbol_of(in_turn.tree) == "?⇢"
    assert in_turn.tree.arguments_as_written == {"in_turn": "true"}
