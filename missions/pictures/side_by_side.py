"""Two missions in two columns of text, a sign between them for what is the same, changed, added or removed."""

from collections.abc import Iterator

from rich.cells import cell_len, chop_cells, set_cell_size

from missions.pictures.compare import CHANGES, Comparison, Pair
from missions.pictures.drawing import Box

LEAST = 16
"""Columns of a side at least, however narrow the terminal is."""


def side_by_side(comparison: Comparison, width: int, *, ascii_only: bool = False) -> str:
    """Return a line for each pair of nodes, in ``width`` columns; below it, what has changed in the node itself."""
    side = max((width - 3) // 2, LEAST)
    rows = [_row(comparison.left.mission, " ", comparison.right.mission, side)]
    rows += _rows(comparison.root, 0, side)
    text = "\n".join([*rows, comparison.summary]) + "\n"
    return text.translate({ord("≠"): "!", ord("…"): "~"}) if ascii_only else text


def _rows(pair: Pair, depth: int, side: int) -> Iterator[str]:
    indent = " " * min(2 * depth, side // 2)
    left, right = (indent + _said(box) if box is not None else "" for box in (pair.left, pair.right))
    yield _row(left, CHANGES[pair.change], right, side)
    below = f"{indent}    "
    for line in pair.what.splitlines():
        yield from (_row("", " ", below + part, side) for part in chop_cells(line, side - len(below)))
    for child in pair.children:
        yield from _rows(child, depth + 1, side)


def _said(box: Box) -> str:
    """Return a node in one line: its case, title, arguments, modifiers, and the variable that keeps its result."""
    words = [f"{box.case}:"] if box.case else []
    words.append(box.title)
    told = [f"{name}: {text}" for name, text in box.untold.items()]
    told += [f"as: {box.keep_as}"] if box.keep_as else []
    told += [f"{badge.kind}: {badge.text}" for badge in box.badges]
    return " ".join(words) + (f" ({', '.join(told)})" if told else "")


def _row(left: str, sign: str, right: str, side: int) -> str:
    return f"{set_cell_size(_cut(left, side), side)} {sign} {_cut(right, side)}".rstrip()


def _cut(text: str, most: int) -> str:
    return text if cell_len(text) <= most else f"{chop_cells(text, most - 1)[0]}…"
