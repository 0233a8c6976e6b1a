"""A mission's tree as nested HTML lists: an outline, or a drawing from left to right; readable without JavaScript.

The page's style sheet and script find the elements by their roles and attributes. A page has only one tree.
"""

import json
from collections.abc import Iterator, Mapping, Sequence

from missions.language.nodes import FINALLY, RECOVER
from missions.plugins.pictures.page.document import Markup, join, start_tag, tag
from missions.plugins.pictures.svg import kind_of
from missions.trees.drawing import SIGNS, Badge, Status, TreeBox, TreeDrawing
from missions.trees.drawing_builder import legend

_PLAIN_LABELS = ("default", RECOVER, FINALLY)
"""Labels of child nodes that are no cases of a switch."""

# Card of a node on the page, with all its facts. For a screen reader the card is the node's name.
#
# Order and wording suit screen readers: first the node, then its status and reason, then the rest. Signs are
# hidden from screen readers; a word only for them has the class "unseen".


def card(box: TreeBox, time: float | None = None) -> Markup:
    """Return the lines of a node's card as HTML. With a ``time``, they include the node's status and its age."""
    return join(*_card_lines(box, time))


def _card_lines(box: TreeBox, time: float | None) -> Iterator[Markup]:
    live = time is not None
    if box.case:
        yield tag("span", box.case if box.case in _PLAIN_LABELS else f"case {box.case}", class_="case")
    yield _title(box, live=live)
    if time is not None:
        yield _state(box.status, box.reason, "" if box.since is None else _age(box.status, time - box.since))
    for name, text in box.untitled_arguments.items():
        yield _argument(name, text)
    if box.keep_as:
        yield _argument("as", box.keep_as)
    if box.badges:
        yield tag("span", *(_badge(badge, live=live) for badge in box.badges), class_="badges")
    if box.folded:
        yield tag("span", f"{box.folded} more inside", class_="argument")


def _argument(name: str, text: str) -> Markup:
    return tag("span", tag("i", name), " ", text, class_="argument")


def _title(box: TreeBox, *, live: bool) -> Markup:
    kind, _, name = box.title.partition(": ")
    named = [tag("b", kind), f" {name}" if name else "", *(["\u00a0", _sign(box.status)] if live else [])]
    return tag(
        "span",
        tag("span", box.symbol, class_="symbol", aria_hidden="true"),
        tag("span", *named),
        " ",
        tag(
            "span",
            tag("span", box.file, class_="unseen"),
            f":{box.line}",
            class_="line",
            title=f"{box.file}:{box.line}",
        ),
        class_="title",
    )


def _age(status: Status, seconds: float) -> str:
    """Return the time since a node started, or since it ended, as text; the report's script writes the same text."""
    return f"{seconds:.1f} s" if status in ("running", "suspended") else f"{seconds:.1f} s ago"


def _state(status: Status, reason: str, age: str) -> Markup:
    """Return status, age and reason of a node as HTML; the page's script writes the same form."""
    return tag(
        "span",
        tag("span", status, class_="word"),
        tag("span", f" {age}" if age else "", class_="age"),
        tag("span", f" {reason}" if reason else "", class_="reason"),
        class_="state",
    )


def _sign(status: Status) -> Markup:
    return tag("span", SIGNS[status], class_="sign", aria_hidden="true")


def _badge(badge: Badge, *, live: bool) -> Markup:
    """Return a modifier as HTML; with ``live``, with its status and reason, which may differ from those of its node."""
    text = f"{badge.kind} {badge.text}".strip()
    if not live:
        return tag("span", text, class_="badge", title=f"line {badge.line}")
    state = _state(badge.status, badge.reason, "")
    return tag(
        "span", _sign(badge.status), " ", text, " ", state,
        class_="badge", data_key=badge.key, data_status=badge.status, title=f"line {badge.line}",
    )  # fmt: skip


# Tools above a tree: search, fold, layout, zoom, and the legend. The script makes them visible.

STATUSES: Mapping[Status, str] = {
    "idle": "is idle",
    "running": "is running",
    "suspended": "waits for a sensor that does not report",
    "success": "succeeded, or true",
    "skipped": "was not started: its condition was false",
    "failure": "failed, or false",
}
"""Description of each node status, as the page shows it."""


def tools(drawing: TreeDrawing) -> Markup:
    """Return the toolbar of the tree that ``tree(drawing)`` returns, and a legend of the signs in it."""
    missions = any(box.mission and box.children for box in drawing.root.walk())
    fold = button("Fold sub-missions", data_fold="[data-mission]") if missions else ""
    return join(
        toolbar(fold, unfold_button(), button("Outline", data_outline=True, aria_pressed="true")), _legend(drawing)
    )


def toolbar(*buttons: str) -> Markup:
    """Return a bar with the search field, the ``buttons``, and the zoom."""
    finder = tag(
        "span",
        start_tag("input", type="search", aria_label="Search nodes", placeholder="Search  /", autocomplete="off"),
        tag("span", role="status", class_="count"),
        class_="finder",
    )
    zoom = tag(
        "span",
        button("\N{MINUS SIGN}", aria_label="Zoom out", data_zoom="out"),
        button("100 %", aria_label="Zoom to 100 %", data_zoom="none"),
        button("+", aria_label="Zoom in", data_zoom="in"),
        button("Fit", aria_label="Zoom to fit the width", data_zoom="fit"),
        class_="joined",
    )
    return tag("div", finder, *buttons, zoom, role="search", aria_label="Tree", class_="tools", hidden=True)


def button(text: str, **attributes: str | bool | None) -> Markup:
    """Return a button; the page's script finds its action by the ``attributes``."""
    return tag("button", text, type="button", **attributes)


def unfold_button() -> Markup:
    """Return the button that unfolds all nodes."""
    return button("Unfold all", data_unfold=True)


def _legend(drawing: TreeDrawing) -> Markup:
    used = {box.symbol for box in drawing.root.walk()}
    rows = [(sign, word, what) for sign, word, what in legend() if sign in used]
    rows += [(sign, status, STATUSES[status]) for status, sign in SIGNS.items() if drawing.time is not None]
    terms = (
        join(tag("dt", tag("span", sign, class_="symbol"), " ", word), tag("dd", what)) for sign, word, what in rows
    )
    return tag("details", tag("summary", "Legend"), tag("dl", *terms), class_="legend")


def tree(drawing: TreeDrawing, *, label: str) -> Markup:
    """Return the tree; ``label`` is its name for screen readers.

    A drawing with a ``time`` includes the status of each node, which ``missiontree.showStates`` may change later.
    """
    live = drawing.time is not None
    return window(
        _item(drawing.root, drawing.time, first=True), label=label, layout="outline live" if live else "outline"
    )


def window(root: Markup, *, label: str, layout: str, above: str = "") -> Markup:
    """Return the tree ``root`` in a scrolling window; ``label`` is its name for screen readers.

    ``above`` is a fixed line above the tree. ``layout`` is the style class of the tree: "outline", which the script may
    change to "spread", or "pairs".
    """
    signs = json.dumps(SIGNS, ensure_ascii=False)
    listed = tag("ul", root, role="tree", aria_label=label, class_=layout, data_signs=signs)
    return tag("div", above, listed, class_="window")


def item(
    key: str, content: Markup, children: Sequence[Markup], *, first: bool, **attributes: str | bool | None
) -> Markup:
    """Return a node of the tree as a list item with its card ``content`` and its ``children``.

    ``key`` identifies the node for the page's script. The ``first`` item of the page takes the keyboard focus.
    """
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


def _item(box: TreeBox, time: float | None, *, first: bool = False) -> Markup:
    live = time is not None
    return item(
        box.key,
        card(box, time),
        [_item(child, time) for child in box.children],
        first=first,
        data_status=box.status if live else None,
        data_outer=box.outer_status if live else None,
        data_mission=box.mission or None,
        data_sort=kind_of(box),
    )
