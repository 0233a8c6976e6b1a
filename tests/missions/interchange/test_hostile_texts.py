"""Texts of an XML file never become paths, YAML or Python code, and texts of a mission never become XML markup."""

from pathlib import Path
from runpy import run_path
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import pytest
from py_trees.behaviours import Success
from py_trees.composites import Sequence

from behaviours.catalogue import LEAVES
from config.diagnostics import SourceText
from config.yaml_nodes import Mapping, compose
from missions.language.document import check_plan
from missions.library.vocabulary import load_leaves
from missions.plugins.interchange.exporter import export_mission
from missions.plugins.interchange.importer import import_trees
from missions.plugins.interchange.python_trees import tree_element
from missions.plugins.interchange.report import ImportReport
from missions.plugins.interchange.xml_reader import walk_elements
from tests.missions.interchange.round_trips import write_import
from tests.missions.interchange.trees import import_text, tree_lines, tree_text

HOSTILE = (
    *(
        "x\nextra: 1",
        "- extra: 1",
        "a # b",
        "a: b",
        "${extra}",
        '"""\nimport extra\n"""',
        "\\",
        "\\'",
        '\\"',
        "&a",
        "*a",
    ),
    *(
        "!!str x",
        "{extra: 1}",
        "[extra]",
        "x²",
        "ﬁ",
        "٣",
        chr(0x1D4B3) * 90,
        "名" * 300,
        "../../x",
        "/etc/x",
        "\x85extra: 1",
    ),
    *("\u2028extra: 1", "5\nm", "yaml: 5\nextra: 1", "x\textra: 1", "true", "007", "9" * 5000, "class", "'", "`", "🤖"),
)


def attribute(name: str, text: str) -> str:
    return f" {name}={quoteattr(text, {chr(10): '&#10;', chr(9): '&#9;'})}"


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_becomes_neither_yaml_nor_python(text: str, tmp_path: Path) -> None:
    name, value, code = (attribute(key, text) for key in ("name", "value", "code"))
    pointer = attribute("to", f"{{{text}}}")
    comment = f"<!-- {text.replace('--', '')} -->"
    nodes = (
        f"{comment}<Grasp{name}{value}{pointer}/><Action{attribute('ID', text)}/><Script{code}/>"
        f"<Sleep{attribute('msec', text)}/><Parallel name='[parallel]'{attribute('success_count', text)}><A/>"
        f"</Parallel><Fallback name='[race]'/>"
        f"<Fallback{attribute('_skipIf', text)}{attribute('_description', text)}><B/></Fallback>"
    )
    port = f"<input_port{attribute('name', text)}{attribute('default', text)} type='int'>a</input_port>"
    models = f"<TreeNodesModel><Action ID='Grasp'>{port}</Action></TreeNodesModel>"
    xml = tree_text(f"<Sequence>{nodes}</Sequence>", more=models).replace('ID="Patrol"', attribute("ID", text))
    (tmp_path / "tree.xml").write_text(xml, encoding="utf-8")
    write_import(tmp_path / "tree.xml", tmp_path / "made", LEAVES)
    written = [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "tree.xml"]
    assert {path.parent for path in written} == {tmp_path / "made", tmp_path / "made" / "behaviours"}
    (mission,) = (tmp_path / "made").glob("*.yaml")
    root = compose(SourceText("mission", mission.read_text(encoding="utf-8")))
    assert isinstance(root, Mapping)
    assert {*root.keys()} <= {"mission", "params", "tree"}
    tree = root.get("tree")
    assert isinstance(tree, Mapping)
    assert "extra" not in tree.keys()  # noqa: SIM118 - no dict
    stubs = run_path(str(tmp_path / "made" / "behaviours" / "tree.py"))
    assert {"Grasp", "A", "B"} <= {*stubs}


def test_stubs_with_names_of_python_keep_all_ports(tmp_path: Path) -> None:
    ports = (
        "str",
        "float",
        "argument",
        "bool",
        "Any",
        "Status",
        "class",
        "update",
        "tag",
        "name_",
        "a-b",
        "a.b",
        "a_b",
    )
    written = "".join(attribute(port, "x") for port in ports)
    leaves = "".join(f'<Action ID="{word}"{written}/>' for word in ("Leaf", "Status", "Argument", "ﬁx", "fix", "Fix"))
    (tmp_path / "tree.xml").write_text(tree_text(f"<Sequence>{leaves}</Sequence>"), encoding="utf-8")
    write_import(tmp_path / "tree.xml", tmp_path / "made", LEAVES)
    stubs = [leaf for leaf in load_leaves([tmp_path / "made" / "behaviours" / "tree.py"]).values() if leaf.stub]
    assert len(stubs) == 6
    for stub in stubs:
        assert {*stub.arguments} == {*ports}


def test_trees_with_like_names_get_different_short_file_names(tmp_path: Path) -> None:
    ids = ("Dock", "dock", "DOCK", "do ck", "名" * 300, "名" * 301, "../dock", "x²", "x2")
    trees = "".join(f"<BehaviorTree{attribute('ID', each)}><AlwaysSuccess/></BehaviorTree>" for each in ids)
    (tmp_path / "tree.xml").write_text(f'<root BTCPP_format="4">{trees}</root>', encoding="utf-8")
    names = [name for name in import_trees(tmp_path / "tree.xml", LEAVES).files if name.endswith(".yaml")]
    assert len({name.casefold() for name in names}) == len(ids)
    assert max(len(name.encode()) for name in names) <= 255
    assert not any("/" in name or name.startswith(".") for name in names)


def test_export_of_characters_that_xml_forbids_is_xml() -> None:
    text = r"""mission: "<m> \x01"
# <!-- -- -->
tree:
  sequence:
    - say: "<b> \x00 \uFFFF ]]> &"
      name: "<\e>"
    - switch: {on: 1, cases: {1: nod}, default: {log: "\x03"}}
      name: "\x04"
    - fail: "</root> \x02"
"""
    plans = [check_plan(SourceText("m.yaml", text), LEAVES, {}) for _ in range(2)]
    first, second = (export_mission(plan).text for plan in plans)
    root = ET.fromstring(first.encode())  # noqa: S314 - written by ourselves
    assert [each.tag for each in root] == ["BehaviorTree", "TreeNodesModel"]
    assert first == second


def test_names_of_python_trees_are_cleaned() -> None:
    tree = Sequence("a\x1b\u2028\ud800b", memory=True, children=[Success("\x00")])
    tree.add_child(Success("x"))
    tree.children[1].name = 5  # type: ignore[assignment]
    root = tree_element(tree, "module:function", ImportReport())
    names = [each.attributes["name"] for each in walk_elements(root) if "name" in each.attributes]
    assert names == ["a   b", " ", "5"]


@pytest.mark.parametrize(
    ("node", "lines"),
    [
        ('<Switch2 variable="{a}" name="way"><A/><B/><C/></Switch2>', ["c:", "name: way"]),
        ('<Switch2 variable="{a}"><A/><B/></Switch2>', ['fail: "no case"']),
        ('<ScriptCondition code="0"/>', ["check: not not 0"]),
        ("<AlwaysSuccess _skipIf=\"'x'\"/>", ["succeed:", "if: not 'x'"]),
    ],
)
def test_odd_values_of_nodes_give_missions_without_errors(node: str, lines: list[str], tmp_path: Path) -> None:
    imported = import_text(tmp_path, tree_text(node))
    text = imported.files["patrol.yaml"]
    assert tree_lines(imported)[-len(lines) :] == lines
    stubs = imported.files.get("behaviours/patrol.py", "")
    (tmp_path / "stubs.py").write_text(stubs)
    check_plan(SourceText("patrol.yaml", text), load_leaves([tmp_path / "stubs.py"]) if stubs else LEAVES, {})
