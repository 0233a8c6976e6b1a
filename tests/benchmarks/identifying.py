"""How surely people are recognised: ``python -m tests.benchmarks.identifying`` prints the tables of docs/people.md.

Some people are enrolled from three pictures each and asked for in their others; all other people are strangers. Which
are known, and which pictures teach, is drawn by chance, several times over. A track is five pictures in a row of one
person. Sets of people are folders with a folder of pictures for each person, and are named on the command line
(``ORL=/where/it/is``); the drawn people, and the recorded clips where they are, come besides. Recognisers other than
our own are those that are here: OpenCV's LBPH (opencv-contrib-python-headless), dlib (the extra ``people``), SFace
(``--sface`` and ``--yunet`` name the files).
"""

import sys
from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice
from math import atan2, cos, pi, sin
from pathlib import Path
from random import Random
from time import process_time
from typing import Any

import cv2
import numpy as np

from drivers.sim.looks import LOOKS
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import World
from missions.testing.sweep.rate import wilson
from perception.api import Box, Image
from perception.crops import face_in, portrait
from perception.dlib_people import DlibDescriber, DlibPeople
from perception.faces import HaarFaces
from perception.identity import Look, Recogniser, agreed
from perception.people import KnownPeople
from perception.sface import SFacePeople
from perception.yunet import YuNetFaces
from tests.footage import FOOTAGE
from tests.perception.people_drawn import EYE, FAR_DISTANCES, LENS, NEAR_DISTANCES, strangers

CLIPS = ("again", "learn", "sister", "want")

TAUGHT = 3
"""Pictures of each person that teach."""

TRACK = 5
"""Looks in a row that are voted on."""

KNOWN = 10
"""People who are known, or half of all where there are fewer than twenty."""

FALSE = 0.01
"""Share of looks at strangers that may be accepted, where recognisers are compared."""

Portraits = Mapping[str, Sequence[Image]]
Make = Callable[[Portraits], Recogniser]


@dataclass(frozen=True)
class Asked:
    """What a recogniser said of the pictures of one person, who is called ``name``; empty for a stranger."""

    name: str
    looks: Sequence[Look]

    def tracks(self) -> "Asked":
        """Return the same of tracks of pictures."""
        begins = range(0, len(self.looks) - TRACK + 1, TRACK)
        return Asked(self.name, [agreed(self.looks[begin : begin + TRACK]) for begin in begins])


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
        looks = [recogniser.look(each, face_in(each)) for each in pictures]
        found.append(Asked(name if name in known else "", [look for look in looks if look is not None]))
    return found


def trials(
    people: Portraits, known: int, count: int, *, seed: int = 1
) -> Iterator[tuple[Portraits, Portraits, list[str]]]:
    """Yield ``count`` times what teaches, what is asked, and who is known."""
    random = Random(seed)  # noqa: S311 - no secret
    for _ in range(count):
        names = random.sample(sorted(people), known)
        teach = {name: random.sample(range(len(people[name])), TAUGHT) for name in names}
        taught = {name: [people[name][place] for place in places] for name, places in teach.items()}
        asked = {
            name: [each for place, each in enumerate(pictures) if place not in teach.get(name, ())]
            for name, pictures in people.items()
        }
        yield taught, asked, names


def folder(where: Path) -> Portraits:
    """Return the portraits of people in a folder: of each picture the largest face, where one is found."""
    found = {}
    for home in sorted(path for path in where.iterdir() if path.is_dir()):
        pictures = [cv2.imread(str(path)) for path in sorted(home.iterdir())]
        faces = [shown for each in pictures if each is not None and (shown := _portrait(np.asarray(each, np.uint8)))]
        if len(faces) > TAUGHT:
            found[home.name] = [face for (face,) in faces]
    return found


def _portrait(image: Image) -> tuple[Image] | None:
    """Return the portrait of the largest face; a small picture is given a border first, and enlarged."""
    if max(image.shape) < 240:
        edge = image.shape[1] // 3
        image = np.asarray(cv2.copyMakeBorder(image, edge, edge, edge, edge, cv2.BORDER_REPLICATE), np.uint8)
        image = np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8)
    faces = HaarFaces().detect(image)
    return (portrait(image, faces[0].box),) if faces else None


def drawn(
    near: Sequence[float] = NEAR_DISTANCES,
    far: Sequence[float] = FAR_DISTANCES,
    *,
    teach: int = 1,
    each: int = 6,
    seed: int = 11,
) -> tuple[Portraits, Portraits]:
    """Draw people near and far: what teaches (``teach`` at each distance), and what is asked."""
    return _around(near, each=teach, seed=seed), _around(far, each=each, seed=seed + 50)


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


def clips(where: Path = FOOTAGE, *, step: int = 1) -> tuple[Portraits, Portraits]:
    """Take the faces of the recorded clips, from each ``step``-th frame.

    What teaches is from their first halves, what is asked from the second.
    """
    taught, asked = {}, {}
    for name in CLIPS:
        detector, found = HaarFaces(), list[Image]()
        ends: list[int] = []
        for image in islice(_frames(where / f"{name}.mkv"), 0, None, step):
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


def hundred() -> dict[str, list[Image]]:
    """Return the faces of ``people_drawn.strangers`` as portraits, each that of somebody else."""
    whole = Box(0.0, 0.0, 96.0, 96.0)
    return {f"stranger {number}": [portrait(each, whole)] for number, each in enumerate(strangers())}


class Histograms:
    """OpenCV's LBPH as it comes, on a box of 100 x 100 pixels: a ``Recogniser`` whose margins are distances."""

    def __init__(self, people: Portraits) -> None:
        self._names = list(people)
        shown = [(_box(each), number) for number, name in enumerate(people) for each in people[name]]
        face: Any = cv2
        self._model = face.face.LBPHFaceRecognizer_create()
        self._model.train([each for each, _ in shown], np.array([number for _, number in shown]))

    def look(self, image: Image, face: Box) -> Look | None:
        """Return who is nearest; the face must be that of a portrait."""
        del face
        number, distance = self._model.predict(_box(image))
        return Look(self._names[number], -distance)


def _box(shown: Image) -> Any:
    box = face_in(shown)
    rows, columns = (slice(round(begin), round(begin + box.width)) for begin in (box.y, box.x))
    return cv2.resize(cv2.cvtColor(shown, cv2.COLOR_BGR2GRAY)[rows, columns], (100, 100), interpolation=cv2.INTER_AREA)


def recognisers(sface: Path | None, yunet: Path | None) -> Iterator[tuple[str, Make]]:
    """Yield the recognisers that are here."""
    yield "own", KnownPeople
    if hasattr(cv2, "face"):
        yield "LBPH", Histograms
    if sface is not None and yunet is not None:
        yield "SFace", lambda people: SFacePeople(sface, YuNetFaces(yunet), people)
    if find_spec("dlib") is not None:
        describe = DlibDescriber()
        yield "dlib", lambda people: DlibPeople(people, describe)


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


def main(words: Sequence[str]) -> None:
    """Print the table."""
    parser = ArgumentParser()
    parser.add_argument("sets", nargs="*", help="NAME=FOLDER")
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--known", type=int, default=KNOWN)
    parser.add_argument("--sface", type=Path)
    parser.add_argument("--yunet", type=Path)
    given = parser.parse_args(words)
    sets: dict[str, list[tuple[Portraits, Portraits, list[str]]]] = {}
    for name, where in (each.split("=", 1) for each in given.sets):
        people = folder(Path(where))
        sets[name] = list(trials(people, min(given.known, len(people) // 2), given.trials))
    halves = {"drawn people": drawn()} | ({"clips": clips()} if FOOTAGE.is_dir() else {})
    for name, (taught, asked) in halves.items():
        names = sorted(taught)
        chosen = [Random(seed).sample(names, min(given.known, len(names) // 2)) for seed in range(given.trials)]  # noqa: S311
        sets[name] = [(taught, asked, each) for each in chosen]
        sets[f"{name}, and 100 strangers"] = [
            (taught, {known: asked[known] for known in each} | hundred(), each) for each in chosen
        ]
    print("| people | recogniser | known / strangers | right at 1 % | tracks of five | own threshold: right | refused "
          "| wrong | strangers accepted | tracks: right | wrong | accepted | cost |")  # fmt: skip
    print("| --- " * 13 + "|")
    for name, held in sets.items():
        for called, make in recognisers(given.sface, given.yunet):
            begin = process_time()
            asked_all = [each for taught, asked, known in held for each in ask(make, taught, asked, known)]
            counts = f"{len(held[0][2])} / {len(held[0][1]) - len(held[0][2])}"
            print(row([name, called, counts], asked_all, process_time() - begin), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
