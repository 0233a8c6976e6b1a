"""A success rate, and how far it can be trusted."""

from dataclasses import dataclass
from math import sqrt

Z95 = 1.959963984540054
"""The standard normal quantile at 97.5 %: for intervals that hold 95 %."""


def wilson(successes: int, runs: int) -> tuple[float, float]:
    """Return the 95 % interval of a success rate: Wilson's score interval, (0, 1) without a run.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927), 209-212.
    It stays within 0..1 and holds for rates near the ends, where the usual p +- 1.96 s does not.
    """
    if runs == 0:
        return 0.0, 1.0
    share, z2 = successes / runs, Z95**2
    middle = (share + z2 / (2 * runs)) / (1 + z2 / runs)
    half = Z95 * sqrt(share * (1 - share) / runs + z2 / (4 * runs**2)) / (1 + z2 / runs)
    # At the ends the formula gives 0 and 1 but for rounding.
    return (0.0 if successes == 0 else middle - half), (1.0 if successes == runs else middle + half)


@dataclass(frozen=True, slots=True)
class Rate:
    """How many of ``runs`` succeeded."""

    successes: int
    runs: int

    @property
    def share(self) -> float:
        """The share of successes, 0 without a run."""
        return self.successes / self.runs if self.runs else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of that share."""
        return wilson(self.successes, self.runs)
