"""British pronunciations, by rule, beside the American ones of the dictionary.

Two rules make most of the difference: R is silent
unless a vowel follows, and the vowel of *stop* is round.
"""

from collections.abc import Sequence

from perception.hearing.phones import VOWELS

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
