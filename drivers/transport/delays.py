"""How long something takes that is done again and again, as figures of a device's health."""

from collections.abc import Mapping


class Delays:
    """Adds up times. For one thread that adds; any may ask for the figures."""

    def __init__(self) -> None:
        self._count = 0
        self._sum = self._longest = 0.0

    def add(self, seconds: float) -> None:
        """Take in one more."""
        self._sum += seconds
        self._longest = max(self._longest, seconds)
        self._count += 1

    def counters(self, name: str) -> Mapping[str, int]:
        """Return totals for ``drivers.api.Health``, in microseconds: ``NAMEs``, ``NAME_us`` and ``longest_NAME_us``.

        What lies between two looks at them has a mean: the difference of the times by that of the counts.
        """
        return {
            f"{name}s": self._count,
            f"{name}_us": round(self._sum * 1e6),
            f"longest_{name}_us": round(self._longest * 1e6),
        }
