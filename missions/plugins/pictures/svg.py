"""A mission's tree as SVG: cards with kind, arguments, modifiers and line number, from left to right.

The drawing does not depend on machine or date. Statuses have signs and borders in addition to colours.
"""

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import Literal
from xml.etree import ElementTree as ET

from missions.language.nodes import MISSION
from missions.plugins.pictures.compare import CHANGES, Change, TreeComparison
from missions.plugins.pictures.layout import (
    BADGE_PADDING,
    BAND_WIDTH,
    GAP,
    INSET,
    PAGE_WIDTH,
    PAIR_PAGE_WIDTH,
    SMALL_FONT_SIZE,
    CardLink,
    CardText,
    PlacedCard,
    TreeLayout,
    case_width,
    is_live,
    lay_out,
    lay_out_pair,
    text_width,
    truncate,
)
from missions.trees.drawing import SIGNS, Status, TreeBox, TreeDrawing
from missions.trees.drawing_builder import ACTION_SYMBOL, CONDITION_SYMBOL

# Style of drawn trees: colours for colour-blind readers (Okabe and Ito), each with a border of its own.
#
# Plain classes without variables: many SVG programs support no more CSS. Programs that support dark mode
# draw it dark at night; others always draw it light.

STYLE = """
text { font-family: "DejaVu Sans", Verdana, sans-serif; font-size: 11px; fill: #1d2530 }
.page { fill: #fdfdfe } .title { font-size: 22px; font-weight: bold } .summary { font-size: 13px; fill: #525c6a }
.moment { font-size: 13px; font-weight: bold; fill: #0067a8 }
.panel { fill: #f1f3f8; stroke: #d3d9e4 } .within { fill: #5d6776 }
.shadow { fill: #e3e7ed } .card { fill: #ffffff; stroke: #aeb7c3; stroke-width: 1.2 } .outline { fill: none }
.composite { fill: #434d5c } .mission { fill: #5f4b91 } .condition { fill: #0f736d } .action { fill: #2a5d8f }
.band.idle { fill: #767d88 } .band.running { fill: #0067a8 } .band.suspended { fill: #7a5200 }
.band.skipped { fill: #56616d } .band.success { fill: #00735a } .band.failure { fill: #b3400a }
.card.idle { stroke: #858c97; stroke-dasharray: 4 3 }
.card.running { fill: #eaf4fc; stroke: #0067a8; stroke-width: 3 }
.card.suspended { fill: #fdf3dc; stroke: #7a5200; stroke-width: 3; stroke-dasharray: 2 3 }
.card.success { fill: #ecf7f3; stroke: #00735a }
.card.skipped { fill: #f4f5f7; stroke: #56616d; stroke-dasharray: 1 3 }
.card.failure { fill: #fdf0e9; stroke: #b3400a; stroke-width: 1.5 }
.inner { fill: none; stroke: #b3400a; stroke-width: 1.2 }
.link { fill: none; stroke: #aeb7c3; stroke-width: 1.6 }
.link.idle { stroke: #a3aab4; stroke-dasharray: 4 3 } .link.running { stroke: #0067a8; stroke-width: 3 }
.link.suspended { stroke: #7a5200; stroke-width: 3; stroke-dasharray: 2 3 }
.link.skipped, .pill.skipped { stroke: #56616d; stroke-dasharray: 1 3 }
.link.success { stroke: #00735a } .link.failure { stroke: #b3400a; stroke-dasharray: 9 3 }
.symbol { fill: #ffffff; font-size: 14px; text-anchor: middle } .sample { text-anchor: middle }
.kind { font-size: 13px; font-weight: bold } .name { font-size: 13px }
.sign { font-size: 13px } .line { font-size: 10px; fill: #66707e }
.argument { fill: #434d5c } .folded { fill: #5f4b91 } .reason { fill: #1d2530 } .case { fill: #434d5c }
.sign.suspended { fill: #7a5200 }
.sign.running { fill: #0067a8 } .sign.success { fill: #00735a } .sign.failure { fill: #b3400a }
.pill { fill: #fdf3dc; stroke: #d9bd7a } .badge { fill: #573f00 }
.pill.running { stroke: #0067a8; stroke-width: 2 } .pill.success { stroke: #00735a }
.pill.suspended { stroke: #7a5200; stroke-width: 2; stroke-dasharray: 2 3 }
.pill.failure { stroke: #b3400a; stroke-width: 2 }
.same { opacity: 0.72 } .change { fill: #86305f }
.mark { stroke: #ffffff; stroke-width: 1.5 } .marked { fill: #ffffff; font-size: 12px; font-weight: bold }
.mark.changed { fill: #97376c } .mark.added { fill: #00735a } .mark.removed { fill: #b3400a }
.card.changed { fill: #fcf1f7; stroke: #97376c; stroke-width: 2 }
.card.added { fill: #ecf7f3; stroke: #00735a; stroke-width: 2.5 }
.card.removed { fill: #fdf0e9; stroke: #b3400a; stroke-width: 2; stroke-dasharray: 7 4 }
.rule { stroke: #d3d9e4; stroke-width: 1.5 }
@media (prefers-color-scheme: dark) {
text { fill: #e5e9ee } .page { fill: #12161b } .summary { fill: #a3aeba } .moment { fill: #7cc0f5 }
.panel { fill: #181d23; stroke: #343d48 } .within { fill: #a3aeba } .shadow { fill: #0a0d10 }
.card { fill: #1f262e; stroke: #56616d } .card.idle { stroke: #8a95a1 }
.card.running { fill: #152a3c; stroke: #7cc0f5 } .card.success { fill: #14302a; stroke: #67d0a8 }
.card.suspended { fill: #372c12; stroke: #f0c667 } .link.suspended { stroke: #f0c667 }
.sign.suspended { fill: #f0c667 } .pill.suspended { stroke: #f0c667 }
.card.skipped { fill: #1f262e; stroke: #a3aeba } .link.skipped, .pill.skipped { stroke: #a3aeba }
.card.failure { fill: #3a2119; stroke: #ff9f73 } .inner { stroke: #ff9f73 }
.link { stroke: #56616d } .link.idle { stroke: #6b7682 } .link.running { stroke: #7cc0f5 }
.link.success { stroke: #67d0a8 } .link.failure { stroke: #ff9f73 }
.line, .argument, .case { fill: #a3aeba } .folded { fill: #bdb0ea } .reason { fill: #e5e9ee }
.sign.running { fill: #7cc0f5 } .sign.success { fill: #67d0a8 } .sign.failure { fill: #ff9f73 }
.pill { fill: #3a3113; stroke: #8a6d1f } .badge { fill: #f2dfa8 } .pill.running { stroke: #7cc0f5 }
.pill.success { stroke: #67d0a8 } .pill.failure { stroke: #ff9f73 }
.change { fill: #eeb0d2 } .mark { stroke: #12161b } .card.changed { fill: #35202d; stroke: #d987b5 }
.card.added { fill: #14302a; stroke: #67d0a8 } .card.removed { fill: #3a2119; stroke: #ff9f73 }
.symbol, .marked { fill: #ffffff } .rule { stroke: #343d48 }
}
"""


# SVG document in whole pixels: rectangles, lines and texts, each with a class.


class SvgCanvas:
    """SVG document or group to which shapes are added; later shapes lie on top."""

    def __init__(self, element: ET.Element) -> None:
        self._element = element

    @classmethod
    def new_page(cls, name: str, wide: int, high: int) -> "SvgCanvas":
        """Return an empty page; ``name`` is its title for programs and screen readers."""
        size = {"viewBox": f"0 0 {wide} {high}", "width": str(wide), "height": str(high)}
        canvas = cls(ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "role": "img", **size}))
        canvas.tooltip(name)
        canvas._add("style").text = STYLE
        canvas._add("rect", width=str(wide), height=str(high)).set("class", "page")
        return canvas

    def document(self) -> str:
        """Return the SVG text."""
        ET.indent(self._element)
        return ET.tostring(self._element, encoding="unicode") + "\n"

    def group(self, kind: str, x: int = 0, y: int = 0) -> "SvgCanvas":
        """Add a group with the CSS class ``kind`` and its origin at ``x``, ``y``; return it as a canvas."""
        group = self._add("g")
        if kind:
            group.set("class", kind)
        if x or y:
            group.set("transform", f"translate({x} {y})")
        return SvgCanvas(group)

    def tooltip(self, text: str) -> None:
        """Add a tooltip, which is shown for all shapes of this group."""
        self._add("title").text = _clean(text)

    def text(self, kind: str, text: str, x: int, y: int) -> None:
        """Add ``text`` with the CSS class ``kind`` and its baseline at ``x``, ``y``; an empty text adds nothing."""
        if text:
            written = self._add("text", x=str(x), y=str(y))
            written.set("class", kind)
            written.text = _clean(text)

    def rect(self, kind: str, x: int, y: int, wide: int, high: int, *, radius: int = 8) -> None:
        """Add a rectangle with the CSS class ``kind``; ``radius`` is that of its corners."""
        size = {"width": str(wide), "height": str(high), "rx": str(radius)}
        self._add("rect", x=str(x), y=str(y), **size).set("class", kind)

    def path(self, kind: str, path: str) -> None:
        """Add a path in SVG notation, with the CSS class ``kind``."""
        self._add("path", d=path).set("class", kind)

    def disc(self, kind: str, x: int, y: int, radius: int) -> None:
        """Add a disc with the CSS class ``kind``."""
        self._add("circle", cx=str(x), cy=str(y), r=str(radius)).set("class", kind)

    def _add(self, tag: str, **attributes: str) -> ET.Element:
        return ET.SubElement(self._element, tag, attributes)


def _clean(text: str) -> str:
    """Return ``text`` without characters that XML forbids."""
    return "".join(letter if letter in "\t\n" or letter.isprintable() else "\ufffd" for letter in text)


MARGIN, HEADER, LEGEND, MOMENT_WIDTH = 28, 88, 50, 140
"""Pixels around the tree, above it for the title, below it for the legend, and beside the title for the moment."""

TITLE_SIZE, SUMMARY_SIZE = 22, 13
"""Font sizes of the header."""

CORNER_RADIUS, LINK_OFFSET = 8, 20
"""Radius of the corners of links, and distance of their ends from the upper edge of a card."""

Kind = Literal["composite", "condition", "action", "mission"]
KINDS: Mapping[Kind, str] = {"composite": "", "condition": CONDITION_SYMBOL, "action": ACTION_SYMBOL, "mission": "▣"}
"""Kinds of nodes with their signs; empty for composites, since each composite, such as `sequence`, has its own sign."""

_LINK_ORDER: Mapping[Status, int] = {
    "idle": 0,
    "skipped": 1,
    "success": 2,
    "failure": 3,
    "suspended": 4,
    "running": 5,
}
"""Order in which links to nodes of each status are drawn, since links may share a path; the last one lies on top."""


def svg(drawing: TreeDrawing) -> str:
    """Return the drawing of a tree, with statuses if it shows a moment of a run."""
    layout, live = lay_out(drawing), is_live(drawing)
    wide = _page_width(drawing, layout, PAGE_WIDTH)
    canvas = SvgCanvas.new_page(drawing.mission, wide + 2 * MARGIN, HEADER + layout.height + LEGEND)
    _header(canvas, drawing, MARGIN, wide)
    _TreeDrawing(canvas.group("tree", MARGIN, HEADER), live, {}).draw(layout)
    statuses = {status for box in drawing.root.walk() for status in (box.status, *(each.status for each in box.badges))}
    kinds = {kind_of(box) for box in drawing.root.walk()}
    samples = [("card", it, sign) for it, sign in SIGNS.items() if it in statuses]
    bands = [("band", it, sign) for it, sign in KINDS.items() if it in kinds]
    _legend(canvas, HEADER + layout.height, samples if live else bands)
    return canvas.document()


def svg_pair(comparison: TreeComparison) -> str:
    """Return the drawing of two missions side by side, corresponding nodes at the same height, differences marked."""
    left, right = lay_out_pair(comparison)
    left_wide, right_wide = (
        _page_width(comparison.left, left, PAIR_PAGE_WIDTH),
        _page_width(comparison.right, right, PAIR_PAGE_WIDTH),
    )
    middle = left_wide + 2 * MARGIN
    height = HEADER + max(left.height, right.height)
    name = f"{comparison.left.mission} and {comparison.right.mission}: {comparison.summary}"
    canvas = SvgCanvas.new_page(name, middle + right_wide + 2 * MARGIN, height + LEGEND)
    canvas.path("rule", f"M{middle} {MARGIN}V{height}")
    pairs = list(comparison.root.walk())
    of_left = {pair.left.key: pair.change for pair in pairs if pair.left is not None}
    of_right = {pair.right.key: pair.change for pair in pairs if pair.right is not None}
    for drawing, layout, x, wide, changes in (
        (comparison.left, left, MARGIN, left_wide, of_left),
        (comparison.right, right, middle + MARGIN, right_wide, of_right),
    ):
        _header(canvas, drawing, x, wide)
        _TreeDrawing(canvas.group("tree", x, HEADER), is_live(drawing), changes).draw(layout)
    _legend(canvas, height, [("card", it, sign) for it, sign in CHANGES.items() if comparison.count(it)])
    return canvas.document()


def kind_of(box: TreeBox) -> Kind:
    """Return the kind of the node ``box``: composite, condition, action or mission."""
    leaves: Mapping[str, Kind] = {CONDITION_SYMBOL: "condition", ACTION_SYMBOL: "action"}
    return "mission" if box.kind == MISSION else leaves.get(box.symbol, "composite")


def _page_width(drawing: TreeDrawing, layout: TreeLayout, max_width: int) -> int:
    """Return the width of a tree with its header; the header is no wider than ``max_width``."""
    title = ceil(text_width(drawing.mission, TITLE_SIZE, bold=True)) + MOMENT_WIDTH
    return max(layout.width, title, min(ceil(text_width(drawing.summary, SUMMARY_SIZE)), max_width))


def _header(canvas: SvgCanvas, drawing: TreeDrawing, x: int, wide: int) -> None:
    """Write the mission's name and summary, and the time in the run that the drawing shows."""
    canvas.text("title", drawing.mission, x, MARGIN + 18)
    canvas.text("summary", truncate(drawing.summary, SUMMARY_SIZE, wide), x, MARGIN + 40)
    if drawing.time is not None:
        beside = x + ceil(text_width(drawing.mission, TITLE_SIZE, bold=True)) + 14
        canvas.text("moment", f"at {drawing.time:.2f} s", beside, MARGIN + 18)


def _legend(canvas: SvgCanvas, y: int, samples: Sequence[tuple[str, str, str]]) -> None:
    """Draw the legend of a tree: a sample of each colour in the drawing, with its sign and its word."""
    x, y = MARGIN, y + LEGEND - 20
    for sort, word, sign in samples:
        canvas.rect(f"{sort} {word}", x, y - 12, 24, 16, radius=4)
        canvas.text("symbol" if sort == "band" else f"sign sample {word}", sign, x + 12, y + 1)
        canvas.text("within", word, x + 31, y)
        x += 31 + ceil(text_width(word, SMALL_FONT_SIZE)) + 22


class _TreeDrawing:
    """Drawing of one tree.

    ``changes`` says for each node, by its key, how the node differs from the tree beside this one: "same", "added"...
    """

    def __init__(self, canvas: SvgCanvas, live: bool, changes: Mapping[str, Change]) -> None:
        self._canvas = canvas
        self._live = live
        self._changes = changes

    def draw(self, layout: TreeLayout) -> None:
        """Draw panels, links, and the cards on top of them."""
        for panel in layout.panels:
            self._canvas.rect("panel", panel.x, panel.y, panel.width, panel.height)
            self._canvas.text("within", panel.label, panel.x + INSET, panel.y + 17)
        for link in sorted(layout.links, key=lambda link: _LINK_ORDER[link.child.box.outer_status]):
            self._link(link)
        for each in layout.cards:
            self._card(each)

    def _link(self, link: CardLink) -> None:
        """Draw a link from the right or the bottom of a node to its child; it branches just before the child."""
        parent, child = link.parent, link.child
        x, y = parent.x + parent.width, parent.y + LINK_OFFSET
        end_x, end_y = child.x, child.y + LINK_OFFSET
        into = f"V{end_y - CORNER_RADIUS}q0 {CORNER_RADIUS} {CORNER_RADIUS} {CORNER_RADIUS}H{end_x}"
        if link.below:
            way = f"M{parent.x + BAND_WIDTH // 2} {parent.y + parent.height}{into}"
        elif end_y == y:
            way = f"M{x} {y}H{end_x}"
        else:
            way = f"M{x} {y}h{GAP // 2 - CORNER_RADIUS}q{CORNER_RADIUS} 0 {CORNER_RADIUS} {CORNER_RADIUS}{into}"
        self._canvas.path(f"link {child.box.outer_status}" if self._live else "link", way)
        self._canvas.text("case", child.box.case, end_x - case_width(child.box) + 2, end_y - 5)

    def _card(self, placed: PlacedCard) -> None:
        box, x, y, wide, high = placed.box, placed.x, placed.y, placed.width, placed.height
        change = self._changes.get(box.key)
        node = self._canvas.group(f"node {change or ''}".rstrip())
        node.tooltip("\n".join(_tooltip_lines(box)))
        look = f"{box.status if self._live else ''} {'' if change in (None, 'same') else change}".strip()
        if box.folded:
            node.rect("card", x + 5, y + 5, wide, high)
        node.rect("shadow", x, y + 2, wide, high)
        node.rect(f"card {look}".rstrip(), x, y, wide, high)
        node.path(f"band {box.status if self._live else kind_of(box)}", _band_path(x, y, high))
        if look == "failure":
            node.rect("inner", x + 3, y + 3, wide - 6, high - 6, radius=5)
        for line in placed.lines:
            _write_text(node, line, x + line.x, y + line.y, box.status)
        if change is not None and change != "same":
            sign = CHANGES[change]
            node.disc(f"mark {change}", x, y, 9)
            node.text("marked", sign, x - round(text_width(sign, 12, bold=True) / 2), y + 4)


def _write_text(node: SvgCanvas, line: CardText, x: int, y: int, status: Status) -> None:
    """Write one text of a card: a modifier with a rounded background, a symbol centred, others from ``x`` on."""
    if line.part == "badge":
        node.rect(f"pill {line.status}", x - BADGE_PADDING, y - 13, line.width + 2 * BADGE_PADDING, 18, radius=9)
    middle = x + line.width // 2 if line.part == "symbol" else x
    node.text(f"sign {status}" if line.part == "sign" else line.part, line.text, middle, y)


def _tooltip_lines(box: TreeBox) -> Iterator[str]:
    """Yield all facts of a node, one a line, for its tooltip; the card may show fewer."""
    yield f"{box.title} ({box.file}, line {box.line})"
    yield from (f"{name}: {text}" for name, text in box.arguments.items())
    if box.keep_as:
        yield f"as: {box.keep_as}"
    for badge in box.badges:
        yield f"{badge.kind}: {badge.text}" + (f" ({badge.status}: {badge.reason})" if badge.reason else "")
    if box.status != "idle":
        yield f"{box.status}: {box.reason}".removesuffix(": ")


def _band_path(x: int, y: int, high: int) -> str:
    """Return the SVG path of the left end of a card, which holds its symbol."""
    flat, down = BAND_WIDTH - CORNER_RADIUS, high - 2 * CORNER_RADIUS
    r = CORNER_RADIUS
    return f"M{x + BAND_WIDTH} {y}h-{flat}q-{r} 0 -{r} {r}v{down}q0 {r} {r} {r}h{flat}z"
