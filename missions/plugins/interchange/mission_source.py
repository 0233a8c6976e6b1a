"""A mission that is exported: the nodes of its YAML file, its params, and the kinds of values of its variables."""

import re
from dataclasses import dataclass, field

from config.diagnostics import SourceText
from config.units import parse_quantity
from config.yaml_nodes import Listing, Node, Scalar, compose
from config.yaml_nodes import Mapping as Entries
from missions.language.expressions import Value
from missions.language.for_each import steps_in_scope
from missions.language.param_types import NAME_TYPES
from missions.language.plan import Step
from missions.plugins.interchange.node_kinds import HEADER_KEYS
from missions.plugins.interchange.script_writer import (
    ANY,
    FLAG,
    FRACTION,
    OTHER,
    TEXT,
    WHOLE,
    value_of,
    variable_kinds,
)
from missions.plugins.interchange.yaml_ports import YAML_PREFIX, flow_text

REMARK = re.compile(r"""[\s-]*(\w+):\s+(?:"(?:[^"\\]|\\.)*"|'(?:[^']|'')*'|[^"'{}\[\]#\s][^{}\[\]#]*)\s#\s+(.*)""")
"""Line of a mission file with a key, a value and a comment."""

TREE_ID = re.compile(r"^mission:[^#\n]*\s#\s+([A-Za-z][A-Za-z0-9_]*)\s*$", re.MULTILINE)
"""First line of an imported mission, with the ID of its tree as a comment."""


@dataclass(frozen=True, slots=True)
class MissionParam:
    """A param of an exported mission: the kind of its values in scripts, its default in YAML, and its description."""

    kind: str
    default: Node | None = None
    help: str = ""


@dataclass(slots=True)
class MissionSource:
    """A mission that becomes a tree: ``tree`` is its root step, ``id`` the ID of the tree, ``root`` its YAML file.

    ``nodes`` has, by line and column of a key, its YAML mapping and its value; ``lines`` are the lines of the file.
    ``kinds`` are the kinds of the variables' values in scripts.
    """

    id: str
    tree: Step
    source: SourceText
    root: Entries
    is_main: bool
    kinds: dict[str, str] = field(default_factory=dict)
    params: dict[str, "MissionParam"] = field(default_factory=dict)
    nodes: dict[tuple[int, int], tuple[Entries, Node]] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    def beside(self, step: Step) -> Entries:
        """Return the YAML mapping whose key is the word of a step; empty for a step that is only a word."""
        found = self.nodes.get((step.mark.line, step.mark.column))
        return Entries(step.mark) if found is None else found[0]

    def value(self, step: Step) -> Node:
        """Return the YAML value behind the word of a step."""
        found = self.nodes.get((step.mark.line, step.mark.column))
        return Scalar(step.mark, "", None) if found is None else found[1]

    def assigned(self, step: Step) -> dict[str, Value]:
        """Return the values that a ``set`` step assigns, as written in the file, by variable."""
        value = self.value(step)
        entries = value.entries if isinstance(value, Entries) else []
        return {name.text: value_of(node) for name, node in entries}

    def remark(self, step: Step) -> str:
        """Return the comment behind the line of a modifier; empty without one."""
        found = REMARK.fullmatch(self.lines[step.mark.line - 1])
        return found[2].strip() if found is not None and found[1] == step.kind else ""

    def comments(self, step: Step) -> list[str]:
        """Return the comments above a step in the mission file; each comment is returned only once."""
        entries = self.beside(step).entries
        number = (entries[0][0].mark if entries else step.mark).line - 1
        found = list[str]()
        while number > 0 and (line := self.lines[number - 1].strip()).startswith("#"):
            found.insert(0, line.lstrip("# ").rstrip())
            self.lines[number - 1] = ""
            number -= 1
        return [line for line in found if line]

    def header(self) -> str:
        """Return the top-level keys of the mission file, such as ``summary`` and ``params``, as one YAML mapping."""
        nodes = {key: node for key in HEADER_KEYS if (node := self.root.get(key)) is not None}
        return f"{YAML_PREFIX}{{{', '.join(f'{key}: {flow_text(node)}' for key, node in nodes.items())}}}"


def read_mission(id_: str, tree: Step, source: SourceText, *, is_main: bool) -> MissionSource:
    """Return the source of a mission; ``tree`` is its checked plan, ``source`` its file, ``id_`` the ID of its tree."""
    root = compose(source, [])
    keys = root if isinstance(root, Entries) else Entries(root.mark)
    found = MissionSource(id_, tree, source, keys, is_main, lines=source.text.splitlines())
    _index(keys, found.nodes)
    params = keys.get("params")
    found.params = {key.text: _param(node) for key, node in params.entries} if isinstance(params, Entries) else {}
    kinds = {name: param.kind for name, param in found.params.items()}
    found.kinds = variable_kinds(steps_in_scope(tree), kinds, found.assigned)
    return found


def _index(node: Node, found: dict[tuple[int, int], tuple[Entries, Node]]) -> None:
    if isinstance(node, Entries):
        for name, value in node.entries:
            found[name.mark.line, name.mark.column] = node, value
            _index(value, found)
    elif isinstance(node, Listing):
        for item in node.items:
            _index(item, found)


_KINDS = {
    "number": FRACTION,
    "count": WHOLE,
    "flag": FLAG,
    "value": ANY,
    **dict.fromkeys(("text", "choice", *NAME_TYPES), TEXT),
}


def script_kind(type_: str) -> str:
    """Return the kind of values, in scripts, of a param or an argument with this type."""
    return _KINDS.get(type_, OTHER)


def _param(node: Node) -> MissionParam:
    if not isinstance(node, Entries):
        return MissionParam(_param_kind(node), node)
    help_node = node.get("help")
    return MissionParam(_param_kind(node), node.get("default"), help_node.text if isinstance(help_node, Scalar) else "")


def _param_kind(node: Node) -> str:
    """Return the kind of values, in scripts, of a param with the YAML value ``node``: a default or its long form."""
    if isinstance(node, Entries):
        kind, default = node.get("type"), node.get("default")
        if isinstance(kind, Scalar):
            return script_kind(kind.text)
        return _param_kind(default) if default is not None else OTHER
    if not isinstance(node, Scalar) or node.value is None:
        return OTHER
    if isinstance(node.value, bool):
        return FLAG
    if isinstance(node.value, int | float):
        return FRACTION
    return OTHER if parse_quantity(node.text) is not None and not node.quoted else TEXT
