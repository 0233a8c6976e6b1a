"""How surely people are recognised: ``python -m tests.benchmarks.identifying`` prints the table of docs/people.md.

People are enrolled from eight pictures and asked for in others: drawn people from 1.5 m away at most, and asked from 2
to 3 m; of recorded clips the first half, and asked in the second. Each person in turn is left out to be the stranger.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, islice
from pathlib import Path

import cv2
import numpy as np

from drivers.sim.looks import LOOKS
from missions.sweep.rate import wilson
from perception.api import UNKNOWN, Box, Image
from perception.crops import face_in, portrait
from perception.faces import HaarFaces
from perception.fisher import Fisher, calibrate
from perception.identity import Look, Votes
from perception.people import FisherPeople, described, fisher_people
from perception.pupils import EyeFinder
from tests.perception.people_drawn import FAR, NEAR, pictures, strangers

FOOTAGE = Path(__file__).parents[2].parent / "shared/data/faces"
CLIPS = ("again", "learn", "sister", "want")
TAUGHT = 8
VOTED = 6
"""Looks in a row that make a name."""

Portraits = Mapping[str, Sequence[Image]]


@dataclass
class Count:
    """How many of how many."""

    hits: int = 0
    of: int = 0

    def add(self, hit: bool) -> None:
        self.hits += hit
        self.of += 1

    @property
    def share(self) -> float:
        return self.hits / self.of if self.of else 0.0

    def __str__(self) -> str:
        """Say the share and its 95 % interval (Wilson's)."""
        if not self.of:
            return "-"
        low, high = wilson(self.hits, self.of)
        return f"{100 * self.share:.1f} % ({100 * low:.0f}..{100 * high:.0f}; n = {self.of})"


@dataclass
class Rates:
    """What was found: ``nearest`` is right when nobody is a stranger; the others are errors with strangers about.

    ``refused`` are looks at known people that do not give their name, ``accepted`` those at strangers that give one;
    ``voted`` the same of the names that looks in a row make. ``faces`` are those of ``people_drawn.strangers``.
    """

    nearest: Count = field(default_factory=Count)
    refused: Count = field(default_factory=Count)
    accepted: Count = field(default_factory=Count)
    voted_refused: Count = field(default_factory=Count)
    voted_accepted: Count = field(default_factory=Count)
    faces: Count = field(default_factory=Count)

    @property
    def row(self) -> list[str]:
        counts = (self.nearest, self.refused, self.accepted, self.voted_refused, self.voted_accepted, self.faces)
        return [str(count) for count in counts]


def measure(taught: Portraits, asked: Portraits) -> Rates:
    """Teach and ask, with everybody known and with each one left out."""
    rates, everybody = Rates(), fisher_people(taught)
    for name, portraits in asked.items():
        for look in looks(everybody, portraits):
            rates.nearest.add(look.name == name)
    for picture in strangers():
        seen = everybody.look(picture, Box(0.0, 0.0, picture.shape[1], picture.shape[0]))
        rates.faces.add(seen is not None and seen.verdict != UNKNOWN)
    for stranger in taught if len(taught) > 1 else ():
        others = fisher_people({name: each for name, each in taught.items() if name != stranger})
        for name, portraits in asked.items():
            wanted = UNKNOWN if name == stranger else name
            single, voted = (
                (rates.accepted, rates.voted_accepted) if name == stranger else (rates.refused, rates.voted_refused)
            )
            found = looks(others, portraits)
            for look in found:
                single.add(look.verdict != wanted)
            for begin in range(0, len(found) - VOTED + 1, VOTED):
                voted.add(vote(found[begin : begin + VOTED]) != wanted)
    return rates


def looks(people: FisherPeople, portraits: Sequence[Image]) -> list[Look]:
    found = (people.look(each, face_in(each)) for each in portraits)
    return [look for look in found if look is not None]


def vote(found: Sequence[Look]) -> str:
    votes = Votes()
    for look in found:
        votes.vote(1, look)
    return votes.name(1)


def drawn(people: Sequence[str] = tuple(LOOKS), *, each: int = 6, seed: int = 11) -> tuple[Portraits, Portraits]:
    """Draw people near and far: what teaches, and what is asked."""
    detector = HaarFaces()

    def faces(images: Sequence[Image]) -> list[Image]:
        return [portrait(image, found[0].box) for image in images if (found := detector.detect(image))]

    taught = {look: faces(pictures(look, NEAR, each=3, seed=seed))[:TAUGHT] for look in people}
    return taught, {look: faces(pictures(look, FAR, each=each, seed=seed + 50)) for look in people}


def clips(folder: Path = FOOTAGE, *, step: int = 1) -> tuple[Portraits, Portraits]:
    """Take the faces of the recorded clips, from each ``step``-th frame.

    What teaches is from their first halves, what is asked from the second.
    """
    taught, asked = {}, {}
    for name in CLIPS:
        detector, found = HaarFaces(), list[Image]()
        ends: list[int] = []
        for image in islice(_frames(folder / f"{name}.mkv"), 0, None, step):
            faces = detector.detect(image)
            found += [portrait(image, faces[0].box)] if faces else []
            ends.append(len(found))
        first = found[: ends[len(ends) // 2]]
        taught[name] = [first[place] for place in np.linspace(0, len(first) - 1, TAUGHT).astype(int)]
        asked[name] = found[len(first) :]
    return taught, asked


def _frames(path: Path) -> Iterator[Image]:
    film = cv2.VideoCapture(str(path))
    try:
        while (frame := film.read())[0]:
            yield np.asarray(frame[1], np.uint8)
    finally:
        film.release()


def by_count(taught: Portraits, asked: Portraits) -> Iterator[tuple[int, int, Rates, float]]:
    """Yield how many are known, how many choices of them there are, and the rates over all of these choices.

    All others are strangers. The last is the share of looks at strangers that the worst choice accepts.
    """
    eyes = EyeFinder()
    samples = {name: [described(each, eyes) for each in portraits] for name, portraits in taught.items()}
    shown = {name: np.stack([described(each, eyes)[0] for each in portraits]) for name, portraits in asked.items()}
    for count in range(1, len(samples)):
        rates, worst, choices = Rates(), 0.0, list(combinations(samples, count))
        for choice in choices:
            known = {name: samples[name] for name in choice}
            fisher = Fisher.fit({name: np.concatenate(each) for name, each in known.items()})
            threshold, accepted = calibrate(known).threshold, Count()
            for name, vectors in shown.items():
                distances = [fisher.distances(vector) for vector in vectors]
                nearest = [min(each, key=each.__getitem__) for each in distances]
                found = [Look(who, threshold - each[who]) for who, each in zip(nearest, distances, strict=True)]
                wanted = name if name in choice else UNKNOWN
                single = rates.refused if name in choice else rates.accepted
                voted = rates.voted_refused if name in choice else rates.voted_accepted
                for look in found:
                    single.add(look.verdict != wanted)
                    if name not in choice:
                        accepted.add(look.verdict != wanted)
                for begin in range(0, len(found) - VOTED + 1, VOTED):
                    voted.add(vote(found[begin : begin + VOTED]) != wanted)
            worst = max(worst, accepted.share)
        yield count, len(choices), rates, worst


def main() -> None:
    """Print the tables."""
    near, far = drawn()
    groups: dict[str, tuple[Portraits, Portraits]] = {"6 drawn people": (near, far)}
    if FOOTAGE.is_dir():
        real, later = clips()
        groups["4 people in clips"] = (real, later)
        groups["all 10"] = ({**near, **real}, {**far, **later})
    print(
        "| who is known | nearest right | refused | strangers accepted | voted: refused | voted: accepted | 100 faces |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, (taught, asked) in groups.items():
        print(f"| {name} | {' | '.join(measure(taught, asked).row)} |", flush=True)
    print("\n| known of 6 drawn | refused | strangers accepted | worst choice | voted: refused | voted: accepted |")
    print("| --- | --- | --- | --- | --- | --- |")
    for count, choices, rates, worst in by_count(near, far):
        cells = [f"{count} ({choices} choices)", *rates.row[1:3], f"{100 * worst:.0f} %", *rates.row[3:5]]
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
