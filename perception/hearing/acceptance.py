"""Whether a phrase was really said: one number out of the figures of its decoding, learned from examples.

A logistic regression: above 0 it was more likely said than not, as far as the examples were like life. What they were,
docs/speech.md says; ``acceptance.json`` beside this file holds what was learned.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

MODEL_FILE = Path(__file__).with_name("acceptance.json")

MAX_DEVIATIONS = 4.0
"""Standard deviations beyond which a figure is no more extreme: one that is far off must not decide alone."""


@dataclass(frozen=True, slots=True)
class AcceptanceModel:
    """For each figure by ``names`` what is usual (``mean``, ``deviation``) and its ``weights``; and a ``bias``."""

    names: tuple[str, ...]
    mean: tuple[float, ...]
    deviation: tuple[float, ...]
    weights: tuple[float, ...]
    bias: float

    def score(self, figures: Mapping[str, float]) -> float:
        """Return how surely it was said: the logarithm of the odds."""
        values = np.array([figures[name] for name in self.names])
        usual = np.clip((values - self.mean) / np.array(self.deviation), -MAX_DEVIATIONS, MAX_DEVIATIONS)
        return float(usual @ np.array(self.weights) + self.bias)


def load_acceptance(path: Path = MODEL_FILE) -> AcceptanceModel:
    """Read what was learned."""
    found = json.loads(path.read_text(encoding="utf-8"))
    return AcceptanceModel(
        names=tuple(found["names"]),
        mean=tuple(found["mean"]),
        deviation=tuple(found["deviation"]),
        weights=tuple(found["weights"]),
        bias=found["bias"],
    )
