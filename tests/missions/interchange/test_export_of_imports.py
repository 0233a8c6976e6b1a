"""A tree that was imported is exported with the names, types and defaults that it had."""

from pathlib import Path

from missions.plugins.interchange.exporter import export_mission
from missions.plugins.interchange.tree_writer import ExportedTree
from missions.plugins.interchange.xml_reader import Element, parse_xml, walk_elements
from tests.missions.interchange.round_trips import plan_of, write_import
from tests.missions.interchange.trees import tree_text

MODELS = """<TreeNodesModel>
  <Action ID="FindParcel">
    <output_port name="weight" type="double"/>
    <input_port name="label" type="std::string">what is "written" \\ on it</input_port>
    <output_port name="shelf" type="Pose2D" default="{shelf}"/>
  </Action>
  <Action ID="Hold"><input_port name="force" type="int" default="2"/></Action>
  <Condition ID="IsHolding"/>
</TreeNodesModel>"""


def imported_and_exported(folder: Path, body: str, more: str = MODELS) -> ExportedTree:
    """Import a tree, and export its mission."""
    xml = folder / "patrol.xml"
    xml.write_text(tree_text(body, more=more), encoding="utf-8")
    write_import(xml, folder, {})
    return export_mission(plan_of(folder / "patrol.yaml"))


def main_tree(exported: ExportedTree) -> Element:
    return parse_xml(exported.text.encode(), "tree.xml").children[0]


def ports_of_models(text: str) -> dict[str, dict[str, tuple[str, dict[str, str], str]]]:
    """Return the tag, attributes and description of each declared port, by ID and name."""
    root = parse_xml(text.encode(), "tree.xml")
    models = [each for each in walk_elements(root) if each.tag in ("Action", "Condition") and "ID" in each.attributes]
    return {
        f"{model.tag} {model.attributes['ID']}": {
            port.attributes["name"]: (port.tag, port.attributes, port.text.strip())
            for port in model.children
            if port.tag != "description"
        }
        for model in models
    }


def test_an_export_declares_the_ports_of_the_import(tmp_path: Path) -> None:
    body = '<Sequence><FindParcel label="a" shelf="{s}"/><Hold force="5"/><IsHolding/></Sequence>'
    exported = imported_and_exported(tmp_path, body)
    assert ports_of_models(exported.text) == ports_of_models(f"<root>{MODELS}</root>")
    nodes = {each.tag: each.attributes for each in main_tree(exported).children[0].children}
    assert nodes == {"FindParcel": {"label": "a", "shelf": "{s}"}, "Hold": {"force": "5"}, "IsHolding": {}}


def test_the_id_of_a_leaf_is_not_given_to_another_node(tmp_path: Path) -> None:
    exported = imported_and_exported(tmp_path, '<Hold force="5"/>')
    assert main_tree(exported).children[0].tag == "Hold"
    path = tmp_path / "patrol.yaml"
    path.write_text("mission: patrol\ntree: {hold_action: {force: 5}, hold: 1 s}\n")
    outer = main_tree(export_mission(plan_of(path))).children[0]
    assert (outer.tag, outer.children[0].tag) == ("MissionHold", "Hold")


def test_a_parent_that_became_a_leaf_is_reported(tmp_path: Path) -> None:
    exported = imported_and_exported(tmp_path, "<Careful><Hold/></Careful>")
    assert any("the Decorator 'Careful' there is an action here" in line for line in exported.lines())


def test_leaves_of_other_scripts_get_ids_of_ascii_letters(tmp_path: Path) -> None:
    exported = imported_and_exported(tmp_path, '<Sequence><Action ID="Größe"/><Action ID="抓取"/></Sequence>')
    sequence = main_tree(exported).children[0]
    assert [each.tag for each in sequence.children] == ["Gre", "Mission"]
    text = (tmp_path / "patrol.yaml").read_text(encoding="utf-8")
    (tmp_path / "patrol.xml").write_text(exported.text, encoding="utf-8")
    write_import(tmp_path / "patrol.xml", tmp_path, {})
    assert (tmp_path / "patrol.yaml").read_text(encoding="utf-8") == text


def test_a_node_model_that_is_not_xml_is_reported(tmp_path: Path) -> None:
    imported_and_exported(tmp_path, '<Hold force="5"/>')
    path = tmp_path / "behaviours" / "patrol.py"
    path.write_text(path.read_text().replace("<Action", "Action"))
    exported = export_mission(plan_of(tmp_path / "patrol.yaml"))
    assert main_tree(exported).children[0].tag == "HoldAction"
    assert any("its node_model is not XML" in line for line in exported.lines())


def test_ids_of_trees_and_names_of_nodes_are_kept(tmp_path: Path) -> None:
    body = """<Repeat name="rounds" num_cycles="2"><Timeout name="in time" msec="250"><Sequence name="both">
      <IsHolding name="held"/><Inverter name="not held"><IsHolding/></Inverter></Sequence></Timeout></Repeat>"""
    tree = main_tree(imported_and_exported(tmp_path, body))
    assert tree.attributes == {"ID": "Patrol"}
    names = [each.attributes.get("name") for each in walk_elements(tree.children[0])]
    assert names == ["[repeat] rounds", "in time", "both", "held", "not held", None]


def test_a_script_on_failure_is_an_attribute_again(tmp_path: Path) -> None:
    body = """<Sequence><Hold force="5" _onFailure="slips = 1; hurt = true"/>
      <Fallback><Hold/><AlwaysFailure/></Fallback></Sequence>"""
    first, second = main_tree(imported_and_exported(tmp_path, body)).children[0].children
    assert first.attributes == {"force": "5", "_onFailure": "slips := 1; hurt := true"}
    assert (second.tag, len(second.children)) == ("Fallback", 2)


def test_several_outputs_of_a_leaf_are_its_ports_again(tmp_path: Path) -> None:
    body = '<FindParcel name="look" label="a" weight="{w}" shelf="{s}"/>'
    exported = imported_and_exported(tmp_path, body)
    assert main_tree(exported).children[0].attributes == {"name": "look", "label": "a", "weight": "{w}", "shelf": "{s}"}
    assert ports_of_models(exported.text)["Action FindParcel"].keys() == {"weight", "label", "shelf"}
    path = tmp_path / "patrol.yaml"
    path.write_text(path.read_text().replace("w: ", "v: 1, w: "))
    assert main_tree(export_mission(plan_of(path))).children[0].tag == "Sequence"


def test_an_import_of_the_export_is_the_same_mission(tmp_path: Path) -> None:
    body = """<Repeat name="rounds" num_cycles="2"><Sequence>
      <FindParcel name="look" label="a" weight="{w}" shelf="{s}"/><Hold force="5" _onFailure="slips = 1"/>
      </Sequence></Repeat>"""
    exported = imported_and_exported(tmp_path, body)
    again = tmp_path / "again"
    again.mkdir()
    (again / "patrol.xml").write_text(exported.text, encoding="utf-8")
    write_import(again / "patrol.xml", again, {})
    for name in ("patrol.yaml", "behaviours/patrol.py"):
        assert (again / name).read_text() == (tmp_path / name).read_text()
