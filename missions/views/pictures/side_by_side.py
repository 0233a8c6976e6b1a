"""Two missions in two columns of text, a sign between them for what is the same, changed, added or removed."""

from collections.abc import Iterator, Mapping

from rich.cells import cell_len, chop_cells, set_cell_size

from missions.views.pictures.compare import CHANGES, Comparison, Pair
from missions.views.pictures.drawing import ASCII_SIGNS, SIGNS, Box, Drawing, Status

LEAST = 16
"""Columns of a side at least, however narrow the terminal is."""

Signs = Mapping[Status, str]
"""How statuses are written in a column; none are, where it shows no moment of a run."""


def side_by_side(comparison: Comparison, width: int, *, ascii_only: bool = False) -> str:
    """Return a line for each pair of nodes, in ``width`` columns; below it, what has changed in the node itself.

    A column that shows a moment of a run says how each node stands then.
    """
    side = max((width - 3) // 2, LEAST)
    both = (comparison.left, comparison.right)
    left, right = ({} if each.time is None else ASCII_SIGNS if ascii_only else SIGNS for each in both)
    rows = [_row(_head(comparison.left), " ", _head(comparison.right), side)]
    rows += _rows(comparison.root, 0, side, left, right)
    text = "\n".join([*rows, comparison.summary]) + "\n"
    return text.translate({ord("≠"): "!", ord("…"): "~"}) if ascii_only else text


def _head(drawing: Drawing) -> str:
    return drawing.mission if drawing.time is None else f"{drawing.mission} at {drawing.time:.2f} s"


def _rows(pair: Pair, depth: int, side: int, left: Signs, right: Signs) -> Iterator[str]:
    indent = " " * min(2 * depth, side // 2)
    columns = ((pair.left, left), (pair.right, right))
    old, new = (indent + _said(box, signs) if box is not None else "" for box, signs in columns)
    yield _row(old, CHANGES[pair.change], new, side)
    below = f"{indent}    "
    for line in pair.what.splitlines():
        yield from (_row("", " ", below + part, side) for part in chop_cells(line, side - len(below)))
    for child in pair.children:
        yield from _rows(child, depth + 1, side, left, right)


def _said(box: Box, signs: Signs) -> str:
    """Return a node in one line: how it stands, its case and title, why, arguments, modifiers, and its result."""
    words = [signs[box.status]] if signs else []
    words += [f"{box.case}:"] if box.case else []
    words.append(box.title)
    words += [f"-- {box.reason}"] if box.reason else []
    told = [f"{name}: {text}" for name, text in box.untold.items()]
    told += [f"as: {box.keep_as}"] if box.keep_as else []
    told += [f"{f'{signs[badge.status]} ' if signs else ''}{badge.kind}: {badge.text}" for badge in box.badges]
    return " ".join(words) + (f" ({', '.join(told)})" if told else "")


def _row(left: str, sign: str, right: str, side: int) -> str:
    return f"{set_cell_size(_cut(left, side), side)} {sign} {_cut(right, side)}".rstrip()


def _cut(text: str, most: int) -> str:
    return text if cell_len(text) <= most else f"{chop_cells(text, most - 1)[0]}…"
