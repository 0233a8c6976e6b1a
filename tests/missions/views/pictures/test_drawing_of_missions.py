"""Drawings of missions: what the file says of each node, statuses on them, and parts folded away."""

from pathlib import Path

from behaviours.catalogue import LEAVES
from drivers.clock import ManualClock
from missions.language.nodes import BRANCHES, MISSION
from missions.library.shipped import load_mission, shipped_missions
from missions.trees.drawing import NodeState, TreeBox, TreeDrawing, outline
from missions.trees.drawing_builder import (
    ACTION_SYMBOL,
    CONDITION_SYMBOL,
    drawing_of,
    fold_missions,
    legend,
    one_line,
    with_states,
)
from missions.trees.text import mermaid
from tests.cases import each
from tests.missions.views.pictures.drawn import downwards, keys_and_lines, plan_of, ready


def box(drawing: TreeDrawing, kind: str) -> TreeBox:
    """Return the first box of a kind."""
    return next(box for box in drawing.root.walk() if box.kind == kind)


@each("name", shipped_missions())
def test_drawing_has_the_keys_and_lines_of_the_executed_nodes(name: str) -> None:
    plan = load_mission(name)
    root, _ = ready(plan, ManualClock())
    assert keys_and_lines(drawing_of(plan)) == {node.key: node.line for node in downwards(root)}


def test_arguments_keep_the_text_and_order_of_the_file() -> None:
    tree = "  drive: {speed: 20 cm/s, distance: 1.50 m}\n"
    assert list(box(drawing_of(plan_of(tree)), "drive").arguments.items()) == [
        ("speed", "20 cm/s"),
        ("distance", "1.50 m"),
    ]


@each(
    ("tree", "arguments"),
    [
        ("say: Hello", {"text": "Hello"}),
        ('say: "007"', {"text": "007"}),
        ("find_face: {pan: [-60 deg, 60 deg]}", {"pan": "[-60 deg, 60 deg]"}),
        ("move_joints: {to: {elbow: 20 deg, gripper: 0 deg}}", {"to": "{elbow: 20 deg, gripper: 0 deg}"}),
        ('set: {a: [1, "x y", {b: true}], c: ~}', {"a": "[1, x y, {b: true}]", "c": "~"}),
        ("track_face:", {}),
        ("track_face", {}),
    ],
)
def test_each_form_of_an_argument_is_written_back(tree: str, arguments: dict[str, str]) -> None:
    root = drawing_of(plan_of(f"  {tree}\n")).root
    assert root.arguments == arguments


def test_written_form_is_ignored_when_plans_are_compared() -> None:
    one, other = (plan_of(f"  wait: {time}\n").tree for time in ("2 s", "2.0 s"))
    assert one.arguments_as_written != other.arguments_as_written
    assert (one.arguments["duration"].constant, other.arguments["duration"].constant) == (2.0, 2.0)


def test_modifiers_are_badges_outermost_first_with_their_own_keys_and_lines() -> None:
    root = drawing_of(plan_of("  drive: 2 m\n  timeout: 5 s\n  retry: 3\n")).root
    assert [(badge.key, badge.kind, badge.text, badge.line) for badge in root.badges] == [
        ("1", "retry", "3", 5),
        ("1.1", "timeout", "5 s", 4),
    ]
    assert (root.key, root.kind, root.line) == ("1.1.1", "drive", 3)


def test_switch_children_show_their_case_as_in_yaml() -> None:
    cases = "cases: {yes: {wait: 1 s}, 2: {wait: 1 s}, 30 deg: {wait: 1 s}}"
    head = "params: {answer: {default: x, type: text}}\n"
    root = drawing_of(plan_of(f"  switch: {{on: answer, {cases}, default: {{drive: 2 m, retry: 2}}}}\n", head)).root
    assert root.arguments == {"on": "answer"}
    assert [child.case for child in root.children] == ["yes", "2", "30 deg", "default"]
    root = drawing_of(plan_of("  switch: {on: answer == 'x', cases: {true: {wait: 1 s}}}\n", head)).root
    assert [child.case for child in root.children] == ["true"]


def test_recovery_and_cleanup_are_drawn_as_children_with_their_words() -> None:
    beside = "  retry: 3\n  recover: {say: Again}\n  finally: {show: ''}\n  halt_limit: 2 s\n"
    plan = plan_of(f"  sequence: [stop, {{drive: 2 m}}]\n{beside}")
    root = drawing_of(plan).root
    assert [(child.key, child.kind, child.case) for child in root.children] == [
        ("1.1.1.1", "stop", ""),
        ("1.1.1.2", "drive", ""),
        ("1.1.2", "say", "recover"),
        ("1.2", "show", "finally"),
    ]
    assert [(badge.kind, badge.text) for badge in root.badges] == [("finally", "at most 2 s"), ("retry", "3")]
    tree, _ = ready(plan, ManualClock())
    assert keys_and_lines(drawing_of(plan)) == {node.key: node.line for node in downwards(tree)}
    assert "finally: ■ show" in outline(drawing_of(plan))
    assert '|"recover"| n1_1_2' in mermaid(drawing_of(plan))


def test_submission_shows_its_mission_arguments_and_file() -> None:
    plan = plan_of("  mission: greet_everybody\n  with: {limit: 2, side: 30 deg}\n  name: meet them\n")
    root = drawing_of(plan).root
    assert (root.mission, root.name, root.file) == ("greet_everybody", "meet them", "m.yaml")
    assert root.title == "mission: meet them"
    assert root.arguments == {"limit": "2", "side": "30 deg"}
    assert {each.file for child in root.children for each in child.walk()} == {"greet_everybody.yaml"}


def test_shipped_files_are_named_by_their_path_in_the_package() -> None:
    assert drawing_of(load_mission("motions/square")).file == "motions/square.yaml"


def test_users_file_is_named_as_given(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("mission: own\ntree: {wait: 1 s}\n")
    assert drawing_of(load_mission(str(path))).file == str(path)


def test_texts_become_one_printable_line() -> None:
    root = drawing_of(plan_of('  say: "a\\n b\\tc\\x1b[31m\\u202e \\u00fc"\n  name: "x\\ny"\n')).root
    assert root.arguments == {"text": "a b c\ufffd[31m\ufffd ü"}
    assert root.name == "x y"
    assert one_line("a\u200db \ud800") == "a\u200db \ufffd"


def test_every_node_kind_has_its_own_symbol_in_the_legend() -> None:
    signs = [sign for sign, _, _ in legend()]
    assert len(set(signs)) == len(signs) == len(BRANCHES) + 3  # a selector in turn, condition and action
    assert all(word and meaning for _, word, meaning in legend())


def test_leaf_that_only_reads_is_a_condition() -> None:
    root = drawing_of(
        plan_of("  sequence:\n    - bumped\n    - wait: 1 s\n    - set: {a: 1}\n    - turn: 3 deg\n")
    ).root
    assert [child.symbol for child in root.children] == [CONDITION_SYMBOL, ACTION_SYMBOL, ACTION_SYMBOL, ACTION_SYMBOL]
    assert {word for word, leaf in LEAVES.items() if leaf.instant} > {"bumped", "set"}


def test_statuses_fall_on_boxes_and_badges_by_key_and_the_rest_is_idle() -> None:
    drawing = drawing_of(plan_of("  sequence:\n    - wait: 5 s\n      timeout: 1 s\n    - wait: 1 s\n"))
    failed = with_states(
        drawing, {"1": NodeState("running", "a\nb", 0.5), "1.1": NodeState("failure", "timed out", 1.5)}, 2.0
    )
    first, second = failed.root.children
    assert (failed.time, failed.root.status, failed.root.reason, failed.root.since) == (2.0, "running", "a b", 0.5)
    assert (first.status, first.badges[0].status, first.badges[0].reason) == ("idle", "failure", "timed out")
    assert (first.outer_status, second.outer_status, second.since) == ("failure", "idle", None)
    assert with_states(failed, {}, 0.0) == with_states(drawing, {}, 0.0)


def test_submission_folds_into_one_box_with_a_count() -> None:
    drawing = drawing_of(load_mission("patrol"))
    closed = box(fold_missions(drawing, 0), MISSION)
    below = [each for child in box(drawing, MISSION).children for each in child.walk()]
    assert (closed.children, closed.folded) == ((), len(below) + sum(len(each.badges) for each in below))
    assert fold_missions(drawing, 1) == drawing


def test_only_submissions_nested_too_deeply_fold(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text("mission: inner\ntree: {wait: 1 s}\n")
    (tmp_path / "middle.yaml").write_text("mission: middle\ntree: {mission: inner.yaml}\n")
    (tmp_path / "outer.yaml").write_text("mission: outer\ntree: {sequence: [{mission: middle.yaml}, {wait: 1 s}]}\n")
    drawing = drawing_of(load_mission(str(tmp_path / "outer.yaml")))

    def hidden(depth: int) -> list[tuple[str, int]]:
        return [(box.mission, box.folded) for box in fold_missions(drawing, depth).root.walk() if box.mission]

    assert hidden(0) == [("middle", 2)]
    assert hidden(1) == [("middle", 0), ("inner", 1)]
    assert hidden(2) == [("middle", 0), ("inner", 0)]
    assert fold_missions(fold_missions(drawing, 1), 0) == fold_missions(drawing, 0), "what is hidden is counted once"
