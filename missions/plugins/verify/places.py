"""Places of nodes in the mission files, for counterexamples and messages."""

from pathlib import Path

from behaviours.leaf import Leaf
from behaviours.node import Node
from missions.language.nodes import MISSION, MODIFIERS


def place_text(file: str, line: int, main_file: str) -> str:
    """Return the place of a node: "(line 4)" in the verified mission, "(patrol.yaml:4)" in a sub-mission."""
    return f"(line {line})" if file == main_file else f"({Path(file).name}:{line})"


def node_place(node: Node) -> str:
    """Return the place of a node in its mission file, as ``place_text`` writes it."""
    root = node
    while isinstance(root.parent, Node):
        root = root.parent
    return place_text(node.file, node.line, root.file)


def describe_node(node: Node) -> str:
    """Return a description of a node: name, or a modifier's word, and its place."""
    shows_kind = len(node.children) == 1 and not isinstance(node, Leaf) and node.kind != MISSION
    return f"{node.kind if shows_kind or node.kind in MODIFIERS else node.name} {node_place(node)}"
