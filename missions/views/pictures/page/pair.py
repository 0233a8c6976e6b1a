"""The page of two missions: one tree of pairs, the left mission's node at the left and the right one's at the right."""

from missions.views.pictures.compare import CHANGES, Comparison, Pair
from missions.views.pictures.drawing import Box
from missions.views.pictures.page.card import card
from missions.views.pictures.page.document import document
from missions.views.pictures.page.markup import Markup, join, tag
from missions.views.pictures.page.page import header, moment
from missions.views.pictures.page.tools import button, toolbar, unfold
from missions.views.pictures.page.tree import item, window


def pair_page(comparison: Comparison) -> str:
    """Return the page of a comparison."""
    left, right = comparison.left, comparison.right
    title = f"{left.mission} and {right.mission}" if left.mission != right.mission else f"{left.mission}, two versions"
    bar = toolbar(
        button("Next change", data_next='[data-change]:not([data-change="same"])'),
        button("Fold what is the same", data_fold="[data-alike]"),
        unfold(),
    )
    sides = tag("div", *(tag("b", f"{each.file}{moment(each)}") for each in (left, right)), class_="sides")
    root = _item(comparison.root, "0", (left.time, right.time))
    content = join(
        header(title, comparison.summary.capitalize() + ".", [left.file, right.file]),
        bar,
        window(root, label=title, layout="pairs", above=sides),
    )
    return document(title, content)


def _item(pair: Pair, key: str, times: tuple[float | None, float | None], level: int = 0) -> Markup:
    """Return the item of a pair, at the ``times`` of its two sides.

    Its key is its place in this tree: the two nodes have keys of their own.
    """
    children = [
        _item(child, f"{key}.{number}", times, level + 1) for number, child in enumerate(pair.children, start=1)
    ]
    mark = tag(
        "span",
        tag("span", CHANGES[pair.change], aria_hidden="true"),
        _unseen(pair.change),
        class_="mark",
        title=pair.change,
    )
    again = pair.change == "same" and times == (None, None)
    what = tag("span", pair.what, class_="what") if pair.what else ""
    return item(
        key,
        join(mark, _half(pair.left, times[0]), _half(pair.right, times[1], again=again), what),
        children,
        first=level == 0,
        style=f"--level:{level}",
        data_change=pair.change,
        data_alike=all(each.change == "same" for each in pair.walk()),
    )


def _half(box: Box | None, time: float | None, *, again: bool = False) -> Markup:
    """Return one side of a pair; to the ear only if it does not say the other's ``again``."""
    return tag(
        "div", card(box, time) if box is not None else _unseen("nothing"), class_="half", aria_hidden=again and "true"
    )


def _unseen(word: str) -> Markup:
    return tag("span", word, class_="unseen")
