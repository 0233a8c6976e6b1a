"""The PD controller: the textbook's answer, to compare the fuzzy ones with."""

import math
from collections.abc import Mapping

from drivers.api.quick import dataclass

KEYS = ("p", "d", "most")


@dataclass(frozen=True, slots=True)
class ProportionalDerivative:
    """A rate (rad/s) of ``p`` (1/s) times the error (radians) plus ``d`` times its rate (rad/s), ``most`` at most."""

    p: float
    d: float
    most: float = math.inf

    @classmethod
    def from_mapping(cls, name: str, mapping: Mapping[str, object]) -> "ProportionalDerivative":
        """Make it of plain SI values: ``p``, ``d`` and perhaps ``most``.

        Raises ValueError, as ``name``, for a value that is no number of 0 or more, and for any other key.
        """
        if unknown := mapping.keys() - set(KEYS):
            raise ValueError(f"{name}: a PD controller has no '{min(unknown)}'; known are: {', '.join(KEYS)}")
        found: dict[str, float] = {}
        for key, value in mapping.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
                raise ValueError(f"{name}: '{key}' needs a number of 0 or more, not {value!r}")
            found[key] = float(value)
        if missing := {"p", "d"} - found.keys():
            raise ValueError(f"{name}: a PD controller needs '{min(missing)}'")
        return cls(**found)

    def __call__(self, error: float, rate: float) -> float:
        """Return the rate for an error and how fast it changes. Raises ValueError for NaN."""
        asked = self.p * error + self.d * rate
        if math.isnan(asked):
            raise ValueError("a value is not a number (NaN)")
        return min(max(asked, -self.most), self.most)
