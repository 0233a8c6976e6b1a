"""The finder on films of real people, against their true places and beside the course's own call."""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import cv2.data
import numpy as np

from perception.api import Box, Image
from perception.face_finder import FaceFinder
from perception.haar_faces import HaarFaceDetector

CLIPS = ["again.mkv", "learn.mkv", "sister.mkv", "want.mkv"]
Seen = Callable[[Image], Sequence[Box]]


def frames(footage: Path, clip: str) -> Iterator[tuple[Image, list[Box]]]:
    """Each frame of a clip with the true boxes in it."""
    truth = json.loads((footage / "truth.json").read_text())[clip]
    film = cv2.VideoCapture(str(footage / clip))
    try:
        for boxes in truth:
            more, picture = film.read()
            assert more
            yield np.asarray(picture, dtype=np.uint8), [Box(*box) for box in boxes]
    finally:
        film.release()


def on(box: Box, true: Box) -> bool:
    """Whether a box is on a face: its middle inside, and enough of it."""
    x, y = box.centre
    return true.x <= x <= true.x + true.width and true.y <= y <= true.y + true.height and box.overlap(true) > 0.3


def finder() -> Seen:
    faces = FaceFinder(HaarFaceDetector())
    return lambda picture: [sighting.detection.box for sighting in faces.find(picture)]


def test_a_face_is_covered_in_nearly_every_frame_and_hardly_one_is_wrong(footage: Path) -> None:
    total = covered = wrong = 0
    for clip in CLIPS:
        see = finder()
        for picture, truth in frames(footage, clip):
            boxes = see(picture)
            total += 1
            covered += any(on(box, true) for box in boxes for true in truth)
            wrong += any(not any(on(box, true) for true in truth) for box in boxes)
    assert covered >= 0.98 * total
    assert wrong <= 0.01 * total


def test_the_finder_costs_a_fraction_of_the_courses_call(footage: Path) -> None:
    course = cv2.CascadeClassifier(str(Path(cv2.data.haarcascades) / "haarcascade_frontalface_default.xml"))
    see, ours, theirs = finder(), 0, 0
    for picture, _ in frames(footage, "learn.mkv"):
        began = cv2.getTickCount()
        see(picture)
        between = cv2.getTickCount()
        course.detectMultiScale(picture, 1.5, 5)
        ours, theirs = ours + between - began, theirs + cv2.getTickCount() - between
    assert ours < 0.5 * theirs  # 0.1 on a machine that has nothing else to do
