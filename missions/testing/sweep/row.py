"""What is kept of one run of a sweep."""

from dataclasses import dataclass
from typing import Literal

from missions.testing.sweep.variation import Drawn

Outcome = Literal["success", "failure", "unfinished", "error"]
"""How a run went: ``unfinished`` when its time was up, ``error`` when something other than the mission went wrong."""


@dataclass(frozen=True, slots=True)
class Row:
    """One run: what it had drawn (in the order of the sweep's variations), and how it went.

    ``seconds`` are simulated. Nothing here depends on the machine, or on which of the workers ran it.
    """

    seed: int
    values: tuple[Drawn, ...]
    result: Outcome
    reason: str
    seconds: float
    ticks: int
