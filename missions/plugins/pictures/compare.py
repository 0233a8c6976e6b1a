"""Comparison of two missions: the corresponding nodes and their differences.

Line numbers, node keys and statuses are not compared: a node that only moved down in its file is unchanged.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from rich.cells import cell_len, chop_cells, set_cell_size

from missions.trees.drawing import ASCII_SIGNS, SIGNS, Status, TreeBox, TreeDrawing

Change = Literal["same", "changed", "added", "removed"]

CHANGES: Mapping[Change, str] = {"same": "=", "changed": "≠", "added": "+", "removed": "-"}
"""Sign of each kind of difference between two missions."""


@dataclass(frozen=True, slots=True)
class NodePair:
    """A node of the left mission and the corresponding node of the right one; None if a mission lacks the node.

    ``differences`` has a line for each difference between the two nodes, children not included.
    """

    left: TreeBox | None
    right: TreeBox | None
    change: Change
    differences: str
    children: tuple["NodePair", ...] = ()

    def walk(self) -> Iterator["NodePair"]:
        """Yield this pair and all pairs below it."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True, slots=True)
class TreeComparison:
    """Comparison of two missions: both drawings, and the root of the tree of corresponding nodes."""

    left: TreeDrawing
    right: TreeDrawing
    root: NodePair

    def count(self, change: Change) -> int:
        """Return the number of nodes that are ``same``, ``changed``, ``added`` or ``removed``."""
        return sum(pair.change == change for pair in self.root.walk())

    @property
    def summary(self) -> str:
        """Number of nodes by kind of difference, as text."""
        counts = [f"{self.count(change)} {change}" for change in ("changed", "added", "removed") if self.count(change)]
        return ", ".join(counts) or "no difference"


def compare(left: TreeDrawing, right: TreeDrawing) -> TreeComparison:
    """Match the nodes of two missions: their roots, and similar children, in order."""
    return TreeComparison(left, right, _pair(left.root, right.root))


def _pair(left: TreeBox, right: TreeBox) -> NodePair:
    what = "\n".join(_differences(left, right))
    children = tuple(_match_children(left.children, right.children))
    return NodePair(left, right, "changed" if what else "same", what, children)


def _match_children(left: Sequence[TreeBox], right: Sequence[TreeBox]) -> Iterator[NodePair]:
    """Yield pairs of corresponding children of two nodes; a child without a counterpart is added or removed.

    Equal subtrees are matched first, then nodes of the same kind and name, then nodes of the same kind.
    """
    for old, new in _align(left, right, [_subtree_facts, lambda box: (box.kind, box.name), lambda box: box.kind]):
        if old is not None and new is not None:
            yield _pair(old, new)
        elif old is not None:
            yield _unmatched(old, "removed")
        elif new is not None:
            yield _unmatched(new, "added")


def _unmatched(box: TreeBox, change: Literal["added", "removed"]) -> NodePair:
    left, right = (box, None) if change == "removed" else (None, box)
    return NodePair(left, right, change, "", tuple(_unmatched(child, change) for child in box.children))


Likeness = Callable[[TreeBox], Hashable]
Fact = tuple[str, str, int]
Match = tuple[TreeBox | None, TreeBox | None]


def _align(left: Sequence[TreeBox], right: Sequence[TreeBox], likenesses: Sequence[Likeness]) -> Iterator[Match]:
    """Yield pairs of matching boxes in order; a box without a match is paired with None.

    Two boxes match if the first function of ``likenesses`` returns the same value for both. Boxes between these matches
    are compared by the next function.
    """
    if not likenesses or not left or not right:
        yield from ((old, None) for old in left)
        yield from ((None, new) for new in right)
        return
    old_end = new_end = 0
    matches = _common_indices([likenesses[0](box) for box in left], [likenesses[0](box) for box in right])
    for old, new in [*matches, (len(left), len(right))]:
        yield from _align(left[old_end:old], right[new_end:new], likenesses[1:])
        if old < len(left):
            yield left[old], right[new]
        old_end, new_end = old + 1, new + 1


def _common_indices(left: Sequence[Hashable], right: Sequence[Hashable]) -> list[tuple[int, int]]:
    """Return the index pairs of a longest common subsequence."""
    start = 0
    while start < min(len(left), len(right)) and left[start] == right[start]:
        start += 1
    end = 0
    while end < min(len(left), len(right)) - start and left[-1 - end] == right[-1 - end]:
        end += 1
    middle = _longest_common(left[start : len(left) - end], right[start : len(right) - end])
    found = [(place, place) for place in range(start)]
    found += [(start + old, start + new) for old, new in middle]
    return found + [(len(left) - place, len(right) - place) for place in range(end, 0, -1)]


def _longest_common(left: Sequence[Hashable], right: Sequence[Hashable]) -> Iterator[tuple[int, int]]:
    """Yield the index pairs of a longest common subsequence, from its dynamic-programming table."""
    table = [[0] * (len(right) + 1) for _ in range(len(left) + 1)]
    for old in reversed(range(len(left))):
        for new in reversed(range(len(right))):
            below, beside = table[old + 1][new], table[old][new + 1]
            table[old][new] = table[old + 1][new + 1] + 1 if left[old] == right[new] else max(below, beside)
    old = new = 0
    while old < len(left) and new < len(right):
        if left[old] == right[new]:
            yield old, new
            old, new = old + 1, new + 1
        elif table[old + 1][new] >= table[old][new + 1]:
            old += 1
        else:
            new += 1


def _subtree_facts(box: TreeBox) -> Hashable:
    """Return the kinds, arguments and modifiers of all nodes of a subtree; equal subtrees return equal values."""
    return box.kind, tuple(_node_facts(box).items()), tuple(_subtree_facts(child) for child in box.children)


def _node_facts(box: TreeBox) -> dict[Fact, str]:
    """Return the properties of a node that are compared, without those of its children.

    The order of its modifiers counts, that of its arguments does not.
    """
    named = "" if box.name in (box.kind, box.mission) else box.name
    own = {"name": named, "mission": box.mission, "case": box.case, "as": box.keep_as}
    facts = {("node", name, 0): text for name, text in own.items() if text}
    facts |= {("argument", name, 0): text for name, text in sorted(box.arguments.items())}
    for place, badge in enumerate(box.badges):
        before = sum(other.kind == badge.kind for other in box.badges[:place])
        facts["modifier", badge.kind, before] = badge.text
    return facts


def _differences(left: TreeBox, right: TreeBox) -> Iterator[str]:
    """Yield the differences between two nodes, without those between their children, one line each."""
    old, new = _node_facts(left), _node_facts(right)
    if left.kind != right.kind:  # then the arguments have other meanings
        yield f"kind: {left.kind} -> {right.kind}"
        old, new = ({fact: text for fact, text in each.items() if fact[0] == "modifier"} for each in (old, new))
    for fact in [*old, *(fact for fact in new if fact not in old)]:
        name = fact[1]
        if fact not in new:
            yield f"- {name}: {old[fact]}"
        elif fact not in old:
            yield f"+ {name}: {new[fact]}"
        elif old[fact] != new[fact]:
            yield f"{name}: {old[fact]} -> {new[fact]}"
    if [fact for fact in old if fact in new] != [fact for fact in new if fact in old]:
        yield "modifiers in another order"


# Two missions in two columns of text; signs between them mark equal, changed, added and removed nodes.

MIN_SIDE_COLUMNS = 16
"""Minimum text columns for each of two missions side by side, even on a narrow terminal."""

Signs = Mapping[Status, str]
"""Sign of each node status, for one column of the text; empty if the column does not show statuses."""


def side_by_side(comparison: TreeComparison, width: int, *, ascii_only: bool = False) -> str:
    """Return two missions as text, ``width`` columns wide, with a line for each pair of corresponding nodes.

    Below a pair stand the differences of its two nodes. The side of a mission that shows a moment of a run includes the
    status of each node.
    """
    side = max((width - 3) // 2, MIN_SIDE_COLUMNS)
    both = (comparison.left, comparison.right)
    left, right = ({} if each.time is None else ASCII_SIGNS if ascii_only else SIGNS for each in both)
    rows = [_row(_head(comparison.left), " ", _head(comparison.right), side)]
    rows += _rows(comparison.root, 0, side, left, right)
    text = "\n".join([*rows, comparison.summary]) + "\n"
    return text.translate({ord("≠"): "!", ord("…"): "~"}) if ascii_only else text


def _head(drawing: TreeDrawing) -> str:
    return drawing.mission if drawing.time is None else f"{drawing.mission} at {drawing.time:.2f} s"


def _rows(pair: NodePair, depth: int, side: int, left: Signs, right: Signs) -> Iterator[str]:
    indent = " " * min(2 * depth, side // 2)
    columns = ((pair.left, left), (pair.right, right))
    old, new = (indent + _node_text(box, signs) if box is not None else "" for box, signs in columns)
    yield _row(old, CHANGES[pair.change], new, side)
    below = f"{indent}    "
    for line in pair.differences.splitlines():
        yield from (_row("", " ", below + part, side) for part in chop_cells(line, side - len(below)))
    for child in pair.children:
        yield from _rows(child, depth + 1, side, left, right)


def _node_text(box: TreeBox, signs: Signs) -> str:
    """Return a node as one line: status, case of a switch, title, reason, arguments, ``as``, and modifiers."""
    words = [signs[box.status]] if signs else []
    words += [f"{box.case}:"] if box.case else []
    words.append(box.title)
    words += [f"-- {box.reason}"] if box.reason else []
    extras = [f"{name}: {text}" for name, text in box.untitled_arguments.items()]
    extras += [f"as: {box.keep_as}"] if box.keep_as else []
    extras += [f"{f'{signs[badge.status]} ' if signs else ''}{badge.kind}: {badge.text}" for badge in box.badges]
    return " ".join(words) + (f" ({', '.join(extras)})" if extras else "")


def _row(left: str, sign: str, right: str, side: int) -> str:
    return f"{set_cell_size(_truncate(left, side), side)} {sign} {_truncate(right, side)}".rstrip()


def _truncate(text: str, max_columns: int) -> str:
    return text if cell_len(text) <= max_columns else f"{chop_cells(text, max_columns - 1)[0]}…"
