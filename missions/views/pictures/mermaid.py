"""A drawing as a Mermaid flowchart, which GitHub, GitLab and many editors draw where it stands in a page."""

from collections.abc import Iterator, Mapping

from missions.views.pictures.drawing import Box, Drawing, Status
from missions.views.pictures.labels import Labels

STYLES: Mapping[Status, str] = {
    "idle": "fill:#ffffff,stroke:#858c97,color:#1d2530,stroke-dasharray:4 3",
    "running": "fill:#eaf4fc,stroke:#0067a8,color:#1d2530,stroke-width:3px",
    "suspended": "fill:#fdf3dc,stroke:#7a5200,color:#1d2530,stroke-width:3px,stroke-dasharray:2 3",
    "success": "fill:#ecf7f3,stroke:#00735a,color:#1d2530",
    "skipped": "fill:#f4f5f7,stroke:#56616d,color:#1d2530,stroke-dasharray:1 3",
    "failure": "fill:#fdf0e9,stroke:#b3400a,color:#1d2530,stroke-width:2px",
}
"""Colours that go with the signs of statuses, and a border of its own for each."""

_ENTITIES = str.maketrans({mark: f"#{ord(mark)};" for mark in '#"<>&`|\\'})
"""What means something else within a label of Mermaid, as it is written there: by its number."""


def mermaid(drawing: Drawing) -> str:
    """Return the flowchart, from left to right; modifiers stand above what they modify, in the same box."""
    labels = Labels(drawing)
    live = drawing.time is not None
    lines = ["flowchart LR"]
    if live:
        seldom = {"suspended", "skipped"} - {box.outer for box in drawing.root.walk()}
        lines += [f"  classDef {status} {style}" for status, style in STYLES.items() if status not in seldom]
    for box in drawing.root.walk():
        said = "<br/>".join(part.translate(_ENTITIES) for part in _lines(labels, box))
        lines.append(f'  {identifier(box.key)}["{said}"]' + (f":::{box.outer}" if live else ""))
    lines += _links(drawing.root)
    return "\n".join(lines) + "\n"


def identifier(key: str) -> str:
    """Return the key of a node as a word that is an identifier in Mermaid and in DOT: "1.2" as "n1_2"."""
    return f"n{key.replace('.', '_')}"


def _lines(labels: Labels, box: Box) -> Iterator[str]:
    """Yield the lines of a box: each modifier, then the node itself with its symbol."""
    for badge in box.badges:
        yield " ".join(labels.badge(box, badge))
    title, *more = labels.box(box)
    yield f"{box.symbol} {title}"
    yield from more


def _links(box: Box) -> Iterator[str]:
    for child in box.children:
        case = f'|"{child.case.translate(_ENTITIES)}"| ' if child.case else ""
        yield f"  {identifier(box.key)} --> {case}{identifier(child.key)}"
        yield from _links(child)
