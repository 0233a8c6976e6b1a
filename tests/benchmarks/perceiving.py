"""What seeing costs, against the course's own detector call on the same frames: rendered, and of real people."""

from collections.abc import Iterator
from itertools import islice

import cv2
import numpy as np

from perception.haar_faces import HaarFaceDetector
from tests.benchmarks.covering import Film, clips, rendered, score
from tests.benchmarks.table import Row

BOUND = 0.2
"""The share of the course's cost that is allowed."""

LOOKS = 2
"""Films of rendered people that are searched: more of them change nothing but the time it takes."""


def rows() -> Iterator[Row]:
    """Yield what a frame costs in the pipeline, on each kind of film."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield _row("a face followed, rendered", list(islice(rendered(), LOOKS)))
        films = list(clips())
        if films:
            yield _row("a face followed, clips of real people", films)
    finally:
        cv2.setNumThreads(before)


def _row(name: str, films: list[Film]) -> Row:
    detector = HaarFaceDetector()
    detector.detect(np.zeros((480, 640), np.uint8))  # the cascade is read before anything is timed
    ours, theirs = score(films, lambda image: image, detector)
    mine, other = ours.seconds / ours.frames, theirs.seconds / theirs.frames
    return Row(name, mine, other, mine / other, BOUND)
