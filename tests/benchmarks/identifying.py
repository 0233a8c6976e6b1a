"""How surely people are recognised: ``python -m tests.benchmarks.identifying`` prints the tables of docs/people.md.

People are enrolled from eight pictures and asked for in others: drawn people from 1.5 m away at most, and asked from 2
to 3 m; of recorded clips the first half, and asked in the second. Of each number of known people some choices are
tried, and whoever is not chosen is a stranger.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from itertools import combinations, islice
from math import atan2, cos, pi, sin
from pathlib import Path
from random import Random
from typing import Self

import cv2
import numpy as np

from drivers.sim.looks import LOOKS
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import World
from missions.sweep.rate import wilson
from perception.api import UNKNOWN, Box, Image
from perception.crops import crop, face_in, portrait
from perception.faces import HaarFaces
from perception.fisher import Fisher, Vectors
from perception.identity import Look, Votes
from perception.lbp import describe
from perception.people import described
from perception.pupils import EyeFinder
from tests.perception.people_drawn import EYE, FAR, LENS, NEAR, strangers

FOOTAGE = Path(__file__).parents[2].parent / "shared/data/faces"
CLIPS = ("again", "learn", "sister", "want")
TAUGHT = 8
VOTED = 6
"""Looks in a row that make a name."""

COUNTS = (1, 2, 3, 4, 6, 10)
"""How many are known."""

CHOICES = 12
"""Choices of known people that are tried at most for each number of them."""

Portraits = Mapping[str, Sequence[Image]]


@dataclass
class Count:
    """How many of how many."""

    hits: int = 0
    of: int = 0

    def add(self, hit: bool) -> None:
        self.hits += hit
        self.of += 1

    def __iadd__(self, other: Self) -> Self:
        self.hits += other.hits
        self.of += other.of
        return self

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
    """What was found: ``refused`` are looks at known people that give no name, ``wrong`` those that give another's.

    ``accepted`` are looks at strangers that give a name, ``faces`` those at ``people_drawn.strangers`` that do;
    ``voted`` the same of the names that looks in a row make.
    """

    refused: Count = field(default_factory=Count)
    wrong: Count = field(default_factory=Count)
    accepted: Count = field(default_factory=Count)
    voted_refused: Count = field(default_factory=Count)
    voted_wrong: Count = field(default_factory=Count)
    voted_accepted: Count = field(default_factory=Count)
    faces: Count = field(default_factory=Count)

    def __iadd__(self, other: Self) -> Self:
        for each in fields(self):
            count: Count = getattr(self, each.name)
            count += getattr(other, each.name)
        return self


class Shown:
    """People as they are described: in the pictures that teach, in those that are asked; and the hundred faces."""

    def __init__(self, taught: Portraits, asked: Portraits) -> None:
        eyes = EyeFinder()
        self.taught = {name: np.concatenate([described(each, eyes) for each in seen]) for name, seen in taught.items()}
        self.asked = {name: _plain([(each, face_in(each)) for each in seen], eyes) for name, seen in asked.items()}
        self.faces = _hundred()

    def measure(self, known: Sequence[str]) -> Rates:
        """Teach some of the people, and ask for all of them."""
        rates, fisher = Rates(), Fisher.fit({name: self.taught[name] for name in known})
        for name, vectors in self.asked.items():
            seen = looks(fisher, vectors)
            singles = [look.verdict for look in seen]
            voted = [vote(seen[begin : begin + VOTED]) for begin in range(0, len(seen) - VOTED + 1, VOTED)]
            if name in known:
                _count(singles, name, rates.refused, rates.wrong)
                _count(voted, name, rates.voted_refused, rates.voted_wrong)
            else:
                _count(singles, UNKNOWN, Count(), rates.accepted)
                _count(voted, UNKNOWN, Count(), rates.voted_accepted)
        _count([look.verdict for look in looks(fisher, self.faces)], UNKNOWN, Count(), rates.faces)
        return rates

    def choices(self, count: int) -> list[tuple[str, ...]]:
        """Return choices of ``count`` known people: all of them, or as many as are tried."""
        found = list(combinations(self.taught, count))
        return found if len(found) <= CHOICES else Random(count).sample(found, CHOICES)  # noqa: S311 - no secret


@cache
def _hundred() -> Vectors:
    """Return how the faces of ``people_drawn.strangers`` are described."""
    whole = [(each, Box(0.0, 0.0, float(each.shape[1]), float(each.shape[0]))) for each in strangers()]
    return _plain(whole, EyeFinder())


def looks(fisher: Fisher, vectors: Vectors) -> list[Look]:
    """Return what looks at faces say, as ``perception.people.FisherPeople`` would."""
    found = []
    for distances in fisher.all_distances(vectors):
        nearest = int(distances.argmin())
        found.append(Look(fisher.names[nearest], fisher.threshold - float(distances[nearest])))
    return found


def vote(found: Sequence[Look]) -> str:
    votes = Votes()
    for look in found:
        votes.vote(1, look)
    return votes.name(1)


def _count(found: Sequence[str], wanted: str, refused: Count, wrong: Count) -> None:
    for verdict in found:
        refused.add(verdict != wanted and verdict == UNKNOWN)
        wrong.add(verdict not in (wanted, UNKNOWN))


def _plain(faces: Sequence[tuple[Image, Box]], eyes: EyeFinder) -> Vectors:
    return np.stack([describe(crop(image, box, eyes.find(image, box))) for image, box in faces])


def drawn(
    near: Sequence[float] = NEAR, far: Sequence[float] = FAR, *, teach: int = 3, each: int = 6, seed: int = 11
) -> tuple[Portraits, Portraits]:
    """Draw people near and far: what teaches (``teach`` at each distance, ``TAUGHT`` at most), and what is asked."""
    taught = _around(near, each=teach, seed=seed)
    return {look: found[:TAUGHT] for look, found in taught.items()}, _around(far, each=each, seed=seed + 50)


def _around(distances: Sequence[float], *, each: int, seed: int) -> dict[str, list[Image]]:
    """Return portraits of the drawn people, who stand in a circle around the camera and are looked at one by one."""
    random, detector = np.random.default_rng(seed), HaarFaces()
    places = {look: 2 * pi * number / len(LOOKS) for number, look in enumerate(LOOKS)}
    found: dict[str, list[Image]] = {look: [] for look in LOOKS}
    for number, away in enumerate(distances):
        people = (Person(look, look, x=away * cos(yaw), y=away * sin(yaw)) for look, yaw in places.items())
        renderer = Renderer(World(people=tuple(people)), LENS, seed=seed + number)
        for look, yaw in places.items():
            for _ in range(each):
                pitch = -atan2(0.5, away) + random.uniform(-0.1, 0.1)
                view = Viewpoint(0.0, 0.0, EYE, yaw=yaw + random.uniform(-0.25, 0.25), pitch=pitch)
                image = renderer.draw(view, 0.0)
                faces = detector.detect(image)
                found[look] += [portrait(image, faces[0].box)] if faces else []
    return found


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


def rows(people: Shown) -> Iterator[str]:
    """Yield a row of the table for each number of known people that there may be."""
    for count in (count for count in COUNTS if count <= len(people.taught)):
        rates, worst, choices = Rates(), 0.0, people.choices(count)
        for choice in choices:
            found = people.measure(choice)
            rates += found
            worst = max(worst, found.accepted.share)
        cells = [
            f"{count} ({len(choices)})",
            *map(str, (rates.refused, rates.wrong, rates.accepted)),
            f"{100 * worst:.0f} %" if rates.accepted.of else "-",
            *map(str, (rates.voted_refused, rates.voted_accepted, rates.faces)),
        ]
        yield f"| {' | '.join(cells)} |"


def main() -> None:
    """Print the tables."""
    near, far = drawn()
    groups: dict[str, tuple[Portraits, Portraits]] = {"of 6 drawn people": (near, far)}
    if FOOTAGE.is_dir():
        real, later = clips()
        groups["of 4 people in clips"] = (real, later)
        groups["of all 10"] = ({**near, **real}, {**far, **later})
    for name, (taught, asked) in groups.items():
        print(f"| known {name} (choices) | refused | wrong | accepted | worst choice | voted: refused "
              "| voted: accepted | 100 faces |")  # fmt: skip
        print("| --- " * 8 + "|")
        for row in rows(Shown(taught, asked)):
            print(row, flush=True)
        print()


if __name__ == "__main__":
    main()
