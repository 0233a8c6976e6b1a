"""The tree of a mission as nested lists: an outline that can be read without script, or drawn from left to right.

Style and script find all that they need by its roles and attributes. A page has one tree, and ``tools`` for it.
"""

import json
from collections.abc import Sequence

from missions.views.pictures.drawing import SIGNS, Box, Drawing
from missions.views.pictures.page.card import card
from missions.views.pictures.page.markup import Markup, tag
from missions.views.pictures.svg import kind_of


def tree(drawing: Drawing, *, label: str) -> Markup:
    """Return the tree; ``label`` is its name to a screen reader.

    A drawing that has a ``time`` says how each node stands, and ``missiontree.showStates`` may change that later.
    """
    live = drawing.time is not None
    return window(
        _item(drawing.root, drawing.time, first=True), label=label, layout="outline live" if live else "outline"
    )


def window(root: Markup, *, label: str, layout: str, above: str = "") -> Markup:
    """Return the window in which the tree of a ``root`` scrolls, with a line ``above`` it that stays in view.

    ``layout`` is its class in the style: "outline", which the script may turn into "spread", or "pairs".
    """
    signs = json.dumps(SIGNS, ensure_ascii=False)
    listed = tag("ul", root, role="tree", aria_label=label, class_=layout, data_signs=signs)
    return tag("div", above, listed, class_="window")


def item(
    key: str, content: Markup, children: Sequence[Markup], *, first: bool, **attributes: str | bool | None
) -> Markup:
    """Return an item of a tree, named by its content. The ``first`` is where the keyboard enters the tree."""
    fold = tag("span", class_="fold", aria_hidden="true") if children else ""
    return tag(
        "li",
        tag("div", fold, content, class_="box", id=f"node-{key}"),
        tag("ul", *children, role="group") if children else "",
        role="treeitem",
        aria_labelledby=f"node-{key}",
        aria_expanded="true" if children else None,
        tabindex=0 if first else -1,
        data_key=key,
        **attributes,
    )


def _item(box: Box, time: float | None, *, first: bool = False) -> Markup:
    live = time is not None
    return item(
        box.key,
        card(box, time),
        [_item(child, time) for child in box.children],
        first=first,
        data_status=box.status if live else None,
        data_outer=box.outer if live else None,
        data_mission=box.mission or None,
        data_sort=kind_of(box),
    )
