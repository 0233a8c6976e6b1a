"""How surely people are recognised: ``python -m tests.benchmarks.identifying`` prints the tables of docs/people.md.

Some people are enrolled from ``--pictures`` each and asked for in their others; all other people are strangers. Which
are known, and which pictures teach, is drawn by chance, several times over. A track is five pictures in a row of one
person. ``--half`` takes the first or the last half of the people of each set, in the order of their numbers;
``--changed`` changes each picture by itself, as those of the press differ. Sets of people are folders with a folder of
pictures for each person, and are named on the command line
(``ORL=/where/it/is``); the drawn people, and the recorded clips where they are, come besides. Recognisers other than
our own are those that are here: OpenCV's LBPH (opencv-contrib-python-headless), dlib (the extra ``people``), SFace
(``--sface`` and ``--yunet`` name the files).
"""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from random import Random
from time import process_time
from typing import Any

import cv2
import numpy as np

from missions.plugins.testing.sweep.summary import wilson
from perception.api import Box, Image
from perception.crops import portrait_face_box
from perception.dlib_people import DlibDescriber, DlibRecogniser
from perception.identity import MIN_CLEAR_LOOKS, FaceMatch, FaceRecogniser, combine_matches
from perception.people import PatchRecogniser
from perception.sface import SFaceRecogniser
from perception.yunet import YuNetFaceDetector
from tests.benchmarks.portraits import TAUGHT, Portraits, changed, clips, drawn, folder, hundred
from tests.footage import FOOTAGE

TRACK = 5
"""Looks in a row that are voted on."""

KNOWN = 10
"""People who are known, or half of all where there are fewer than twenty."""

FALSE = 0.01
"""Share of looks at strangers that may be accepted, where recognisers are compared."""

Make = Callable[[Portraits], FaceRecogniser]


@dataclass(frozen=True)
class Asked:
    """What a recogniser said of the pictures of one person, who is called ``name``; empty for a stranger."""

    name: str
    looks: Sequence[FaceMatch]

    def tracks(self) -> "Asked":
        """Return the same of tracks of pictures: all together where they are ``ENOUGH`` but fewer than ``TRACK``."""
        shortest = TRACK if len(self.looks) >= TRACK else MIN_CLEAR_LOOKS
        begins = range(0, len(self.looks) - shortest + 1, TRACK)
        return Asked(self.name, [combine_matches(self.looks[begin : begin + TRACK]) for begin in begins])


@dataclass(frozen=True)
class Rates:
    """How many of the looks at known people were ``right``, and to nobody (``refused``) or somebody else (``wrong``).

    ``accepted`` are the looks at strangers that gave a name. Each is how many, and of how many.
    """

    right: tuple[int, int]
    refused: tuple[int, int]
    wrong: tuple[int, int]
    accepted: tuple[int, int]


def rates(asked: Sequence[Asked], threshold: float = 0.0) -> Rates:
    """Return how it went, where margins above ``threshold`` count."""
    known = [(each.name, look) for each in asked if each.name for look in each.looks]
    right = sum(look.name == name and look.margin > threshold for name, look in known)
    refused = sum(look.margin <= threshold for _, look in known)
    margins = [look.margin for each in asked if not each.name for look in each.looks]
    total, accepted = len(known), sum(margin > threshold for margin in margins)
    return Rates((right, total), (refused, total), (total - right - refused, total), (accepted, len(margins)))


def strict(asked: Sequence[Asked], share: float = FALSE) -> float:
    """Return the threshold above which that share of the looks at strangers is, at most; 0 without any."""
    margins = sorted((look.margin for each in asked if not each.name for look in each.looks), reverse=True)
    return margins[int(share * len(margins))] if margins else 0.0


def ask(make: Make, taught: Portraits, asked: Portraits, known: Sequence[str]) -> list[Asked]:
    """Teach some people to a recogniser, and ask it for all."""
    recogniser = make({name: taught[name] for name in known})
    found = []
    for name, pictures in asked.items():
        looks = [recogniser.match(each, portrait_face_box(each)) for each in pictures]
        found.append(Asked(name if name in known else "", [look for look in looks if look is not None]))
    return found


def trials(
    people: Portraits, known: int, count: int, *, seed: int = 1, pictures: int = TAUGHT
) -> Iterator[tuple[Portraits, Portraits, list[str]]]:
    """Yield ``count`` times what teaches, what is asked, and who is known; of each, one picture at least is asked."""
    random = Random(seed)  # noqa: S311 - no secret
    for _ in range(count):
        names = random.sample(sorted(people), known)
        teach = {name: random.sample(range(len(people[name])), min(pictures, len(people[name]) - 1)) for name in names}
        taught = {name: [people[name][place] for place in places] for name, places in teach.items()}
        asked = {
            name: [each for place, each in enumerate(shown) if place not in teach.get(name, ())]
            for name, shown in people.items()
        }
        yield taught, asked, names


class Histograms:
    """OpenCV's LBPH as it comes, on a box of 100 x 100 pixels: a ``Recogniser`` whose margins are distances."""

    def __init__(self, people: Portraits) -> None:
        self._names = list(people)
        shown = [(_box(each), number) for number, name in enumerate(people) for each in people[name]]
        face: Any = cv2
        self._model = face.face.LBPHFaceRecognizer_create()
        self._model.train([each for each, _ in shown], np.array([number for _, number in shown]))

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return who is nearest; the face must be that of a portrait."""
        del face
        number, distance = self._model.predict(_box(image))
        return FaceMatch(self._names[number], -distance)


def _box(shown: Image) -> Any:
    box = portrait_face_box(shown)
    rows, columns = (slice(round(begin), round(begin + box.width)) for begin in (box.y, box.x))
    return cv2.resize(cv2.cvtColor(shown, cv2.COLOR_BGR2GRAY)[rows, columns], (100, 100), interpolation=cv2.INTER_AREA)


def recognisers(sface: Path | None, yunet: Path | None) -> Iterator[tuple[str, Make]]:
    """Yield the recognisers that are here."""
    yield "own", PatchRecogniser
    if hasattr(cv2, "face"):
        yield "LBPH", Histograms
    if sface is not None and yunet is not None:
        yield "SFace", lambda people: SFaceRecogniser(sface, YuNetFaceDetector(yunet), people)
    if find_spec("dlib") is not None:
        describe = DlibDescriber()
        yield "dlib", lambda people: DlibRecogniser(people, describe)


def row(cells: Sequence[str], asked: Sequence[Asked], seconds: float) -> str:
    """Return a row of the table."""
    tracks = [each.tracks() for each in asked]
    count = sum(len(each.looks) for each in asked)
    found = [_right_at(each) for each in (asked, tracks)]
    single, voted = rates(asked), rates(tracks)
    found += [single.right, single.refused, single.wrong, single.accepted, voted.right, voted.wrong, voted.accepted]
    return f"| {' | '.join([*cells, *map(percent, found), f'{1000 * seconds / count:.0f} ms'])} |"


def _right_at(asked: Sequence[Asked]) -> tuple[int, int]:
    """Return how many looks at known people are right where few strangers pass; of none where no stranger was shown."""
    strangers = any(each.looks for each in asked if not each.name)
    return rates(asked, strict(asked)).right if strangers else (0, 0)


def percent(hits: tuple[int, int]) -> str:
    """Say a share and its 95 % interval (Wilson's)."""
    if not hits[1]:
        return "-"
    low, high = wilson(*hits)
    return f"{100 * hits[0] / hits[1]:.1f} % ({100 * low:.0f}..{100 * high:.0f})"


def named(asked: Sequence[Asked]) -> str:
    """Say of how many of the different strangers one look at least gave a name, and of how many a track."""
    strangers = [each for each in asked if not each.name and each.looks]
    looks, tracks = (
        (sum(any(look.margin > 0 for look in each.looks) for each in found), len(found))
        for found in (strangers, [each.tracks() for each in strangers])
    )
    return f"strangers of a draw who were named in a look {percent(looks)}, in a track {percent(tracks)}"


def sets(given: Namespace, count: int) -> Iterator[tuple[str, list[tuple[Portraits, Portraits, list[str]]]]]:
    """Yield each set of people by its name, and its draws with ``count`` pictures that teach."""
    for name, where in (each.split("=", 1) for each in given.sets):
        people = folder(Path(where), given.half)
        random = np.random.default_rng(77)
        if given.changed:
            people = {each: [changed(shown, random) for shown in pictures] for each, pictures in people.items()}
        known = min(given.known, len(people) // 2)
        yield name, list(trials(people, known, given.trials, pictures=count))
    if given.half or given.changed:
        return
    halves = {"drawn people": drawn()} | ({"clips": clips(pictures=count)} if FOOTAGE.is_dir() else {})
    for name, (taught, asked) in halves.items():
        names = sorted(taught)
        chosen = [Random(seed).sample(names, min(given.known, len(names) // 2)) for seed in range(given.trials)]  # noqa: S311
        yield name, [(taught, asked, each) for each in chosen]
        strange = [{known: asked[known] for known in each} | hundred() for each in chosen]
        yield f"{name}, and 100 strangers", [(taught, who, each) for who, each in zip(strange, chosen, strict=True)]


def main(words: Sequence[str]) -> None:
    """Print the table."""
    parser = ArgumentParser()
    parser.add_argument("sets", nargs="*", help="NAME=FOLDER")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--known", type=int, default=KNOWN)
    parser.add_argument("--pictures", type=int, nargs="*", default=[TAUGHT])
    parser.add_argument("--half", choices=("first", "last"), default="")
    parser.add_argument("--changed", action="store_true")
    parser.add_argument("--own", action="store_true", help="no other recogniser")
    parser.add_argument("--sface", type=Path)
    parser.add_argument("--yunet", type=Path)
    given = parser.parse_args(words)
    cv2.setNumThreads(1)
    print("| people | recogniser | pictures | known / strangers | right at 1 % | tracks of five | own threshold: right "
          "| refused | wrong | strangers accepted | tracks: right | wrong | accepted | cost |")  # fmt: skip
    print("| --- " * 14 + "|")
    for count, (name, held) in ((number, each) for number in given.pictures for each in sets(given, number)):
        for called, make in recognisers(given.sface, given.yunet):
            if given.own and called != "own":
                continue
            begin = process_time()
            asked_all = [each for taught, asked, known in held for each in ask(make, taught, asked, known)]
            counts = f"{len(held[0][2])} / {len(held[0][1]) - len(held[0][2])}"
            print(row([name, called, str(count), counts], asked_all, process_time() - begin), flush=True)
            print(f"{name}, {called}, {count}: {named(asked_all)}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
