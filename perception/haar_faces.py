"""Face detection in one picture with the Haar cascade of OpenCV."""

from collections.abc import Iterator
from functools import cached_property
from math import degrees, inf, radians
from pathlib import Path
from typing import cast

import cv2
import cv2.data
import numpy as np
import numpy.typing as npt

from drivers.api.fast_dataclass import dataclass
from perception.api import Box, Detection, Image
from perception.face_search import FaceSearch
from perception.image_preparation import (
    GreyImage,
    brighten,
    check_image,
    equalise,
    is_dark,
    resize,
    to_grey,
    window_slices,
)


@dataclass(frozen=True, slots=True)
class CascadeCrop:
    """A part of a picture, prepared for a cascade.

    It is scaled by ``scale``; its corner is at ``left``, ``top`` of the picture. If ``roll`` (radians) is not 0, it was
    rotated to the left by it, and ``inverse`` (shape (2, 3)) maps positions in ``image`` back.
    """

    image: GreyImage
    scale: float
    left: float = 0.0
    top: float = 0.0
    roll: float = 0.0
    inverse: npt.NDArray[np.float64] | None = None

    def to_detection(self, box: Box, score: float) -> Detection:
        """Return a box in the crop as a detection in the picture.

        If the crop is rotated, only the middle of the box is rotated back; the returned box is upright.
        """
        x, y = box.centre if self.inverse is None else (self.inverse @ (*box.centre, 1.0)).tolist()
        width, height = box.width / self.scale, box.height / self.scale
        corner = self.left + x / self.scale - width / 2, self.top + y / self.scale - height / 2
        return Detection(Box(*corner, width, height), score, self.roll)


def prepare_picture(image: Image | GreyImage, scale: float, roll: float = 0.0) -> CascadeCrop:
    """Return a whole picture scaled by ``scale``, for a cascade. Raises ValueError for an invalid picture.

    Its contrast is equalised with half the limit that ``prepare_region`` uses. With this limit the cascade takes two
    thirds of the time, and finds 59 faces where it finds 60 with the full limit.
    """
    return _rotate_crop(CascadeCrop(equalise(resize(brighten(to_grey(image)), scale), tiles=8, limit=1.0), scale), roll)


def prepare_region(
    image: Image | GreyImage, box: Box, grow: float, pixels: float, roll: float = 0.0
) -> CascadeCrop | None:
    """Return the region ``grow`` times as large as ``box``, scaled so that the box is ``pixels`` wide.

    None if it is outside the picture. Raises ValueError for an invalid picture.
    """
    rows, columns = window_slices(image.shape, box, grow)
    if box.width <= 0 or image[rows, columns].size == 0:
        return None
    scale = pixels / box.width
    shown = equalise(resize(brighten(to_grey(image[rows, columns])), scale), tiles=2)
    return _rotate_crop(CascadeCrop(shown, scale, columns.start, rows.start), roll)


def _rotate_crop(cut: CascadeCrop, roll: float) -> CascadeCrop:
    """Rotate a crop to the left by ``roll``. Its corners are lost: keeping them would take twice as long."""
    if roll == 0.0:
        return cut
    height, width = cut.image.shape
    move = cv2.getRotationMatrix2D((width / 2, height / 2), degrees(roll), 1.0)
    shown = cast(GreyImage, cv2.warpAffine(cut.image, move, (width, height)))
    back = np.asarray(cv2.invertAffineTransform(move), np.float64)
    return CascadeCrop(shown, cut.scale, cut.left, cut.top, roll, back)


CASCADE = "haarcascade_frontalface_default.xml"
PROFILE = "haarcascade_profileface.xml"

MAX_SIDE = 640
"""Pixels of the longer side to which a larger picture is shrunk before the search.

All settings of this module were measured with this size.
"""

MIN_SIDE = 320
"""Pixels of the longer side to which a smaller picture is enlarged before the search."""

PICTURE_SEARCH = 1.2, 4
"""Scale step of the search in single pictures, and number of overlapping detections that make a face.

With 3 instead of 4 detections, it finds 2 % more faces, but 11 false ones instead of 2.
"""

FILM_SEARCH = 1.2, 3
"""Scale step of the search in films, and number of overlapping detections that make a face.

In films, ``CONFIRMING_CASCADES`` reject most false faces.
"""

MIN_FACE_PIXELS = 28  # pixels: a face 3.5 m away for a camera of 640 pixels and 60 degrees
CASCADE_WINDOW = 24  # pixels of the smallest face that the cascade knows
MIN_LEANING_FACE_PIXELS = 35  # pixels to which leaning ones are shrunk

ROLL_STEP = radians(22)
"""Angle in radians by which the picture is rotated for leaning faces.

The cascade tolerates half of it in either direction.
"""

SAME_FACE_OVERLAP = 0.3  # overlap from which on two boxes are one face
REGION_WIDTHS = 1.7  # how much of the picture is searched around a known face, in widths of it
REGION_SIZES = (0.75, 1.4)  # times the known width that are searched for there
REGION_SEARCHES = (
    (44, 1.15),
    (64, 1.1),
)  # pixels to which a known face is scaled and step of sizes: a quick look, a careful one

CONFIRMING_CASCADES = (
    ("haarcascade_frontalface_alt.xml", 44, 2, False),
    ("haarcascade_frontalface_alt.xml", 64, 3, False),
    ("haarcascade_frontalface_alt2.xml", 64, 2, True),
)
"""Independently trained cascades that confirm a face.

For each: its file, the width in pixels to which the face is scaled, the number of overlapping detections, and whether
the picture is mirrored. All three accept 90 of 100 true faces, many of them dark, and 3 of 100 false faces that the
first cascade sees in gravel and coins. Each of them alone accepts about 92 true faces, and 11 to 23 false ones.
"""


class HaarFaceDetector:
    """Detects faces that look towards the camera, upright or, on request, leaning. For one thread.

    A box spans from ear to ear and from the hairline to the chin; its score is the weight of the cascade's last stage
    (-1..10 for true faces). Contrast is equalised first. Takes colour or grey pictures. It is a ``ThoroughDetector``.
    """

    newcomer_interval = 40
    search_plan = (
        FaceSearch(0.047),
        FaceSearch(0.0375, 0.07),
        FaceSearch(0.09, roll=ROLL_STEP),
        FaceSearch(0.09, roll=-ROLL_STEP),
    )
    """Searches for upright faces up to 3.3 m away, upright faces up to 4.2 m, and leaning faces up to 1.7 m.

    The distances are for a camera with an angle of view of 60 degrees.
    """

    quick_search = FaceSearch(0.09)
    """Search for upright faces up to 1.7 m away, at a third of the cost."""

    def __init__(self) -> None:
        self._other_cascades: dict[str, cv2.CascadeClassifier] = {}

    def detect(
        self, image: Image | GreyImage, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> list[Detection]:
        """Return the faces anywhere in the picture, largest first, whose width is about ``smallest``..``largest`` px.

        The faces lean to the right by about ``roll`` (radians). A ``smallest`` above 0 is for films: the search then
        finds more faces, and more false ones. Raises ValueError for an invalid picture.
        """
        check_image(image)
        side = max(image.shape)
        scale = min(max(side, MIN_SIDE), MAX_SIDE) / side
        least = max(CASCADE_WINDOW, smallest * scale) if smallest else MIN_FACE_PIXELS
        coarser = min(1.0, (MIN_LEANING_FACE_PIXELS if roll else CASCADE_WINDOW) / least) if smallest else 1.0
        least, most, scale = least * coarser, min(MAX_SIDE, largest * scale) * coarser, scale * coarser
        if most < least:
            return []
        step, neighbours = FILM_SEARCH if smallest else PICTURE_SEARCH
        sizes = round(least), round(most)
        found = self._search(prepare_picture(image, scale, roll), step=step, neighbours=neighbours, sizes=sizes)
        return [detection for detection in found if self._is_seen_closer(image, detection)]

    def is_expensive(self, image: Image | GreyImage) -> bool:
        """Return whether a picture is enlarged or brightened first, which takes two to five times as long."""
        return max(image.shape) < MIN_SIDE or is_dark(image)

    def detect_near(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        """Return the face near ``box``, of similar size, that leans by ``roll``; None if there is none.

        Takes a twentieth of the time of ``detect`` and finds more, since it searches every size in a small region at a
        fixed scale: first with large steps of size, then, if nothing was found, with small ones. Raises ValueError for
        an invalid picture.
        """
        check_image(image)
        for pixels, step in REGION_SEARCHES:
            cut = prepare_region(image, box, REGION_WIDTHS, pixels, roll)
            if cut is None:
                return None
            found = self._search(cut, step=step, neighbours=3, sizes=_size_range(pixels))
            if found:
                return max(found, key=lambda detection: detection.box.overlap(box))
        return None

    def detect_leaning(self, image: Image | GreyImage, known: Detection) -> Iterator[Detection]:
        """Yield the ``known`` face at other angles of lean; raises as ``detect_near``."""
        for roll in sorted((-ROLL_STEP, 0.0, ROLL_STEP), key=lambda roll: abs(roll - known.roll)):
            if roll != known.roll and (found := self.detect_near(image, known.box, roll=roll)) is not None:
                yield found

    def is_turned_aside(self, image: Image | GreyImage, box: Box) -> bool:
        """Return whether a face that was found at ``box`` is still there, but in profile.

        Raises as ``detect_near``.
        """
        check_image(image)
        pixels = 44
        cut = prepare_region(image, box, REGION_WIDTHS, pixels)
        if cut is None:
            return False
        sides = cut.image, np.ascontiguousarray(cut.image[:, ::-1])
        return any(
            self._search(
                CascadeCrop(side, 1.0),
                step=1.1,
                neighbours=3,
                cascade=self._other_cascade(PROFILE),
                sizes=_size_range(pixels),
            )
            for side in sides
        )

    def is_confirmed(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> bool:
        """Return whether other cascades see a face at ``box``, at other sizes and in the mirrored picture.

        Takes at most as long as two calls of ``detect_near``. Raises ValueError for an invalid picture.
        """
        check_image(image)
        return all(self._is_confirmed_by(image, box, roll, *witness) for witness in CONFIRMING_CASCADES)

    def _is_confirmed_by(
        self, image: Image | GreyImage, box: Box, roll: float, name: str, pixels: int, neighbours: int, mirrored: bool
    ) -> bool:
        """Return whether the cascade in the file ``name`` sees a face at ``box``.

        ``roll`` is the lean of the face in radians; the other arguments are as in ``CONFIRMING_CASCADES``.
        """
        cut = prepare_region(image, box, REGION_WIDTHS, pixels, roll)
        if cut is None:
            return False
        found = self._search(
            cut,
            step=1.1,
            neighbours=neighbours,
            cascade=self._other_cascade(name),
            mirrored=mirrored,
            sizes=_size_range(pixels),
        )
        return any(detection.box.overlap(box) > SAME_FACE_OVERLAP for detection in found)

    def _is_seen_closer(self, image: Image | GreyImage, found: Detection) -> bool:
        """Return whether ``detect_near`` finds the face ``found``, too.

        This rejects half of the false faces, and 1 % of the true ones.
        """
        closer = self.detect_near(image, found.box, roll=found.roll)
        return closer is not None and closer.box.overlap(found.box) > SAME_FACE_OVERLAP

    def _search(
        self,
        cut: CascadeCrop,
        *,
        step: float,
        neighbours: int,
        sizes: tuple[int, int],
        cascade: cv2.CascadeClassifier | None = None,
        mirrored: bool = False,
    ) -> list[Detection]:
        """Run a cascade, by default the main one, on a crop, and return the faces that it finds.

        ``step`` is the ratio of successive scales, ``neighbours`` the number of overlapping detections that make a
        face, ``sizes`` the smallest and largest width of a face in pixels. With ``mirrored``, the crop is searched
        mirrored.
        """
        boxes, _, weights = (cascade or self._cascade).detectMultiScale3(
            np.ascontiguousarray(cut.image[:, ::-1]) if mirrored else cut.image,
            scaleFactor=step,
            minNeighbors=neighbours,
            minSize=(sizes[0], sizes[0]),
            maxSize=(sizes[1], sizes[1]),
            outputRejectLevels=True,
        )
        found = []
        for (x, y, width, height), weight in zip(boxes, weights, strict=True):
            left = cut.image.shape[1] - x - width if mirrored else x
            found.append(cut.to_detection(Box(float(left), float(y), float(width), float(height)), float(weight)))
        return sorted(found, key=lambda detection: -detection.box.width)

    @cached_property
    def _cascade(self) -> cv2.CascadeClassifier:
        """The main cascade, loaded from OpenCV's folder for the first picture."""
        return _read_cascade(CASCADE)

    def _other_cascade(self, name: str) -> cv2.CascadeClassifier:
        """Return another cascade, loaded at its first use."""
        if name not in self._other_cascades:
            self._other_cascades[name] = _read_cascade(name)
        return self._other_cascades[name]


def _size_range(pixels: int) -> tuple[int, int]:
    """Return the smallest and the largest width of a face that is about ``pixels`` wide."""
    return round(pixels * REGION_SIZES[0]), round(pixels * REGION_SIZES[1])


def _read_cascade(name: str) -> cv2.CascadeClassifier:
    path = Path(cv2.data.haarcascades) / name
    if not path.is_file():
        raise FileNotFoundError(f"faces: {path} is missing\n  try: pip install 'opencv-python-headless<5'")
    return cv2.CascadeClassifier(str(path))
