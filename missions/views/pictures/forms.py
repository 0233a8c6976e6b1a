"""The forms in which a mission's tree, or two of them side by side, are dumped, by name and by suffix."""

import json
from collections.abc import Callable, Mapping
from functools import partial

from missions.views.pictures.compare import Comparison
from missions.views.pictures.diff_json import comparison_to_json
from missions.views.pictures.drawing import Drawing
from missions.views.pictures.mermaid import mermaid
from missions.views.pictures.outline import outline
from missions.views.pictures.page.page import page
from missions.views.pictures.page.pair import pair_page
from missions.views.pictures.png import png
from missions.views.pictures.side_by_side import side_by_side
from missions.views.pictures.svg import svg, svg_pair
from missions.views.pictures.text import dot, text_tree
from missions.views.pictures.tree_json import to_json

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
