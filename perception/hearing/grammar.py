"""What may be said: the phrases that a mission listens for, as text and as a network of words.

The network has one chain of states for each phrase. A grammar in JSGF would mean the same, but pocketsphinx puts empty
arcs into it, and then cannot align phones.
"""

import re
import unicodedata
from collections.abc import Iterable, Sequence

from drivers.api.fast_dataclass import dataclass

Arc = tuple[int, int, float, str]
"""From one state to another, with a probability, on a word."""

START, END = 0, 1

_APOSTROPHES = str.maketrans({"\u2019": "'", "\u02bc": "'"})
_BETWEEN = re.compile(r"[^\w']+|_+")


def normalise(text: str) -> str:
    """Return ``text`` as it is listened for: small letters, single spaces, no punctuation but within words.

    Accents are one with their letters (Unicode's NFC), as dictionaries have them.
    """
    small = unicodedata.normalize("NFC", text.casefold())
    words = _BETWEEN.sub(" ", small.translate(_APOSTROPHES)).split()
    return " ".join(filter(None, (word.strip("'") for word in words)))


def phrase_error(text: str) -> str:
    """Say what is wrong with a phrase to listen for; empty when it can be said."""
    phrase = normalise(text)
    if not phrase:
        return "there is no word in it"
    if any(sign.isdigit() for sign in phrase):
        return "it has digits: write them out as they are said"
    return ""


@dataclass(frozen=True, slots=True)
class PhraseGrammar:
    """The ``phrases`` that count, normalised, each once. Make it with ``PhraseGrammar.of``."""

    phrases: tuple[str, ...] = ()

    @classmethod
    def from_texts(cls, texts: Iterable[str]) -> "PhraseGrammar":
        """Return the grammar of some texts. Raises ValueError for one that nobody can say."""
        texts = list(texts)
        for text in texts:
            if fault := phrase_error(text):
                raise ValueError(f"cannot listen for {text!r}: {fault}")
        return cls(tuple(dict.fromkeys(map(normalise, texts))))

    @property
    def words(self) -> tuple[str, ...]:
        """The words of all phrases, each once."""
        return tuple(dict.fromkeys(word for phrase in self.phrases for word in phrase.split()))

    def arcs(self) -> list[Arc]:
        """Return the network, from ``START`` to ``END``; all phrases are equally likely."""
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
        """Return the longest phrase that stands in a written ``text`` with at most ``beside`` other words, else ""."""
        words = normalise(text).split()
        fitting = (phrase for phrase in self.phrases if _contains_phrase(phrase.split(), words, extra_words))
        return max(fitting, key=lambda phrase: len(phrase.split()), default="")


def _contains_phrase(phrase: Sequence[str], words: Sequence[str], extra_words: int) -> bool:
    size = len(phrase)
    if not 0 <= len(words) - size <= extra_words:
        return False
    return any(list(words[at : at + size]) == list(phrase) for at in range(len(words) - size + 1))
