"""What is missing in a record."""

from collections.abc import Mapping
from dataclasses import field

from drivers.api.quick import dataclass


@dataclass(frozen=True, slots=True)
class Loss:
    """What is missing in a record: messages by topic, and why. ``ended`` is when it reached its limit (s), or None."""

    counts: Mapping[str, int] = field(default_factory=dict)
    why: str = ""
    ended: float | None = None

    def __bool__(self) -> bool:
        return bool(self.counts or self.why or self.ended is not None)

    def __str__(self) -> str:
        """Say it in a line for people; nothing where nothing is missing."""
        said = []
        if self.counts:
            named = ", ".join(f"{count} on {topic}" for topic, count in sorted(self.counts.items()))
            said.append(f"{sum(self.counts.values())} messages are missing ({self.why or 'lost'}): {named}")
        elif self.why:
            said.append(self.why)
        if self.ended is not None:
            said.append(f"it reached its limit at {self.ended:.1f} s and ends there")
        return "; ".join(said)
