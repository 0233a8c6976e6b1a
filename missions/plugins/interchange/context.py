"""Context for the translation of one tree, and functions that create steps which several kinds of nodes need.

The context has the names of variables, the kinds of their values, the stub leaves and the report.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Literal

from behaviours.leaf import Leaf
from missions.plugins.interchange.blackboard import EntryKinds, SubtreeCall, VariableNames, entry_of
from missions.plugins.interchange.foreign_trees import ForeignProject, SourceTree, normal_form
from missions.plugins.interchange.leaf_rules import LeafRule
from missions.plugins.interchange.mission_text import Computed, MissionStep, Verbatim, snake_word
from missions.plugins.interchange.node_kinds import KINDS, OLD_PORTS
from missions.plugins.interchange.report import LOST, RENAMED, STUB, WRITTEN, ImportReport
from missions.plugins.interchange.scripts import (
    FLAG,
    LOGIC,
    NUMBER,
    Assignment,
    Formula,
    Script,
    ScriptError,
    as_condition,
    parse_script,
)
from missions.plugins.interchange.stub_leaves import StubTable
from missions.plugins.interchange.xml_reader import Element

SkipAs = Literal["success", "failure", "running"]
"""How a parent treats a skipped child: like a success, like a failure, or like a child that is still running."""

TranslateNode = Callable[["TreeContext", Element, SkipAs, str], MissionStep]
"""Function that translates an XML node and all nodes below it to a step.

Its arguments are the context, the node, how the parent treats a skipped child, and the kind of the parent, such as
"ReactiveSequence".
"""


class TreeContext:
    """Translation of one tree to steps of a mission, ``root``, and all that it needs: names, stub leaves, report.

    All trees of an import share ``kinds``, ``stubs`` and ``report``. ``rules`` say which of the ``leaves`` of missions
    replace leaves of the tree. ``translate_node`` translates a node of any kind; the translations of parents call it
    for their children. ``names`` are the variables, ``entries`` has the blackboard entry of each. ``calls`` are the
    ``mission`` steps of SubTree nodes, ``initial`` the values of variables that the translation adds.
    """

    def __init__(
        self,
        project: ForeignProject,
        tree: SourceTree,
        kinds: EntryKinds,
        rules: Mapping[str, LeafRule],
        stubs: StubTable,
        leaves: Mapping[str, type[Leaf]],
        report: ImportReport,
        translate_node: TranslateNode,
    ) -> None:
        self.project, self.tree, self.rules, self.stubs, self.report = project, tree, rules, stubs, report
        self.leaves = leaves
        self.kinds = kinds.of(tree)
        self._translate_node = translate_node
        self.names = VariableNames(is_main=tree.is_main)
        self.entries: dict[str, str] = {}
        self.calls: list[tuple[MissionStep, SubtreeCall]] = []
        self.initial: dict[str, object] = {}
        self.root = MissionStep("succeed")

    def translate(self) -> None:
        """Translate the whole tree."""
        if self.tree.body is not None:
            self.root = self.node(self.tree.body, "success", "")
        for entry, name in self.names.renamed.items():
            self.report.add(RENAMED, self.tree.element, f"the entry '{entry}' is the variable '{name}'", self.tree.id)

    def node(self, element: Element, skip_as: SkipAs, parent: str) -> MissionStep:
        """Translate a node, with its pre- and postconditions; ``parent`` is the kind of the node above it."""
        return self._translate_node(self, element, skip_as, parent)

    def fresh_name(self, element: Element, default: str, suffix: str) -> str:
        """Return a variable that the tree does not use, such as ``dock_done`` for the node ``dock`` and "done".

        It begins with the node's name, or with ``default`` if the node has none.
        """
        return self.names.fresh(f"{snake_word(element.attributes.get('name') or default, 'node')}_{suffix}")

    def children(self, element: Element, skip_as: SkipAs) -> list[MissionStep]:
        kind, _ = normal_form(element, self.project)
        return [self.node(child, skip_as, kind) for child in element.children]

    def add_name(self, step: MissionStep, element: Element) -> MissionStep:
        name = element.attributes.get("name", "").strip()
        if name and name != element.attributes.get("ID") and name not in (element.tag, step.word):
            step.keys = {"name": name, **step.keys}
        return step

    def add_outer_name(self, step: MissionStep, element: Element) -> MissionStep:
        """Give ``step`` the name of a node around it that has no step of its own, unless the step has a name."""
        name = element.attributes.get("name", "").strip()
        if name and name != element.tag and "name" not in step.keys and step.word != "mission":
            step.keys = {"name": name, **step.keys}
            step.remarks = {key: remark for key, remark in step.remarks.items() if remark != name}
        return step

    def port(self, element: Element, kind: str, port: str) -> str:
        """Return the value of a node's port, which may be written with an older name; otherwise its default."""
        for name, value in element.attributes.items():
            if name == port or OLD_PORTS.get((kind, name)) == port:
                return value.strip()
        return KINDS[kind].ports.get(port, "")

    def variable(self, entry: str) -> str:
        name = self.names.name(entry)
        self.entries.setdefault(name, entry.removeprefix("@") if self.tree.is_main else entry)
        return name

    def pointer(self, value: str, port: str) -> str:
        """Return the name of the variable for a port's ``value`` that names a blackboard entry: ``{x}``."""
        return self.variable(entry_of(value, port))

    def condition(self, element: Element, code: str) -> Formula | None:
        script = self.script(element, code)
        if script is None or script.condition is None or script.assignments:
            self.report.add(LOST, element, f"the condition '{code}'")
            return None
        return as_condition(script.condition)

    def report_stub(self, element: Element, tag: str, kind: str, more: str = "") -> None:
        """Report the stub leaf of a node, or the leaf that its author has made of the stub."""
        if tag in self.stubs.written:
            self.report.add(WRITTEN, element, f"the leaf '{tag}'{more}", kind)
        else:
            self.report.add(STUB, element, f"the stub leaf '{tag}'{more}", kind)

    def script(self, element: Element, code: str) -> Script | None:
        """Return the parsed script ``code``; None if missions cannot express it, which is reported."""
        try:
            return parse_script(code, self.variable, self.kinds)
        except ScriptError as error:
            self.report.add(LOST, element, f"the script '{code}': {error}")
            return None

    def variables_of(self, formula: Formula) -> tuple[str, ...]:
        return tuple(dict.fromkeys(self.variable(entry) for entry in formula.reads))

    def set_steps(self, assignments: Iterable[Assignment]) -> list[MissionStep]:
        """Return ``set`` steps for the assignments of a script, as few as possible.

        An assignment that reads a variable which the script has set before needs a step of its own.
        """
        steps = list[MissionStep]()
        for each in assignments:
            name = self.variable(each.entry)
            reads = self.variables_of(each.formula)
            last = steps[-1] if steps else None
            if last is None or name in last.sets or set(reads) & set(last.sets):
                last = MissionStep("set", {})
                steps.append(last)
            if isinstance(last.value, dict):
                last.value[name] = assigned_value(each.formula, self.kinds.get(each.entry))
            last.reads = tuple(dict.fromkeys((*last.reads, *reads)))
            last.sets = (*last.sets, name)
        return steps


def assigned_value(formula: Formula, kind: str | None) -> object:
    """Return the new value in an assignment as a value for ``set``; ``kind`` is the kind of the variable's values."""
    constant = formula.constant
    if isinstance(constant, bool):
        return int(constant) if kind == NUMBER else constant
    if isinstance(constant, float):
        return bool(constant) if kind == FLAG and constant in (0, 1) else constant
    if isinstance(constant, str):
        return constant
    if formula.is_template:
        words = (part.constant if isinstance(part.constant, str) else f"${{{part.text}}}" for part in formula.parts)
        return Verbatim(json.dumps("".join(words), ensure_ascii=False))
    if kind == NUMBER and formula.kind == FLAG:
        return Computed(f"1 if {formula.within(LOGIC)} else 0")
    return Computed(formula.text)


def set_step(values: dict[str, object]) -> MissionStep:
    """Return a step that sets variables."""
    return MissionStep("set", values, sets=tuple(values))


def fail_again() -> MissionStep:
    """Return a ``fail`` step whose reason is that of the failure before it."""
    return MissionStep("fail", Computed("failure"))


def wrap_in(step: MissionStep, word: str, children: list[MissionStep]) -> MissionStep:
    """Return a composite ``word`` with these children; it takes over the comments of ``step``, one of them."""
    return MissionStep(word, children, comments=take_comments(step))


def take_comments(step: MissionStep) -> list[str]:
    """Remove the comments of a step and return them; a new step around it then has them."""
    comments, step.comments = step.comments, []
    return comments


def copies(steps: list[MissionStep]) -> list[MissionStep]:
    """Return copies of steps that a mission runs at a second place of the tree."""
    return [MissionStep(step.word, step.value, dict(step.keys), reads=step.reads, sets=step.sets) for step in steps]


def with_outputs(
    step: MissionStep, outputs: dict[str, str], *, several: bool, fresh: Callable[[str], str]
) -> MissionStep:
    """Return a step that runs the leaf ``step`` and stores its outputs; ``outputs`` has a variable for each port.

    The only output of a leaf is stored by ``as``. With ``several``, the leaf returns a mapping, which ``as`` stores in
    a variable named by ``fresh``; a ``set`` step after it stores each output.
    """
    if not outputs:
        return step
    if not several:
        variable = next(iter(outputs.values()))
        step.keys["as"] = variable
        step.sets = (variable,)
        return step
    found = fresh(f"{step.word}_result")
    step.keys["as"] = found
    step.sets = (found,)
    values: dict[str, object] = {variable: Computed(f"{found}.{port}") for port, variable in outputs.items()}
    stored = MissionStep("set", values, reads=(found,), sets=tuple(values))
    return MissionStep("sequence", [step, stored])


def description_of(element: Element) -> list[str]:
    """Return the note that an editor stored in the attribute ``_description`` of a node, as a list of comments."""
    text = element.attributes.get("_description", "").strip()
    return [text] if text else []


def remark_of(element: Element, child: MissionStep) -> str:
    """Return the name of a decorator, as a comment behind the modifier that replaces it; empty if it says nothing new.

    ``child`` is the step of the decorator's child.
    """
    name = element.attributes.get("name", "").strip()
    return "" if name in ("", element.tag, child.keys.get("name")) else name


def skip_in(word: str) -> SkipAs:
    """Return how the composite ``word`` of a mission treats a skipped child."""
    return "failure" if word.endswith("selector") else "success"


def quantity(number: float, unit: str) -> Verbatim:
    """Return a number with a unit, such as ``2 s``; a time below 1 s is written in milliseconds."""
    if unit == "s" and abs(number) < 1:
        number, unit = number * 1000, "ms"
    return Verbatim(f"{round(number, 9):.12g} {unit}")
