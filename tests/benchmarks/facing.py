"""Faces, and only faces, when it gets harder: how many are covered, what is false, ids and cost, for each way to look.

``python -m tests.benchmarks.facing [--tune] [--only WORD] [--ways haar,yunet]`` prints a table: films that are on this
machine, made harder; the half that was kept to report on, or with ``--tune`` the other. Costs are CPU time over that of
the course's own call on the same frames. Judged is what the tracker tells of: what a mission hears.
"""

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

import cv2
import cv2.data
import numpy as np

from perception.api import Box, Face, Image
from perception.face_finder import FaceDetector, FaceFinder, Floats
from perception.geometry import Pinhole
from perception.haar_faces import HaarFaceDetector
from perception.tracks import Tracker
from perception.yunet import YuNetFaceDetector
from tests.benchmarks.covering import on
from tests.benchmarks.hardships import EMPTY, HARD, Shot, films, mirrored, together
from tests.footage import FOOTAGE

MODEL = FOOTAGE.parent / "models" / "face_detection_yunet_2023mar.onnx"
RATE = 10.0

Way = Callable[[Image, float], Sequence[tuple[int, Box]]]
"""Looks at the next frame, taken at a time; returns the faces told of, each with its id, 0 for none."""


@dataclass(slots=True)
class Score:
    """Frames, faces in them, of these covered; frames with one that is covered; false ones; ids and changes of id."""

    frames: int = 0
    peopled: int = 0
    faces: int = 0
    covered: int = 0
    met: int = 0
    false: int = 0
    switches: int = 0
    seconds: float = 0.0
    course: float = 0.0
    ids: set[int] = field(default_factory=set)
    last: dict[int, int] = field(default_factory=dict)

    def add(self, seen: Sequence[tuple[int, Box]], truth: list[Box]) -> None:
        """Count one frame; faces are told apart by their order in the truth."""
        self.frames += 1
        self.peopled += bool(truth)
        self.faces += len(truth)
        self.ids |= {number for number, _ in seen}
        self.false += sum(not any(on(box, true) for true in truth) for _, box in seen)
        covered = 0
        for place, true in enumerate(sorted(truth, key=lambda box: box.x)):
            number = next((number for number, box in seen if on(box, true)), None)
            if number is None:
                continue
            covered += 1
            self.switches += self.last.get(place, number) != number
            self.last[place] = number
        self.covered += covered
        self.met += covered > 0

    def __str__(self) -> str:
        """One row of the table."""
        share = f"{self.covered / self.faces:>7.1%} {self.met / self.peopled:>7.1%}" if self.faces else f"{'':>15}"
        return (
            f"{share} {self.false / self.frames:>7.3f} {len(self.ids):>4} {self.switches:>4} "
            f"{self.seconds / self.course:>7.3f}"
        )


def followed(detector: FaceDetector) -> Way:
    """Return the finder and the tracker, as the eyes have them."""
    finder, tracker = FaceFinder(detector), Tracker[Face]()

    def look(image: Image, now: float) -> list[tuple[int, Box]]:
        camera = Pinhole(image.shape[1], image.shape[0], math.radians(60))
        told = tracker.update(finder.find(image), camera=camera, gaze=None, stamp=now)
        return [(face.id, face.box) for face in told if face.stamp == now]

    return look


def bare(side: int) -> Way:
    """Return YuNet alone on each frame, shrunk to ``side`` pixels."""
    network = cv2.FaceDetectorYN.create(str(MODEL), "", (320, 320), 0.6, 0.3, 50)

    def look(image: Image, _: float) -> list[tuple[int, Box]]:
        scale = min(1.0, side / max(image.shape))
        shown = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else image
        network.setInputSize((shown.shape[1], shown.shape[0]))
        found = cast(Floats | None, network.detect(shown)[1])  # None for none, which the type stubs leave out
        return [] if found is None else [(0, Box(*row[:4])) for row in (found / scale).tolist()]

    return look


def course() -> Way:
    """Return the course's own call on each frame."""
    cascade = cv2.CascadeClassifier(cv2.data.haarcascades + "haarcascade_frontalface_default.xml")

    def look(image: Image, _: float) -> list[tuple[int, Box]]:
        found = cascade.detectMultiScale(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), 1.5, 5)
        return [(0, Box(*(float(value) for value in box))) for box in found]

    return look


DETECTORS: dict[str, Callable[[], HaarFaceDetector | YuNetFaceDetector]] = {
    "haar": HaarFaceDetector,
    "yunet": lambda: YuNetFaceDetector(MODEL),
}


def begin(name: str) -> Callable[[], Way]:
    """Return how to begin a way of looking; its files are read by now, so that none of it is timed."""
    start = np.full((120, 160, 3), 128, np.uint8)
    if name in DETECTORS:
        detector = DETECTORS[name]()
        detector.detect(start)
        detector.is_confirmed(start, Box(40, 40, 60, 60))
        return lambda: followed(detector)
    look = course() if name == "course" else bare(int(name.removeprefix("bare")))
    look(start, 0.0)
    return lambda: look


def score(shots: Sequence[Shot], begins: Mapping[str, Callable[[], Way]]) -> dict[str, Score]:
    """Return how each way does on a film, frame by frame in turns."""
    looks = {name: each() for name, each in begins.items()}
    scores = {name: Score() for name in begins}
    for number, (image, truth) in enumerate(shots):
        for name, look in looks.items():
            began = time.process_time()
            seen = look(image, number / RATE)
            scores[name].seconds += time.process_time() - began
            scores[name].add(seen, truth)
    for each in scores.values():
        each.course = scores["course"].seconds
    return scores


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(prog="python -m tests.benchmarks.facing")
    options.add_argument("--tune", action="store_true")
    options.add_argument("--kinds", default="faces,heads,nofaces")
    options.add_argument("--only", default="")
    options.add_argument("--most", type=int, default=120)
    options.add_argument("--ways", default="haar,yunet,bare320")
    options.add_argument("--together", action="store_true", help="Three and four people in one picture, as it is.")
    asked = options.parse_args()
    cv2.setNumThreads(1)
    begins = {name: begin(name) for name in (*asked.ways.split(","), "course")}
    print(f"{'':<44} {'way':<8} {'faces':>7} {'frames':>7} {'false':>7} {'ids':>4} {'swit':>4} {'cost':>7}")
    if asked.together:
        shots = [film.shots(asked.most) for film in films("faces") if film.tuned is asked.tune]
        parts = [*shots, *map(mirrored, shots)]
        for count in (3, 4):
            for name, each in score(together(parts[:count]), begins).items():
                print(f"{f'{count} people together':<44} {name:<8} {each}", flush=True)
        return
    for kind in asked.kinds.split(","):
        for hardship, change in (EMPTY if kind == "nofaces" else HARD).items():
            if asked.only not in hardship:
                continue
            for film in films(kind):
                if film.tuned is asked.tune:
                    for name, each in score(change(film.shots(asked.most)), begins).items():
                        print(f"{hardship + ', ' + film.name[:-4][:30]:<44} {name:<8} {each}", flush=True)


if __name__ == "__main__":
    main()
