"""How well single words of people are heard: recordings of one word each, through the whole listening path.

``python -m tests.benchmarks.single_words FOLDER`` reads ``labels.csv`` there (columns ``file``, ``word``, ``speaker``)
and prints a table for three words and for ten, each for every second speaker and for the others: what was chosen in
sight of the former is reported on the latter. Four minutes on one core for 200 recordings; what is in ``--results`` is
not heard again.
"""

import argparse
import csv
import os
import wave
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from perception.hearing.acceptance import load_acceptance
from tests.benchmarks.listening import Result, hear_all, read
from tests.benchmarks.round_trip import Outcome, outcomes
from tests.benchmarks.spoken import HISS, RATE, Floats, Said, Stream

THREE = ("yes", "no", "stop")
GRAMMARS = {"three": THREE, "ten": (*THREE, "left", "right", "up", "down", "on", "off", "go")}

GAP = 1.5
"""Seconds of silence between two words."""

HALVES = ("tuning", "held out")
"""Every second speaker, and the others."""


def recording(path: Path) -> Floats:
    """Read a WAV file of one channel, 16 bits and 16 kHz. Raises ValueError for any other."""
    with wave.open(str(path), "rb") as file:
        if (file.getnchannels(), file.getsampwidth(), file.getframerate()) != (1, 2, RATE):
            raise ValueError(f"{path} has not one channel of 16 bits at {RATE} Hz")
        return np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(np.float64)


def streams(folder: Path) -> Iterator[Stream]:
    """Yield a stream for each speaker and grammar, in which the speaker says all words with pauses between."""
    rows = list(csv.DictReader((folder / "labels.csv").read_text(encoding="utf-8").splitlines()))
    rows.sort(key=lambda row: row["speaker"])
    for number, (speaker, own) in enumerate(groupby(rows, lambda row: row["speaker"])):
        texts = list(own)
        for name, phrases in GRAMMARS.items():
            rng = np.random.default_rng(number)
            parts: list[Floats] = [np.zeros(int(2 * RATE))]
            said: list[Said] = []
            for row in texts:
                sound, start = recording(folder / row["file"]), sum(map(len, parts)) / RATE
                phrase = row["word"] if row["word"] in phrases else ""
                said.append(Said(start, start + len(sound) / RATE, row["word"], phrase))
                parts += [sound, np.zeros(int(GAP * RATE))]
            whole = np.concatenate(parts)
            whole += rng.standard_normal(len(whole)) * HISS
            samples = np.asarray(np.clip(whole, -32768, 32767), np.int16)
            yield Stream(f"{name}/{speaker}", HALVES[number % 2], speaker, phrases, samples, tuple(said))


def equal_error(found: Sequence[Outcome]) -> float:
    """Return the share of misses where as many others are taken for a phrase; between two thresholds their mean."""
    hits = np.array([each.score if each.right else -np.inf for each in found if each.phrase])
    others = np.array([each.score for each in found if not each.phrase])
    errors = [(np.mean(hits < each), np.mean(others >= each)) for each in sorted({*hits, *others})]
    missed, taken = min(errors, key=lambda pair: abs(pair[0] - pair[1]))
    return float(missed + taken) / 2


def summary(name: str, half: str, results: Sequence[Result]) -> str:
    """Return a row of the table of both halves."""
    found = [outcome for result in results for outcome in outcomes(result, load_acceptance())]
    phrases, others = ([each for each in found if each.phrase is wanted] for wanted in (True, False))
    shares = (
        np.mean([each.right and each.score > 0 for each in phrases]),
        np.mean([each.score > 0 for each in others]),
        equal_error(found),
    )
    cost = sum(each.spent + each.spent_here for each in results) / sum(each.seconds for each in results)
    cells = (name, half, f"{len(phrases)} / {len(others)}", *(f"{share:.1%}".replace("%", " %") for share in shares))
    return f"| {' | '.join(cells)} | {cost:.3f} |"


def by_word(results: Iterable[Result]) -> Mapping[str, tuple[int, int, int]]:
    """Return for each word how often it was said, was found (refused where it is none), and was taken for another."""
    counts: dict[str, tuple[int, int, int]] = {}
    for result in results:
        for said, outcome in zip(result.said, outcomes(result, load_acceptance()), strict=True):
            times, good, wrong = counts.get(said["text"], (0, 0, 0))
            taken = outcome.score > 0
            right = (outcome.right and taken) if outcome.phrase else not taken
            counts[said["text"]] = (times + 1, good + right, wrong + (taken and not right))
    return counts


def main() -> None:
    """Hear the recordings, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--results", type=Path, default=Path("single_words.jsonl"), help="what was heard before")
    chosen = parser.parse_args()
    os.nice(5)
    hear_all(streams(chosen.folder), chosen.results)
    results = list(read(chosen.results))
    print("| phrases | speakers | said / others | found | false | equal error | cost |\n| --- |" + " --- |" * 6)
    for name in GRAMMARS:
        for half in HALVES:
            own = [each for each in results if each.key.startswith(f"{name}/") and each.background == half]
            print(summary(name, half, own))
    for name in GRAMMARS:
        own = [each for each in results if each.key.startswith(f"{name}/") and each.background == HALVES[1]]
        print(f"\nheld out, {name}:\n\n| word | said | right | wrong |\n| --- | --- | --- | --- |")
        for word, counts in sorted(by_word(own).items()):
            print(f"| {word} | {' | '.join(map(str, counts))} |")


if __name__ == "__main__":
    main()
