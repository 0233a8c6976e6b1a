"""Where each card of a picture stands: children to the right of their parent, as long as the page is wide enough.

Where it is not, they stand below it and a little to the right, as in the file: a deep tree grows downwards, and stays
legible without being scaled down. A node is at the height of its first child, so that a picture is read from its upper
left corner. The tree of a sub-mission stands on a panel of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil

from missions.views.pictures.card import SMALL, Card, Line, card
from missions.views.pictures.compare import Comparison, Pair
from missions.views.pictures.drawing import Box, Drawing
from missions.views.pictures.measure import width

PAGE, PAIR_PAGE = 1200, 760
"""Pixels beyond which children stand below their parent: in a picture of one tree, and in that of two."""

GAP, INDENT, ROW = 44, 48, 12
"""Pixels from a card to a child at its right, from its left edge to a child below it, and between two rows."""

INSET, LABEL = 14, 26
"""The margin of a panel, and the height of its label."""


@dataclass(frozen=True, slots=True)
class Placed:
    """A node's card: its upper left corner, its size, and its lines, which count from that corner."""

    box: Box
    x: int
    y: int
    width: int
    height: int
    lines: tuple[Line, ...]


@dataclass(frozen=True, slots=True)
class Link:
    """The way from a node to its child, which stands ``below`` it or at its right."""

    parent: Placed
    child: Placed
    below: bool


@dataclass(frozen=True, slots=True)
class Panel:
    """What lies under the tree of a sub-mission."""

    x: int
    y: int
    width: int
    height: int
    label: str


@dataclass(frozen=True, slots=True)
class Layout:
    """A whole tree, in whole pixels from its upper left corner; panels that hold others come first."""

    placed: tuple[Placed, ...]
    links: tuple[Link, ...]
    panels: tuple[Panel, ...]
    width: int
    height: int


def lay_out(drawing: Drawing) -> Layout:
    """Return where everything stands in the picture of one tree."""
    root = _row(drawing.root, is_live(drawing))
    root.place((0,), 0, PAGE)
    return _Collected(root, 0).layout()


def lay_out_pair(comparison: Comparison) -> tuple[Layout, Layout]:
    """Return the same for two trees that are compared: what belongs together stands at the same height."""
    root = _pair_row(comparison.root, is_live(comparison.left), is_live(comparison.right))
    root.place((0, 0), 0, PAIR_PAGE)
    return _Collected(root, 0).layout(), _Collected(root, 1).layout()


def is_live(drawing: Drawing) -> bool:
    """Say whether it shows a moment of a run, and not only the mission."""
    return drawing.time is not None or any(box.status != "idle" for box in drawing.root.walk())


@dataclass(slots=True)
class _Row:
    """A node of the layout: its card in each of the pictures that lie side by side, None where it has none there.

    ``spans`` say how wide it is with all below it, had it all room to its right.
    """

    cards: tuple[Card | None, ...]
    children: Sequence["_Row"]
    panelled: bool
    spans: tuple[int, ...] = field(init=False)
    xs: tuple[int, ...] = field(init=False)
    y: int = field(init=False)
    bottom: int = field(init=False)
    below: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        inner = [max((child.spans[picture] for child in self.children), default=0) for picture in self._pictures]
        blank = GAP + self._before if self.children else 0
        after = INSET if self.panelled else 0
        self.spans = tuple(self._width(picture) + blank + inner[picture] + after for picture in self._pictures)

    def place(self, xs: tuple[int, ...], top: int, page: int) -> None:
        """Say of it and of all below it where they stand: ``xs`` in each picture, ``top`` in all of them."""
        self.xs, self.y = xs, top
        self.bottom = top + max(each.height for each in self.cards if each is not None)
        if not self.children:
            return
        self.below = any(x + span > page for x, span in zip(xs, self.spans, strict=True))
        ahead = (INDENT if self.below else self._width(picture) + GAP for picture in self._pictures)
        inner = tuple(x + more + self._before for x, more in zip(xs, ahead, strict=True))
        under = self.panel_top + (LABEL if self.panelled else 0)
        for child in self.children:
            child.place(inner, under, page)
            under = child.bottom + ROW
        self.bottom = max(self.bottom, under - ROW + (INSET if self.panelled else 0))

    @property
    def panel_top(self) -> int:
        """The height at which what is below it begins."""
        return self.y + max(each.height for each in self.cards if each is not None) + ROW if self.below else self.y

    @property
    def _before(self) -> int:
        """The room that its children need before them: for the margin of a panel, and for the cases of a switch."""
        cards = (each for child in self.children for each in child.cards if each is not None)
        return (INSET if self.panelled else 0) + max((case_width(each.box) for each in cards), default=0)

    @property
    def _pictures(self) -> range:
        return range(len(self.cards))

    def _width(self, picture: int) -> int:
        found = self.cards[picture]
        return 0 if found is None else found.width


def case_width(box: Box) -> int:
    """Return how much room the label needs under which a switch chooses a node."""
    return ceil(width(box.case, SMALL)) + 10 if box.case else 0


def _row(box: Box, live: bool) -> _Row:
    children = [_row(child, live) for child in box.children]
    return _Row((card(box, live=live),), children, bool(box.mission and children))


def _pair_row(pair: Pair, live_left: bool, live_right: bool) -> _Row:
    left = None if pair.left is None else card(pair.left, live=live_left)
    right = None if pair.right is None else card(pair.right, live=live_right, change=pair.what)
    children = [_pair_row(child, live_left, live_right) for child in pair.children]
    panelled = any(each is not None and each.box.mission and each.box.children for each in (left, right))
    return _Row((left, right), children, panelled)


class _Collected:
    """Collects what stands in one of the pictures of rows that are placed."""

    def __init__(self, root: _Row, picture: int) -> None:
        self._picture = picture
        self._placed: list[Placed] = []
        self._links: list[Link] = []
        self._panels: list[Panel] = []
        self._right = self._collect(root, None, False)

    def layout(self) -> Layout:
        """Return all of it."""
        bottoms = [each.y + each.height for each in self._placed] + [each.y + each.height for each in self._panels]
        panels = tuple(reversed(self._panels))
        return Layout(tuple(self._placed), tuple(self._links), panels, self._right, max(bottoms))

    def _collect(self, row: _Row, parent: Placed | None, below: bool) -> int:
        """Collect a row and all below it; return where the rightmost of them ends."""
        found = row.cards[self._picture]
        if found is None:  # nor is there anything below it
            return 0
        placed = Placed(found.box, row.xs[self._picture], row.y, found.width, found.height, found.lines)
        self._placed.append(placed)
        if parent is not None:
            self._links.append(Link(parent, placed, below))
        right = max((self._collect(child, placed, row.below) for child in row.children), default=0)
        if found.box.mission and found.box.children:
            left = row.children[0].xs[self._picture] - INSET
            right += INSET
            label = found.box.children[0].file
            self._panels.append(Panel(left, row.panel_top, right - left, row.bottom - row.panel_top, label))
        return max(right, placed.x + placed.width)
