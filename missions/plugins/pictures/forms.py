"""The forms in which a mission's tree, or two of them side by side, are dumped, by name and by suffix."""

import json
from collections.abc import Callable, Mapping
from functools import partial

from missions.plugins.pictures.compare import Comparison, Pair, side_by_side
from missions.plugins.pictures.page.pair import page, pair_page
from missions.plugins.pictures.png import png
from missions.plugins.pictures.svg import svg, svg_pair
from missions.trees.drawing import Drawing, outline
from missions.trees.text import dot, mermaid, text_tree
from missions.trees.tree_json import to_json

# A comparison of two missions as plain JSON, for other programs.

FORMAT = "missiontree-diff/1"


def comparison_to_json(comparison: Comparison) -> dict[str, object]:
    """Return both trees as they are told alone, and ``pairs``: the tree of which keys belong together."""
    return {
        "format": FORMAT,
        "summary": comparison.summary,
        "left": to_json(comparison.left),
        "right": to_json(comparison.right),
        "pairs": _pair(comparison.root),
    }


def _pair(pair: Pair) -> dict[str, object]:
    return {
        "left": None if pair.left is None else pair.left.key,
        "right": None if pair.right is None else pair.right.key,
        "change": pair.change,
        "what": pair.what.splitlines(),
        "children": [_pair(child) for child in pair.children],
    }


Dump = str | bytes


def _json(data: object) -> str:
    return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


FORMS: Mapping[str, Callable[[Drawing], Dump]] = {
    "text": outline,
    "unicode": text_tree,
    "ascii": partial(text_tree, ascii=True),
    "dot": dot,
    "svg": svg,
    "png": lambda drawing: png(svg(drawing)),
    "mermaid": mermaid,
    "json": lambda drawing: _json(to_json(drawing)),
    "html": page,
}
"""Every form of one tree. Text is meant as UTF-8; ``png`` raises ImportError without the extra ``plots``."""

WIDE = 120
"""Columns of two missions side by side in a file."""

PAIR_FORMS: Mapping[str, Callable[[Comparison], Dump]] = {
    "text": partial(side_by_side, width=WIDE),
    "unicode": partial(side_by_side, width=WIDE),
    "ascii": partial(side_by_side, width=WIDE, ascii_only=True),
    "svg": svg_pair,
    "png": lambda comparison: png(svg_pair(comparison)),
    "json": lambda comparison: _json(comparison_to_json(comparison)),
    "html": pair_page,
}
"""The forms in which two trees stand side by side."""

SUFFIXES: Mapping[str, str] = {
    ".txt": "text",
    ".unicode": "unicode",
    ".ascii": "ascii",
    ".dot": "dot",
    ".gv": "dot",
    ".svg": "svg",
    ".png": "png",
    ".mmd": "mermaid",
    ".json": "json",
    ".html": "html",
}
"""The form that the name of a file asks for."""
