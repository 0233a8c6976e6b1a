"""Dead nodes of a tree are left out, since the checker refuses them, and reported."""

from pathlib import Path

from missions.plugins.interchange.report import LOST
from tests.missions.interchange.trees import import_text, remarks, tree_lines, tree_text


def test_children_behind_an_end_are_left_out(tmp_path: Path) -> None:
    dead = "<Sequence><ForceFailure><Grasp/></ForceFailure>\n<Lift/></Sequence>"
    imported = import_text(tmp_path, tree_text(dead))
    assert tree_lines(imported) == ["sequence:", "  - grasp:", "    on_success: fail"]
    assert remarks(imported, LOST) == ["patrol.xml:2: Lift: is never reached"]


def test_modifiers_without_effect_are_left_out(tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text('<ForceSuccess><Sleep msec="50"/></ForceSuccess>'))
    assert tree_lines(imported) == ["wait: 50 ms"]
    assert remarks(imported, LOST) == ["patrol.xml:1: ForceSuccess: 'on_failure' has no effect here"]


def test_the_ends_of_a_subtree_count(tmp_path: Path) -> None:
    more = '<BehaviorTree ID="Rest"><Sleep msec="50"/></BehaviorTree>'
    body = '<Fallback><SubTree ID="Rest"/><Grasp/></Fallback>'
    assert tree_lines(import_text(tmp_path, tree_text(body, more=more))) == ["selector:", "  - mission: rest"]


def test_a_timeout_of_a_condition_is_left_out(tmp_path: Path) -> None:
    body = '<Timeout msec="100"><Condition ID="Holding"/></Timeout>'
    assert tree_lines(import_text(tmp_path, tree_text(body))) == ["holding"]


def test_each_child_of_a_round_robin_is_reached(tmp_path: Path) -> None:
    body = '<RoundRobin><Wait wait_duration="5"/><Spin spin_dist="1"/></RoundRobin>'
    imported = import_text(tmp_path, tree_text(body))
    assert tree_lines(imported) == ["selector:", "  - wait: 5 s", "  - turn: 1 rad", "in_turn: true"]
    assert not remarks(imported, LOST)


def test_success_count_that_too_few_children_reach_is_left_out(tmp_path: Path) -> None:
    dead = "<ForceFailure><Grasp/></ForceFailure>"
    imported = import_text(tmp_path, tree_text(f'<Parallel success_count="2">{dead}{dead}<Grasp/></Parallel>'))
    assert not any("success_count" in line for line in tree_lines(imported))
    assert len(remarks(imported, LOST)) == 1
