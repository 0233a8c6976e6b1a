"""Export of steps without an equal node in BehaviorTree.CPP, as custom nodes with a declaration in the file."""

import re
from collections.abc import Mapping

from behaviours.leaf import Leaf
from config.diagnostics import InvalidFileError
from config.yaml_nodes import Mapping as Entries
from config.yaml_nodes import Scalar
from missions.language.nodes import (
    BRANCHES,
    FINALLY,
    FOR_EACH,
    HALT_LIMIT,
    MODIFIERS,
    OWNED_KEYS,
    RECOVER,
    RETRY,
    SWITCHES,
    WAIT_FOR,
)
from missions.language.plan import Step
from missions.plugins.interchange.foreign_trees import DIRECTIONS
from missions.plugins.interchange.mission_source import script_kind
from missions.plugins.interchange.node_kinds import KINDS, OLD_NAMES, RESULT, STEP_DESCRIPTION
from missions.plugins.interchange.report import DIFFERS, LOST
from missions.plugins.interchange.script_writer import NotAScriptError
from missions.plugins.interchange.stub_leaves import stores_several
from missions.plugins.interchange.tree_writer import TreeWriter
from missions.plugins.interchange.xml_reader import Element, parse_xml
from missions.plugins.interchange.yaml_ports import YAML_PREFIX, flow_text, is_text_argument, port_text

_ARGUMENT_TYPES = {"number": "double", "count": "int", "flag": "bool", "value": "BT::AnyTypeAllowed"}


NODE_NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")
"""Name of a node or a port that every version of BehaviorTree.CPP accepts."""


def custom_element(writer: TreeWriter, step: Step) -> Element:
    """Return the XML element of a step, but no modifier, as a custom node; its ports are the step's arguments."""
    if step.leaf is not None:
        return _custom_leaf(writer, step, step.leaf)
    if step.kind == FOR_EACH:
        return _custom_loop(writer, step)
    ports = dict[str, str]()
    if step.kind in SWITCHES:
        on = writer.argument(step, "on")
        ports = {"on": on.text if isinstance(on, Scalar) else ""}
        cases = enumerate(writer.case_entries(step), start=1)
        ports |= {f"case_{number}": port_text(case, is_text=False) for number, (case, _) in cases}
    beside = writer.mission.beside(step)
    for name in writer.settings(step):
        if (node := beside.get(name)) is not None:
            ports[name] = port_text(node, is_text=False)
    role = "Decorator" if step.kind == WAIT_FOR else "Control"
    return _custom_parent(writer, step, role, ports, writer.children(step), is_named=True)


def custom_modifier(writer: TreeWriter, step: Step, child: Element) -> Element:
    """Return the XML element of a modifier as a custom node around ``child``, the element of the modified node.

    It is a decorator; for ``recover`` and ``finally``, which have a second child, a control node.
    """
    others = [writer.element(other) for other in step.children[1:]]
    value = writer.mission.value(step)
    is_expression = MODIFIERS[step.kind].value in ("condition", "expression")
    ports = (
        {"value": value.text if is_expression else port_text(value, is_text=False)} if isinstance(value, Scalar) else {}
    )
    limit = writer.mission.beside(step).get(HALT_LIMIT)
    if others and limit is not None and step.kind == FINALLY:
        ports[HALT_LIMIT] = port_text(limit, is_text=False)
    return _custom_parent(writer, step, "Control" if others else "Decorator", ports, [child, *others])


def _custom_parent(
    writer: TreeWriter,
    step: Step,
    role: str,
    ports: Mapping[str, str],
    children: list[Element],
    *,
    is_named: bool = False,
) -> Element:
    word = step.kind
    id_ = _custom_id(writer, f"{RETRY}_{RECOVER}" if word == RETRY and role == "Control" else word, word)
    model = _model(writer, role, id_, word, BRANCHES[word].help if word in BRANCHES else MODIFIERS[word].help, step)
    for port in ports:
        _declare(model, "input_port", port, "std::string", OWNED_KEYS[port][2] if port in OWNED_KEYS else "")
    return writer.new(id_, step, ports, children, is_named=is_named)


def _custom_loop(writer: TreeWriter, step: Step) -> Element:
    value = writer.mission.value(step)
    ports = dict[str, str]()
    for name in ("in", "as", "number"):
        node = value.get(name) if isinstance(value, Entries) else None
        if isinstance(node, Scalar) and node.text.isidentifier():
            ports[name] = f"{{{node.text}}}"
        elif node is not None:
            ports[name] = YAML_PREFIX + flow_text(node)
    return _custom_parent(writer, step, "Decorator", ports, writer.children(step), is_named=True)


def _custom_leaf(writer: TreeWriter, step: Step, leaf: type[Leaf]) -> Element:
    original = _original_model(leaf)
    role = "Condition" if leaf.instant and not (leaf.drives or leaf.acts or leaf.open_ended) else "Action"
    role, wish = (role, "") if original is None else (original.tag, original.attributes.get("ID", ""))
    if leaf.node_model and original is None:
        writer.note(DIFFERS, step, "its node_model is not XML, so it has the ports of its arguments")
    if role not in ("Action", "Condition"):
        writer.note(DIFFERS, step, f"the {role} '{wish}' there is an action here")
        role, wish = "Action", ""
    id_ = _custom_id(writer, leaf.tag, leaf.tag, wish)
    if id_ != wish != "":
        writer.note(DIFFERS, step, f"'{wish}' cannot be its name in this file, so it is '{id_}'")
    model = _model(writer, role, id_, leaf.tag, _first_line(leaf), step)
    for port in () if original is None else original.children:
        name, known = port.attributes.get("name", ""), leaf.arguments.get(port.attributes.get("name", ""))
        if port.tag in DIRECTIONS and NODE_NAME.fullmatch(name):
            kind = "BT::AnyTypeAllowed" if known is None else _ARGUMENT_TYPES.get(known.kind, "std::string")
            kind = port.attributes.get("type") or kind
            _declare(model, port.tag, name, kind, port.text, port.attributes.get("default"))
    for argument in leaf.arguments.values():
        kind = _ARGUMENT_TYPES.get(argument.kind, "std::string")
        _declare(model, "input_port", _port_name(argument.name), kind, argument.help)
    if leaf.open_ended:
        _declare(model, "input_port", "values", "std::string", "values of variables, as YAML")
    result = _result_port(leaf, model)
    if leaf.output_doc and not (stores_several(leaf) and step.output_variable is None):
        kind = "std::string" if leaf.output_type is str else "BT::AnyTypeAllowed"
        _declare(model, "output_port", result, kind, leaf.output_doc)
    writer.found.leaves[id_] = None
    script = dict[str, str]()
    ports = _leaf_ports(writer, step, leaf, script)
    if step.output_variable is not None:
        ports[result] = f"{{{step.output_variable}}}"
    return writer.prepared(step, writer.new(id_, step, ports, is_named=True), script)


def _leaf_ports(writer: TreeWriter, step: Step, leaf: type[Leaf], script: dict[str, str]) -> dict[str, str]:
    """Return the ports of an exported leaf; assignments for their calculated values are added to ``script``."""
    value = writer.mission.value(step)
    if leaf.open_ended:
        return {"values": YAML_PREFIX + flow_text(value)}
    principal = next((each.name for each in leaf.arguments.values() if each.principal), "")
    is_one = not isinstance(value, Entries) or set(step.arguments_as_written) == {principal} != {*value.keys()}
    if is_one:
        entries = {principal: value} if principal in step.arguments_as_written else {}
    else:
        entries = {name.text: node for name, node in value.entries} if isinstance(value, Entries) else {}
    ports = dict[str, str]()
    for name, node in entries.items():
        argument = leaf.arguments.get(name)
        port, text = _port_name(name), port_text(node, is_text=is_text_argument(argument))
        if "${" in text:
            try:
                kind = script_kind("" if argument is None else argument.kind)
                text = writer.calculate(node, f"{leaf.tag}_{name}", kind, script)
            except NotAScriptError as reason:
                writer.note(LOST, step, f"the port '{port}' is not calculated there ({reason}): {text}")
        ports[port] = text
    return ports


def _original_model(leaf: type[Leaf]) -> Element | None:
    """Return the declaration of the node that a leaf was imported from; None without one, or if it is not XML."""
    try:
        return parse_xml(leaf.node_model.encode(errors="replace"), leaf.tag) if leaf.node_model else None
    except InvalidFileError:
        return None


def output_ports(leaf: type[Leaf]) -> list[str]:
    """Return the output ports of the node that a leaf was imported from."""
    model = _original_model(leaf)
    ports = [] if model is None else model.children
    return [port.attributes.get("name", "") for port in ports if DIRECTIONS.get(port.tag, "in") != "in"]


def _custom_id(writer: TreeWriter, name: str, word: str, wish: str = "") -> str:
    """Return the ID of the custom node for the step ``word``: ``wish`` or ``name``, unless another node has it."""
    camel = re.sub(r"\W", "", camel_case(name), flags=re.ASCII)
    wishes = (wish, camel, f"Mission{camel}", *(f"Mission{camel}{number}" for number in range(2, 10_000)))
    taken = {*KINDS, *OLD_NAMES, *writer.found.trees}
    taken |= {id_ for id_, model in writer.models.items() if not model.children[-1].text.startswith(_beginning(word))}
    return next(each for each in wishes if NODE_NAME.fullmatch(each) and each not in taken)


def _beginning(word: str) -> str:
    """Return the beginning of the description of the custom node for the step ``word``."""
    return f"{STEP_DESCRIPTION}'{word}': "


def _model(writer: TreeWriter, role: str, id_: str, word: str, help_text: str, step: Step) -> Element:
    """Return the declaration of the custom node ``id_`` in ``TreeNodesModel``, which is made at the first use.

    Its description has the step's word, by which an import finds the step again.
    """
    if id_ not in writer.models:
        text = _beginning(word) + " ".join(help_text.split())
        description = Element("description", {}, step.source, 1, text=text)
        writer.models[id_] = Element(role, {"ID": id_}, step.source, 1, children=[description])
    return writer.models[id_]


def _declare(model: Element, direction: str, name: str, kind: str, help_text: str, default: str | None = None) -> None:
    if all(port.attributes.get("name") != name for port in model.children):
        attributes = {"name": name, "type": kind, **({} if default is None else {"default": default})}
        port = Element(direction, attributes, model.source, 1, text=" ".join(help_text.split()))
        model.children.insert(len(model.children) - 1, port)


def camel_case(word: str) -> str:
    """Return a word of missions in camel case, as the ID of a node: FindFace for ``find_face``."""
    return "".join(part[:1].upper() + part[1:] for part in word.split("_"))


def _port_name(argument: str) -> str:
    """Return the port for an argument; ``name`` and ``ID``, which BehaviorTree.CPP reserves, get a suffix."""
    return f"{argument}_" if argument in ("name", "ID") else argument


def _result_port(leaf: type[Leaf], model: Element) -> str:
    """Return the output port for the result of a leaf: the first that ``model`` declares, or one of its own."""
    outputs = [port.attributes["name"] for port in model.children if DIRECTIONS.get(port.tag, "in") != "in"]
    if outputs and not stores_several(leaf):
        return outputs[0]
    return f"{RESULT}_" if RESULT in leaf.arguments else RESULT


def _first_line(leaf: type[Leaf]) -> str:
    return (leaf.__doc__ or "").strip().split("\n")[0]
