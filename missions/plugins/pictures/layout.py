"""Layout of the cards in a drawing of a tree: children to the right of their parent, up to the page width.

Beyond that width, children stand below their parent and slightly to the right, as in the file, so that a deep tree
grows downwards and stays legible. A node has the height of its first child. The tree of a sub-mission has a panel of
its own.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import ceil
from typing import Literal
from unicodedata import category, combining, east_asian_width, normalize

from missions.plugins.pictures.compare import NodePair, TreeComparison
from missions.trees.drawing import SIGNS, Status, TreeBox, TreeDrawing

# Widths of texts in DejaVu Sans, so that the layout needs no font and is the same on every machine.
#
# It is among the widest usual sans fonts, so texts also fit in a substitute.

_REGULAR = """
318 401 460 838 637 951 780 275 391 391 500 838 318 361 318 337 637 637 637 637 637 637 637 637 637 637 337 337 838 838
838 531 1000 685 687 699 771 632 576 775 752 295 295 656 558 863 749 788 604 788 695 635 611 732 685 989 686 611 686
391 337 391 838 500 500 613 635 550 635 616 353 635 634 278 278 580 278 975 634 612 635 635 412 521 393 634 592 818 592
592 525 637 337 637 838"""
_BOLD = """
349 457 521 838 696 1002 873 307 458 458 523 838 380 416 380 366 696 696 696 696 696 696 696 696 696 696 400 400 838 838
838 581 1000 774 763 734 831 684 684 821 837 373 373 775 638 996 837 851 733 851 771 721 683 813 774 1104 771 725 726
458 366 458 838 500 500 675 716 593 716 679 436 716 712 343 343 666 343 1042 712 688 716 716 494 596 479 712 652 924 646
652 583 712 366 712 838"""
# Widths of the ASCII characters from the blank on in thousandths of the font size, from the font's table.

_LETTER, _SIGN, _WIDE = 0.75, 1.0, 1.05
"""Widths of characters outside the table: small letters of other scripts; signs and capitals; East Asian characters."""
_BROAD = frozenset("ÆŒæœƕƣǶȡȵȸȹωϖϣͳЉЊЖШЩЮжмфшщыюљњ‰‱№")
_BROADER = 1.4
"""Factor by which wide letters and signs, such as æ and Ж, are wider than usual ones of the same kind."""
_HORN = 0.15
"""Additional width of a letter with a horn, or with a caron written as an apostrophe, as in ơ and ľ."""


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Return the width of ``text`` in a font of ``size``, in the same unit."""
    return size * sum(_advance(letter, bold) for letter in text)


def truncate(text: str, size: float, max_width: float, *, bold: bool = False) -> str:
    """Return ``text`` in one line within the maximum width, truncated with an ellipsis."""
    text = " ".join(text.split())
    if text_width(text, size, bold=bold) <= max_width:
        return text
    room = max_width - text_width("…", size, bold=bold)
    kept = 0
    for letter in text:
        room -= text_width(letter, size, bold=bold)
        if room < 0:
            break
        kept += 1
    return f"{text[:kept].rstrip()}…"


def wrap_items(items: Iterable[str], separator: str, size: float, max_width: float, max_lines: int) -> tuple[str, ...]:
    """Wrap ``items``, joined by ``separator``, to at most ``max_lines`` lines; an ellipsis replaces the rest.

    An item wider than a line is broken between its words; other items are not broken.
    """
    rows: list[str] = []
    for glue, word in _unbreakable_words(items, separator, size, max_width):
        longer = f"{rows[-1]}{glue}{word}" if rows else word
        if rows and (len(rows) == max_lines or text_width(longer, size) <= max_width):
            rows[-1] = longer
        else:
            rows.append(word)
    return tuple(truncate(row, size, max_width) for row in rows)


def _unbreakable_words(
    items: Iterable[str], separator: str, size: float, max_width: float
) -> Iterator[tuple[str, str]]:
    """Yield the texts between which a line may break, each as (separator before it on the same line, text).

    An item wider than ``max_width`` is split into its words.
    """
    for item in items:
        words = [item] if text_width(item, size) <= max_width else item.split()
        yield from zip([separator, *(" " for _ in words)], words, strict=False)


@lru_cache(maxsize=4096)
def _advance(letter: str, bold: bool) -> float:
    """Return the width of one character in a font of size 1."""
    if combining(letter) or category(letter) in ("Cf", "Mn", "Me"):
        return 0.0
    parts = [each for each in normalize("NFKD", letter) if category(each).startswith("L")]
    if len(parts) > 1:  # a ligature, such as dž
        return sum(_advance(each, bold) for each in parts)
    plain, *marks = list(normalize("NFD", letter))  # an accent makes no letter wider
    horn = _HORN if "\u031b" in marks or (plain == "l" and "\u030c" in marks) else 0.0
    if " " <= plain <= "~":
        return int((_BOLD if bold else _REGULAR).split()[ord(plain) - ord(" ")]) / 1000 + horn
    if east_asian_width(letter) in "WF":
        return _WIDE
    usual = _LETTER if category(letter) == "Ll" else _SIGN
    return usual * (_BROADER if plain in _BROAD else 1.0) * (1.1 if bold else 1.0)


# Card of a node: a few short lines of text with their positions.
#
# Title, arguments, modifiers and reason stand below each other, in whole pixels, so that a picture is
# the same everywhere. Long texts end in "…"; the tooltip has the rest.

Part = Literal["symbol", "kind", "name", "sign", "line", "argument", "badge", "reason", "change", "folded"]

SIZES: Mapping[Part, int] = {"symbol": 14, "kind": 13, "name": 13, "sign": 13, "line": 10}
"""Font sizes in pixels of the larger parts of a card; all other parts have ``SMALL_FONT_SIZE``."""

SMALL_FONT_SIZE = 11

BAND_WIDTH, MAX_LINE_WIDTH, CARD_PADDING = 30, 320, 11
"""The band at the left that the symbol stands on, the widest line, and the blank beside it; all in pixels."""

TITLE_HEIGHT, SMALL_LINE_HEIGHT, BADGE_HEIGHT, BADGE_PADDING = 20, 16, 23, 7
"""The heights of the rows, and the blank at both ends of a badge."""


@dataclass(frozen=True, slots=True)
class CardText:
    """A text on a card, with its baseline at ``x``, ``y`` (pixels) from the card's upper left corner.

    ``part`` is the part of the card that it belongs to. ``status`` is the status of a modifier, if the text is one.
    """

    part: Part
    text: str
    x: int
    y: int
    width: int
    status: Status = "idle"


@dataclass(frozen=True, slots=True)
class Card:
    """Card of a node, with its texts, and its size in pixels."""

    box: TreeBox
    width: int
    height: int
    lines: tuple[CardText, ...]


def make_card(box: TreeBox, *, live: bool = False, change: str = "") -> Card:
    """Return the card of the node ``box``.

    With ``live`` it has the sign of the node's status. ``change`` are the node's differences from another mission, a
    line each.
    """
    writer = _CardWriter()
    writer.title(box, live)
    writer.small("argument", _wrap_small(_arguments(box), ", ", 3))
    writer.badges(box, live)
    writer.small("folded", [f"{box.folded} more inside"] if box.folded else [])
    writer.small("reason", _wrap_small(_reasons(box), "; ", 2))
    writer.small("change", _wrap_small(change.split("\n") if change else [], "; ", 3))
    return writer.card(box)


class _CardWriter:
    """Lays out the rows of one card from top to bottom."""

    def __init__(self) -> None:
        self._lines: list[CardText] = []
        self._y = 5  # top of the next row

    def title(self, box: TreeBox, live: bool) -> None:
        """Add the title row of a node: kind, name, status sign, and line number in the file."""
        base = self._y + 15
        self._write("symbol", box.symbol, (BAND_WIDTH - ceil(text_width(box.symbol, SIZES["symbol"]))) // 2, base)
        kind = truncate(box.kind, SIZES["kind"], MAX_LINE_WIDTH / 2, bold=True)
        x = self._write("kind", kind, BAND_WIDTH + CARD_PADDING, base)
        x = self._write("name", truncate(_name(box), SIZES["name"], MAX_LINE_WIDTH), x, base)
        if live:
            x = self._write("sign", SIGNS[box.status], x + 12, base)
        self._write("line", f":{box.line}", x + 10, base)
        self._y += TITLE_HEIGHT

    def small(self, part: Part, texts: Iterable[str]) -> None:
        """Add lines in the small font to the card."""
        for text in texts:
            self._write(part, text, BAND_WIDTH + CARD_PADDING, self._y + 12)
            self._y += SMALL_LINE_HEIGHT

    def badges(self, box: TreeBox, live: bool) -> None:
        """Add the modifiers of a node below its title, as many in a row as fit."""
        if not box.badges:
            return
        x = left = BAND_WIDTH + CARD_PADDING - 2
        self._y += 3
        for badge in box.badges:
            sign = f"{SIGNS[badge.status]} " if live else ""
            text = truncate(f"{sign}{badge.kind} {badge.text}", SMALL_FONT_SIZE, MAX_LINE_WIDTH - 2 * BADGE_PADDING)
            end = x + ceil(text_width(text, SMALL_FONT_SIZE)) + 2 * BADGE_PADDING
            if x > left and end > left + MAX_LINE_WIDTH:
                end, x, self._y = end - x + left, left, self._y + BADGE_HEIGHT
            self._lines.append(
                CardText("badge", text, x + BADGE_PADDING, self._y + 14, end - x - 2 * BADGE_PADDING, badge.status)
            )
            x = end + 6
        self._y += BADGE_HEIGHT

    def card(self, box: TreeBox) -> Card:
        """Return the finished card; status sign and line number are moved to its right edge."""
        ends = (line.x + line.width + (BADGE_PADDING if line.part == "badge" else 0) for line in self._lines)
        wide = max(ends) + CARD_PADDING
        title = max(line.x + line.width for line in self._lines if line.part == "line")
        shift = wide - CARD_PADDING - title
        lines = (replace(it, x=it.x + shift) if it.part in ("sign", "line") else it for it in self._lines)
        return Card(box, wide, self._y + 6, tuple(lines))

    def _write(self, part: Part, text: str, x: int, y: int) -> int:
        """Add one text to the card; return the x coordinate of its right end."""
        wide = ceil(text_width(text, SIZES.get(part, SMALL_FONT_SIZE), bold=part == "kind"))
        if text:
            self._lines.append(CardText(part, text, x, y, wide))
        return x + wide


def _name(box: TreeBox) -> str:
    """Return the name of a node for its title; an argument that is too long for the title gets lines of its own."""
    name = box.title.removeprefix(box.kind)
    return "" if not box.untitled_arguments and box.said and text_width(name, SIZES["name"]) > MAX_LINE_WIDTH else name


def _arguments(box: TreeBox) -> Iterator[str]:
    """Yield a node's arguments as written in the file, except one in the title, and the variable for the result."""
    untold = box.untitled_arguments if _name(box) else box.arguments
    yield from (f"{name}: {text}" for name, text in untold.items())
    if box.keep_as:
        yield f"as: {box.keep_as}"


def _reasons(box: TreeBox) -> Iterator[str]:
    """Yield the reason of a node's status, the time since which it has the status, and the reasons of its modifiers."""
    if box.reason:
        yield box.reason
    if box.since is not None:
        yield f"since {box.since:.2f} s"
    more = dict.fromkeys(badge.reason for badge in box.badges if badge.reason)
    yield from (reason for reason in more if reason != box.reason)


def _wrap_small(items: Iterable[str], separator: str, rows: int) -> tuple[str, ...]:
    return wrap_items(items, separator, SMALL_FONT_SIZE, MAX_LINE_WIDTH, rows)


PAGE_WIDTH, PAIR_PAGE_WIDTH = 1200, 760
"""Page width in pixels, beyond which children stand below their parent: for one tree, and for two."""

GAP, INDENT, ROW = 44, 48, 12
"""Gaps in pixels: to a child on the right, from the left edge to a child below, and between rows."""

INSET, LABEL = 14, 26
"""Margin of a panel, and height of its label."""


@dataclass(frozen=True, slots=True)
class PlacedCard:
    """A node's card in a drawing: position of its upper left corner, size, and texts relative to that corner."""

    box: TreeBox
    x: int
    y: int
    width: int
    height: int
    lines: tuple[CardText, ...]


@dataclass(frozen=True, slots=True)
class CardLink:
    """Line from a node to its child, which stands ``below`` the node or to its right."""

    parent: PlacedCard
    child: PlacedCard
    below: bool


@dataclass(frozen=True, slots=True)
class MissionPanel:
    """Background of the tree of a sub-mission in the drawing of a mission."""

    x: int
    y: int
    width: int
    height: int
    label: str


@dataclass(frozen=True, slots=True)
class TreeLayout:
    """Positions of all cards, links and panels of a tree, in pixels from the upper left corner of the drawing.

    The panel of a sub-mission comes before the panels of the sub-missions inside it.
    """

    cards: tuple[PlacedCard, ...]
    links: tuple[CardLink, ...]
    panels: tuple[MissionPanel, ...]
    width: int
    height: int


def lay_out(drawing: TreeDrawing) -> TreeLayout:
    """Return the layout of one tree."""
    root = _row(drawing.root, is_live(drawing))
    root.place((0,), 0, PAGE_WIDTH)
    return _LayoutCollector(root, 0).layout()


def lay_out_pair(comparison: TreeComparison) -> tuple[TreeLayout, TreeLayout]:
    """Return the layouts of two compared trees; corresponding nodes have the same height."""
    root = _pair_row(comparison.root, is_live(comparison.left), is_live(comparison.right))
    root.place((0, 0), 0, PAIR_PAGE_WIDTH)
    return _LayoutCollector(root, 0).layout(), _LayoutCollector(root, 1).layout()


def is_live(drawing: TreeDrawing) -> bool:
    """Return whether a drawing shows a moment of a run."""
    return drawing.time is not None or any(box.status != "idle" for box in drawing.root.walk())


@dataclass(slots=True)
class _Row:
    """A node of the layout: its card in each of the pictures side by side; None in a picture without this node.

    ``spans`` are the widths (pixels) that its subtree needs in each picture if children stand to the right.
    """

    cards: tuple[Card | None, ...]
    children: Sequence["_Row"]
    has_panel: bool
    spans: tuple[int, ...] = field(init=False)
    xs: tuple[int, ...] = field(init=False)
    y: int = field(init=False)
    bottom: int = field(init=False)
    below: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        inner = [max((child.spans[picture] for child in self.children), default=0) for picture in self._pictures]
        blank = GAP + self._left_margin if self.children else 0
        after = INSET if self.has_panel else 0
        self.spans = tuple(self._width(picture) + blank + inner[picture] + after for picture in self._pictures)

    def place(self, xs: tuple[int, ...], top: int, page: int) -> None:
        """Set the positions of the node and its subtree.

        ``xs`` are the left edges in each picture, ``top`` is the upper edge in all pictures, ``page`` the page width.
        All in pixels.
        """
        self.xs, self.y = xs, top
        self.bottom = top + max(each.height for each in self.cards if each is not None)
        if not self.children:
            return
        self.below = any(x + span > page for x, span in zip(xs, self.spans, strict=True))
        ahead = (INDENT if self.below else self._width(picture) + GAP for picture in self._pictures)
        inner = tuple(x + more + self._left_margin for x, more in zip(xs, ahead, strict=True))
        under = self.panel_top + (LABEL if self.has_panel else 0)
        for child in self.children:
            child.place(inner, under, page)
            under = child.bottom + ROW
        self.bottom = max(self.bottom, under - ROW + (INSET if self.has_panel else 0))

    @property
    def panel_top(self) -> int:
        """The y coordinate at which the node's children, and the panel around them, begin."""
        return self.y + max(each.height for each in self.cards if each is not None) + ROW if self.below else self.y

    @property
    def _left_margin(self) -> int:
        """The width needed to the left of the node's children: for a panel's margin and a switch's cases."""
        cards = (each for child in self.children for each in child.cards if each is not None)
        return (INSET if self.has_panel else 0) + max((case_width(each.box) for each in cards), default=0)

    @property
    def _pictures(self) -> range:
        return range(len(self.cards))

    def _width(self, picture: int) -> int:
        found = self.cards[picture]
        return 0 if found is None else found.width


def case_width(box: TreeBox) -> int:
    """Return the width of the label of a node that is a case of a switch."""
    return ceil(text_width(box.case, SMALL_FONT_SIZE)) + 10 if box.case else 0


def _row(box: TreeBox, live: bool) -> _Row:
    children = [_row(child, live) for child in box.children]
    return _Row((make_card(box, live=live),), children, bool(box.mission and children))


def _pair_row(pair: NodePair, live_left: bool, live_right: bool) -> _Row:
    left = None if pair.left is None else make_card(pair.left, live=live_left)
    right = None if pair.right is None else make_card(pair.right, live=live_right, change=pair.differences)
    children = [_pair_row(child, live_left, live_right) for child in pair.children]
    panelled = any(each is not None and each.box.mission and each.box.children for each in (left, right))
    return _Row((left, right), children, panelled)


class _LayoutCollector:
    """Collects the elements of one picture from positioned rows."""

    def __init__(self, root: _Row, picture: int) -> None:
        self._picture = picture
        self._placed: list[PlacedCard] = []
        self._links: list[CardLink] = []
        self._panels: list[MissionPanel] = []
        self._right = self._collect(root, None, False)

    def layout(self) -> TreeLayout:
        bottoms = [each.y + each.height for each in self._placed] + [each.y + each.height for each in self._panels]
        panels = tuple(reversed(self._panels))
        return TreeLayout(tuple(self._placed), tuple(self._links), panels, self._right, max(bottoms))

    def _collect(self, row: _Row, parent: PlacedCard | None, below: bool) -> int:
        """Collect the card, links and panels of a node and its subtree; return the x coordinate of their right end."""
        found = row.cards[self._picture]
        if found is None:  # then it has no subtree either
            return 0
        placed = PlacedCard(found.box, row.xs[self._picture], row.y, found.width, found.height, found.lines)
        self._placed.append(placed)
        if parent is not None:
            self._links.append(CardLink(parent, placed, below))
        right = max((self._collect(child, placed, row.below) for child in row.children), default=0)
        if found.box.mission and found.box.children:
            left = row.children[0].xs[self._picture] - INSET
            right += INSET
            label = found.box.children[0].file
            self._panels.append(MissionPanel(left, row.panel_top, right - left, row.bottom - row.panel_top, label))
        return max(right, placed.x + placed.width)
