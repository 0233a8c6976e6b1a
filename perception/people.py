"""From pictures of people to what recognises them."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.api import Box, Image
from perception.crops import crop, face_in, portrait, variants
from perception.finder import FaceDetector
from perception.fisher import Calibration, Fisher, Vectors, calibrate
from perception.identity import Look
from perception.lbp import describe
from perception.pupils import EyeFinder

FEWEST = 3
"""Pictures of a person that teach something."""

MOST, TOGETHER = 60, 240
"""Pictures of one person, and of all together, that are learnt from: time grows with the third power, and so many take
8 s on a laptop and a quarter of a gigabyte."""


class NotOneFace(ValueError):
    """A picture that does not show one face: ``found`` says how many it shows, ``hint`` what to do."""

    def __init__(self, found: int) -> None:
        super().__init__("there is no face in it" if found == 0 else f"there are {found} faces in it")
        self.found = found
        self.hint = "look into the camera, in good light" if found == 0 else "cut one out: who of them is meant?"


def enrol(image: Image, detector: FaceDetector) -> Image:
    """Return the portrait of the one person whom a picture shows. Raises NotOneFace, and ValueError for no picture."""
    faces = detector.detect(image)
    if len(faces) != 1:
        raise NotOneFace(len(faces))
    return portrait(image, faces[0].box)


class FisherPeople:
    """Knows people by Fisher's distance between local binary patterns: a ``perception.identity.Recogniser``."""

    def __init__(self, fisher: Fisher, calibration: Calibration) -> None:
        self.calibration = calibration
        self._fisher = fisher
        self._eyes = EyeFinder()

    def look(self, image: Image, face: Box) -> Look | None:
        """Return who is nearest, and by how much within the threshold; None for a box without pixels."""
        try:
            shown = crop(image, face, self._eyes.find(image, face))
        except ValueError:
            return None
        distances = self._fisher.distances(describe(shown))
        name = min(distances, key=distances.__getitem__)
        return Look(name, self._fisher.threshold - distances[name])


def fisher_people(portraits: Mapping[str, Sequence[Image]]) -> FisherPeople:
    """Learn people from their portraits (``enrol``). Raises ValueError for nobody, or somebody without a portrait."""
    eyes = EyeFinder()
    samples = {name: [described(each, eyes) for each in pictures] for name, pictures in portraits.items()}
    fisher = Fisher.fit({name: np.concatenate(each) if each else np.empty((0, 0), np.float32)
                         for name, each in samples.items()})  # fmt: skip
    return FisherPeople(fisher, calibrate(fisher, samples))


def described(picture: Image, eyes: EyeFinder) -> Vectors:
    """Return the descriptions of a portrait and of its variants, which are the same each time."""
    face = face_in(picture)
    shown = crop(picture, face, eyes.find(picture, face))
    return np.stack([describe(each) for each in variants(shown, np.random.default_rng(0))])
