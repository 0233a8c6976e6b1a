"""From pictures of people to what recognises them."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.api import Box, Image
from perception.crops import align_by_eyes, crop_face, make_portrait, portrait_face_box
from perception.elastic_matching import Gallery, PictureDescription
from perception.eye_finder import EyeFinder
from perception.face_finder import FaceDetector
from perception.identity import FaceMatch
from perception.image_preparation import GreyImage
from perception.patches import describe_face

MIN_PICTURES = 3
"""Pictures of a person that teach something."""

RECOMMENDED_PICTURES = 6
"""Pictures of a person, from different sides, after which more of the same day add little (docs/people.md)."""

MAX_PICTURES, MAX_PICTURES_TOGETHER = 24, 240
"""Pictures of one person, and of all together, that are learnt from."""

MAX_TEMPLATES = 240
"""Pictures and variants of all together that are compared: 271 kB each, and what a look costs is in proportion."""

MAX_VARIANTS = 4
"""How a picture is shown at most: by its box, upright by its eyes, and both in the mirror, which shows a head that is
turned the other way, and lit from the other side."""


class NotOneFaceError(ValueError):
    """A picture that does not show one face: ``face_count`` says how many it shows, ``hint`` what to do."""

    def __init__(self, face_count: int) -> None:
        super().__init__("there is no face in it" if face_count == 0 else f"there are {face_count} faces in it")
        self.face_count = face_count
        self.hint = "look into the camera, in good light" if face_count == 0 else "cut one out: who of them is meant?"


def enrol(image: Image, detector: FaceDetector) -> Image:
    """Return the portrait of the one person whom a picture shows. Raises NotOneFace, and ValueError for no picture."""
    faces = detector.detect(image)
    if len(faces) != 1:
        raise NotOneFaceError(len(faces))
    return make_portrait(image, faces[0].box)


class PatchRecogniser:
    """Knows people by the patches of their faces: a ``perception.identity.FaceRecogniser``.

    Learns from their ``portraits`` (``enrol``); ``cohort`` are those of others who are strangers for sure.
    Raises ValueError for nobody, or somebody without a portrait.
    """

    def __init__(self, portraits: Mapping[str, Sequence[Image]], cohort: Sequence[Sequence[Image]] = ()) -> None:
        share = min(MAX_PICTURES, MAX_TEMPLATES // max(1, len(portraits) + len(cohort)))
        self._eyes = EyeFinder()
        people = {name: describe_portraits(pictures, share, self._eyes) for name, pictures in portraits.items()}
        gallery = Gallery(people, [describe_portraits(pictures, share, self._eyes) for pictures in cohort])
        self.calibration = gallery.calibration
        self._gallery = gallery

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return who is nearest, and by how much within the threshold; None for a box without pixels."""
        try:
            return self._gallery.match([describe_face(each) for each in face_crops(image, face, self._eyes)])
        except ValueError:
            return None


def describe_portraits(portraits: Sequence[Image], share: int, eyes: EyeFinder) -> list[PictureDescription]:
    """Return the descriptions of a person's portraits and of their variants: about ``share`` in all.

    Of more portraits some are taken, spread over all of them.
    """
    count = min(len(portraits), share)
    taken = [portraits[place * len(portraits) // count] for place in range(count)]
    return [_describe_portrait(picture, share // count, eyes) for picture in taken]


def _describe_portrait(portrait: Image, count: int, eyes: EyeFinder) -> PictureDescription:
    """Return how a portrait is described, with ``count`` templates at most."""
    crops = face_crops(portrait, portrait_face_box(portrait), eyes)
    seen = [describe_face(each) for each in crops]
    missing = max(0, min(MAX_VARIANTS, count) - len(seen))
    mirrored = [describe_face(np.ascontiguousarray(each[:, ::-1])) for each in crops[:missing]]
    return PictureDescription(seen, [*seen, *mirrored][:count])


def face_crops(image: Image, face: Box, eyes: EyeFinder) -> list[GreyImage]:
    """Return the crops of a face: by its box and, where both eyes are found, upright by them. Raises as ``crop``."""
    shown = [crop_face(image, face)]
    found = align_by_eyes(face, eyes.find(image, face))
    return shown if found is None else [*shown, crop_face(image, found[0], roll=found[1])]
