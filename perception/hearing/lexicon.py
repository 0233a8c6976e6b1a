"""How words are pronounced: by the robot file, else by the dictionary that comes with the recogniser."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from perception.hearing.phones import KIND_OF, VOWELS

# British pronunciations, by rule, beside the American ones of the dictionary.
#
# Two rules make most of the difference: R is silent unless a vowel follows, and the vowel of *stop* is round.

_CENTRING = frozenset(("IH", "EH", "UH"))  # near, hair, tour: what is left of the R is a vowel


def variants(phones: Sequence[str]) -> list[tuple[str, ...]]:
    """Return how else a word of ``phones`` is said; nothing that equals it, and nothing twice."""
    plain = tuple(phones)
    rounded = _rounded(plain)
    found = dict.fromkeys((_silent_r(plain), rounded, _silent_r(rounded)))
    found.pop(plain, None)
    return list(found)


def _rounded(phones: Sequence[str]) -> tuple[str, ...]:
    """Say the vowel of *stop* with round lips, but not that of *start*."""
    following = (*phones[1:], "")
    return tuple("AO" if (a, b != "R") == ("AA", True) else a for a, b in zip(phones, following, strict=True))


def _silent_r(phones: Sequence[str]) -> tuple[str, ...]:
    """Leave out each R that no vowel follows; *near* and *forward* keep a faint vowel in its place."""
    said: list[str] = []
    for phone, following in zip(phones, (*phones[1:], ""), strict=True):
        if following in VOWELS or phone not in {"R", "ER"}:
            said.append(phone)
        elif phone == "ER":  # weak, but in the first syllable, as in *turn*
            said.append("AH" if VOWELS.intersection(said) else "ER")
        elif not said or said[-1] not in VOWELS:
            said.append(phone)
        elif said[-1] in _CENTRING:
            said.append("AH")
    return tuple(said)


Phones = tuple[str, ...]


def model_folder() -> Path | None:
    """Return where pocketsphinx keeps its English model; None where it is not installed. Does not import it."""
    spec = find_spec("pocketsphinx")
    return None if spec is None or spec.origin is None else Path(spec.origin).parent / "model" / "en-us"


class Lexicon:
    """Pronunciations from the text of a dictionary (``word AH B ..`` a line, ``word(2) ..`` for another), and ``own``.

    ``own`` are those of the robot file, which come instead of the dictionary's. Raises ValueError for a phone in them
    that the model has not.
    """

    def __init__(self, dictionary: str, own: Mapping[str, str] | None = None) -> None:
        self._text = f"\n{dictionary}"
        self._found: dict[str, list[Phones]] = {}
        self._own = {word.casefold(): tuple(said.upper().split()) for word, said in (own or {}).items()}
        for word, said in self._own.items():
            if not said or (wrong := [phone for phone in said if phone not in KIND_OF]):
                what = f"{wrong[0]!r} is no phone" if said else "it has no phones"
                raise ValueError(f"pronunciation of {word!r}: {what}; phones are {' '.join(sorted(KIND_OF))}")

    def pronunciations(self, word: str) -> list[Phones]:
        """Return all the ways to say ``word``, with British ones; empty when it is unknown."""
        if word not in self._found:
            own = self._own.get(word)
            known = [own] if own is not None else list(self._listed(word))
            self._found[word] = list(dict.fromkeys((*known, *(other for said in known for other in variants(said)))))
        return list(self._found[word])

    def unknown(self, words: Sequence[str]) -> list[str]:
        """Return those of ``words`` that nobody knows how to say."""
        return [word for word in words if not self.pronunciations(word)]

    def _listed(self, word: str) -> Iterator[Phones]:
        entry, number = word, 1
        while (at := self._text.find(f"\n{entry} ")) >= 0:
            begin = at + len(entry) + 2
            end = self._text.find("\n", begin)
            yield tuple(self._text[begin : end if end >= 0 else None].split())
            number += 1
            entry = f"{word}({number})"


def english(own: Mapping[str, str] | None = None) -> Lexicon | None:
    """Return the lexicon of the model that pocketsphinx carries; None where it is not installed."""
    folder = model_folder()
    return None if folder is None else _read(folder / "cmudict-en-us.dict", tuple((own or {}).items()))


@lru_cache(maxsize=4)
def _read(path: Path, own: Sequence[tuple[str, str]]) -> Lexicon:
    """Read a dictionary once: each check of a mission asks for it."""
    return Lexicon(path.read_text(encoding="utf-8"), dict(own))
