"""How well the robot hears: spoken by the synthesiser, heard again through the whole listening path.

``python -m tests.benchmarks.round_trip --docs`` runs the trial (an hour on one core; what is in ``--results`` is not
said again) and writes its table into docs/speech.md. ``--strangers`` is the same with other voices.
"""

import argparse
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perception.hearing.acceptance import AcceptanceModel, load_acceptance
from perception.hearing.engines import limit_by_decoys
from tests.benchmarks.listening import Result, hear_all, read
from tests.benchmarks.speaking import Speaking
from tests.benchmarks.spoken import BACKGROUNDS, STRANGERS, TRIAL

FALSE = (0.02, 0.05, 0.10, 0.15)
"""Shares of other sentences that are taken for a phrase, for which the table says how many phrases are right."""

NEVER = -99.0
PAGE = Path(__file__).parents[2] / "docs/speech.md"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Something said: whether it was a phrase, whether that was recognised, and the score of what was heard."""

    phrase: bool
    right: bool
    score: float


@dataclass(frozen=True, slots=True)
class Row:
    """The figures of one background; shares 0..1, but ``cost`` in seconds of processor for a second of sound."""

    background: str
    phrases: int
    others: int
    recognised: float
    at: tuple[float, ...]
    accepted: float
    false: float
    cost: float


def outcomes(result: Result, acceptance: AcceptanceModel) -> Iterator[Outcome]:
    """Yield what became of everything said in a stream: of several clips of it, the surest counts."""
    for said in result.said:
        heard = [take for take in result.takes if take.start < said["end"] and take.end > said["start"]]
        scores = [
            (limit_by_decoys(acceptance.score(take.figures), take.margin) if take.figures else NEVER, take.phrase)
            for take in heard
        ]
        score, phrase = max(scores, default=(NEVER, ""))
        yield Outcome(bool(said["phrase"]), phrase == said["phrase"], score)


def row(background: str, results: Sequence[Result], acceptance: AcceptanceModel) -> Row:
    """Return the figures of some streams."""
    found = [outcome for result in results for outcome in outcomes(result, acceptance)]
    phrases = [outcome for outcome in found if outcome.phrase]
    others = np.array([outcome.score for outcome in found if not outcome.phrase])

    def right(threshold: float) -> float:
        return float(np.mean([outcome.right and outcome.score > threshold for outcome in phrases]))

    return Row(
        background,
        len(phrases),
        len(others),
        float(np.mean([outcome.right for outcome in phrases])),
        tuple(right(float(np.quantile(others, 1 - share, method="higher"))) for share in FALSE),
        right(0.0),
        float(np.mean(others > 0.0)),
        sum(each.spent + each.spent_here for each in results) / sum(each.seconds for each in results),
    )


def rows(results: Iterable[Result]) -> list[Row]:
    """Return the figures of all streams, by background."""
    found, acceptance = list(results), load_acceptance()
    kinds = {kind: [result for result in found if result.background == kind] for kind in BACKGROUNDS}
    return [row(kind, some, acceptance) for kind, some in kinds.items() if some]


def table(found: Sequence[Row]) -> str:
    """Return the table, in Markdown."""
    head = ("background", "phrases / others", "recognised", *(f"at {100 * share:.0f} % false" for share in FALSE))
    head = (*head, "score above 0: right", "false", "cost")
    lines = [head, ("---",) * len(head)]
    for each in found:
        shares = (each.recognised, *each.at, each.accepted, each.false)
        cells = (f"{share:.1%}".replace("%", " %") for share in shares)
        lines.append((each.background, f"{each.phrases} / {each.others}", *cells, f"{each.cost:.3f}"))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def written(page: str, name: str, text: str) -> str:
    """Return a page with ``text`` between its marks of that name. Raises ValueError where it has none."""
    begin, end = f"<!-- round trip of {name}: begin -->", f"<!-- round trip of {name}: end -->"
    head, found, rest = page.partition(begin)
    _, closed, tail = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"the page has no place for it: {begin} .. {end}")
    return f"{head}{begin}\n{text}\n{end}{tail}"


def main() -> None:
    """Run the trial and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strangers", action="store_true", help="voices in which nothing was tried before")
    parser.add_argument("--results", type=Path, help="what was heard; goes on from there")
    parser.add_argument("--docs", action="store_true", help="write the table into docs/speech.md")
    chosen = parser.parse_args()
    material = STRANGERS if chosen.strangers else TRIAL
    results = chosen.results or Path(f"{material.name}.jsonl")
    os.nice(5)
    with Speaking() as speaking:
        hear_all(material.streams(speaking.say, {result.key for result in read(results)}), results)
    text = table(rows(read(results)))
    print(text)
    if chosen.docs:
        PAGE.write_text(written(PAGE.read_text(encoding="utf-8"), material.name, text), encoding="utf-8")


if __name__ == "__main__":
    main()
