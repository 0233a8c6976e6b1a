"""From pictures of people to what recognises them."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.api import Box, Image
from perception.crops import crop, face_in, portrait
from perception.elastic import Gallery, Picture
from perception.finder import FaceDetector
from perception.identity import Look
from perception.patches import describe

FEWEST = 3
"""Pictures of a person that teach something."""

MAX_PICTURES, MAX_PICTURES_TOGETHER = 24, 240
"""Pictures of one person, and of all together, that are learnt from."""

TEMPLATES = 240
"""Pictures and variants of all together that are compared: 226 kB each, and what a look costs is in proportion."""

VARIANTS = ((False, 0.0, 1.0), (True, 0.0, 1.0), (False, 0.0, 0.93), (False, 0.0, 1.08), (False, 6.0, 1.0),
            (False, -6.0, 1.0), (False, 0.0, 0.87), (False, 0.0, 1.16))  # fmt: skip
"""How a picture is shown: in the mirror, turned by degrees, how large. The first is as it is; the mirror shows a head
that is turned the other way, and lit from the other side; the others are how detectors frame a face."""


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
        people = {name: described(pictures, share) for name, pictures in portraits.items()}
        gallery = Gallery(people, [described(pictures, share) for pictures in cohort])
        self.calibration = gallery.calibration
        self._gallery = gallery

    def look(self, image: Image, face: Box) -> Look | None:
        """Return who is nearest, and by how much within the threshold; None for a box without pixels."""
        try:
            shown = crop(image, face)
        except ValueError:
            return None
        return self._gallery.look(describe(shown))


def described(portraits: Sequence[Image], share: int) -> list[Picture]:
    """Return the descriptions of a person's portraits and of their variants: about ``share`` in all.

    Of more portraits some are taken, spread over all of them.
    """
    count = min(len(portraits), share)
    taken = [portraits[place * len(portraits) // count] for place in range(count)]
    return [_shown(picture, share // count) for picture in taken]


def _shown(portrait: Image, count: int) -> Picture:
    """Return how a portrait is described, and as many of its variants as make ``count``."""
    found = []
    for mirrored, roll, zoom in VARIANTS[:count]:
        shown = crop(portrait, face_in(portrait), roll=roll, zoom=zoom)
        found.append(describe(np.ascontiguousarray(shown[:, ::-1]) if mirrored else shown))
    return found
