"""``mission show -o FILE.xml``: equal nodes where BehaviorTree.CPP has them, custom nodes and a report elsewhere."""

from collections.abc import Callable
from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from missions.library.shipped import shipped_missions
from missions.plugins.interchange.exporter import export_mission
from missions.plugins.interchange.tree_writer import ExportedTree
from missions.plugins.interchange.xml_reader import Element, parse_xml, walk_elements
from tests.cases import each
from tests.missions.command import Outcome, command
from tests.missions.interchange.round_trips import export_and_import, plan_of, tree_of

Mission = Callable[..., Outcome]


def export(folder: Path, tree: str, *, params: str = "{n: 1, way: 1 m, word: a}", name: str = "m") -> ExportedTree:
    """Export a mission, and check that an import returns the same tree and params."""
    path = folder / f"{name}.yaml"
    path.write_text(f"mission: {name}\nparams: {params}\ntree: {tree}\n")
    plan = plan_of(path, LEAVES)
    exported, again = export_and_import(plan, folder / "again", LEAVES)
    found = plan_of(again, LEAVES)
    assert tree_of(found.tree) == tree_of(plan.tree)
    assert found.params == plan.params
    return exported


def body(exported: ExportedTree) -> Element:
    """Return the root node of the main tree."""
    return parse_xml(exported.text.encode(), "tree.xml").children[0].children[0]


def tags(element: Element) -> object:
    return (element.tag, *map(tags, element.children)) if element.children else element.tag


@each(
    ("tree", "expected"),
    [
        ("{sequence: [succeed, fail]}", ("Sequence", "AlwaysSuccess", "AlwaysFailure")),
        ("{reactive_selector: [fail, {wait: 1 s}]}", ("ReactiveFallback", "AlwaysFailure", "Sleep")),
        ("{race: [{wait: 1 s}, {wait: 2 s}]}", ("Parallel", "Sleep", "Sleep")),
        ("{wait: 1 s, for: 500 ms}", ("Parallel", "Sleep", "Sleep")),
        ("{wait: 1 s, while: n < 2}", ("ReactiveSequence", "ScriptCondition", "Sleep")),
        ("{wait: 1 s, until: n == 2}", ("ReactiveFallback", "ScriptCondition", "Sleep")),
        ("{wait: 3 s, timeout: 1 s, retry: 3}", ("RetryUntilSuccessful", ("Timeout", "Sleep"))),
        ("{wait: 1 s, delay: 1 s, repeat: forever}", ("Repeat", ("Delay", "Sleep"))),
        ("{fail: no, invert: true, on_success: fail}", ("ForceFailure", ("Inverter", "AlwaysFailure"))),
        ("{fail: no, on_failure: succeed, once: true}", ("RunOnce", ("ForceSuccess", "AlwaysFailure"))),
        ("{wait_until: n > 3}", ("RetryUntilSuccessful", "ScriptCondition")),
        ("{set: {n: 2, word: b}}", "Script"),
        ("{set: {n: null, m: 1}}", ("Sequence", "UnsetBlackboard", "Script")),
        ("{switch: {on: n > 1, cases: {true: succeed}}}", ("IfThenElse", "ScriptCondition", "AlwaysSuccess")),
        (
            "{reactive_switch: {on: n > 1, cases: {false: succeed}, default: fail}}",
            ("WhileDoElse", "ScriptCondition", "AlwaysFailure", "AlwaysSuccess"),
        ),
        (
            "{reactive_switch: {on: word, cases: {a: succeed, b: fail}}}",
            ("Switch2", "AlwaysSuccess", "AlwaysFailure", "AlwaysFailure"),
        ),
        ("{parallel: [succeed, fail], wait_for_all: true}", ("ParallelAll", "AlwaysSuccess", "AlwaysFailure")),
        (
            "{parallel: [succeed, {wait: 1 s}], success_count: all, wait_for_all: true}",
            ("ParallelAll", "AlwaysSuccess", "Sleep"),
        ),
    ],
)
def test_a_step_becomes_the_equal_nodes(tmp_path: Path, tree: str, expected: object) -> None:
    exported = export(tmp_path, tree)
    assert tags(body(exported)) == expected
    assert exported.lines() == []


@each(
    ("tree", "tag", "cause"),
    [
        ("{drive: 1 m, hold: 1 s}", "Hold", "'hold'"),
        ("{drive: 1 m, cooldown: 1 s}", "Cooldown", "'cooldown'"),
        ("{wait: 1 s, timeout: '${n * 1 s}'}", "MissionTimeout", "a calculated duration"),
        ("{wait: 1 s, if: battery.percent > 20}", "If", "'battery.percent'"),
        ("{check: way > 50 cm}", "Check", "the value of 'way'"),
        ("{set: {n: '${max(n, 2)}'}}", "Set", "the function 'max'"),
        ("{random_selector: [fail, succeed], weights: [1, 2]}", "RandomSelector", "'random_selector'"),
        ("{selector: [fail, succeed], in_turn: true}", "MissionSelector", "'in_turn'"),
        ("{for_each: {in: [1, 2], as: x, do: {log: '${x}'}}}", "MissionForEach", "'for_each'"),
        ("{fail: no, retry: 2, recover: succeed}", "RetryRecover", "'retry'"),
        ("{wait: 1 s, finally: {say: bye}, halt_limit: 2 s}", "Finally", "'finally'"),
        ("{wait: 1 s, if: n > 1, timeout: 1 s}", "MissionTimeout", "'timeout' around a skipped node"),
    ],
)
def test_a_step_without_an_equal_node_is_custom_and_reported_with_its_line(
    tmp_path: Path, tree: str, tag: str, cause: str
) -> None:
    exported = export(tmp_path, tree)
    assert tag in [element.tag for element in walk_elements(body(exported))]
    assert any(line.strip().startswith("m.yaml:3: ") and cause in line for line in exported.lines())


def test_the_root_that_is_skipped_succeeds_there_too(tmp_path: Path) -> None:
    assert tags(body(export(tmp_path, "{fail: no, if: n > 5}"))) == ("Sequence", "AlwaysSuccess", "AlwaysFailure")


def test_values_of_arguments_keep_their_types(tmp_path: Path) -> None:
    tree = """{sequence: [{say: "5"}, {say: "{x}"}, {say: "a: [b] # c"}, {drive: {distance: "${way}", speed: 0.2 m/s}},
      {find_face: {pan: [-1 rad, "${n * 10 deg}"], new: true}, as: who}, {say: ""}, {say: "yaml: x"}, {log: "null"}]}"""
    exported = export(tmp_path, tree)
    ports = [each.attributes for each in body(exported).children]
    assert ports[0] == {"text": "5"}
    assert ports[1] == {"text": 'yaml: "{x}"'}
    assert ports[3] == {"distance": "{way}", "speed": "0.2 m/s"}
    assert ports[4]["result"] == "{who}"
    assert any("is not calculated there" in line for line in exported.lines())


def test_params_of_a_submission_are_set_by_a_script(tmp_path: Path) -> None:
    inner = "mission: inner\nparams: {k: 1, t: a, f: true}\ntree: {set: {found: '${k + 1}'}}\nreturns: {found: found}\n"
    (tmp_path / "inner.yaml").write_text(inner)
    exported = export(tmp_path, "{mission: inner, with: {k: '${n * 2}', t: '${word}'}, name: first}")
    script, call = body(exported).children
    assert script.attributes["code"] == "inner_k := n * 2; inner_f := true"
    assert call.attributes["t"] == "{word}"
    assert call.attributes["found"] == "{found}"
    assert call.attributes["_defaults"] == "f"
    assert exported.lines() == []


def test_a_list_is_passed_to_a_submission_as_yaml(tmp_path: Path) -> None:
    inner = "mission: inner\nparams: {spots: [{x: 1 m}], words: [a]}\ntree: {listen: {for: '${words}'}}\n"
    (tmp_path / "inner.yaml").write_text(inner)
    exported = export(tmp_path, "{mission: inner, with: {spots: [{x: 2 m}, {x: 3 m}], words: ['a: b', 'no']}}")
    assert body(exported).attributes["spots"] == "yaml: [{x: 2 m}, {x: 3 m}]"
    assert body(exported).attributes["words"] == 'yaml: ["a: b", no]'
    assert '<input_port name="spots" type="std::string" default="yaml: [{x: 1 m}]"/>' in exported.text
    assert len(exported.lines()) == 1  # the leaf


@each(
    ("leaf", "code", "ports"),
    [
        ("say: 'Good day, ${word}'", "say_text := 'Good day, ' .. word", {"text": "{say_text}"}),
        (
            "find_face: {scans: '${k + 1}', new: true}",
            "find_face_scans := k + 1",
            {"scans": "{find_face_scans}", "new": "true"},
        ),
    ],
)
def test_a_script_calculates_the_arguments_of_a_leaf(
    tmp_path: Path, leaf: str, code: str, ports: dict[str, str]
) -> None:
    params = "{word: a, k: {type: count, default: 1}}"
    exported = export(tmp_path, f"{{{leaf}, retry: 2}}", params=params)
    sequence = body(exported).children[0]
    assert [each.attributes for each in sequence.children] == [{"code": code}, ports]
    assert not any("not calculated" in line for line in exported.lines())


@each("leaf", ["say: '${n} times'", "drive: '${way * 2}'", "move_joints: {to: {elbow: '${n * 1 deg}'}}"])
def test_an_argument_that_no_script_calculates_is_reported(tmp_path: Path, leaf: str) -> None:
    lines = export(tmp_path, f"{{{leaf}}}").lines()
    assert any(line.strip().startswith("m.yaml:3: ") and "is not calculated there (" in line for line in lines)


def test_retry_and_retry_with_recover_are_two_kinds_of_nodes(tmp_path: Path) -> None:
    tree = "{sequence: [{fail: no, retry: '${n + 1}'}, {fail: no, retry: 2, recover: succeed}]}"
    models = parse_xml(export(tmp_path, tree).text.encode(), "tree.xml").children[-1].children
    roles = {each.attributes["ID"]: each.tag for each in models}
    assert (roles["MissionRetry"], roles["RetryRecover"]) == ("Decorator", "Control")


def test_cases_and_names_are_read_back_with_their_types(tmp_path: Path) -> None:
    export(tmp_path, "{switch: {on: way, cases: {1 m: succeed, 200 cm: fail}}, name: 'a: ${b} <c>'}")
    export(tmp_path, "{switch: {on: word, cases: {'1 m': succeed, '5': fail}}}")


def test_a_switch_that_is_custom_has_its_cases_as_ports_and_the_reason(tmp_path: Path) -> None:
    exported = export(tmp_path, "{switch: {on: word, cases: {a: succeed, '5': {log: b}}}}")
    assert body(exported).attributes == {"on": "word", "case_1": "a", "case_2": 'yaml: "5"'}
    assert any("a 'reactive_switch' becomes Switch2" in line for line in exported.lines())
    assert '<Action ID="Log">' in exported.text


def test_comments_and_names_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    steps = "    # the first\n    - succeed\n    - fail: x\n      name: last\n"
    path.write_text(f"# a mission -- of two steps\nmission: m\ntree:\n  sequence:\n{steps}")
    exported = export_mission(plan_of(path, LEAVES))
    assert "<!-- a mission - - of two steps -->" in exported.text
    assert (
        "<!-- the first -->\n      <AlwaysSuccess/>\n      <AlwaysFailure name=\"[fail: 'x'] last\"/>" in exported.text
    )


@each("name", [name for name in shipped_missions() if not name.startswith("motions/")])
def test_a_shipped_mission_is_the_same_after_export_and_import(tmp_path: Path, name: str) -> None:
    plan = plan_of(Path(__file__).parents[3] / "missions" / f"{name}.yaml", LEAVES)
    _, path = export_and_import(plan, tmp_path, LEAVES)
    again = plan_of(path, LEAVES)
    assert tree_of(again.tree) == tree_of(plan.tree)
    assert (again.params, again.summary, again.if_interrupted) == (plan.params, plan.summary, plan.if_interrupted)
    assert [each.text for each in again.properties] == [each.text for each in plan.properties]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    return lambda *words: command(capsys, *words)


def test_mission_show_writes_xml_and_a_report(mission: Mission, tmp_path: Path) -> None:
    done = mission("show", "greet", "-o", "greet.xml")
    assert done.code == 0
    assert "wrote greet.xml" in done.err
    assert "'hold' has no counterpart there" in done.err
    assert parse_xml((tmp_path / "greet.xml").read_bytes(), "greet.xml").attributes["BTCPP_format"] == "4"
    assert mission("show", "greet", "--format", "xml").out == (tmp_path / "greet.xml").read_text()
    refused = mission("show", "greet", "--diff", "wave", "-o", "both.xml")
    assert refused.code == 2
    assert "XML holds one whole mission" in refused.err
