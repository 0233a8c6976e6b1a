"""Acceptance score of a recognised phrase: logistic regression on features of its decoding.

Above 0 the phrase was more likely spoken than not, by the training examples. docs/speech.md describes these;
``acceptance.json`` beside this file has the trained parameters.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

MODEL_FILE = Path(__file__).with_name("acceptance.json")

MAX_DEVIATIONS = 4.0
"""Standard deviations at which a feature of a decoding is clipped, so that one outlier does not decide alone."""


@dataclass(frozen=True, slots=True)
class AcceptanceModel:
    """Logistic regression with ``mean``, ``deviation`` and weight of each feature in ``names``, and a ``bias``."""

    names: tuple[str, ...]
    mean: tuple[float, ...]
    deviation: tuple[float, ...]
    weights: tuple[float, ...]
    bias: float

    def score(self, figures: Mapping[str, float]) -> float:
        """Return the logarithm of the odds that the phrase was spoken; ``figures`` are its features by name."""
        values = np.array([figures[name] for name in self.names])
        usual = np.clip((values - self.mean) / np.array(self.deviation), -MAX_DEVIATIONS, MAX_DEVIATIONS)
        return float(usual @ np.array(self.weights) + self.bias)


def load_acceptance(path: Path = MODEL_FILE) -> AcceptanceModel:
    """Return the model that scores whether a recognised phrase was really spoken, with the parameters in a file."""
    found = json.loads(path.read_text(encoding="utf-8"))
    return AcceptanceModel(
        names=tuple(found["names"]),
        mean=tuple(found["mean"]),
        deviation=tuple(found["deviation"]),
        weights=tuple(found["weights"]),
        bias=found["bias"],
    )
