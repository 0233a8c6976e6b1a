"""The page of one mission: its tree, to be looked at, searched and folded."""

from missions.views.pictures.drawing import Drawing
from missions.views.pictures.page.document import document
from missions.views.pictures.page.markup import Markup, join, tag
from missions.views.pictures.page.tools import tools
from missions.views.pictures.page.tree import tree


def page(drawing: Drawing) -> str:
    """Return the page of a mission, or of a moment of a record."""
    title = f"Mission {drawing.mission}"
    count = drawing.root.nodes
    facts = [drawing.file, f"{count} nodes" if count > 1 else "1 node"]
    facts += [f"as it stood{moment(drawing)}"] if drawing.time is not None else []
    return document(title, join(header(title, drawing.summary, facts), tools(drawing), tree(drawing, label=title)))


def moment(drawing: Drawing) -> str:
    """Return " at 5.00 s" for a drawing of a moment of a run, nothing for one of a mission at rest."""
    return "" if drawing.time is None else f" at {drawing.time:.2f} s"


def header(title: str, summary: str, facts: list[str]) -> Markup:
    """Return the head of a page: what it is of, in a sentence, and a line of facts."""
    said = tag("p", summary) if summary else ""
    return tag("header", tag("h1", title), said, tag("p", " · ".join(facts), class_="facts"))
