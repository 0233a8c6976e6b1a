"""What is varied between the runs of a sweep: ``NAME=VALUES`` from the command line, and a run's own draw of it."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Literal

from config.units import EXAMPLES, UNITS, parse_quantity, quoted_value

DrawnValue = float | int | str
"""What a run has drawn: a number in the unit of its variation, or a word."""

ANGULAR_KINDS = ("angle", "turn rate")
"""Dimensions whose SI unit nobody means by a bare number."""

DECIMALS = 4
"""Decimals to which numbers are drawn: what a run had then stands in a table and in a file as it was."""

_NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


@dataclass(frozen=True, slots=True)
class ValueRange:
    """Every number from ``low`` to ``high`` alike; whole ones where both are."""

    low: float | int
    high: float | int

    def draw(self, random: Random) -> float | int:
        """Return one of them."""
        share = random.random()
        if isinstance(self.low, int) and isinstance(self.high, int):
            return self.low + int(share * (self.high - self.low + 1))
        return round(self.low + share * (self.high - self.low), DECIMALS)

    def ends(self) -> Sequence[DrawnValue]:
        """Return the two ends."""
        return self.low, self.high


@dataclass(frozen=True, slots=True)
class ValueList:
    """One of some values, each as likely as the others."""

    values: tuple[DrawnValue, ...]

    def draw(self, random: Random) -> DrawnValue:
        """Return one of them."""
        return self.values[int(random.random() * len(self.values))]

    def ends(self) -> Sequence[DrawnValue]:
        """Return all of them."""
        return self.values


@dataclass(frozen=True, slots=True)
class Variation:
    """One thing that is varied. Numbers are in ``unit``, the first of their dimension; empty for none."""

    name: str
    unit: str
    values: ValueRange | ValueList

    def draw(self, seed: int) -> DrawnValue:
        """Return what the run with this seed has: it depends on the name and the seed, and on nothing else."""
        # Seeded by a text, which Python hashes alike everywhere; so it is independent of the mission's own chance.
        return self.values.draw(Random(f"{self.name} of run {seed}"))  # noqa: S311 - a draw is no secret

    def text(self, value: DrawnValue) -> str:
        """Write a value as a world file or a param has it."""
        return value if isinstance(value, str) else f"{value:.12g} {self.unit}".rstrip()

    @property
    def title(self) -> str:
        """The name with its unit: the head of a column."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def is_single(self) -> bool:
        """True when every run has the same value."""
        return len(set(self.values.ends())) == 1


def read_values(text: str, kind: str) -> tuple[str, ValueRange | ValueList]:
    """Read ``a..b`` or ``a,b,c`` as values of ``kind``; return their unit, and the values in it.

    A kind is a dimension of ``config.units``, "number", "count" or "text". A range may say its unit once, at its end.
    A number without a unit is in SI units, but for angles. Raises ValueError that says what is wrong.
    """
    unit = next(iter(UNITS[kind])) if kind in UNITS else ""
    if kind == "text":
        return unit, ValueList(tuple(_read_word(word) for word in text.split(",")))
    if ".." not in text:
        return unit, ValueList(tuple(_read_number(word, kind) for word in text.split(",")))
    first, _, last = (part.strip() for part in text.partition(".."))
    if _NUMBER.fullmatch(first) and not _NUMBER.fullmatch(last):
        first += _NUMBER.sub("", last, count=1)  # 5..100 %: the unit stands for both
    low, high = _read_number(first, kind), _read_number(last, kind)
    if low > high:
        raise ValueError(f"begins above its end: {quoted_value(text)}")
    return unit, ValueRange(low, high)


def _read_word(text: str) -> str:
    if not text.strip():
        raise ValueError("has an empty value in its list")
    return text.strip()


def _read_number(text: str, kind: str) -> float | int:
    """Return one number in the first unit of its kind."""
    text = text.strip()
    if kind == "count":
        if not re.fullmatch("[0-9]{1,9}", text):
            raise ValueError(f"needs a whole number, got {quoted_value(text)}")
        return int(text)
    bare = float(text) if _NUMBER.fullmatch(text) else None
    if kind == "number":
        if bare is None or not math.isfinite(bare):
            raise ValueError(f"needs a number without a unit, got {quoted_value(text)}")
        return bare
    found = parse_quantity(text)
    if bare is not None and kind not in ANGULAR_KINDS and math.isfinite(bare):
        si = bare
    elif found is not None and found.dimension == kind:
        si = float(found)
    else:
        raise ValueError(f"needs values such as '{EXAMPLES[kind]}', got {quoted_value(text)}")
    return round(si / next(iter(UNITS[kind].values())), 9)


def display_value(variation: Variation, value: DrawnValue) -> str:
    """Write a value for people, short."""
    return value if isinstance(value, str) else f"{value:.3g} {variation.unit}".rstrip()


# What is kept of one run of a sweep.

Outcome = Literal["success", "failure", "unfinished", "error"]
"""How a run went: ``unfinished`` when its time was up, ``error`` when something other than the mission went wrong."""


@dataclass(frozen=True, slots=True)
class SweepRow:
    """One run: what it had drawn (in the order of the sweep's variations), and how it went.

    ``seconds`` are simulated. Nothing here depends on the machine, or on which of the workers ran it.
    """

    seed: int
    values: tuple[DrawnValue, ...]
    result: Outcome
    reason: str
    seconds: float
    ticks: int
