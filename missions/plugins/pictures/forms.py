"""Functions that write one mission's tree, or two trees side by side, as text, JSON, SVG, PNG or HTML."""

import json
from collections.abc import Callable, Mapping
from functools import partial

from missions.plugins.pictures.compare import NodePair, TreeComparison, compare, side_by_side
from missions.plugins.pictures.page.pair import page, pair_page
from missions.plugins.pictures.png import png
from missions.plugins.pictures.svg import svg, svg_pair
from missions.trees.drawing import TreeDrawing, to_json

# JSON of a comparison, for other programs.

FORMAT = "missiontree-diff/1"


def comparison_to_json(comparison: TreeComparison) -> dict[str, object]:
    """Return two compared missions as JSON data: both trees, and under ``pairs`` the keys of corresponding nodes."""
    return {
        "format": FORMAT,
        "summary": comparison.summary,
        "left": to_json(comparison.left),
        "right": to_json(comparison.right),
        "pairs": _pair(comparison.root),
    }


def _pair(pair: NodePair) -> dict[str, object]:
    return {
        "left": None if pair.left is None else pair.left.key,
        "right": None if pair.right is None else pair.right.key,
        "change": pair.change,
        "what": pair.differences.splitlines(),
        "children": [_pair(child) for child in pair.children],
    }


Dump = str | bytes


def _json(data: object) -> str:
    return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


PICTURE_FORMS: Mapping[str, Callable[[TreeDrawing], Dump]] = {
    "svg": svg,
    "png": lambda drawing: png(svg(drawing)),
    "html": page,
}
"""File formats for the picture of one tree, with the function that writes each.

``png`` raises ImportError without the extra ``plots``.
"""

PAIR_COLUMNS = 120
"""Width in columns of a text with two trees side by side, when it is written to a file."""

PAIR_FORMS: Mapping[str, Callable[[TreeComparison], Dump]] = {
    "text": partial(side_by_side, width=PAIR_COLUMNS),
    "unicode": partial(side_by_side, width=PAIR_COLUMNS),
    "ascii": partial(side_by_side, width=PAIR_COLUMNS, ascii_only=True),
    "svg": svg_pair,
    "png": lambda comparison: png(svg_pair(comparison)),
    "json": lambda comparison: _json(comparison_to_json(comparison)),
    "html": pair_page,
}
"""Formats of two trees side by side, with the function that writes each."""


def dump_pair(left: TreeDrawing, right: TreeDrawing, form: str, width: int | None) -> Dump:
    """Return two trees side by side in the format ``form``, compared node by node.

    If ``width`` is given, a text is that many columns wide. Raises ValueError for an unknown format.
    """
    if form not in PAIR_FORMS:
        raise ValueError(f"--diff has no format '{form}'; formats: {', '.join(PAIR_FORMS)}")
    comparison = compare(left, right)
    if width is not None and form in ("text", "unicode", "ascii"):
        return side_by_side(comparison, width, ascii_only=form == "ascii")
    return PAIR_FORMS[form](comparison)
