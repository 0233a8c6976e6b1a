"""Which phrases are easily confused: those that differ by hardly more than one sound."""

from collections.abc import Sequence
from itertools import chain, combinations, islice, product

from perception.hearing.lexicon import Lexicon
from perception.hearing.phones import KIND_OF

NEAR_CHANGES = 1.0
"""Changes of phones up to which two phrases are near; one by another of its kind (m by n) counts half."""

WAYS = 16
"""Of the ways to say a phrase, as many are looked at."""


def confusable(phrases: Sequence[str], lexicon: Lexicon) -> list[tuple[str, str]]:
    """Return the pairs of normalised phrases that are easily taken for each other; those unknown are in none."""
    said = {phrase: _ways(phrase, lexicon) for phrase in phrases}
    return [
        (one, other)
        for one, other in combinations(said, 2)
        if any(_changes(first, second) <= NEAR_CHANGES for first, second in product(said[one], said[other]))
    ]


def _ways(phrase: str, lexicon: Lexicon) -> list[tuple[str, ...]]:
    ways = product(*(lexicon.pronunciations(word) for word in phrase.split()))
    return [tuple(chain.from_iterable(way)) for way in islice(ways, WAYS)]


def _changes(one: Sequence[str], other: Sequence[str]) -> float:
    kinds = ([KIND_OF[phone] for phone in each] for each in (one, other))
    return (edits(one, other) + edits(*kinds)) / 2


def edits(one: Sequence[str], other: Sequence[str]) -> int:
    """Return how many insertions, deletions and replacements make ``other`` of ``one`` (Levenshtein's distance)."""
    row = list(range(len(other) + 1))
    for number, each in enumerate(one, 1):
        before, row[0] = row[0], number
        for place, against in enumerate(other, 1):
            before, row[place] = row[place], min(row[place] + 1, row[place - 1] + 1, before + (each != against))
    return row[-1]
