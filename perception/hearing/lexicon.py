"""Pronunciations of words, from the robot file, the recogniser's dictionary or a synthesiser; and similar phrases."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from importlib.util import find_spec
from itertools import chain, combinations, islice, product
from pathlib import Path

# The phones of the English model: ARPABET without stress, as in the CMU dictionary.

# Pronunciations from a synthesiser: what espeak-ng calls its phonemes, as phones of the recogniser.
#
# For words that no dictionary has, such as names. Of 1500 words of the CMU dictionary drawn by lot, 57 % come out as
# they stand there, and 11 % of all phones differ.

_ESPEAK_PHONES = {
    "p": "P", "b": "B", "t": "T", "t#": "T", "t2": "T", "d": "D", "k": "K", "g": "G", "f": "F", "v": "V", "T": "TH",
    "D": "DH", "s": "S", "z": "Z", "S": "SH", "Z": "ZH", "h": "HH", "x": "K", "tS": "CH", "dZ": "JH", "m": "M",
    "n": "N", "n-": "AH N", "N": "NG", "l": "L", "@L": "AH L", "r": "R", "r-": "AH R", "w": "W", "j": "Y",
    "a": "AE", "aa": "AE", "a#": "AH", "A:": "AA", "A@": "AA R", "0": "AA", "V": "AH", "@": "AH", "@-": "AH",
    "@2": "AH", "3": "ER", "3:": "ER", "E": "EH", "e@": "EH R", "I": "IH", "I2": "IH", "I#": "IH", "i": "IY",
    "i:": "IY", "i@": "IY AH", "i@3": "IH R", "O:": "AO", "O2": "AO", "O@": "AO R", "o@": "AO R", "U": "UH",
    "U@": "UH R", "u:": "UW", "eI": "EY", "aI": "AY", "aI@": "AY AH", "aI3": "AY ER", "OI": "OY", "aU": "AW",
    "oU": "OW",
}  # fmt: skip
"""Phones by the phoneme mnemonics of espeak-ng's voice en-us, without stress."""

_SILENT_MNEMONICS = frozenset(("", "_", "_:", "?", ";", "|"))


def espeak_to_phones(mnemonics: Sequence[str]) -> tuple[str, ...]:
    """Return the phones of a word from espeak-ng's phoneme events. Raises ValueError for mnemonics of other voices."""
    found: list[str] = []
    for mnemonic in mnemonics:
        plain = mnemonic.lstrip("',%=")
        if plain in _SILENT_MNEMONICS:
            continue
        if plain not in _ESPEAK_PHONES:
            raise ValueError(f"phoneme {mnemonic!r} is not one of the voice en-us")
        found += _ESPEAK_PHONES[plain].split()
    return tuple(found)


PHONE_KINDS = {
    "vowel": ("AA", "AE", "AH", "AO", "AW", "AY", "EH", "ER", "EY", "IH", "IY", "OW", "OY", "UH", "UW"),
    "hiss": ("CH", "F", "JH", "S", "SH", "TH", "Z", "ZH"),
    "breath": ("DH", "HH", "V"),
    "stop": ("B", "D", "G", "K", "P", "T"),
    "nasal": ("M", "N", "NG"),
    "glide": ("L", "R", "W", "Y"),
}
"""Phones of each kind; phones of one kind are easily confused."""

KIND_OF = {phone: kind for kind, phones in PHONE_KINDS.items() for phone in phones}
"""Kind of each phone; noises and silence have none."""

VOWELS = frozenset(PHONE_KINDS["vowel"])


# British pronunciations, by rule, beside the American ones of the dictionary.
#
# Two rules make most of the difference: R is silent unless a vowel follows, and the vowel of *stop* is round.

_CENTRING_VOWELS = frozenset(("IH", "EH", "UH"))  # near, hair, tour: what is left of the R is a vowel


def british_variants(phones: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the British pronunciations of a word, without ``phones`` itself and without duplicates."""
    plain = tuple(phones)
    rounded = _round_vowels(plain)
    found = dict.fromkeys((_drop_silent_r(plain), rounded, _drop_silent_r(rounded)))
    found.pop(plain, None)
    return list(found)


def _round_vowels(phones: Sequence[str]) -> tuple[str, ...]:
    """Return the phones with the vowel of *stop* rounded, but not that of *start*."""
    following = (*phones[1:], "")
    return tuple("AO" if (a, b != "R") == ("AA", True) else a for a, b in zip(phones, following, strict=True))


def _drop_silent_r(phones: Sequence[str]) -> tuple[str, ...]:
    """Return the phones without each R that no vowel follows; *near* and *forward* keep a faint vowel instead."""
    said: list[str] = []
    for phone, following in zip(phones, (*phones[1:], ""), strict=True):
        if following in VOWELS or phone not in {"R", "ER"}:
            said.append(phone)
        elif phone == "ER":  # weak, but in the first syllable, as in *turn*
            said.append("AH" if VOWELS.intersection(said) else "ER")
        elif not said or said[-1] not in VOWELS:
            said.append(phone)
        elif said[-1] in _CENTRING_VOWELS:
            said.append("AH")
    return tuple(said)


Phones = tuple[str, ...]


def model_folder() -> Path | None:
    """Return the folder of pocketsphinx's English model, without an import of pocketsphinx; None if not installed."""
    spec = find_spec("pocketsphinx")
    return None if spec is None or spec.origin is None else Path(spec.origin).parent / "model" / "en-us"


class Lexicon:
    """Pronunciations of words, from the text of a dictionary and from ``overrides``.

    A line of the dictionary is ``word AH B ..``, and ``word(2) ..`` for a second pronunciation. ``overrides`` are those
    of the robot file, which replace the dictionary's. Raises ValueError for an unknown phone in ``overrides``.
    """

    def __init__(self, dictionary: str, overrides: Mapping[str, str] | None = None) -> None:
        self._text = f"\n{dictionary}"
        self._cache: dict[str, list[Phones]] = {}
        self._overrides = {word.casefold(): tuple(said.upper().split()) for word, said in (overrides or {}).items()}
        for word, said in self._overrides.items():
            if not said or (wrong := [phone for phone in said if phone not in KIND_OF]):
                what = f"{wrong[0]!r} is not a phone" if said else "it has no phones"
                raise ValueError(f"pronunciation of {word!r}: {what}; phones are {' '.join(sorted(KIND_OF))}")

    def pronunciations(self, word: str) -> list[Phones]:
        """Return all pronunciations of ``word``, including British ones; empty if it is unknown."""
        if word not in self._cache:
            own = self._overrides.get(word)
            known = [own] if own is not None else list(self._dictionary_pronunciations(word))
            self._cache[word] = list(
                dict.fromkeys((*known, *(other for said in known for other in british_variants(said))))
            )
        return list(self._cache[word])

    def unknown_words(self, words: Sequence[str]) -> list[str]:
        """Return the words in ``words`` that have no known pronunciation."""
        return [word for word in words if not self.pronunciations(word)]

    def _dictionary_pronunciations(self, word: str) -> Iterator[Phones]:
        entry, number = word, 1
        while (at := self._text.find(f"\n{entry} ")) >= 0:
            begin = at + len(entry) + 2
            end = self._text.find("\n", begin)
            yield tuple(self._text[begin : end if end >= 0 else None].split())
            number += 1
            entry = f"{word}({number})"


def load_english(overrides: Mapping[str, str] | None = None) -> Lexicon | None:
    """Return the lexicon of pocketsphinx's English model; None if it is not installed."""
    folder = model_folder()
    return None if folder is None else _read_lexicon(folder / "cmudict-en-us.dict", tuple((overrides or {}).items()))


@lru_cache(maxsize=4)
def _read_lexicon(path: Path, overrides: Sequence[tuple[str, str]]) -> Lexicon:
    """Read the dictionary in ``path``, with ``overrides``; cached, because each check of a mission needs it."""
    return Lexicon(path.read_text(encoding="utf-8"), dict(overrides))


# Which phrases are easily confused: those that differ by hardly more than one sound.

MAX_CONFUSABLE_CHANGES = 1.0
"""Largest edit distance, in phones, at which two phrases count as easily confused.

A replacement of a phone by one of the same kind, such as m by n, counts half.
"""

MAX_PRONUNCIATIONS = 16
"""Maximum number of pronunciations of a phrase that are compared."""


def find_confusable(phrases: Sequence[str], lexicon: Lexicon) -> list[tuple[str, str]]:
    """Return the pairs of normalised phrases that are easily confused; phrases with unknown words are ignored."""
    said = {phrase: _phrase_pronunciations(phrase, lexicon) for phrase in phrases}
    return [
        (one, other)
        for one, other in combinations(said, 2)
        if any(
            _phone_distance(first, second) <= MAX_CONFUSABLE_CHANGES
            for first, second in product(said[one], said[other])
        )
    ]


def _phrase_pronunciations(phrase: str, lexicon: Lexicon) -> list[tuple[str, ...]]:
    ways = product(*(lexicon.pronunciations(word) for word in phrase.split()))
    return [tuple(chain.from_iterable(way)) for way in islice(ways, MAX_PRONUNCIATIONS)]


def _phone_distance(one: Sequence[str], other: Sequence[str]) -> float:
    kinds = ([KIND_OF[phone] for phone in each] for each in (one, other))
    return (edit_distance(one, other) + edit_distance(*kinds)) / 2


def edit_distance(one: Sequence[str], other: Sequence[str]) -> int:
    """Return the Levenshtein distance of two sequences."""
    row = list(range(len(other) + 1))
    for number, each in enumerate(one, 1):
        before, row[0] = row[0], number
        for place, against in enumerate(other, 1):
            before, row[place] = row[place], min(row[place] + 1, row[place - 1] + 1, before + (each != against))
    return row[-1]
