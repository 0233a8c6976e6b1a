"""From pictures of people to what recognises them."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.api import Box, Image
from perception.crops import crop, face_in, portrait, upright
from perception.elastic import Gallery, Picture
from perception.finder import FaceDetector
from perception.identity import Look
from perception.light import Grey
from perception.patches import describe
from perception.pupils import EyeFinder

FEWEST = 3
"""Pictures of a person that teach something."""

ENOUGH = 6
"""Pictures of a person, from different sides, after which more of the same day add little (docs/people.md)."""

MAX_PICTURES, MAX_PICTURES_TOGETHER = 24, 240
"""Pictures of one person, and of all together, that are learnt from."""

TEMPLATES = 240
"""Pictures and variants of all together that are compared: 271 kB each, and what a look costs is in proportion."""

VARIANTS = 4
"""How a picture is shown at most: by its box, upright by its eyes, and both in the mirror, which shows a head that is
turned the other way, and lit from the other side."""


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


class KnownPeople:
    """Knows people by the patches of their faces: a ``perception.identity.Recogniser``.

    Learns from their ``portraits`` (``enrol``); ``cohort`` are those of others who are strangers for sure.
    Raises ValueError for nobody, or somebody without a portrait.
    """

    def __init__(self, portraits: Mapping[str, Sequence[Image]], cohort: Sequence[Sequence[Image]] = ()) -> None:
        share = min(MAX_PICTURES, TEMPLATES // max(1, len(portraits) + len(cohort)))
        self._eyes = EyeFinder()
        people = {name: described(pictures, share, self._eyes) for name, pictures in portraits.items()}
        gallery = Gallery(people, [described(pictures, share, self._eyes) for pictures in cohort])
        self.calibration = gallery.calibration
        self._gallery = gallery

    def look(self, image: Image, face: Box) -> Look | None:
        """Return who is nearest, and by how much within the threshold; None for a box without pixels."""
        try:
            return self._gallery.look([describe(each) for each in sights(image, face, self._eyes)])
        except ValueError:
            return None


def described(portraits: Sequence[Image], share: int, eyes: EyeFinder) -> list[Picture]:
    """Return the descriptions of a person's portraits and of their variants: about ``share`` in all.

    Of more portraits some are taken, spread over all of them.
    """
    count = min(len(portraits), share)
    taken = [portraits[place * len(portraits) // count] for place in range(count)]
    return [_described(picture, share // count, eyes) for picture in taken]


def _described(portrait: Image, count: int, eyes: EyeFinder) -> Picture:
    """Return how a portrait is described, with ``count`` templates at most."""
    crops = sights(portrait, face_in(portrait), eyes)
    seen = [describe(each) for each in crops]
    missing = max(0, min(VARIANTS, count) - len(seen))
    mirrored = [describe(np.ascontiguousarray(each[:, ::-1])) for each in crops[:missing]]
    return Picture(seen, [*seen, *mirrored][:count])


def sights(image: Image, face: Box, eyes: EyeFinder) -> list[Grey]:
    """Return the crops of a face: by its box and, where both eyes are found, upright by them. Raises as ``crop``."""
    shown = [crop(image, face)]
    found = upright(face, eyes.find(image, face))
    return shown if found is None else [*shown, crop(image, found[0], roll=found[1])]
