"""What stands above a tree: search, fold, layout, zoom, and the legend. The script that works them shows them."""

from collections.abc import Mapping

from missions.views.pictures.draw import legend
from missions.views.pictures.drawing import SIGNS, Drawing, Status
from missions.views.pictures.page.markup import Markup, join, start, tag

STATUSES: Mapping[Status, str] = {
    "idle": "is not being asked",
    "running": "is at work",
    "suspended": "waits for a sensor that does not report",
    "success": "has done it, or says yes",
    "skipped": "was not started: its condition was false",
    "failure": "could not do it, or says no",
}
"""What each status says of a node."""


def tools(drawing: Drawing) -> Markup:
    """Return the tools for ``tree(drawing)``, and a legend of the signs in it."""
    missions = any(box.mission and box.children for box in drawing.root.walk())
    fold = button("Fold sub-missions", data_fold="[data-mission]") if missions else ""
    return join(toolbar(fold, unfold(), button("Outline", data_outline=True, aria_pressed="true")), _legend(drawing))


def toolbar(*buttons: str) -> Markup:
    """Return a bar with the search, these buttons, and the zoom."""
    finder = tag(
        "span",
        start("input", type="search", aria_label="Search nodes", placeholder="Search  /", autocomplete="off"),
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
    """Return a button; the script knows by its attributes what it does."""
    return tag("button", text, type="button", **attributes)


def unfold() -> Markup:
    """Return the button that unfolds all."""
    return button("Unfold all", data_unfold=True)


def _legend(drawing: Drawing) -> Markup:
    """Return what the signs mean, those that are in the drawing."""
    used = {box.symbol for box in drawing.root.walk()}
    rows = [(sign, word, what) for sign, word, what in legend() if sign in used]
    rows += [(sign, status, STATUSES[status]) for status, sign in SIGNS.items() if drawing.time is not None]
    terms = (
        join(tag("dt", tag("span", sign, class_="symbol"), " ", word), tag("dd", what)) for sign, word, what in rows
    )
    return tag("details", tag("summary", "Legend"), tag("dl", *terms), class_="legend")
