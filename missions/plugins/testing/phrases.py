"""Parser of phrases in test files, such as ``camera frozen from 5 s to 8 s``, with a position for each word."""

import math
import re

from config.diagnostics import Diagnostic, Mark, SourceText, add_diagnostic, suggest_from
from config.units import quantity_text, quoted_value, si_value
from config.yaml_nodes import Scalar

JOINING_WORDS = ("to", "for", "from", "at", "when", "then", "because")
"""Words that join the parts of phrases. They are not read as units after a number."""

_WORD = re.compile(r'"[^"]*"|[^\s",]+|.', re.DOTALL)


class Phrase:
    """Words of one text, consumed from left to right. Errors are added to ``faults`` at their word.

    After the first error, ``failed`` is true and no further errors are added, since they would only follow from it.
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
        """Whether no word is left, or an earlier error makes the rest useless."""
        return self.failed or self._next >= len(self._words)

    @property
    def word(self) -> str:
        """The next word of the phrase; empty at the end."""
        return "" if self.ended else self._words[self._next][0]

    @property
    def following_word(self) -> str:
        """The word after the next; empty if there is none."""
        return "" if self.failed or self._next + 1 >= len(self._words) else self._words[self._next + 1][0]

    def words_until(self, stops: tuple[str, ...]) -> list[str]:
        """Return the words up to the first of ``stops`` or the end, without consuming them."""
        found: list[str] = []
        for word, _ in [] if self.failed else self._words[self._next :]:
            if word in stops:
                break
            found.append(word)
        return found

    def take(self) -> str:
        """Consume and return the next word."""
        word = self.word
        self._next += 1
        return word

    def take_if(self, *words: str) -> str:
        """Consume and return the next word if it is one of ``words``; otherwise return an empty text."""
        return self.take() if self.word and self.word in words else ""

    def add_fault(self, message: str, suggestion: str = "") -> None:
        """Add an error at the next word, or after the last."""
        if not self.failed:
            add_diagnostic(self.faults, Diagnostic(self.source, self._mark(), message, suggestion))
            self.failed = True

    def reject(self, what: str, known: tuple[str, ...]) -> None:
        """Add the error that the next word is not one of ``known``; ``what`` names the kind of value."""
        if not self.word:
            self.add_fault(f"{what} is missing here", suggest_from("", known))
        else:
            self.add_fault(f"{what} cannot be {quoted_value(self.word)}", suggest_from(self.word, known))

    def take_quoted(self, what: str) -> str:
        """Consume a text in double quotes and return it without them; ``what`` names the text in an error."""
        if len(self.word) >= 2 and self.word[0] == self.word[-1] == '"':
            return self.take()[1:-1]
        self.add_fault(f"{what} needs a text in double quotes", 'such as "Hello"')
        return ""

    def take_quantity(self, what: str, dimension: str, *, low: float = 0.0, high: float = math.inf) -> float:
        """Consume a number with its unit ("2s" or "2 s"); return it in SI units, between ``low`` and ``high``.

        ``what`` names the value in an error.
        """
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
        """Consume a whole number of at least 1 and return it; ``what`` names the number in an error."""
        if not re.fullmatch(r"[1-9][0-9]{0,5}", self.word):
            self.add_fault(f"{what} needs a whole number, got {quoted_value(self.word)}")
            return 1
        return int(self.take())

    def take_rest(self) -> str:
        """Consume all remaining words, as written."""
        text = "" if self.ended else self.node.text[self._words[self._next][1] :].strip()
        self._next = len(self._words)
        return text

    def expect_end(self) -> None:
        """Add an error if a word is left, because the phrase should be complete."""
        if not self.ended:
            self.add_fault(f"{quoted_value(self.word)} is not expected here")

    def _mark(self) -> Mark:
        """Return the position of the next word; of the whole text if the file uses escapes or folding."""
        mark = self.node.mark
        if self._next < len(self._words):
            word, column = self._words[self._next]
        else:
            word, column = " ", len(self.node.text)
        begin = mark.column - 1 + self.node.quoted
        if self.source.line(mark.line).startswith(self.node.text[:column] + word.strip(), begin):
            return Mark(mark.line, begin + column + 1, len(word))
        return mark
