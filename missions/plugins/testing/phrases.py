"""Phrases in test files, such as ``camera frozen from 5 s to 8 s``: read word by word, each with its place."""

import math
import re

from config.diagnostics import Diagnostic, Mark, SourceText, add_diagnostic, suggest_from
from config.units import quantity_text, quoted_value, si_value
from config.yaml_nodes import Scalar

JOINING_WORDS = ("to", "for", "from", "at", "when", "then", "because")
"""Words that join the parts of phrases, and so are no units."""

_WORD = re.compile(r'"[^"]*"|[^\s",]+|.', re.DOTALL)


class Phrase:
    """The words of one text, taken from left to right. What is wrong is noted in ``faults``, at the word itself.

    After the first fault the phrase is of no more use: ``failed`` is true, and no other fault is noted, since it
    would only follow from the first.
    """

    def __init__(self, source: SourceText, node: Scalar, faults: list[Diagnostic]) -> None:
        self.source = source
        self.node = node
        self.faults = faults
        self.failed = False
        self._words = [(found[0], found.start()) for found in _WORD.finditer(node.text) if not found[0].isspace()]
        self._next = 0

    @property
    def ended(self) -> bool:
        """True when no word is left, or none of any use."""
        return self.failed or self._next >= len(self._words)

    @property
    def word(self) -> str:
        """The word that comes next; empty at the end."""
        return "" if self.ended else self._words[self._next][0]

    @property
    def following_word(self) -> str:
        """The word after the next one; empty where there is none."""
        return "" if self.failed or self._next + 1 >= len(self._words) else self._words[self._next + 1][0]

    def words_until(self, stops: tuple[str, ...]) -> list[str]:
        """Return the words from the next one up to the first of ``stops``, or to the end; take none of them."""
        found: list[str] = []
        for word, _ in [] if self.failed else self._words[self._next :]:
            if word in stops:
                break
            found.append(word)
        return found

    def take(self) -> str:
        """Take the next word."""
        word = self.word
        self._next += 1
        return word

    def take_if(self, *words: str) -> str:
        """Take the next word if it is one of ``words``; else return the empty string and leave it."""
        return self.take() if self.word and self.word in words else ""

    def add_fault(self, message: str, suggestion: str = "") -> None:
        """Note a mistake at the word that comes next, or behind the last."""
        if not self.failed:
            add_diagnostic(self.faults, Diagnostic(self.source, self._mark(), message, suggestion))
            self.failed = True

    def reject(self, what: str, known: tuple[str, ...]) -> None:
        """Note that the next word is none of those that ``what`` can be."""
        if not self.word:
            self.add_fault(f"{what} is missing here", suggest_from("", known))
        else:
            self.add_fault(f"{what} cannot be {quoted_value(self.word)}", suggest_from(self.word, known))

    def take_quoted(self, what: str) -> str:
        """Take a text in double quotes."""
        if len(self.word) >= 2 and self.word[0] == self.word[-1] == '"':
            return self.take()[1:-1]
        self.add_fault(f"{what} needs a text in double quotes", 'such as "Hello"')
        return ""

    def take_quantity(self, what: str, dimension: str, *, low: float = 0.0, high: float = math.inf) -> float:
        """Take a number with its unit, in SI units and between ``low`` and ``high``; "2s" is as right as "2 s"."""
        text = self.word
        apart = not re.search(r"[A-Za-z%°]", text) and bool(re.match(r"[A-Za-z%°]", self.following_word))
        apart = apart and self.following_word not in JOINING_WORDS
        try:
            value = si_value(f"{text} {self.following_word}" if apart else text, dimension)
        except ValueError as error:
            self.add_fault(f"{what} {error}")
            return 0.0
        if value < low:
            self.add_fault(f"{what} must be at least {quantity_text(low, dimension)}")
        if value > high:
            self.add_fault(f"{what} must be at most {quantity_text(high, dimension)}")
        self._next += 2 if apart else 1
        return value

    def take_count(self, what: str) -> int:
        """Take a whole number from 1."""
        if not re.fullmatch(r"[1-9][0-9]{0,5}", self.word):
            self.add_fault(f"{what} needs a whole number, got {quoted_value(self.word)}")
            return 1
        return int(self.take())

    def take_rest(self) -> str:
        """Take all words that are left, as they were written."""
        text = "" if self.ended else self.node.text[self._words[self._next][1] :].strip()
        self._next = len(self._words)
        return text

    def expect_end(self) -> None:
        """Note a word that nobody has asked for."""
        if not self.ended:
            self.add_fault(f"{quoted_value(self.word)} is not expected here")

    def _mark(self) -> Mark:
        """Return where the next word stands: the whole text where the file writes that otherwise."""
        mark = self.node.mark
        if self._next < len(self._words):
            word, column = self._words[self._next]
        else:
            word, column = " ", len(self.node.text)
        begin = mark.column - 1 + self.node.quoted
        if self.source.line(mark.line).startswith(self.node.text[:column] + word.strip(), begin):
            return Mark(mark.line, begin + column + 1, len(word))
        return mark
