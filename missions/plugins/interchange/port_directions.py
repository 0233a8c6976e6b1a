"""Directions of the ports of leaves, input or output: declared, known from tables, or guessed from their use."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import suppress

from missions.plugins.interchange.blackboard import codes_of, entry_of
from missions.plugins.interchange.foreign_trees import (
    ForeignProject,
    NodeModel,
    PortModel,
    SourceTree,
    call_ports,
    normal_form,
    ports_of,
)
from missions.plugins.interchange.leaf_rules import LeafRule
from missions.plugins.interchange.node_kinds import (
    CONDITIONS,
    KINDS,
    NAV2_OUTPUTS,
)
from missions.plugins.interchange.scripts import Script, ScriptError, parse_script
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import is_pointer

INPUT_NAMES = ("input", "in_", "target", "goal", "start")
"""Beginnings of port names that are taken for inputs, even if the port seems to be an output by its use."""

PRODUCERS = ("get", "find", "compute", "calculate", "generate", "detect", "load", "read", "next")
"""Beginnings of the names of leaves, in lower case, to which ``INPUT_NAMES`` do not apply: ``GetGoalPose``."""

Mention = tuple[str, str, str]
"""A use of a blackboard entry: the kind of node that uses it, the port, and the entry.

The kind is empty for nodes other than leaves.
"""


def model_of(project: ForeignProject, name: str, rules: Mapping[str, LeafRule]) -> NodeModel:
    """Return the declaration of the node ``name``: from the XML files, from the tables of leaves, or guessed."""
    model = project.models.get(name) or NodeModel("Condition" if name in CONDITIONS else "")
    known = rules[name].outputs if name in rules else ()
    if not model.ports:
        known = (*known, *NAV2_OUTPUTS.get(name, ()), *sorted(project.guessed_outputs.get(name, ())))
    return NodeModel(model.role, {**model.ports, **{port: PortModel("out") for port in known}}, model.word)


def find_used_outputs(project: ForeignProject, rules: Mapping[str, LeafRule]) -> dict[str, dict[str, PortModel]]:
    """Return the output ports that are connected to a blackboard entry in any tree, by the kind of their node."""
    found = defaultdict[str, dict[str, PortModel]](dict)
    for tree in project.trees():
        for element in tree.elements():
            kind, _ = normal_form(element, project)
            if kind == "SubTree":  # one without a tree is a stub with the name of the tree
                kind = element.attributes.get("ID", "").strip()
            model = model_of(project, kind, rules)
            for port, value in ports_of(element).items():
                if is_pointer(value) and model.port(port).direction != "in":
                    found[kind][port] = model.port(port)
    return found


def guess_outputs(project: ForeignProject, rules: Mapping[str, LeafRule]) -> dict[str, set[str]]:
    """Return the ports that seem to be outputs, by the ID of their leaf, for leaves without a declaration.

    A port seems to be an output if its leaf is the first node of the tree that names a blackboard entry, another port
    names the entry later, no script of the tree sets it, and no other tree passes it in.
    """
    given = _entries_given_by_others(project)
    outputs, inputs = set[tuple[str, str]](), set[tuple[str, str]]()
    for tree in project.trees():
        first: dict[str, Mention] = {}
        known = _set_entries(project, tree) | given[id(tree)]
        for mention in _mentions(project, tree):
            kind, port, entry = mention
            before = first.setdefault(entry, mention)
            if before[:2] != mention[:2]:
                inputs.add((kind, port))
                if entry not in known:
                    outputs.add(before[:2])
            elif entry in known:
                inputs.add((kind, port))
    found = defaultdict[str, set[str]](set)
    for kind, port in outputs - inputs:
        if kind and _is_undeclared(project, kind, rules) and not _is_input(kind, port, rules):
            found[kind].add(port)
    return dict(found)


def _is_input(kind: str, port: str, rules: Mapping[str, LeafRule]) -> bool:
    """Return whether the table of leaves or the name of a port says that it is an input."""
    in_table = kind in rules and port in rules[kind].ports
    return in_table or (port.startswith(INPUT_NAMES) and not kind.lower().startswith(PRODUCERS))


def _is_undeclared(project: ForeignProject, kind: str, rules: Mapping[str, LeafRule]) -> bool:
    has_model = kind in project.models and bool(project.models[kind].ports)
    has_outputs = kind in rules and bool(rules[kind].outputs)
    return not has_model and not has_outputs and kind not in NAV2_OUTPUTS and kind not in KINDS


def _mentions(project: ForeignProject, tree: SourceTree) -> Iterator[Mention]:
    """Yield all uses of blackboard entries in the ports and scripts of a tree, in the order of its nodes."""
    for element in tree.elements():
        kind, _ = normal_form(element, project)
        is_leaf = kind not in KINDS and not element.children
        for name, script in _scripts(element, kind):
            yield from (("", name, entry) for entry in script.reads)
        for name, value in ports_of(element).items():
            if is_pointer(value):
                yield (kind if is_leaf else ""), name, entry_of(value, name)


def _scripts(element: Element, kind: str) -> Iterator[tuple[str, Script]]:
    for name, code in codes_of(element, kind).items():
        with suppress(ScriptError):  # the translation of the node reports it
            yield name, parse_script(code)


def _set_entries(project: ForeignProject, tree: SourceTree) -> set[str]:
    """Return the blackboard entries that the scripts and SetBlackboard nodes of a tree set."""
    found = set[str]()
    for element in tree.elements():
        kind, _ = normal_form(element, project)
        if kind == "SetBlackboard":
            found.add(entry_of(element.attributes.get("output_key", "")))
        for _, script in _scripts(element, kind):
            found |= {each.entry for each in script.assignments}
    return found


def _entries_given_by_others(project: ForeignProject) -> dict[int, set[str]]:
    """Return the blackboard entries that SubTree nodes of other trees pass to a tree, by the tree's Python ``id``."""
    found = defaultdict[int, set[str]](set)
    for tree in project.trees():
        for element in tree.elements():
            inner = project.find_tree(element.attributes.get("ID", ""), tree.file)
            if normal_form(element, project)[0] == "SubTree" and inner is not None:
                found[id(inner)] |= call_ports(project, inner, element).keys()
    return found
