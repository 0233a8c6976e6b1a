"""Rules of BehaviorTree.CPP, its schemas and its editors for XML files: exports hold them all.

Each rule names its source: BehaviorTree.CPP is the schema that the library writes (``writeTreeXSD``) and pull request
1146, numbers are issues of Groot2, and Groot is the check of the first Groot (``VerifyXML``).
"""

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from behaviours.catalogue import LEAVES
from missions.library.shipped import shipped_missions
from missions.plugins.interchange.exporter import export_mission
from missions.plugins.interchange.node_kinds import BTCPP_KINDS, CONDITION_ATTRIBUTES
from tests.cases import each
from tests.missions.interchange.round_trips import export_and_import, plan_of, tree_of
from tests.missions.interchange.test_export_against_behaviortree_cpp import KNOWN, checked_missions
from tests.tries import tries

MISSIONS = Path(__file__).parents[3] / "missions"
RANDOM_MISSIONS = tries(40, most=500)
COMMON = {"name", *CONDITION_ATTRIBUTES}
ROLES = ("Action", "Condition", "Control", "Decorator", "SubTree")
POINTER = re.compile(r"\{\w+\}")
PORT_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
OF_CALLS = {"_given", "_defaults", "_calculated", "_returns", "_as"}


class Exported:
    """An exported file: its trees, and the declarations of its custom nodes and trees by ID."""

    def __init__(self, text: str) -> None:
        self.root = ET.fromstring(text.encode())  # noqa: S314 - written by ourselves
        self.trees = self.root.findall("BehaviorTree")
        self.models = list(self.root.iterfind("TreeNodesModel/*"))
        self.nodes = {model.attrib["ID"]: model for model in self.models if model.tag != "SubTree"}
        self.subtrees = {model.attrib["ID"]: model for model in self.models if model.tag == "SubTree"}

    def elements(self) -> Iterator[ET.Element]:
        for tree in self.trees:
            yield from (node for node in tree.iter() if node is not tree)

    def ports(self, model: ET.Element) -> dict[str, ET.Element]:
        return {port.attrib["name"]: port for port in model if port.tag in ("input_port", "output_port")}


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> list[Exported]:
    plans = [plan_of(MISSIONS / f"{name}.yaml", LEAVES) for name in shipped_missions()]
    folder = tmp_path_factory.mktemp("missions")
    plans += [plan for _, _, plan in islice(checked_missions(folder, 910_000, all_kinds=True), RANDOM_MISSIONS)]
    return [Exported(export_mission(plan).text) for plan in plans]


def test_root_declares_format_and_main_tree(exports: list[Exported]) -> None:
    """BehaviorTree.CPP; its pull request 575: Groot2 refuses a file without BTCPP_format."""
    for export in exports:
        assert export.root.tag == "root"
        assert export.root.attrib.keys() == {"BTCPP_format", "main_tree_to_execute"}
        assert export.root.attrib["BTCPP_format"] == "4"
        assert [child.tag for child in export.root] == ["BehaviorTree"] * len(export.trees) + ["TreeNodesModel"]


def test_each_tree_has_an_id_of_its_own_and_one_child(exports: list[Exported]) -> None:
    """BehaviorTree.CPP, Groot, 56: no other attribute than the ID, which is used once."""
    for export in exports:
        ids = [tree.attrib["ID"] for tree in export.trees]
        assert len({name.lower() for name in ids}) == len(ids)
        assert export.root.attrib["main_tree_to_execute"] in ids
        for tree in export.trees:
            assert tree.attrib.keys() == {"ID"}
            assert PORT_NAME.fullmatch(tree.attrib["ID"])
            assert len(tree) == 1
        called = {node.attrib["ID"] for node in export.elements() if node.tag == "SubTree"}
        assert called <= set(ids) == export.subtrees.keys()


def test_names_of_nodes_and_trees_differ(exports: list[Exported]) -> None:
    """BehaviorTree.CPP#827: no ID is that of a node and of a tree; 72: no built-in node is declared again."""
    for export in exports:
        ids = [model.attrib["ID"] for model in export.models]
        assert len(set(ids)) == len(ids)
        assert not {*ids} & {*BTCPP_KINDS, *ROLES, "TryCatch", "WasEntryUpdated"}


def test_each_custom_node_is_declared_with_its_role(exports: list[Exported]) -> None:
    """BehaviorTree.CPP#1146: without a declaration, Groot2 loops for ever. Groot: the numbers of children."""
    for export in exports:
        for node in export.elements():
            children, kind = len(node), BTCPP_KINDS.get(node.tag)
            role = export.nodes[node.tag].tag if kind is None else kind.role.capitalize()
            assert children == 1 if role == "Decorator" else children >= 1 if role == "Control" else children == 0


def test_each_attribute_of_a_node_is_a_declared_port(exports: list[Exported]) -> None:
    """64, BehaviorTree.CPP: an attribute without a port is refused, and so is a port with another name than a word."""
    for export in exports:
        for node in export.elements():
            if node.tag == "SubTree":
                assert all(PORT_NAME.fullmatch(name) for name in node.attrib.keys() - COMMON - OF_CALLS), node.attrib
                continue
            kind = BTCPP_KINDS.get(node.tag)
            ports = export.ports(export.nodes[node.tag]) if kind is None else kind.ports
            assert node.attrib.keys() - COMMON <= set(ports), (node.tag, node.attrib)
            required = {name for name, default in kind.ports.items() if default == ""} if kind is not None else set()
            assert required <= node.attrib.keys(), (node.tag, node.attrib)


def test_declarations_have_ports_and_one_description(exports: list[Exported]) -> None:
    """BehaviorTree.CPP: ports with a name and a type, then at most one description."""
    for export in exports:
        for model in export.models:
            assert model.attrib.keys() == {"ID"}
            assert model.tag in ROLES
            tags = [child.tag for child in model]
            assert tags[-1:] == ["description"]
            assert set(tags[:-1]) <= {"input_port", "output_port"}
            names = [port.attrib["name"] for port in model if port.tag != "description"]
            assert len(set(names)) == len(names)
            assert all(PORT_NAME.fullmatch(name) and name not in ("ID", "name") for name in names)
            assert all(port.attrib["type"] for port in model if port.tag != "description")


def test_output_ports_are_entries(exports: list[Exported]) -> None:
    """BehaviorTree.CPP: the value of an output port is a pointer."""
    outputs = 0
    for export in exports:
        for node in export.elements():
            for name, port in export.ports(export.nodes[node.tag]).items() if node.tag in export.nodes else ():
                if port.tag == "output_port" and name in node.attrib:
                    outputs += 1
                    assert POINTER.fullmatch(node.attrib[name]), (node.tag, node.attrib)
    assert outputs


def test_a_call_has_all_ports_without_default_and_a_name_of_its_own(exports: list[Exported]) -> None:
    """BehaviorTree.CPP 4.10: a SubTree without such a port, and one with the name of another, are refused."""
    for export in exports:
        for tree in export.trees:
            calls = list(tree.iter("SubTree"))
            names = [call.attrib["name"] for call in calls if "name" in call.attrib]
            assert len(set(names)) == len(names)
            for call in calls:
                ports = export.ports(export.subtrees[call.attrib["ID"]])
                required = {name for name, port in ports.items() if "default" not in port.attrib}
                assert required <= call.attrib.keys()


def saved_by_an_editor(text: str) -> str:
    """Return a file as Groot2 saves it: without main tree (7) and comments, and with empty ports (57).

    Trees are in alphabetical order, nodes in the explicit form, and attributes of the editor are added.
    """
    export = Exported(text)
    root = export.root
    del root.attrib["main_tree_to_execute"]
    for number, node in enumerate(export.elements()):
        node.set("_uid", str(number))
        if node.tag == "SubTree":
            node.set("_autoremap", "false")
        elif node.tag in export.nodes:
            ports = export.ports(export.nodes[node.tag])
            node.attrib = {"ID": node.tag, **dict.fromkeys(ports, ""), **node.attrib}
            node.tag = export.nodes[node.tag].tag
    for tree in export.trees:
        root.remove(tree)
        tree.set("_fullpath", "")
    for model in export.models:
        model.set("editable", "true")
    root[:0] = sorted(export.trees, key=lambda tree: tree.attrib["ID"])
    return ET.tostring(root, encoding="unicode")


def test_an_export_that_an_editor_has_saved_is_the_same_mission(tmp_path: Path) -> None:
    for seed, _, plan in islice(checked_missions(tmp_path, 910_000, all_kinds=True), RANDOM_MISSIONS):
        _, path = export_and_import(plan, tmp_path / f"{seed}_again", KNOWN, saved_by_an_editor)
        found = plan_of(path, KNOWN)
        assert tree_of(found.tree) == tree_of(plan.tree), seed
        assert found.params == plan.params


@each("name", ["retry", "[retry] x", "[]", "[fail: 'a'] b", "'[", "a [retry]"])
def test_names_that_look_like_marks_are_kept(tmp_path: Path, name: str) -> None:
    quoted = name.replace("'", "''")
    path = tmp_path / "main.yaml"
    lines = ["wait: 1 s", "fail: it's ''no'' ]", "race: [{wait: 1 s}, succeed]", "mission: inner", "mission: inner"]
    steps = "".join(f"    - {line}\n      name: '{quoted}'\n" for line in lines)
    path.write_text(f"mission: main\ntree:\n  sequence:\n{steps}")
    (tmp_path / "inner.yaml").write_text("mission: inner\ntree: succeed\n")
    plan = plan_of(path, LEAVES)
    exported, again = export_and_import(plan, tmp_path / "again", LEAVES)
    assert tree_of(plan_of(again, LEAVES).tree) == tree_of(plan.tree)
    names = [node.get("name") for node in Exported(exported.text).elements() if node.tag == "SubTree"]
    assert len(set(names)) == 2
