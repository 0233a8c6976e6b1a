"""Writer of the XML elements of exported steps, with names and comments, and the remarks of the export."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from config.diagnostics import SourceText
from config.yaml_nodes import Mapping as Entries
from config.yaml_nodes import Node, Scalar
from missions.language.nodes import COMPOSITES, MISSION, MODIFIER_KEYS, MODIFIERS
from missions.language.plan import Step
from missions.plugins.interchange.mission_source import MissionSource
from missions.plugins.interchange.node_kinds import MARK, PREPARED
from missions.plugins.interchange.report import DIFFERS, LOST, Remark, grouped_lines
from missions.plugins.interchange.script_writer import NotAScriptError, script_value, value_of
from missions.plugins.interchange.xml_reader import Element

CUSTOM = "custom"
LEAVES = "Actions and conditions, for which BehaviorTree.CPP needs classes of yours"
EXPLANATIONS = {
    LOST: "Without effect there, but kept in the file for an import",
    CUSTOM: "Custom nodes, for which BehaviorTree.CPP needs a class of yours",
    DIFFERS: "Carried over with a difference",
}


@dataclass(slots=True)
class ExportedTree:
    """Result of an export: the ``text`` of the XML file, and remarks on all that needs attention in BehaviorTree.CPP.

    ``leaves`` are the IDs of custom actions and conditions, for which the user needs C++ classes. ``trees`` are the
    IDs of the trees. ``native`` and ``custom`` count the steps that became nodes of BehaviorTree.CPP and custom nodes.
    """

    text: str = ""
    remarks: dict[Remark, None] = field(default_factory=dict)
    leaves: dict[str, None] = field(default_factory=dict)
    trees: dict[str, None] = field(default_factory=dict)
    native: int = 0
    custom: int = 0

    def lines(self) -> list[str]:
        """Return the remarks as lines of text, grouped by the kind of remark."""
        leaves = [f"{LEAVES}: {', '.join(self.leaves)}"] if self.leaves else []
        return [*leaves, *grouped_lines(self.remarks, EXPLANATIONS)]


class TreeWriter:
    """Writes the XML elements for the steps of one mission; ``write`` is the function that translates any step.

    All missions of an export share ``found``, the result with the remarks, and ``models``, the declarations of custom
    nodes by ID.
    """

    def __init__(
        self,
        mission: MissionSource,
        write: Callable[["TreeWriter", Step], Element],
        found: ExportedTree,
        models: dict[str, Element],
    ) -> None:
        self.mission, self.found, self.models = mission, found, models
        self._write = write

    def element(self, step: Step) -> Element:
        """Return the XML element of a step and its modifiers, with the comments above the step in the mission file."""
        behaviour = step
        while behaviour.kind in MODIFIERS:
            behaviour = behaviour.children[0]
        comments = self.mission.comments(behaviour)
        element = self.build(step)
        element.comments = [*comments, *element.comments]
        return element

    def build(self, step: Step) -> Element:
        """Return the XML element of a step, without the comments above the step."""
        return self._write(self, step)

    def children(self, step: Step) -> list[Element]:
        return [self.element(child) for child in step.children]

    def new(
        self,
        tag: str,
        step: Step,
        attributes: Mapping[str, str] | None = None,
        children: Collection[Element] = (),
        *,
        is_named: bool = False,
    ) -> Element:
        """Return a new XML element for a step; if ``is_named``, with the name that the step has in the mission."""
        found = dict(attributes or {})
        name = self.mission.beside(step).get("name") if is_named else None
        if isinstance(name, Scalar):
            found = {**({"ID": found.pop("ID")} if "ID" in found else {}), "name": name.text, **found}
        return Element(tag, found, step.source, step.mark.line, children=list(children))

    def settings(self, step: Step) -> list[str]:
        """Return the keys beside a composite that are settings, such as ``success_count``."""
        others = (step.kind, "name", *MODIFIERS, *MODIFIER_KEYS)
        return [name for name in self.mission.beside(step).keys() if name not in others]  # noqa: SIM118 - no dict

    def argument(self, step: Step, name: str) -> Node:
        """Return the YAML node of a step's argument ``name``: the value of this key, or the only value of the step."""
        value = self.mission.value(step)
        inner = value.get(name) if isinstance(value, Entries) else None
        return value if inner is None else inner

    def case_entries(self, step: Step) -> list[tuple[Scalar, Node]]:
        value = self.mission.value(step)
        cases = value.get("cases") if isinstance(value, Entries) else None
        return cases.entries if isinstance(cases, Entries) else []

    def calculate(self, node: Node, variable: str, kind: str, script: dict[str, str]) -> str:
        """Add an assignment of the value in ``node`` to ``script``, and return the pointer to the new variable.

        ``variable`` is the wish for its name, ``kind`` the kind of the value. Raises NotAScriptError if a script
        cannot calculate it.
        """
        kinds = self.mission.kinds
        value = script_value(value_of(node), kinds, kind)
        wishes = (variable, *(f"{variable}_{number}" for number in range(2, 10_000)))
        name = next(each for each in wishes if each not in kinds)
        kinds[name] = kind
        script[name] = value
        return f"{{{name}}}"

    def prepared(self, step: Step, element: Element, script: Mapping[str, str]) -> Element:
        """Return ``element`` behind a Script with the assignments of ``script``; alone if there are none."""
        if not script:
            return element
        code = "; ".join(f"{name} := {value}" for name, value in script.items())
        return self.new("Sequence", step, {MARK: PREPARED}, [self.new("Script", step, {"code": code}), element])

    def require_unskipped(self, step: Step) -> None:
        if can_be_skipped(step.children[0]):
            raise NotAScriptError(f"'{step.kind}' around a skipped node")

    def note(self, kind: str, step: Step, text: str) -> None:
        self.note_at(kind, step.source, step.mark.line, step.kind, text)

    def note_at(self, kind: str, source: SourceText, line: int, subject: str, text: str) -> None:
        self.found.remarks[Remark(kind, f"{Path(source.name).name}:{line}", subject, text)] = None


def can_be_skipped(step: Step) -> bool:
    """Return whether a step may end as skipped, because of an ``if``; a mission that is skipped succeeds instead."""
    if step.kind == "if":
        return True
    if step.leaf is not None or step.kind == MISSION:
        return False
    if step.kind in COMPOSITES:
        return all(map(can_be_skipped, step.children))
    return any(map(can_be_skipped, step.children if step.kind not in MODIFIERS else step.children[:1]))
