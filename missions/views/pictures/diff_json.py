"""A comparison of two missions as plain JSON, for other programs."""

from missions.views.pictures.compare import Comparison, Pair
from missions.views.pictures.tree_json import to_json

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
