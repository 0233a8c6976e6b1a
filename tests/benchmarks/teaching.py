"""Teaches the ears when to believe that a phrase was said, from the lesson alone, and writes what was learned.

``python -m tests.benchmarks.teaching`` says the lesson (half an hour on one core; what is in ``--results`` is not said
again) and writes perception/hearing/acceptance.json.
"""

import argparse
import json
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from perception.hearing.acceptance import MAX_DEVIATIONS, MODEL_FILE
from tests.benchmarks.listening import Result, Take, hear_all, read
from tests.benchmarks.speaking import Speaking
from tests.benchmarks.spoken import LESSON, Floats

PENALTY = 1.0
"""What the square of a weight costs, in examples: many figures say nearly the same."""

STEPS = 30
"""Of Newton's method; it has long stopped moving then."""


def rightly(take: Take, result: Result) -> bool:
    """Whether a clip is of the phrase for which it was taken."""
    return any(
        said["phrase"] == take.phrase and take.start < said["end"] and take.end > said["start"] for said in result.said
    )


def fit(values: Floats, right: Floats) -> Floats:
    """Return the weights of a logistic regression with a penalty, the last without: that of the bias."""
    rows = np.column_stack([values, np.ones(len(values))])
    penalty = np.diag([*np.full(values.shape[1], 2 * PENALTY), 0.0])
    weights = np.zeros(rows.shape[1])
    for _ in range(STEPS):
        chance = 1 / (1 + np.exp(-np.clip(rows @ weights, -30, 30)))
        slope = rows.T @ (chance - right) + penalty @ weights
        weights -= np.linalg.solve((rows * (chance * (1 - chance))[:, None]).T @ rows + penalty, slope)
    return weights


def teach(results: Iterable[Result]) -> dict[str, object]:
    """Return what is to be learned from the results of a lesson."""
    examples = [(take.figures, rightly(take, result)) for result in results for take in result.takes if take.figures]
    names = sorted(examples[0][0])
    values = np.array([[figures[name] for name in names] for figures, _ in examples])
    right = np.array([float(truth) for _, truth in examples])
    mean, deviation = values.mean(axis=0), values.std(axis=0) + 1e-9
    *weights, bias = fit(np.clip((values - mean) / deviation, -MAX_DEVIATIONS, MAX_DEVIATIONS), right)
    print(f"{len(examples)} examples, {int(right.sum())} of them right")
    return {
        "names": names,
        "mean": [round(float(each), 5) for each in mean],
        "deviation": [round(float(each), 5) for each in deviation],
        "weights": [round(float(each), 5) for each in weights],
        "bias": round(float(bias), 5),
    }


def main() -> None:
    """Say the lesson, and write what was learned."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("lesson.jsonl"), help="what was heard; goes on from there")
    results = parser.parse_args().results
    os.nice(5)
    with Speaking() as speaking:
        hear_all(LESSON.streams(speaking.say, {result.key for result in read(results)}), results)
    MODEL_FILE.write_text(json.dumps(teach(read(results)), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
