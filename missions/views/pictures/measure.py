"""How wide a text is in DejaVu Sans, so that a picture is laid out without a font, and the same on every machine.

It is among the widest of the usual sans: where another takes its place, every text still fits.
"""

from collections.abc import Iterable, Iterator
from functools import lru_cache
from unicodedata import category, combining, east_asian_width, normalize

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
# Thousandths of the font's size for each character of ASCII from the blank on, as the font's own table has them.

_LETTER, _SIGN, _WIDE = 0.75, 1.0, 1.05
"""What small letters of other scripts take in a word, and what other signs and capitals, and those of East Asia do."""
_BROAD = frozenset("ÆŒæœƕƣǶȡȵȸȹωϖϣͳЉЊЖШЩЮжмфшщыюљњ‰‱№")
_BROADER = 1.4
"""Letters and signs that are as broad as two, and how many times what others of their kind take they do."""
_HORN = 0.15
"""What a horn, or a caron written as an apostrophe, adds to its letter, as in ơ and ľ."""


def width(text: str, size: float, *, bold: bool = False) -> float:
    """Return how far ``text`` reaches in a font of ``size``, in the same unit."""
    return size * sum(_advance(letter, bold) for letter in text)


def cut(text: str, size: float, most: float, *, bold: bool = False) -> str:
    """Return ``text`` in one line no wider than ``most``; what is cut off, an ellipsis stands for."""
    text = " ".join(text.split())
    if width(text, size, bold=bold) <= most:
        return text
    room = most - width("…", size, bold=bold)
    kept = 0
    for letter in text:
        room -= width(letter, size, bold=bold)
        if room < 0:
            break
        kept += 1
    return f"{text[:kept].rstrip()}…"


def packed(items: Iterable[str], blank: str, size: float, most: float, lines: int) -> tuple[str, ...]:
    """Fill at most ``lines`` lines with ``items``, ``blank`` between them; an ellipsis stands for what is more.

    An item that is wider than a line is broken between its words, all others stay in one piece.
    """
    rows: list[str] = []
    for glue, word in _words(items, blank, size, most):
        longer = f"{rows[-1]}{glue}{word}" if rows else word
        if rows and (len(rows) == lines or width(longer, size) <= most):
            rows[-1] = longer
        else:
            rows.append(word)
    return tuple(cut(row, size, most) for row in rows)


def _words(items: Iterable[str], blank: str, size: float, most: float) -> Iterator[tuple[str, str]]:
    """Yield what stays together, each with what stands before it on the same line."""
    for item in items:
        words = [item] if width(item, size) <= most else item.split()
        yield from zip([blank, *(" " for _ in words)], words, strict=False)


@lru_cache(maxsize=4096)
def _advance(letter: str, bold: bool) -> float:
    """Return the width of one character in a font of size 1."""
    if combining(letter) or category(letter) in ("Cf", "Mn", "Me"):
        return 0.0
    parts = [each for each in normalize("NFKD", letter) if category(each).startswith("L")]
    if len(parts) > 1:  # two letters in one, such as dž
        return sum(_advance(each, bold) for each in parts)
    plain, *marks = list(normalize("NFD", letter))  # an accent makes no letter wider
    horn = _HORN if "\u031b" in marks or (plain == "l" and "\u030c" in marks) else 0.0
    if " " <= plain <= "~":
        return int((_BOLD if bold else _REGULAR).split()[ord(plain) - ord(" ")]) / 1000 + horn
    if east_asian_width(letter) in "WF":
        return _WIDE
    usual = _LETTER if category(letter) == "Ll" else _SIGN
    return usual * (_BROADER if plain in _BROAD else 1.0) * (1.1 if bold else 1.0)
