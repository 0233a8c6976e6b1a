"""Variations of a sweep: ``NAME=VALUES`` from the command line, and the value that a run draws."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Literal

from config.units import EXAMPLES, UNITS, parse_quantity, quoted_value

DrawnValue = float | int | str
"""Drawn value of a run: a number in the unit of its variation, or a word."""

ANGULAR_KINDS = ("angle", "turn rate")
"""Dimensions for which a number without a unit is refused, since it could be in degrees or in radians."""

DECIMALS = 4
"""Decimals to which drawn numbers are rounded, so that tables and files show exactly the value of the run."""

_NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


@dataclass(frozen=True, slots=True)
class ValueRange:
    """Numbers from ``low`` to ``high``, uniformly distributed; whole numbers if both ends are."""

    low: float | int
    high: float | int

    def draw(self, random: Random) -> float | int:
        """Return a random number of the range."""
        share = random.random()
        if isinstance(self.low, int) and isinstance(self.high, int):
            return self.low + int(share * (self.high - self.low + 1))
        return round(self.low + share * (self.high - self.low), DECIMALS)

    def ends(self) -> Sequence[DrawnValue]:
        """Return the lowest and the highest number of the range."""
        return self.low, self.high


@dataclass(frozen=True, slots=True)
class ValueList:
    """List of values, drawn with equal probability."""

    values: tuple[DrawnValue, ...]

    def draw(self, random: Random) -> DrawnValue:
        """Return a random value."""
        return self.values[int(random.random() * len(self.values))]

    def ends(self) -> Sequence[DrawnValue]:
        """Return all values of the list, since any of them may be an extreme."""
        return self.values


@dataclass(frozen=True, slots=True)
class Variation:
    """A parameter that a sweep varies, by name. ``unit`` is the unit of its values; empty for values without a unit."""

    name: str
    unit: str
    values: ValueRange | ValueList

    def draw(self, seed: int) -> DrawnValue:
        """Return the value for a seed; it depends only on the name and the seed."""
        # A text seed gives the same numbers on every machine, independent of the mission's own random numbers.
        return self.values.draw(Random(f"{self.name} of run {seed}"))  # noqa: S311 - a draw needs no security

    def text(self, value: DrawnValue) -> str:
        """Return a value as a world file or a param writes it."""
        return value if isinstance(value, str) else f"{value:.12g} {self.unit}".rstrip()

    @property
    def title(self) -> str:
        """Name with its unit: the column heading."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def is_single(self) -> bool:
        """Whether there is only one possible value, so that every run has the same."""
        return len(set(self.values.ends())) == 1


def read_values(text: str, kind: str) -> tuple[str, ValueRange | ValueList]:
    """Read ``a..b`` or ``a,b,c`` as values of ``kind``; return their unit and the values.

    A kind is a dimension of ``config.units``, "number", "count" or "text". A range may name its unit once, at its end.
    Numbers without a unit are in SI units, except angles. Raises ValueError with the reason.
    """
    unit = next(iter(UNITS[kind])) if kind in UNITS else ""
    if kind == "text":
        return unit, ValueList(tuple(_read_word(word) for word in text.split(",")))
    if ".." not in text:
        return unit, ValueList(tuple(_read_number(word, kind) for word in text.split(",")))
    first, _, last = (part.strip() for part in text.partition(".."))
    if _NUMBER.fullmatch(first) and not _NUMBER.fullmatch(last):
        first += _NUMBER.sub("", last, count=1)  # 5..100 %: one unit for both ends
    low, high = _read_number(first, kind), _read_number(last, kind)
    if low > high:
        raise ValueError(f"begins above its end: {quoted_value(text)}")
    return unit, ValueRange(low, high)


def _read_word(text: str) -> str:
    if not text.strip():
        raise ValueError("has an empty value in its list")
    return text.strip()


def _read_number(text: str, kind: str) -> float | int:
    """Return a number converted to the first unit of its dimension ``kind`` in ``config.units``."""
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
    """Return a value as a short text."""
    return value if isinstance(value, str) else f"{value:.3g} {variation.unit}".rstrip()


# Result of one run of a sweep.

Outcome = Literal["success", "failure", "unfinished", "error"]
"""Outcome of a run: ``unfinished`` after its time limit, ``error`` for an error outside the mission."""


@dataclass(frozen=True, slots=True)
class SweepRow:
    """Result of a run: its drawn values (in the order of the sweep's variations), and its outcome.

    ``seconds`` are simulated. The row does not depend on the machine or the worker.
    """

    seed: int
    values: tuple[DrawnValue, ...]
    result: Outcome
    reason: str
    seconds: float
    ticks: int
