"""Taking pictures of somebody who stands before a camera: which of them are good enough, and what to do next."""

import cv2

from missions.library.portraits import digest
from perception.api import Image
from perception.crops import crop, face_in
from perception.finder import FaceDetector
from perception.patches import Patches, describe, likeness
from perception.people import NotOneFace, enrol

GUIDE = (
    "look straight into the camera",
    "turn your head a little to the left",
    "turn your head a little to the right",
    "look up a little",
    "look down a little",
    "take two steps back, and look into the camera",
    "come close again, and smile",
)
"""What somebody is asked to do, one after another: who is known from one side only is not known."""

SHARP = 30.0
"""Variance of the Laplacian of a face's crop: of faces up to 3 m away it was 33 to 1000, of the same ones blurred by a
thirtieth of their width 9 to 30 (drawn ones up to 45)."""

EVERY = 0.8
"""Seconds from one picture to the next: time to move."""


TOO_SOON = "it is too soon after the one before"

SAME = "it is the very picture of one before: does the camera stand still?"

NEAR = 0.88
"""Likeness from which on a picture is nearly one before: frames in a row, of somebody who holds still, were 0.8 to 0.98
alike, those 0.8 s apart 0.58 to 0.89, and pictures of one person that were taken to differ 0.58 to 0.83."""

NEARLY = "it is nearly the same as one before: move as you are asked to"


class Taking:
    """Takes ``count`` pictures that are worth it: ``portraits``."""

    def __init__(self, detector: FaceDetector, count: int) -> None:
        self.portraits: list[Image] = []
        self._detector = detector
        self._count = count
        self._digests: set[bytes] = set()
        self._shown: list[Patches] = []
        self._taken_at: float | None = None

    @property
    def done(self) -> bool:
        """Whether there are enough."""
        return len(self.portraits) >= self._count

    @property
    def guide(self) -> str:
        """What to do for the next one."""
        return GUIDE[min(len(self.portraits) * len(GUIDE) // self._count, len(GUIDE) - 1)]

    def offer(self, image: Image, stamp: float) -> str:
        """Take the picture of ``stamp`` (s) if it is good and not too soon; else say why it is not.

        Raises ValueError for what is no picture.
        """
        if self._taken_at is not None and stamp - self._taken_at < EVERY:
            return TOO_SOON
        try:
            portrait = enrol(image, self._detector)
        except NotOneFace as error:
            return str(error)
        shown = crop(portrait, face_in(portrait))
        if float(cv2.Laplacian(shown, cv2.CV_64F).var()) < SHARP:
            return "it is blurred: hold still, with more light"
        if digest(portrait) in self._digests:
            return SAME
        patches = describe(shown)
        if any(likeness(patches, other) > NEAR for other in self._shown):
            return NEARLY
        self._shown.append(patches)
        self._taken_at = stamp
        self._digests.add(digest(portrait))
        self.portraits.append(portrait)
        return ""
