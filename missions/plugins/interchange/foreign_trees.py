"""Reader of a project of BehaviorTree.CPP: the trees and the declared nodes in its XML files, and included files.

An included file outside the project's folder is not read.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from os.path import realpath
from pathlib import Path

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText
from config.yaml_nodes import Node
from missions.language.nodes import MISSION
from missions.plugins.interchange.marks import read_marks
from missions.plugins.interchange.node_kinds import HEADER_KEYS, KINDS, OLD_NAMES, STEP_DESCRIPTION
from missions.plugins.interchange.py_trees_xml import adapt_py_trees, is_py_trees
from missions.plugins.interchange.report import LOST, ImportReport
from missions.plugins.interchange.xml_reader import Element, read_xml, walk_elements
from missions.plugins.interchange.yaml_ports import YAML_PREFIX, is_pointer, read_entries

MAX_FILES = 2_000
"""Maximum number of XML files in a folder that is imported."""

EXPLICIT_ROLES = ("Action", "Condition", "Control", "Decorator", "SubTree", "SubTreePlus")
"""Tags of the explicit form, in which the tag is the role of a node: ``<Action ID="Grasp"/>`` means ``<Grasp/>``."""

GENERIC_TREE_NAMES = frozenset({"maintree", "main", "behaviortree", "tree", "root", "untitled", "bt", "navigation"})
"""IDs of trees that say less than the name of their file, so that the mission is named after the file."""

INCLUDES = ("include", "import")
"""Tags of elements that include another XML file, in lower case."""

MODEL_TAGS = ("TreeNodesModel", "TreeNodeModel")
STEP_WORD = re.compile(rf"{STEP_DESCRIPTION}'([^\W\d_A-Z]\w{{0,79}})': ")
"""Beginning of the description of a custom node that `mission show` has exported, with the word of the step."""

OUTPUT_NAMES = ("output", "out")
DIRECTIONS = {"input_port": "in", "output_port": "out", "inout_port": "inout"}


@dataclass(frozen=True, slots=True)
class PortModel:
    """A port as declared in the model of its node: ``direction`` is "in", "out" or "inout".

    ``type`` is its C++ type, empty if unknown; ``default`` is None without a default.
    """

    direction: str
    type: str = ""
    default: str | None = None
    help: str = ""


@dataclass(slots=True)
class NodeModel:
    """Declaration of a kind of node: its role, one of ``EXPLICIT_ROLES`` or empty, and its ports by name.

    ``word`` is the word of missions from which `mission show` made the node, empty for others.
    """

    role: str
    ports: dict[str, PortModel] = field(default_factory=dict)
    word: str = ""

    def port(self, name: str) -> PortModel:
        """Return the port with this name. For an undeclared port, the direction is guessed from the name."""
        if name in self.ports:
            return self.ports[name]
        is_output = name.startswith(("output_", "out_")) or name.endswith(("_out", "_output")) or name in OUTPUT_NAMES
        return PortModel("out" if is_output else "in")


@dataclass(slots=True)
class SourceTree:
    """A tree in an XML file: ``element`` is its ``<BehaviorTree>``, ``body`` its root node, None if empty.

    If `mission show` has exported the tree, ``header`` has the top-level keys of the mission file, such as ``params``.
    """

    id: str
    element: Element
    body: Element | None
    file: "TreeFile"
    is_main: bool = False
    header: Mapping[str, Node] = field(default_factory=dict)

    @property
    def version(self) -> int:
        """Version of BehaviorTree.CPP for which the file was written: 3 or 4."""
        return self.file.version

    def elements(self) -> Iterator[Element]:
        """Yield the nodes of the tree."""
        if self.body is not None:
            yield from walk_elements(self.body)

    def port_defaults(self, models: Mapping[str, NodeModel]) -> dict[str, str]:
        """Return the default values of the tree's ports that are not empty, by the name of the port.

        They are declared in the tree's model, one of ``models``, or as attributes of the ``<BehaviorTree>`` element.
        """
        model = models.get(self.id)
        found = {} if model is None else {name: port.default or "" for name, port in model.ports.items()}
        return {name: value for name, value in (found | ports_of(self.element)).items() if value}


@dataclass(slots=True)
class TreeFile:
    """An XML file with behaviour trees: ``trees`` are its own by their ID.

    ``visible`` are its own trees and those of the files that it includes.
    """

    path: Path
    root: Element
    version: int
    trees: dict[str, SourceTree] = field(default_factory=dict)
    visible: dict[str, SourceTree] = field(default_factory=dict)


@dataclass(slots=True)
class ForeignProject:
    """All XML files of an import, and the declarations of nodes in them, ``models``, by the ID of the node.

    ``guessed_outputs`` has, for leaves without a declaration, the ports that seem to be outputs.
    """

    folder: Path
    files: dict[Path, TreeFile] = field(default_factory=dict)
    models: dict[str, NodeModel] = field(default_factory=dict)
    guessed_outputs: dict[str, set[str]] = field(default_factory=dict)

    def trees(self) -> Iterator[SourceTree]:
        """Yield all trees of the project, file by file."""
        for file in self.files.values():
            yield from file.trees.values()

    def find_tree(self, name: str, file: TreeFile) -> SourceTree | None:
        """Return the tree with the ID ``name`` that a SubTree node in ``file`` runs; None if there is none.

        It is a tree of the file or of its includes; otherwise the only one in the project or in the file's folder.
        """
        if name in file.visible:
            return file.visible[name]
        found = [tree for tree in self.trees() if tree.id == name]
        same_folder = [tree for tree in found if tree.file.path.parent == file.path.parent]
        return found[0] if len(found) == 1 else same_folder[0] if len(same_folder) == 1 else None


def read_project(path: Path, report: ImportReport) -> ForeignProject:
    """Read an XML file with the files that it includes, or all XML files of a folder. Raises InvalidFileError.

    In a folder, a file that cannot be read is a remark in ``report``, and files without trees are ignored.
    """
    if not path.is_dir():
        project = ForeignProject(path.parent)
        file = _read_file(project, path, report, ())
        if not file.trees and not file.visible:
            raise file.root.fault("no tree in this file", "it needs <BehaviorTree ID=...> under <root>")
        return project
    project = ForeignProject(path)
    for each in _files_of(path):
        try:
            _read_file(project, each, report, ())
        except InvalidFileError as error:
            for fault in error.diagnostics:
                if fault.message != NOT_A_TREE:
                    empty = Element("file", {}, fault.source, fault.mark.line)
                    report.add(LOST, empty, fault.message)
    if not project.files:
        raise InvalidFileError(
            [Diagnostic(SourceText(str(path), ""), Mark(), "no XML file with behaviour trees in it")]
        )
    return project


NOT_A_TREE = "not a behaviour tree: its first element must be <root>"


def _files_of(folder: Path) -> list[Path]:
    """Return the XML files in a folder and below it, except links to files elsewhere.

    Raises InvalidFileError for more than ``MAX_FILES``.
    """
    found = [each for each in sorted(folder.rglob("*.xml")) if each.is_file() and _is_inside(each, folder)]
    if len(found) > MAX_FILES:
        message = f"more than {MAX_FILES:,} XML files"
        raise InvalidFileError([Diagnostic(SourceText(str(folder), ""), Mark(), message)])
    return found


def _is_inside(path: Path, folder: Path) -> bool:
    return Path(realpath(path)).is_relative_to(realpath(folder))


def _read_file(project: ForeignProject, path: Path, report: ImportReport, chain: tuple[Path, ...]) -> TreeFile:
    where = Path(realpath(path))
    if where in project.files:
        return project.files[where]
    root = read_xml(path, _display_name(path, project.folder))
    if root.tag != "root":
        root = _root_around(root)
    if is_py_trees(root):
        adapt_py_trees(root)
    file = TreeFile(path, root, _version(root))
    _read_elements(project, file, report)
    project.files[where] = file
    for element in root.children:
        if element.tag.lower() in INCLUDES:
            _include(project, file, element, report, (*chain, where))
    file.visible = {**file.visible, **file.trees}
    return file


def _root_around(fragment: Element) -> Element:
    """Return the root element of a file that holds only a tree or a node, as pages and chats show them.

    Raises InvalidFileError for other elements.
    """
    if fragment.tag != "BehaviorTree":
        if fragment.tag not in (*KINDS, *OLD_NAMES):
            raise fragment.fault(NOT_A_TREE)
        fragment = replace(fragment, tag="BehaviorTree", attributes={}, children=[fragment], comments=[])
    return replace(fragment, tag="root", attributes={}, children=[fragment], comments=[], last_comments=[])


def project_of(root: Element, path: Path, report: ImportReport) -> ForeignProject:
    """Return a project with one file, whose elements are known already; nothing is read."""
    project = ForeignProject(path.parent)
    file = TreeFile(path, root, _version(root))
    _read_elements(project, file, report)
    file.visible = dict(file.trees)
    project.files[path] = file
    return project


def _read_elements(project: ForeignProject, file: TreeFile, report: ImportReport) -> None:
    """Add the trees of a file to ``file`` and its node declarations to the project, and mark the main tree."""
    named_main = file.root.attributes.get("main_tree_to_execute", "")
    headers = dict[str, Mapping[str, Node]]()
    for element in file.root.children:
        if element.tag == "BehaviorTree":
            _add_tree(file, element, report)
        elif element.tag in MODEL_TAGS:
            _add_models(project, element)
            headers |= {each.attributes.get("ID", ""): _header(each) for each in element.children}
        elif element.tag.lower() not in INCLUDES:
            report.add(LOST, element, "an unknown element under <root>")
    for tree in file.trees.values():
        tree.header = headers.get(tree.id, {})
    main = file.trees.get(named_main) or (next(iter(file.trees.values())) if len(file.trees) == 1 else None)
    if main is not None:
        main.is_main = True


def _header(model: Element) -> Mapping[str, Node]:
    """Return the top-level keys of a mission from the declaration of its exported tree; empty for other nodes."""
    text = description_of_model(model)
    found = read_entries(text) if model.tag == "SubTree" and text.startswith(YAML_PREFIX) else {}
    return {key: node for key, node in found.items() if key in HEADER_KEYS} if MISSION in found else {}


def description_of_model(model: Element) -> str:
    """Return the description in the declaration of a node or a tree; empty without one."""
    return next((each.text.strip() for each in model.children if each.tag == "description"), "")


def _display_name(path: Path, folder: Path) -> str:
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)


def _include(
    project: ForeignProject, file: TreeFile, element: Element, report: ImportReport, chain: tuple[Path, ...]
) -> None:
    """Read the file that an ``<include>`` element names, if it lies in the folder of the project.

    ``chain`` has the files whose includes lead to this one. Raises InvalidFileError if the file is among them.
    """
    name = next((element.attributes[each] for each in ("path", "file", "src") if element.attributes.get(each)), "")
    if not name or "ros_pkg" in element.attributes or "\0" in name:
        report.add(LOST, element, "includes from a ROS package are not followed: import its folder")
        return
    path = file.path.parent / name
    if not _is_inside(path, project.folder):
        report.add(LOST, element, f"'{name}' is outside the folder and is not read: import the folder of both")
        return
    if Path(realpath(path)) in chain:
        raise element.fault(f"'{name}' includes itself")
    try:
        included = _read_file(project, path, report, chain)
    except InvalidFileError as error:
        report.add(LOST, element, error.diagnostics[0].message)
        return
    file.visible |= included.visible


def _version(root: Element) -> int:
    """Return the version of BehaviorTree.CPP, 3 or 4, for which a file was written.

    It is declared in the attribute ``BTCPP_format``; otherwise it is 4 if the file has elements that only version 4
    has.
    """
    declared = root.attributes.get("BTCPP_format", "").strip()
    if declared:
        return 3 if declared.startswith("3") else 4
    return 4 if any(_is_version_4(each) for each in walk_elements(root)) else 3


def _is_version_4(element: Element) -> bool:
    if element.tag in ("Script", "ScriptCondition") or any(
        name in ("_skipIf", "_while", "_failureIf", "_successIf", "_autoremap") for name in element.attributes
    ):
        return True
    return element.tag == "SubTree" and any(
        is_pointer(value) for name, value in element.attributes.items() if name not in ("ID", "name")
    )


def _add_tree(file: TreeFile, element: Element, report: ImportReport) -> None:
    read_marks(element)
    name = element.attributes.get("ID") or file.path.stem
    if name in file.trees:
        report.add(LOST, file.trees[name].element, f"replaced by the later tree '{name}' at line {element.line}")
    bodies = element.children
    if len(bodies) == 1 and bodies[0].tag == "Root":  # Groot 0.x put all nodes below it
        bodies = bodies[0].children
    body = bodies[0] if bodies else None
    if body is None:
        report.add(LOST, element, "an empty tree")
    elif len(bodies) > 1:
        report.add(LOST, bodies[1], "a tree has one root node: further nodes run after it")
        body = Element("Sequence", {}, element.source, element.line, element.column, list(bodies))
    file.trees[name] = SourceTree(name, element, body, file)


def _add_models(project: ForeignProject, element: Element) -> None:
    for declared in element.children:
        name = declared.attributes.get("ID", "")
        if declared.tag not in EXPLICIT_ROLES or not name:
            continue
        model = project.models.setdefault(name, NodeModel(declared.tag))
        if found_word := STEP_WORD.match(description_of_model(declared)):
            model.word = found_word[1]
        for port in declared.children:
            if (direction := DIRECTIONS.get(port.tag)) and (port_name := port.attributes.get("name", "")):
                found = PortModel(
                    direction, port.attributes.get("type", ""), port.attributes.get("default"), port.text.strip()
                )
                model.ports.setdefault(port_name, found)


def call_ports(project: ForeignProject, tree: SourceTree | None, element: Element) -> dict[str, str]:
    """Return the values of the ports of a SubTree node: those written in it, and the defaults of the called ``tree``.

    A ``tree`` of None is unknown and has no defaults.
    """
    return ({} if tree is None else tree.port_defaults(project.models)) | ports_of(element)


def ports_of(element: Element) -> dict[str, str]:
    """Return the ports of a node as written: its attributes without those that every node can have."""
    items = element.attributes.items()
    return {name: value for name, value in items if name not in ("ID", "name") and not name.startswith("_")}


def normal_form(element: Element, project: ForeignProject) -> tuple[str, str]:
    """Return the kind of a node and its role: ("Grasp", "Action") for ``<Action ID="Grasp"/>``.

    The role is empty if neither the file nor a declaration says it. An older name of a kind is replaced by the present
    one, and a name with other capital letters by that of BehaviorTree.CPP.
    """
    tag, role = element.tag, ""
    if tag in EXPLICIT_ROLES and not tag.startswith("SubTree") and element.attributes.get("ID"):
        tag, role = element.attributes["ID"], tag
    if tag in project.models and tag not in KINDS:
        return tag, role or project.models[tag].role
    if role in ("Action", "Condition") and tag in KINDS and KINDS[tag].role != "leaf":
        return tag, role
    tag = OLD_NAMES.get(tag, tag)
    if tag not in KINDS:
        tag = _LOWER_CASE.get(tag.lower(), tag)
    return tag, role


_LOWER_CASE = {name.lower(): name for name in KINDS} | {old.lower(): name for old, name in OLD_NAMES.items()}
