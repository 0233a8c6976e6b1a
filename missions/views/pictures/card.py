"""A node as it is drawn: a card with a few short lines of text, each with its place on the card.

Title, arguments, modifiers and the reason stand below each other; all of it in whole pixels, so that a picture is the
same everywhere. What is too long ends in "…": a picture's tooltip has the rest.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Literal

from missions.views.pictures.drawing import SIGNS, Box, Status
from missions.views.pictures.measure import cut, packed, width

Part = Literal["symbol", "kind", "name", "sign", "line", "argument", "badge", "reason", "change", "folded"]

SIZES: Mapping[Part, int] = {"symbol": 14, "kind": 13, "name": 13, "sign": 13, "line": 10}
"""The size of the font of each part of a card; that of all others is ``SMALL``."""

SMALL = 11

BAND, MAX_WIDTH, PAD = 30, 320, 11
"""The band at the left that the symbol stands on, the widest line, and the blank beside it; all in pixels."""

TITLE_ROW, SMALL_ROW, BADGE_ROW, BADGE_PAD = 20, 16, 23, 7
"""The heights of the rows, and the blank at both ends of a badge."""


@dataclass(frozen=True, slots=True)
class Line:
    """A text on a card: ``x`` and its base line ``y`` from the card's upper left corner. A badge has a status too."""

    part: Part
    text: str
    x: int
    y: int
    width: int
    status: Status = "idle"


@dataclass(frozen=True, slots=True)
class Card:
    """A box with its lines; ``width`` and ``height`` hold all of them."""

    box: Box
    width: int
    height: int
    lines: tuple[Line, ...]


def card(box: Box, *, live: bool = False, change: str = "") -> Card:
    """Return the card of ``box``: with signs of statuses if ``live``; ``change`` says in which way it differs."""
    writer = _Writer()
    writer.title(box, live)
    writer.small("argument", _packed(_arguments(box), ", ", 3))
    writer.badges(box, live)
    writer.small("folded", [f"{box.folded} more inside"] if box.folded else [])
    writer.small("reason", _packed(_reasons(box), "; ", 2))
    writer.small("change", _packed(change.split("\n") if change else [], "; ", 3))
    return writer.card(box)


class _Writer:
    """Writes the rows of one card from the top downwards."""

    def __init__(self) -> None:
        self._lines: list[Line] = []
        self._y = 5  # where the next row begins

    def title(self, box: Box, live: bool) -> None:
        """Write kind, name, the sign of the status, and the line of the file."""
        base = self._y + 15
        self._write("symbol", box.symbol, (BAND - ceil(width(box.symbol, SIZES["symbol"]))) // 2, base)
        kind = cut(box.kind, SIZES["kind"], MAX_WIDTH / 2, bold=True)
        x = self._write("kind", kind, BAND + PAD, base)
        x = self._write("name", cut(_name(box), SIZES["name"], MAX_WIDTH), x, base)
        if live:
            x = self._write("sign", SIGNS[box.status], x + 12, base)
        self._write("line", f":{box.line}", x + 10, base)
        self._y += TITLE_ROW

    def small(self, part: Part, texts: Iterable[str]) -> None:
        """Write lines of small print."""
        for text in texts:
            self._write(part, text, BAND + PAD, self._y + 12)
            self._y += SMALL_ROW

    def badges(self, box: Box, live: bool) -> None:
        """Write the modifiers, as many in a row as there is room for."""
        if not box.badges:
            return
        x = left = BAND + PAD - 2
        self._y += 3
        for badge in box.badges:
            sign = f"{SIGNS[badge.status]} " if live else ""
            text = cut(f"{sign}{badge.kind} {badge.text}", SMALL, MAX_WIDTH - 2 * BADGE_PAD)
            end = x + ceil(width(text, SMALL)) + 2 * BADGE_PAD
            if x > left and end > left + MAX_WIDTH:
                end, x, self._y = end - x + left, left, self._y + BADGE_ROW
            self._lines.append(Line("badge", text, x + BADGE_PAD, self._y + 14, end - x - 2 * BADGE_PAD, badge.status))
            x = end + 6
        self._y += BADGE_ROW

    def card(self, box: Box) -> Card:
        """Return what was written; what ends the title's row moves to the right edge."""
        ends = (line.x + line.width + (BADGE_PAD if line.part == "badge" else 0) for line in self._lines)
        wide = max(ends) + PAD
        title = max(line.x + line.width for line in self._lines if line.part == "line")
        shift = wide - PAD - title
        lines = (replace(it, x=it.x + shift) if it.part in ("sign", "line") else it for it in self._lines)
        return Card(box, wide, self._y + 6, tuple(lines))

    def _write(self, part: Part, text: str, x: int, y: int) -> int:
        """Write one text, and return where it ends."""
        wide = ceil(width(text, SIZES.get(part, SMALL), bold=part == "kind"))
        if text:
            self._lines.append(Line(part, text, x, y, wide))
        return x + wide


def _name(box: Box) -> str:
    """Return what the title says after the kind; an argument that is too long for it has lines of its own."""
    name = box.title.removeprefix(box.kind)
    return "" if not box.untold and box.said and width(name, SIZES["name"]) > MAX_WIDTH else name


def _arguments(box: Box) -> Iterator[str]:
    """Yield the arguments as the file has them, but one that the title says, and the variable that keeps the result."""
    untold = box.untold if _name(box) else box.arguments
    yield from (f"{name}: {text}" for name, text in untold.items())
    if box.keep_as:
        yield f"as: {box.keep_as}"


def _reasons(box: Box) -> Iterator[str]:
    """Yield why it stands as it does, since when, and what its modifiers add to that."""
    if box.reason:
        yield box.reason
    if box.since is not None:
        yield f"since {box.since:.2f} s"
    more = dict.fromkeys(badge.reason for badge in box.badges if badge.reason)
    yield from (reason for reason in more if reason != box.reason)


def _packed(items: Iterable[str], blank: str, rows: int) -> tuple[str, ...]:
    return packed(items, blank, SMALL, MAX_WIDTH, rows)
