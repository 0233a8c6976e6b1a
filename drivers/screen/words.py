"""Words below a face: as large as fits, in as many lines as they need, broken at spaces."""

import textwrap
import unicodedata

from drivers.api.quick import dataclass

TOP, ROOM, ACROSS = 164.0, 70.0, 308.0
"""Where the words begin below the small face, and their room, on the sheet of 320 x 240."""

LINES = 5
"""More make letters too small to be read from afar."""

LETTER = 0.63
"""How wide a bold letter is on average, as a share of its size; those of Chinese, Japanese and Korean are square."""

LEADING = 1.15
"""From line to line, as a share of the size."""

LARGEST = 44.0

MAX_TEXT_LENGTH = 240
"""Letters that are looked at: a few more than there is ever room for. What is longer costs no more."""

NO_LETTERS = ("Cc", "Cs", "Cn", "Co")
"""Categories of Unicode: controls, surrogates, not assigned, private."""


@dataclass(frozen=True, slots=True)
class Words:
    """Lines of words, the size of their letters, and how far down the foot of each line is."""

    lines: tuple[str, ...]
    size: float
    feet: tuple[float, ...]


def plain(text: str) -> str:
    """Return ``text`` in one line, with spaces for what is no letter: controls, halves of letters, what is unassigned.

    What is longer than ``MAX_TEXT_LENGTH`` letters ends there in an ellipsis.
    """
    text = " ".join(text.split())
    if len(text) > MAX_TEXT_LENGTH:
        text = text[:MAX_TEXT_LENGTH] + "…"
    return "".join(" " if unicodedata.category(letter) in NO_LETTERS else letter for letter in text)


def arranged(text: str) -> Words:
    """Return ``text`` in lines; what does not fit ends in an ellipsis."""
    text = plain(text)
    square = any(unicodedata.east_asian_width(letter) in "WF" for letter in text)
    for count in range(1, LINES + 1):
        size = min(LARGEST, ROOM / (count * LEADING))
        columns = int(ACROSS / (size * (1.0 if square else LETTER)))
        lines = tuple(textwrap.wrap(text, columns, max_lines=count, placeholder="…"))
        if "".join(text.split()) == "".join("".join(lines).split()):
            break
    return Words(lines, size, tuple(TOP + LEADING * size * (number + 0.78) for number in range(len(lines))))
