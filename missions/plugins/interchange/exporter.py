"""Export of a mission, and of the missions that it runs, as one XML file of BehaviorTree.CPP 4.

A step becomes the node of BehaviorTree.CPP that has the same meaning. Without such a node, it becomes a custom node,
and a remark of the report. The declaration of the custom node in ``TreeNodesModel`` has the word of the step, so that
an import finds the step again.
"""

from collections.abc import Collection

from config.diagnostics import SourceText, to_snake_case
from config.yaml_nodes import Mapping as Entries
from config.yaml_nodes import Node, Scalar
from config.yaml_writer import yaml_word
from missions.language.nodes import MISSION, MODIFIERS
from missions.language.plan import Plan, Step
from missions.plugins.interchange.custom_nodes import custom_element, custom_modifier
from missions.plugins.interchange.marks import write_marks
from missions.plugins.interchange.mission_source import TREE_ID, MissionParam, MissionSource, read_mission
from missions.plugins.interchange.native_nodes import native_element, native_modifier
from missions.plugins.interchange.node_kinds import (
    AS,
    CALCULATED,
    DEFAULTS,
    GIVEN,
    KINDS,
    MARK,
    RETURNS,
    UNSKIPPED,
)
from missions.plugins.interchange.report import LOST
from missions.plugins.interchange.script_writer import (
    ANY,
    ENTRY_NAME,
    FLAG,
    FRACTION,
    OTHER,
    TEXT,
    WHOLE,
    NotAScriptError,
)
from missions.plugins.interchange.tree_writer import CUSTOM, ExportedTree, TreeWriter, can_be_skipped
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.xml_writer import xml_text
from missions.plugins.interchange.yaml_ports import YAML_PREFIX, flow_text, is_pointer, port_text


def export_mission(plan: Plan) -> ExportedTree:
    """Return the XML file for a mission and all missions that it runs, with the remarks of the export."""
    return _Exporter().export(plan)


class _Exporter:
    """Collects the trees of all missions of one export, and the declarations of their custom nodes."""

    def __init__(self) -> None:
        self._found = ExportedTree()
        self._missions: dict[str, MissionSource] = {}
        self._trees: list[Element] = []
        self._models: dict[str, Element] = {}
        self._calls: dict[str, list[Collection[str]]] = {}

    def export(self, plan: Plan) -> ExportedTree:
        main = self._add_mission(plan.mission, plan.tree, plan.source, is_main=True)
        root = Element("root", {"BTCPP_format": "4", "main_tree_to_execute": main.id}, plan.source, 1)
        for tree in self._trees:
            write_marks(tree)
        models = [*self._models.values(), *map(self._tree_model, self._missions.values())]
        root.children = [*self._trees, Element("TreeNodesModel", {}, plan.source, 1, children=models)]
        self._found.text = xml_text(root)
        return self._found

    def _add_mission(self, name: str, tree: Step, source: SourceText, *, is_main: bool = False) -> MissionSource:
        if source.name in self._missions:
            return self._missions[source.name]
        found = read_mission(self._free_id(name, source), tree, source, is_main=is_main)
        self._missions[source.name] = found
        self._found.trees[found.id] = None
        writer = TreeWriter(found, self._write, self._found, self._models)
        element = Element("BehaviorTree", {"ID": found.id}, source, 1)
        first = found.root.entries[0][0].mark.line
        element.comments = [line.strip().lstrip("# ") for line in found.lines[: first - 1] if line.strip("# \t")]
        element.children = [_without_skip(writer, tree)]
        _note_header(writer)
        self._trees.insert(0 if is_main else len(self._trees), element)
        return found

    def _free_id(self, name: str, source: SourceText) -> str:
        word = to_snake_case(name)
        word = "".join(letter if letter.isalnum() or letter == "_" else "_" for letter in word).strip("_") or "mission"
        taken = {each.lower() for each in (*self._found.trees, *self._models, *KINDS)}
        original = TREE_ID.search(source.text)
        wishes = (*([str(original[1])] if original else []), word, *(f"{word}_{number}" for number in range(2, 10_000)))
        return next(wish for wish in wishes if wish.lower() not in taken)

    def _write(self, writer: TreeWriter, step: Step) -> Element:
        """Return the XML element of a step: the node with the same meaning, otherwise a custom node and a remark."""
        child = writer.build(step.children[0]) if step.kind in MODIFIERS else None
        try:
            if child is not None:
                element = native_modifier(writer, step, child)
            else:
                element = self._submission(writer, step) if step.kind == MISSION else native_element(writer, step)
            self._found.native += 1
        except NotAScriptError as reason:
            self._found.custom += 1
            if str(reason):
                writer.note(CUSTOM, step, f"{reason} has no counterpart there")
            element = custom_element(writer, step) if child is None else custom_modifier(writer, step, child)
        if child is not None and element is not child and (name := writer.mission.remark(step)):
            element.attributes = {"name": name, **element.attributes}
        return element

    def _tree_model(self, mission: MissionSource) -> Element:
        """Return the declaration of a mission's tree in ``TreeNodesModel``: its params are input ports."""
        model = Element("SubTree", {"ID": mission.id}, mission.source, 1)
        for name, param in mission.params.items():
            attributes = {"name": name, "type": _CPP_TYPES.get(param.kind, "std::string")}
            if param.default is not None and not (isinstance(param.default, Scalar) and param.default.value is None):
                attributes["default"] = port_text(param.default, is_text=True)
            elif not all(name in given for given in self._calls.get(mission.id, [])):
                continue  # the library would require it of all callers
            model.children.append(Element("input_port", attributes, mission.source, 1, text=param.help))
        model.children.append(Element("description", {}, mission.source, 1, text=mission.header()))
        return model

    def _submission(self, writer: TreeWriter, step: Step) -> Element:
        tree = step.children[0]
        inner = self._add_mission(step.text, tree, tree.source)
        beside = writer.mission.beside(step)
        attributes = {"ID": inner.id}
        calculated, script = list[str](), dict[str, str]()
        given_node, own_returns = beside.get("with"), beside.get("returns")
        entries = given_node.entries if isinstance(given_node, Entries) else []
        defaults = {
            name: param.default
            for name, param in inner.params.items()
            if param.kind in (WHOLE, FRACTION, FLAG)
            and name not in step.arguments_as_written
            and param.default is not None
        }
        for name, node in ({key.text: node for key, node in entries} | defaults).items():
            try:
                attributes[name] = _passed(writer, inner, name, node, script)
            except NotAScriptError:
                calculated.append(f"{yaml_word(name)}: {flow_text(node)}")
                writer.note(LOST, step, f"the value of '{name}' is not passed there")
        declared = own_returns if own_returns is not None else inner.root.get("returns")
        for key, node in declared.entries if isinstance(declared, Entries) else ():
            _add_result(writer, step, attributes, key.text, node.text if isinstance(node, Scalar) else "")
        given = [key.text for key, _ in entries if key.text in attributes]
        attributes |= {GIVEN: " ".join(given)} if given else {}
        attributes |= {DEFAULTS: " ".join(defaults)} if defaults else {}
        attributes |= {CALCULATED: f"{YAML_PREFIX}{{{', '.join(calculated)}}}"} if calculated else {}
        attributes |= {RETURNS: YAML_PREFIX + flow_text(own_returns)} if own_returns is not None else {}
        if step.output_variable is not None:
            attributes[AS] = step.output_variable
            writer.note(LOST, step, "'as': its results are not stored there")
        self._calls.setdefault(inner.id, []).append(given)
        call = writer.new("SubTree", step, attributes, is_named=True)
        return writer.prepared(step, call, script)


def _passed(writer: TreeWriter, inner: MissionSource, name: str, node: Node, script: dict[str, str]) -> str:
    """Return the port of a SubTree node for the param ``name`` of the called mission ``inner``.

    It is a text, a list as YAML, or a pointer, since a constant in such a port is always a text. For a number or a
    calculation, an assignment is added to ``script``, which sets a variable before the call, and the port points to
    this variable. Raises NotAScriptError if a script cannot set it.
    """
    param = inner.params.get(name, MissionParam(OTHER))
    text = port_text(node, is_text=param.kind == TEXT)
    if not _can_be_port(name):
        raise NotAScriptError("the name of the param")
    is_text = isinstance(node, Scalar) and isinstance(node.value, str) and not text.startswith(YAML_PREFIX)
    is_list = not isinstance(node, Scalar) and param.kind == OTHER
    if is_pointer(text) or ("${" not in text and (is_list or (is_text and param.kind in (TEXT, OTHER, ANY)))):
        return text
    return writer.calculate(node, f"{inner.id}_{name}", param.kind, script)


def _add_result(writer: TreeWriter, step: Step, attributes: dict[str, str], outer: str, inner: str) -> None:
    """Add a port that connects the variable ``inner`` of the called mission to the variable ``outer`` of the caller.

    If the result is not a variable alone, it is reported as lost.
    """
    pointer = f"{{{outer}}}"
    if step.output_variable is not None:
        return
    if not _can_be_port(inner) or attributes.setdefault(inner, pointer) != pointer:
        writer.note(LOST, step, f"the result '{outer}' is calculated, and not stored there")


def _without_skip(writer: TreeWriter, step: Step) -> Element:
    """Return the root element of a mission's tree.

    A mission whose root is skipped succeeds, but a tree of BehaviorTree.CPP would be skipped; so the element gets a
    Sequence around it.
    """
    element = writer.element(step)
    if not can_be_skipped(step):
        return element
    return writer.new("Sequence", step, {MARK: UNSKIPPED}, [writer.new("AlwaysSuccess", step), element])


def _note_header(writer: TreeWriter) -> None:
    mission = writer.mission
    for word in ("properties", "if_interrupted"):
        found = mission.root.get(word)
        if found is not None:
            writer.note_at(LOST, mission.source, found.mark.line, word, "only missions have it")
    params = mission.root.get("params")
    for key, node in params.entries if isinstance(params, Entries) else ():
        limits = [word for word in ("low", "high", "choices") if isinstance(node, Entries) and node.get(word)]
        if limits:
            text = f"{' and '.join(limits)}: the library does not check it"
            writer.note_at(LOST, mission.source, key.mark.line, key.text, text)


def _can_be_port(name: str) -> bool:
    """Return whether BehaviorTree.CPP accepts the name of a variable as the name of a tree's port."""
    return ENTRY_NAME.fullmatch(name) is not None and not name.startswith("_") and name not in ("ID", "name")


_CPP_TYPES = {WHOLE: "int", FRACTION: "double", FLAG: "bool", TEXT: "std::string", ANY: "BT::AnyTypeAllowed"}
