"""HTML pages of one mission's tree, or of two missions side by side, with corresponding nodes in one row."""

from missions.plugins.pictures.compare import CHANGES, NodePair, TreeComparison
from missions.plugins.pictures.page.document import Markup, document, join, tag
from missions.plugins.pictures.page.tree import button, card, item, toolbar, tools, tree, unfold_button, window
from missions.trees.drawing import TreeBox, TreeDrawing

# Page of one mission: its tree, with search and folding.


def page(drawing: TreeDrawing) -> str:
    """Return the page of a mission, or of a moment of a record."""
    title = f"Mission {drawing.mission}"
    count = drawing.root.nodes
    facts = [drawing.file, f"{count} nodes" if count > 1 else "1 node"]
    facts += [f"state{time_suffix(drawing)}"] if drawing.time is not None else []
    return document(title, join(header(title, drawing.summary, facts), tools(drawing), tree(drawing, label=title)))


def time_suffix(drawing: TreeDrawing) -> str:
    """Return " at 5.00 s" if the drawing shows a run at that time; an empty text if it shows no run."""
    return "" if drawing.time is None else f" at {drawing.time:.2f} s"


def header(title: str, summary: str, facts: list[str]) -> Markup:
    """Return the head of a page: title, summary, and a line with ``facts``, separated by dots."""
    paragraph = tag("p", summary) if summary else ""
    return tag("header", tag("h1", title), paragraph, tag("p", " · ".join(facts), class_="facts"))


def pair_page(comparison: TreeComparison) -> str:
    """Return the HTML page of a comparison of two missions."""
    left, right = comparison.left, comparison.right
    title = f"{left.mission} and {right.mission}" if left.mission != right.mission else f"{left.mission}, two versions"
    bar = toolbar(
        button("Next change", data_next='[data-change]:not([data-change="same"])'),
        button("Fold equal parts", data_fold="[data-alike]"),
        unfold_button(),
    )
    sides = tag("div", *(tag("b", f"{each.file}{time_suffix(each)}") for each in (left, right)), class_="sides")
    root = _item(comparison.root, "0", (left.time, right.time))
    content = join(
        header(title, comparison.summary.capitalize() + ".", [left.file, right.file]),
        bar,
        window(root, label=title, layout="pairs", above=sides),
    )
    return document(title, content)


def _item(pair: NodePair, key: str, times: tuple[float | None, float | None], level: int = 0) -> Markup:
    """Return the list item of two corresponding nodes, with their children.

    ``times`` are the times (s) in the runs that the two sides show, or None. ``key`` is the item's path in this list,
    since the two nodes have different keys.
    """
    children = [
        _item(child, f"{key}.{number}", times, level + 1) for number, child in enumerate(pair.children, start=1)
    ]
    mark = tag(
        "span",
        tag("span", CHANGES[pair.change], aria_hidden="true"),
        _screen_reader_text(pair.change),
        class_="mark",
        title=pair.change,
    )
    again = pair.change == "same" and times == (None, None)
    what = tag("span", pair.differences, class_="what") if pair.differences else ""
    return item(
        key,
        join(mark, _pair_side(pair.left, times[0]), _pair_side(pair.right, times[1], hidden=again), what),
        children,
        first=level == 0,
        style=f"--level:{level}",
        data_change=pair.change,
        data_alike=all(each.change == "same" for each in pair.walk()),
    )


def _pair_side(box: TreeBox | None, time: float | None, *, hidden: bool = False) -> Markup:
    """Return the card of the node in one mission of a comparison; ``box`` is None if this mission lacks the node.

    ``time`` is that of the shown run (s), or None. A ``hidden`` card is hidden from screen readers, since the other
    mission has the same node.
    """
    return tag(
        "div",
        card(box, time) if box is not None else _screen_reader_text("nothing"),
        class_="half",
        aria_hidden=hidden and "true",
    )


def _screen_reader_text(word: str) -> Markup:
    return tag("span", word, class_="unseen")
