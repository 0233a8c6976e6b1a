"""Nodes of BehaviorTree.CPP, Nav2 and MoveIt Pro become nodes of missions."""

from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from missions.language.document import load_plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission
from missions.library.vocabulary import load_leaves
from missions.plugins.interchange.importer import ImportedProject, import_trees
from missions.plugins.interchange.report import DIFFERS, LOST, STUB
from tests.missions.interchange.trees import import_text, remarks, tree_lines, tree_text


@pytest.mark.parametrize(
    ("node", "lines"),
    [
        ("<Sequence><AlwaysSuccess/></Sequence>", ["sequence:", "  - succeed"]),
        ("<ReactiveFallback><AlwaysFailure/></ReactiveFallback>", ["reactive_selector:", "  - fail"]),
        ('<Control ID="Fallback"><AlwaysFailure/></Control>', ["selector:", "  - fail"]),
        ('<Sleep msec="1500"/>', ["wait: 1.5 s"]),
        ('<Delay delay_msec="150"><AlwaysSuccess/></Delay>', ["succeed:", "delay: 150 ms"]),
        ('<Timeout msec="0"><AlwaysSuccess/></Timeout>', ["succeed"]),
        ('<Inverter><Sleep msec="50" name="nap"/></Inverter>', ["wait: 50 ms", "name: nap", "invert: true"]),
        (
            '<RetryUntilSuccessful num_attempts="3" name="thrice"><AlwaysFailure/></RetryUntilSuccessful>',
            ["fail:", "retry: 3  # thrice"],
        ),
        ('<Repeat num_cycles="-1"><AlwaysSuccess/></Repeat>', ["succeed:", "repeat: forever"]),
        ("<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>", ["succeed:", "repeat: forever"]),
        ("<ForceFailure><AlwaysSuccess/></ForceFailure>", ["succeed:", "on_success: fail"]),
        ('<RunOnce then_skip="false"><AlwaysSuccess/></RunOnce>', ["succeed:", "once: true"]),
        ('<Script code="n := 1; m := 2"/>', ["set: {n: 1, m: 2}"]),
        ('<SetBlackboard output_key="{n}" value="3"/>', ["set: {n: 3}"]),
        (
            "<Inverter><Inverter><AlwaysSuccess/></Inverter></Inverter>",
            ["sequence:", "  - succeed:", "    invert: true", "invert: true"],
        ),
    ],
)
def test_nodes_become_words_of_missions(node: str, lines: list[str], tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text(node))
    assert tree_lines(imported) == lines
    assert not remarks(imported)


def test_parallel_counts_are_imported_only_if_they_matter(tmp_path: Path) -> None:
    def keys(ports: str) -> list[str]:
        node = f"<Parallel {ports}><AlwaysSuccess/><AlwaysSuccess/><AlwaysFailure/></Parallel>"
        return tree_lines(import_text(tmp_path, tree_text(node)))[4:]

    assert keys("") == []
    assert keys('success_count="3" failure_count="1"') == []
    assert keys('success_count="2"') == ["success_count: 2"]
    assert keys('success_count="-2" failure_count="2"') == ["success_count: 2", "failure_count: 2"]
    assert keys('success_count="2" failure_count="3"') == ["success_count: 2", "failure_count: all"]
    assert keys('failure_count="3"') == []  # the first failure makes success impossible


def test_parallel_all_waits_for_all(tmp_path: Path) -> None:
    node = '<ParallelAll max_failures="2"><AlwaysSuccess/><AlwaysSuccess/><AlwaysFailure/></ParallelAll>'
    assert tree_lines(import_text(tmp_path, tree_text(node)))[4:] == [
        "wait_for_all: true",
        "success_count: 2",
        "failure_count: 2",
    ]


def test_a_condition_becomes_the_expression_of_a_switch(tmp_path: Path) -> None:
    node = '<IfThenElse><ScriptCondition code="n &gt; 3"/><AlwaysSuccess/><AlwaysFailure/></IfThenElse>'
    lines = tree_lines(import_text(tmp_path, tree_text(f'<Sequence><Script code="n := 1"/>{node}</Sequence>')))
    assert lines[2:] == [
        "  - switch:",
        "      on: n > 3",
        "      cases:",
        "        true: succeed",
        "        false: fail",
    ]


def test_a_leaf_as_the_condition_of_a_choice_sets_a_variable(tmp_path: Path) -> None:
    node = "<WhileDoElse><DoorOpen/><AlwaysSuccess/><AlwaysFailure/></WhileDoElse>"
    assert tree_lines(import_text(tmp_path, tree_text(node))) == [
        "reactive_sequence:",
        "  - selector:",
        "      - sequence:",
        "          - door_open",
        "          - set: {while_do_else_holds: true}",
        "      - set: {while_do_else_holds: false}",
        "  - reactive_switch:",
        "      on: while_do_else_holds",
        "      cases:",
        "        true: succeed",
        "        false: fail",
    ]


def test_conditions_on_a_node_become_checks_and_modifiers(tmp_path: Path) -> None:
    def lines(attributes: str, parent: str = "Sequence") -> list[str]:
        body = f'<{parent}><Script code="n := 1"/><Grasp {attributes}/></{parent}>'
        return tree_lines(import_text(tmp_path, tree_text(body)))[2:]

    assert lines('_skipIf="n == 1"') == ["  - grasp:", "    if: n != 1"]
    assert lines('_skipIf="false"') == ["  - grasp"]
    assert lines('_while="n == 1"') == ["  - grasp:", "    until: n != 1", "    if: n == 1"]
    assert [line.strip() for line in lines('_while="n == 1"', "Fallback")[-3:]] == [
        "- grasp:",
        "while: n == 1",
        "if: n == 1",
    ]
    assert lines('_successIf="n == 1"') == ["  - selector:", "      - check: n == 1", "      - grasp"]
    assert lines('_failureIf="n == 1"') == ["  - sequence:", "      - check: n != 1", "      - grasp"]


def test_post_condition_scripts_run_after_end_or_halt(tmp_path: Path) -> None:
    def lines(attributes: str) -> list[str]:
        body = f'<Sequence><Script code="n := 1"/><Grasp {attributes}/></Sequence>'
        return tree_lines(import_text(tmp_path, tree_text(body)))[2:]

    assert lines('_onSuccess="n = 2"') == ["  - sequence:", "      - grasp", "      - set: {n: 2}"]
    assert lines('_onFailure="n = 2"') == [
        "  - selector:",
        "      - grasp",
        "      - sequence:",
        "          - set: {n: 2}",
        '          - fail: "${failure}"',
    ]
    assert lines('_onHalted="n = 2"') == [
        "  - sequence:",
        "      - set: {grasp_runs: true}",
        "      - selector:",
        "          - grasp",
        "          - sequence:",
        "              - set: {grasp_runs: false}",
        '              - fail: "${failure}"',
        "      - set: {grasp_runs: false}",
        "    finally:",
        "      set: {n: 2}",
        "      if: grasp_runs",
    ]


def test_pipeline_repeats_its_first_child_while_the_next_runs(tmp_path: Path) -> None:
    node = """<PipelineSequence name="navigate">
      <RateController hz="2.0"><ComputePathToPose goal="{goal}" path="{path}"/></RateController>
      <FollowPath path="{path}"/></PipelineSequence>"""
    imported = import_text(tmp_path, tree_text(node, format=""))
    assert tree_lines(imported) == [
        "sequence:",
        "  - set: {path: null, rate_controller_ready: false}",
        "  - race:",
        "      - sequence:",
        '          - compute_path_to_pose: {goal: "${goal}"}',
        "            as: path",
        "          - set: {rate_controller_ready: true}",
        "          - wait: 500 ms",
        "        repeat: forever",
        "      - sequence:",
        "          - wait_until: rate_controller_ready",
        '          - follow_path: {path: "${path}"}',
        "    name: navigate",
    ]


def test_a_recovery_becomes_retry_with_recover(tmp_path: Path) -> None:
    node = '<RecoveryNode number_of_retries="2" name="careful"><Plan/><Clear/></RecoveryNode>'
    imported = import_text(tmp_path, tree_text(node))
    assert tree_lines(imported) == ["plan:", "name: careful", "retry: 3", "recover: clear"]
    assert any("recovery" in each for each in remarks(imported, DIFFERS))


def test_unknown_parents_become_stubs_before_their_children(tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text('<Magic power="3"><AlwaysSuccess/><AlwaysFailure/></Magic>'))
    assert tree_lines(imported) == ["sequence:", "  - magic: {power: 3}", "  - succeed", "  - fail"]
    assert any("patrol.xml:1: Magic: no counterpart" in each for each in remarks(imported, LOST))


def test_subtrees_become_missions_with_params_and_results(tmp_path: Path) -> None:
    more = """<BehaviorTree ID="DriveTo"><Sequence>
      <Drive to="{place}"/><Script code="trips += 1; last := place"/></Sequence></BehaviorTree>"""
    node = """<Sequence><Script code="trips := 0"/>
      <SubTree ID="DriveTo" place="hall" trips="{trips}" last="{seen}"/>
      <ScriptCondition code="seen == 'hall'"/></Sequence>"""
    imported = import_text(tmp_path, tree_text(node, more=more))
    assert tree_lines(imported)[2:5] == [
        "  - mission: drive_to",
        '    with: {place: hall, trips: "${trips}"}',
        "    returns: {trips: trips, seen: last}",
    ]
    assert "params:\n  place: {type: value}\n  trips: {type: value}\n" in imported.files["drive_to.yaml"]


def test_subtrees_of_version_3_name_entries_without_braces(tmp_path: Path) -> None:
    more = '<BehaviorTree ID="DriveTo"><Drive to="{place}"/></BehaviorTree>'
    node = '<Sequence><SetBlackboard output_key="where" value="hall"/><SubTree ID="DriveTo" place="where"/></Sequence>'
    lines = tree_lines(import_text(tmp_path, tree_text(node, format=' BTCPP_format="3"', more=more)))
    assert lines[2:] == ["  - mission: drive_to", '    with: {place: "${where}"}']


def test_subtree_in_another_file_becomes_a_stub_or_a_mission(tmp_path: Path) -> None:
    text = tree_text('<SubTree ID="Charge"/>')
    alone = import_text(tmp_path, text)
    assert tree_lines(alone) == ["charge"]
    assert any("import its folder" in each for each in remarks(alone, LOST))
    (tmp_path / "charge.xml").write_text(text.replace("Patrol", "Charge").replace('<SubTree ID="Charge"/>', "<Dock/>"))
    both = import_text(tmp_path, text)
    assert tree_lines(both) == ["charge"]  # one file alone
    assert tree_lines(import_trees(tmp_path, LEAVES)) == ["mission: charge"]


def test_reserved_names_are_changed_and_reported(tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text('<Script code="battery := 1"/>'))
    assert tree_lines(imported) == ["set: {battery_: 1}"]
    assert remarks(imported) == ["patrol.xml:1: Patrol: the entry 'battery' is the variable 'battery_'"]


def test_comments_and_names_are_kept(tmp_path: Path) -> None:
    text = tree_text('<Sequence name="round"><!-- a nap --><Sleep msec="50" name="nap"/><!-- end --></Sequence>')
    lines = tree_lines(import_text(tmp_path, f"<!-- all -->\n{text}"))
    assert lines == ["# end", "sequence:", "  # a nap", "  - wait: 50 ms", "    name: nap", "name: round"]


def test_stubs_have_the_ports_as_arguments(tmp_path: Path) -> None:
    more = """<TreeNodesModel><Action ID="Grasp"><input_port name="force" type="double" default="2">newton</input_port>
      <output_port name="held" type="bool">whether it holds</output_port></Action></TreeNodesModel>"""
    imported = import_text(tmp_path, tree_text('<Grasp force="5" held="{held}" odd-port="x"/>', more=more))
    assert tree_lines(imported) == ['grasp: {force: 5, "odd-port": x}', "as: held"]
    text = imported.files["behaviours/patrol.py"]
    assert 'force: float = argument("number", "newton", default=2)' in text
    assert "output_type = bool" in text
    assert 'odd_port: str = argument("text", "port odd-port", name="odd-port")' in text
    assert len(remarks(imported, STUB)) == 1


def test_an_undeclared_port_that_later_nodes_read_is_an_output(tmp_path: Path) -> None:
    node = """<Sequence><ChooseMode speed="{speed}" mode="{mode}"/>
      <Switch2 variable="{mode}" case_1="a" case_2="b"><Go/><Stay/><Stay/></Switch2></Sequence>"""
    imported = import_text(tmp_path, tree_text(node))
    assert tree_lines(imported)[1:3] == ['  - choose_mode: {speed: "${speed}"}', "    as: mode"]
    assert "the stub leaf 'choose_mode', whose output seems to be 'mode'" in remarks(imported, STUB)[0]


def test_an_undeclared_port_of_an_entry_that_is_given_is_an_input(tmp_path: Path) -> None:
    def first_line(before: str, port: str = "mode") -> str:
        node = f'<Sequence>{before}<Choose {port}="{{mode}}"/><Say words="{{mode}}"/></Sequence>'
        lines = tree_lines(import_text(tmp_path, tree_text(node)))
        return next(line for line in lines if "choose" in line)

    assert first_line("") == "  - choose:"
    assert first_line("", "goal") == '  - choose: {goal: "${mode}"}'
    get = '<Sequence><GetGoalPose goal_pose="{pose}"/><Say words="{pose}"/></Sequence>'
    assert tree_lines(import_text(tmp_path, tree_text(get)))[1:3] == ["  - get_goal_pose:", "    as: pose"]
    assert first_line("<Script code=\"mode := 'a'\"/>") == '  - choose: {mode: "${mode}"}'


def test_null_for_an_entry_that_no_node_sets_is_reported(tmp_path: Path) -> None:
    other = '<BehaviorTree ID="Go"><Drive pose="{pose}"/></BehaviorTree>'
    imported = import_text(tmp_path, tree_text('<SubTree ID="Go"/>', more=other))
    assert "with: {pose: null}" in imported.files["patrol.yaml"]
    assert remarks(imported, DIFFERS) == [
        "patrol.xml:1: SubTree: 'Go' reads 'pose', which no node sets here: it gets null"
    ]


def test_subtree_in_another_file_hands_its_declared_output_back(tmp_path: Path) -> None:
    model = '<SubTree ID="Find"><input_port name="goal"/><output_port name="found"/></SubTree>'
    body = '<Sequence><SubTree ID="Find" goal="x" found="{it}"/><Say text="{it}"/></Sequence>'
    imported = import_text(tmp_path, tree_text(body, more=f"<TreeNodesModel>{model}</TreeNodesModel>"))
    assert tree_lines(imported)[1:3] == ["  - find: {goal: x}", "    as: it"]
    check_import(imported, tmp_path / "out")


@pytest.mark.parametrize("node", ['<Action ID="Retry" name="again"/>', '<Retry name="again"/>'])
def test_leaf_with_the_name_of_a_decorator_becomes_a_stub(node: str, tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text(f"<Fallback><AlwaysFailure/>{node}</Fallback>"))
    assert tree_lines(imported)[2:] == ["  - retry_action:", "    name: again"]
    check_import(imported, tmp_path / "out")


@pytest.mark.parametrize(
    "text",
    [
        "<Sequence><Go/></Sequence>",
        '<BehaviorTree ID="Main"><Sequence><Go/></Sequence></BehaviorTree>',
        '<root><BehaviorTree ID="Main"><Root><Sequence><Go/></Sequence></Root></BehaviorTree></root>',
    ],
)
def test_fragments_and_trees_of_old_editors_are_imported(text: str, tmp_path: Path) -> None:
    imported = import_text(tmp_path, f"<!-- as shown -->{text}")
    assert tree_lines(imported)[-2:] == ["sequence:", "  - go"]
    assert "# as shown" in imported.files["patrol.yaml"]


def test_names_in_other_scripts_are_kept(tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text('<Sequence><순찰/><Überprüfe/><Action ID="巡逻"/></Sequence>'))
    assert tree_lines(imported)[1:] == ['  - "순찰"', '  - "überprüfe"', '  - "巡逻"']
    check_import(imported, tmp_path / "out")


def check_import(imported: ImportedProject, folder: Path) -> None:
    """Write an import, and check its missions. Raises InvalidFileError."""
    for name, text in imported.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    leaves = load_leaves(sorted((folder / "behaviours").glob("*.py")))
    for mission in folder.glob("*.yaml"):
        load_plan(mission, leaves, LOOKUPS, find_mission=find_mission)


@pytest.mark.parametrize(
    ("node", "driven"),
    [
        ('<BackUp backup_dist="-0.5" backup_speed="-0.1"/>', "drive: {distance: -0.5 m, speed: 0.1 m/s}"),
        ('<BackUp backup_dist="0.3" backup_speed="0.1"/>', "drive: {distance: -0.3 m, speed: 0.1 m/s}"),
        ('<BackUp backup_dist="{far}"/>', 'drive: "${-abs(far) * 1 m}"'),
        ('<DriveOnHeading dist_to_travel="-0.5" speed="-0.1"/>', "drive: {distance: -0.5 m, speed: 0.1 m/s}"),
        ('<DriveOnHeading dist_to_travel="0.5" speed="{v}"/>', 'drive: {distance: 0.5 m, speed: "${abs(v) * 1 m/s}"}'),
    ],
)
def test_robot_backs_up_whatever_the_sign_of_the_distance(node: str, driven: str, tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text(node))
    assert tree_lines(imported) == [driven]
    check_import(imported, tmp_path / "out")


def test_words_of_stubs_part_acronyms_from_words(tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text("<Sequence><CheckAPlan/><ISGameStart/><MoveToXY/></Sequence>"))
    assert tree_lines(imported)[1:] == ["  - check_a_plan", "  - is_game_start", "  - move_to_xy"]
