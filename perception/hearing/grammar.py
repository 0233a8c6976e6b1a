"""Phrases that a mission listens for, as text and as a network of words.

The network has one chain of states per phrase. A grammar in JSGF would be equivalent, but pocketsphinx inserts empty
arcs for it, and then cannot align phones.
"""

import re
import unicodedata
from collections.abc import Iterable, Sequence

from drivers.api.fast_dataclass import dataclass

Arc = tuple[int, int, float, str]
"""Arc of the word network: from state, to state, probability, word."""

START, END = 0, 1

_APOSTROPHES = str.maketrans({"\u2019": "'", "\u02bc": "'"})
_BETWEEN = re.compile(r"[^\w']+|_+")


def normalise(text: str) -> str:
    """Return ``text`` in lower case, with single spaces, and without punctuation except inside words.

    Accents are composed with their letters (Unicode NFC), as in dictionaries.
    """
    small = unicodedata.normalize("NFC", text.casefold())
    words = _BETWEEN.sub(" ", small.translate(_APOSTROPHES)).split()
    return " ".join(filter(None, (word.strip("'") for word in words)))


def phrase_error(text: str) -> str:
    """Return the reason why a phrase cannot be listened for; empty if it can."""
    phrase = normalise(text)
    if not phrase:
        return "it has no words"
    if any(sign.isdigit() for sign in phrase):
        return "it has digits: write them as words"
    return ""


@dataclass(frozen=True, slots=True)
class PhraseGrammar:
    """The normalised ``phrases`` to listen for, each once. Use ``PhraseGrammar.from_texts`` to make one."""

    phrases: tuple[str, ...] = ()

    @classmethod
    def from_texts(cls, texts: Iterable[str]) -> "PhraseGrammar":
        """Return the grammar of some texts. Raises ValueError for an invalid phrase."""
        texts = list(texts)
        for text in texts:
            if fault := phrase_error(text):
                raise ValueError(f"cannot listen for {text!r}: {fault}")
        return cls(tuple(dict.fromkeys(map(normalise, texts))))

    @property
    def words(self) -> tuple[str, ...]:
        """Words of all phrases, each once."""
        return tuple(dict.fromkeys(word for phrase in self.phrases for word in phrase.split()))

    def arcs(self) -> list[Arc]:
        """Return the network from ``START`` to ``END``; all phrases have the same probability."""
        found: list[Arc] = []
        free = END + 1
        for phrase in self.phrases:
            words, state = phrase.split(), START
            for number, word in enumerate(words):
                last = number == len(words) - 1
                found.append((state, END if last else free, 1.0 if number else 1 / len(self.phrases), word))
                state, free = free, free if last else free + 1
        return found

    def find(self, text: str, *, extra_words: int = 2) -> str:
        """Return the longest phrase in a written ``text`` with at most ``extra_words`` other words, or ""."""
        words = normalise(text).split()
        fitting = (phrase for phrase in self.phrases if _contains_phrase(phrase.split(), words, extra_words))
        return max(fitting, key=lambda phrase: len(phrase.split()), default="")


def _contains_phrase(phrase: Sequence[str], words: Sequence[str], extra_words: int) -> bool:
    size = len(phrase)
    if not 0 <= len(words) - size <= extra_words:
        return False
    return any(list(words[at : at + size]) == list(phrase) for at in range(len(words) - size + 1))
