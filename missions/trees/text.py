"""Tree as text: for terminals by py_trees, as Mermaid flowchart, and as DOT graph."""

from collections.abc import Iterator, Mapping

from py_trees import composites, display
from py_trees.behaviour import Behaviour
from py_trees.common import Status as Result
from py_trees.decorators import PassThrough

from missions.executive.composites import COMPOSITES
from missions.language.nodes import SWITCHES
from missions.language.plan import Plan
from missions.trees.drawing import ASCII_SIGNS, SIGNS, NodeLabels, NodeState, Status, TreeBox, TreeDrawing
from missions.trees.drawing_builder import drawing_of, with_states

# A drawing as a Mermaid flowchart, which GitHub, GitLab and many editors draw where it stands in a page.

STYLES: Mapping[Status, str] = {
    "idle": "fill:#ffffff,stroke:#858c97,color:#1d2530,stroke-dasharray:4 3",
    "running": "fill:#eaf4fc,stroke:#0067a8,color:#1d2530,stroke-width:3px",
    "suspended": "fill:#fdf3dc,stroke:#7a5200,color:#1d2530,stroke-width:3px,stroke-dasharray:2 3",
    "success": "fill:#ecf7f3,stroke:#00735a,color:#1d2530",
    "skipped": "fill:#f4f5f7,stroke:#56616d,color:#1d2530,stroke-dasharray:1 3",
    "failure": "fill:#fdf0e9,stroke:#b3400a,color:#1d2530,stroke-width:2px",
}
"""Mermaid style of each node status. The borders differ too, so that pictures do not depend on colour alone."""

_ENTITIES = str.maketrans({mark: f"#{ord(mark)};" for mark in '#"<>&`|\\'})
"""Characters that need escaping in Mermaid labels, with their character codes."""


def mermaid(drawing: TreeDrawing) -> str:
    """Return the tree as a Mermaid flowchart from left to right, with modifiers in the boxes of their nodes."""
    labels = NodeLabels(drawing)
    live = drawing.time is not None
    lines = ["flowchart LR"]
    if live:
        seldom = {"suspended", "skipped"} - {box.outer_status for box in drawing.root.walk()}
        lines += [f"  classDef {status} {style}" for status, style in STYLES.items() if status not in seldom]
    for box in drawing.root.walk():
        said = "<br/>".join(part.translate(_ENTITIES) for part in _lines(labels, box))
        lines.append(f'  {identifier(box.key)}["{said}"]' + (f":::{box.outer_status}" if live else ""))
    lines += _links(drawing.root)
    return "\n".join(lines) + "\n"


def identifier(key: str) -> str:
    """Return the key of a node as an identifier for Mermaid and DOT: "1.2" as "n1_2"."""
    return f"n{key.replace('.', '_')}"


def _lines(labels: NodeLabels, box: TreeBox) -> Iterator[str]:
    """Yield the lines of a box: its modifiers, then the node with its symbol."""
    for badge in box.badges:
        yield " ".join(labels.badge(box, badge))
    title, *more = labels.box(box)
    yield f"{box.symbol} {title}"
    yield from more


def _links(box: TreeBox) -> Iterator[str]:
    for child in box.children:
        case = f'|"{child.case.translate(_ENTITIES)}"| ' if child.case else ""
        yield f"  {identifier(box.key)} --> {case}{identifier(child.key)}"
        yield from _links(child)


def text_tree(
    mission: Plan | TreeDrawing,
    states: Mapping[str, NodeState] | None = None,
    *,
    ascii: bool = False,  # noqa: A002 - the name of the format
) -> str:
    """Return the tree as indented text with a line per node and modifier; ``states`` are the states to show."""
    drawing = _at(mission, states)
    labels = NodeLabels(drawing, ASCII_SIGNS if ascii else SIGNS)
    root = _tree(drawing.root, {key: " ".join(texts) for key, texts in _texts(drawing, labels)})
    if ascii:
        return display.ascii_tree(root).encode("ascii", "replace").decode("ascii")
    return display.unicode_tree(root)


def dot(mission: Plan | TreeDrawing, states: Mapping[str, NodeState] | None = None) -> str:
    """Return the tree as a DOT graph with the keys as node names; ``states`` are the states to show."""
    drawing = _at(mission, states)
    texts = dict(_texts(drawing, NodeLabels(drawing)))
    names = {key: identifier(key) for key in texts}
    graph = display.dot_tree(_tree(drawing.root, names))
    graph.set_name("mission")
    for key, name in names.items():
        for node in graph.get_node(name):
            node.set("label", _quoted("\n".join(texts[key])))
    return str(graph.to_string())


def _at(mission: Plan | TreeDrawing, now: Mapping[str, NodeState] | None) -> TreeDrawing:
    drawing = mission if isinstance(mission, TreeDrawing) else drawing_of(mission)
    return drawing if now is None else with_states(drawing, now, drawing.time or 0.0)


def _texts(drawing: TreeDrawing, labels: NodeLabels) -> Iterator[tuple[str, list[str]]]:
    """Yield the key and text lines of each node and modifier.

    The first line of a child of a ``switch`` begins with its case.
    """
    for box in drawing.root.walk():
        said = [(badge.key, [*labels.badge(box, badge)]) for badge in box.badges]
        said.append((box.key, [*labels.box(box)]))
        if box.case:
            first = said[0][1]
            first[0] = f"{box.case}: {first[0]}"
        yield from said


def _tree(box: TreeBox, names: Mapping[str, str]) -> Behaviour:
    """Return py_trees nodes that represent a box and all boxes below it; for dumps, never ticked."""
    name, children = names[box.key], [_tree(child, names) for child in box.children]
    node: Behaviour
    if box.kind in COMPOSITES:
        node = COMPOSITES[box.kind](name)
    elif box.kind in SWITCHES:
        node = composites.Selector(name, memory=True)
    elif children:
        node = PassThrough(name, children[0])
    else:
        node = _Leaf(name)
    node.children = children
    for badge in reversed(box.badges):
        node = PassThrough(names[badge.key], node)
    return node


class _Leaf(Behaviour):
    """Placeholder for a leaf or a folded sub-mission in a text tree."""

    def update(self) -> Result:
        return Result.INVALID


def _quoted(text: str) -> str:
    r"""Return a DOT label: backslashes and quotes are escaped, line ends are ``\n``."""
    return '"' + text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n") + '"'
