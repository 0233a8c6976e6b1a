"""Enrolment of people, and face recognition by patches."""

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
"""Smallest useful number of pictures of a person."""

RECOMMENDED_PICTURES = 6
"""Recommended number of pictures of a person, from different sides; more of the same day add little (docs/people.md).
"""

MAX_PICTURES, MAX_PICTURES_TOGETHER = 24, 240
"""Pictures of one person, and of all together, that are used."""

MAX_TEMPLATES = 240
"""Largest number of pictures, with their variants, of all people that are compared with a face.

Each takes 271 kB, and the time of a comparison is proportional to their number.
"""

MAX_VARIANTS = 4
"""Largest number of variants of a portrait that are compared.

They are the face by its box, the face upright by its eyes, and both mirrored. A mirrored picture shows a head turned
the other way, and lit from the other side.
"""


class NotOneFaceError(ValueError):
    """A picture does not show exactly one face: ``face_count`` is the number of faces, ``hint`` the remedy."""

    def __init__(self, face_count: int) -> None:
        super().__init__("it shows no face" if face_count == 0 else f"there are {face_count} faces in it")
        self.face_count = face_count
        self.hint = "look into the camera, in good light" if face_count == 0 else "crop it to one person"


def enrol(image: Image, detector: FaceDetector) -> Image:
    """Return the portrait of the one person in a picture. Raises NotOneFaceError, ValueError."""
    faces = detector.detect(image)
    if len(faces) != 1:
        raise NotOneFaceError(len(faces))
    return make_portrait(image, faces[0].box)


class PatchRecogniser:
    """A ``perception.identity.FaceRecogniser`` by the patches of faces.

    Learns from ``portraits`` (see ``enrol``); ``cohort`` has portraits of certain strangers. Raises ValueError without
    people, or for a person without a portrait.
    """

    def __init__(self, portraits: Mapping[str, Sequence[Image]], cohort: Sequence[Sequence[Image]] = ()) -> None:
        share = min(MAX_PICTURES, MAX_TEMPLATES // max(1, len(portraits) + len(cohort)))
        self._eyes = EyeFinder()
        people = {name: describe_portraits(pictures, share, self._eyes) for name, pictures in portraits.items()}
        gallery = Gallery(people, [describe_portraits(pictures, share, self._eyes) for pictures in cohort])
        self.calibration = gallery.calibration
        self._gallery = gallery

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return the nearest person, with the margin to the threshold; None for a box without pixels."""
        try:
            return self._gallery.match([describe_face(each) for each in face_crops(image, face, self._eyes)])
        except ValueError:
            return None


def describe_portraits(portraits: Sequence[Image], share: int, eyes: EyeFinder) -> list[PictureDescription]:
    """Return the descriptions of a person's portraits, with about ``share`` templates in all.

    A template is a portrait or a variant of it (see ``MAX_VARIANTS``). If there are too many portraits, a subset is
    used, spread over all of them.
    """
    count = min(len(portraits), share)
    taken = [portraits[place * len(portraits) // count] for place in range(count)]
    return [_describe_portrait(picture, share // count, eyes) for picture in taken]


def _describe_portrait(portrait: Image, count: int, eyes: EyeFinder) -> PictureDescription:
    """Return the description of a portrait, with at most ``count`` templates."""
    crops = face_crops(portrait, portrait_face_box(portrait), eyes)
    seen = [describe_face(each) for each in crops]
    missing = max(0, min(MAX_VARIANTS, count) - len(seen))
    mirrored = [describe_face(np.ascontiguousarray(each[:, ::-1])) for each in crops[:missing]]
    return PictureDescription(seen, [*seen, *mirrored][:count])


def face_crops(image: Image, face: Box, eyes: EyeFinder) -> list[GreyImage]:
    """Return the crops of a face: by its box and, if both eyes are found, upright. Raises as ``crop_face``."""
    shown = [crop_face(image, face)]
    found = align_by_eyes(face, eyes.find(image, face))
    return shown if found is None else [*shown, crop_face(image, found[0], roll=found[1])]
