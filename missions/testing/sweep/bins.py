"""How often runs succeed for each part of the range of what was varied."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from operator import eq

from missions.testing.sweep.rate import Rate
from missions.testing.sweep.row import Row
from missions.testing.sweep.variation import Drawn, Span, Variation

PARTS = 5
"""Parts into which a range is cut."""

FEW = 10
"""A range of no more whole numbers is not cut: each stands for itself."""

Pairs = Sequence[tuple[Drawn, Row]]
"""Runs, each with the value that it had of one varied quantity."""


@dataclass(frozen=True, slots=True)
class Bin:
    """The runs for which a quantity was in one part of its range, or had one value.

    ``low`` and ``high`` are where it stands on an axis: the numbers, or the place of a word in its list.
    """

    label: str
    low: float
    high: float
    rate: Rate


def bins(variation: Variation, pairs: Pairs) -> list[Bin]:
    """Return the parts of what ``variation`` ranges over, with the runs that fall into each."""
    values = variation.values
    if not isinstance(values, Span):
        return _each(variation, list(dict.fromkeys(values.values)), pairs)
    low, high = values.low, values.high
    if isinstance(low, int) and isinstance(high, int) and high - low < FEW:
        return _each(variation, list(range(low, high + 1)), pairs)
    edges = [low + (high - low) * part / PARTS for part in range(PARTS)] + [float(high)]
    return [Bin(f"{a:.4g} to {b:.4g}", a, b, _rate(pairs, _within(a, b, last=b == high))) for a, b in pairwise(edges)]


def _each(variation: Variation, values: Sequence[Drawn], pairs: Pairs) -> list[Bin]:
    return [
        Bin(variation.text(value), place, place + 1, _rate(pairs, partial(eq, value)))
        for place, value in enumerate(values)
    ]


def _within(low: float, high: float, *, last: bool) -> Callable[[Drawn], bool]:
    """Say what lies from ``low`` to below ``high``; of the last part, the end belongs to it."""

    def within(value: Drawn) -> bool:
        return not isinstance(value, str) and (low <= value < high or (last and value == high))

    return within


def _rate(pairs: Pairs, holds: Callable[[Drawn], bool]) -> Rate:
    found = [row for value, row in pairs if holds(value)]
    return Rate(sum(row.result == "success" for row in found), len(found))
