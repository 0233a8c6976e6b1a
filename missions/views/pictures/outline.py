"""The tree as lines for a terminal, in the symbols of all our pictures; modifiers stand above what they modify."""

from collections.abc import Iterator

from missions.views.pictures.drawing import Box, Drawing
from missions.views.pictures.labels import Labels


def outline(drawing: Drawing) -> str:
    """Return a line for each node and modifier; at a moment of a run, below a line that says of what and when."""
    head = [] if drawing.time is None else [f"{drawing.mission} at {drawing.time:.2f} s"]
    return "\n".join([*head, *_lines(drawing.root, Labels(drawing), "", "")]) + "\n"


def _lines(box: Box, labels: Labels, first: str, rest: str) -> Iterator[str]:
    """Yield the lines of a node and all below it; what branches lead to it stands before the ``first`` and the rest."""
    said = [_badge(*labels.badge(box, badge)) for badge in box.badges]
    title, *more = labels.box(box)
    said.append(" ".join((box.symbol, title, *more)))
    if box.case:
        said[0] = f"{box.case}: {said[0]}"
    yield first + said[0]
    yield from (rest + line for line in said[1:])
    for place, child in enumerate(box.children, start=1):
        last = place == len(box.children)
        yield from _lines(child, labels, rest + ("└─ " if last else "├─ "), rest + ("   " if last else "│  "))


def _badge(title: str, *more: str) -> str:
    return " ".join((f"[{title}]", *more))
