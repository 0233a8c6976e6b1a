"""Import of a project of BehaviorTree.CPP: texts of missions from its trees, stubs of its leaves, and the report."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from behaviours.leaf import Leaf
from config.diagnostics import did_you_mean
from config.yaml_writer import yaml_word
from missions.language.nodes import BOTH_ENDS, MISSION, Ends
from missions.plugins.interchange.blackboard import (
    ANY_VALUE,
    Dataflow,
    EntryKinds,
    MissionInterface,
    constant_value,
    fill_call,
    give_missing_params,
)
from missions.plugins.interchange.context import TreeContext
from missions.plugins.interchange.dead_steps import DeadStepRemover
from missions.plugins.interchange.foreign_trees import GENERIC_TREE_NAMES, ForeignProject, project_of, read_project
from missions.plugins.interchange.leaf_rules import LEAF_RULES, LeafRule
from missions.plugins.interchange.mission_text import MissionStep, mission_text, params_text, snake_word
from missions.plugins.interchange.own_nodes import header_of
from missions.plugins.interchange.port_directions import find_used_outputs, guess_outputs
from missions.plugins.interchange.python_trees import load_tree, tree_element
from missions.plugins.interchange.report import DIFFERS, LOST, UNUSED, ImportReport, Remark
from missions.plugins.interchange.stub_leaves import StubTable, stub_file_text
from missions.plugins.interchange.translation import translate_node
from missions.plugins.interchange.yaml_ports import entries_of, is_pointer

MISSION_SUFFIX = ".yaml"
STUB_FOLDER = "behaviours"
REPORT_NAME = "IMPORTED.md"


@dataclass(slots=True)
class ImportedProject:
    """Result of an import: the text of each file to write, by its path in the output folder, and the report.

    ``missions`` and ``stubs`` are the numbers of missions and of stub leaves.
    """

    files: dict[str, str] = field(default_factory=dict)
    report: ImportReport = field(default_factory=ImportReport)
    missions: int = 0
    stubs: int = 0


def import_trees(
    path: Path,
    leaves: Mapping[str, type[Leaf]],
    rules: Mapping[str, LeafRule] | None = None,
    written: Collection[str] = (),
) -> ImportedProject:
    """Read an XML file or a folder of them, and return the missions of its trees, without writing them.

    ``leaves`` are the leaves of missions by tag; ``rules`` replace leaves of the other program by them, in addition to
    ``LEAF_RULES``. ``written`` are the tags of stubs of earlier imports that are leaves now. Raises InvalidFileError.
    """
    imported = ImportedProject()
    project = read_project(path, imported.report)
    return import_project(imported, project, path, leaves, rules, written)


def import_python_tree(
    target: str,
    leaves: Mapping[str, type[Leaf]],
    rules: Mapping[str, LeafRule] | None = None,
    written: Collection[str] = (),
) -> ImportedProject:
    """Return the mission of a tree of py_trees that a function builds: ``module:function`` or ``file.py:function``.

    The module is imported, and the function is called. Raises PythonTreeError.
    """
    imported = ImportedProject()
    root = tree_element(load_tree(target), target, imported.report)
    path = Path(f"{target.rpartition(':')[2]}.py")
    return import_project(imported, project_of(root, path, imported.report), path, leaves, rules, written)


def import_project(
    imported: ImportedProject,
    project: ForeignProject,
    path: Path,
    leaves: Mapping[str, type[Leaf]],
    rules: Mapping[str, LeafRule] | None,
    written: Collection[str],
) -> ImportedProject:
    """Add the missions of a project to the result of an import; ``path`` names the file of its stubs."""
    names = _mission_names(project)
    kinds = EntryKinds(project)
    table = {**LEAF_RULES, **(rules or {})}
    project.guessed_outputs = guess_outputs(project, table)
    stubs = StubTable(leaves, find_used_outputs(project, table), written)
    translated = {
        id(tree): TreeContext(project, tree, kinds, table, stubs, leaves, imported.report, translate_node)
        for tree in project.trees()
        if tree.body is not None
    }
    for each in translated.values():
        each.translate()
    _report_unused_rules(rules or {}, project, stubs, imported.report)
    interfaces = _connect(project, translated, names, imported.report)
    _remove_dead_steps(translated, leaves, stubs, imported.report)
    for key, each in translated.items():
        imported.files[f"{names[key]}{MISSION_SUFFIX}"] = _text(each, interfaces[key], names[key])
    imported.missions = len(translated)
    imported.stubs = len(stubs.stubs)
    if stubs.stubs:
        stem = snake_word(path.stem) or "imported"
        file = f"{STUB_FOLDER}/{stem}.py"
        imported.files[file] = stub_file_text(path.name, stubs.stubs.values(), file)
    imported.files[REPORT_NAME] = imported.report.markdown(f"Import of {path.name}")
    return imported


def _report_unused_rules(
    rules: Mapping[str, LeafRule], project: ForeignProject, stubs: StubTable, report: ImportReport
) -> None:
    """Report the leaves and ports in the user's table of leaves that no tree has."""
    for name, rule in rules.items():
        if name not in stubs.ports:
            texts = [_with_hint(f"no tree has a leaf '{name}'", name, stubs.ports)]
        else:
            model = project.models.get(name)
            known = stubs.ports[name].union(() if model is None else model.ports)
            unknown = [port for port in (*rule.ports, *rule.outputs) if port not in known]
            texts = [_with_hint(f"no node '{name}' has a port '{port}'", port, known) for port in unknown]
        for text in texts:
            report.remarks[Remark(UNUSED, rule.place, "", text)] = None


def _with_hint(text: str, word: str, known: Collection[str]) -> str:
    hint = did_you_mean(word, known)
    return f"{text}; {hint}" if hint else text


def _mission_names(project: ForeignProject) -> dict[int, str]:
    """Return the name of each tree's mission, by the Python ``id`` of the tree.

    It is the ID of the tree, or the name of its file if the ID is a general word, such as "MainTree".
    """
    found, taken = dict[int, str](), set[str]()
    trees = list(project.trees())
    often = [snake_word(tree.id) for tree in trees]
    for tree in trees:
        word, stem = snake_word(tree.id), snake_word(tree.file.path.stem)
        alone = len(tree.file.trees) == 1 or tree.is_main
        generic = word.replace("_", "") in GENERIC_TREE_NAMES or not word
        wishes = [stem] if generic and alone else [word] if often.count(word) == 1 else [f"{stem}_{word}", word]
        wishes += [f"{stem}_{word}", *(f"{stem}_{word}_{number}" for number in range(2, len(trees) + 3))]
        name = next(wish for wish in wishes if wish and wish not in taken)
        taken.add(name)
        found[id(tree)] = name
    return found


def _connect(
    project: ForeignProject, translated: Mapping[int, TreeContext], names: Mapping[int, str], report: ImportReport
) -> dict[int, MissionInterface]:
    """Fill in all ``mission`` steps, those of called trees first; return the interface of each mission.

    All mappings are by the Python ``id`` of the tree.
    """
    interfaces: dict[int, MissionInterface] = {}
    for key in translated:
        _connect_tree(project, key, translated, interfaces, names, report, ())
    for key, each in translated.items():
        _set_unset_variables(each, interfaces[key])
        for step, call in each.calls:
            if id(call.tree) in interfaces and step.word == MISSION:
                for name in give_missing_params(step, interfaces[id(call.tree)]):
                    text = f"'{call.tree.id}' reads '{name}', which no node sets here: it gets null"
                    report.add(DIFFERS, call.element, text, "SubTree")
    return interfaces


def _connect_tree(
    project: ForeignProject,
    key: int,
    translated: Mapping[int, TreeContext],
    interfaces: dict[int, MissionInterface],
    names: Mapping[int, str],
    report: ImportReport,
    chain: tuple[int, ...],
) -> None:
    if key in interfaces:
        return
    each = translated[key]
    for step, call in each.calls:
        inner = id(call.tree)
        if inner in (*chain, key):
            report.add(LOST, call.element, f"the tree '{call.tree.id}' runs itself: it fails here", "SubTree")
            step.word, step.value = "fail", f"the tree {call.tree.id} runs itself"
            continue
        _connect_tree(project, inner, translated, interfaces, names, report, (*chain, key))
        step.value = names[inner]
        if call.tree.header:
            continue  # its ports are those of the call
        fill_call(step, call, interfaces[inner], each.names, translated[inner].entries)
        for variable in (*step.reads, *step.sets):
            each.entries.setdefault(variable, _entry_behind(each, variable))
        for port in (*call.entries, *call.constants):
            if port not in translated[inner].entries.values():
                report.add(LOST, call.element, f"the port '{port}', which the tree does not use", "SubTree")
    interfaces[key] = _interface(project, each)


def _entry_behind(tree: TreeContext, variable: str) -> str:
    return next((entry for entry, name in tree.names.known().items() if name == variable), variable)


def _interface(project: ForeignProject, each: TreeContext) -> MissionInterface:
    if each.tree.header:
        params, results = (dict.fromkeys(entries_of(each.tree.header.get(key))) for key in ("params", "returns"))
        return MissionInterface(dict(params), results, set(), dict.fromkeys(params))
    flow = Dataflow()
    start = frozenset(each.initial)
    after = flow.follow(each.root, start)
    found = MissionInterface(flow.needs, flow.sets, set(after) - start)
    for variable in flow.needs:
        if variable not in flow.sets:
            found.params[variable] = ANY_VALUE
    defaults = each.tree.port_defaults(project.models)
    for variable, entry in each.entries.items():
        if entry in defaults and not is_pointer(defaults[entry]):
            found.params[variable] = constant_value(defaults[entry])
    return found


def _remove_dead_steps(
    translated: Mapping[int, TreeContext], leaves: Mapping[str, type[Leaf]], stubs: StubTable, report: ImportReport
) -> None:
    """Remove the steps that are never reached from all missions, and report them.

    A called mission comes before its callers, since its possible results decide which steps of the caller are reached.
    """
    instant = frozenset(stub.tag for stub in stubs.stubs.values() if stub.is_instant)
    callees = {id(step): id(call.tree) for each in translated.values() for step, call in each.calls}
    ends: dict[int, Ends] = {}

    def ends_of_mission(step: MissionStep) -> Ends:
        key = callees.get(id(step))
        return BOTH_ENDS if key is None else ends_of_tree(key)

    def ends_of_tree(key: int) -> Ends:
        if key not in ends:
            ends[key] = BOTH_ENDS  # in case a tree runs itself
            if not translated[key].tree.header:  # the checker has accepted ours
                ends[key] = DeadStepRemover(leaves, instant, ends_of_mission, report).clean(translated[key].root)
        return ends[key]

    for key in translated:
        ends_of_tree(key)


def _set_unset_variables(each: TreeContext, interface: MissionInterface) -> None:
    """Set the variables that a mission reads before it sets them, and that are no params, to null at its start."""
    if each.tree.header:
        return
    unset = {name: None for name in interface.needs if name not in interface.params and name not in each.initial}
    initial = {**each.initial, **unset}
    if initial:
        first = MissionStep("set", dict(initial), sets=tuple(initial))
        root = each.root
        following = root.branches[0] if root.word == "sequence" and not root.keys.keys() - {"name"} else None
        if following is not None and following.word == "set" and not (following.keys or following.reads):
            following.value = {**initial, **(following.value if isinstance(following.value, dict) else {})}
        elif root.word == "sequence" and not root.keys.keys() - {"name"} and isinstance(root.value, list):
            root.value.insert(0, first)
        else:
            comments, root.comments = root.comments, []
            each.root = MissionStep("sequence", [first, root], comments=comments)


def _text(each: TreeContext, interface: MissionInterface, name: str) -> str:
    tree = each.tree
    comments = tuple(tree.file.root.comments) if tree.is_main or len(tree.file.trees) == 1 else ()
    header = dict(header_of(tree))
    if not header:
        header["mission"] = f" {yaml_word(name)}"
        outside = [variable for variable in interface.params if tree.is_main and variable not in interface.sets]
        if interface.params:
            header["params"] = params_text(interface.params, dict.fromkeys(outside, "set by the program"))
    if tree.id not in (name, header["mission"].strip()) and len(tree.id.split()) == 1:
        header["mission"] += f"  # {tree.id}"
    return mission_text(
        each.root,
        header,
        comments=(*comments, *tree.element.comments),
        last_comments=(*tree.element.last_comments, *(tree.file.root.last_comments if comments else ())),
    )
