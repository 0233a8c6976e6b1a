"""Finding faces in one picture, with the Haar cascade that comes with OpenCV, in parts of it cut as that wants them."""

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
    """A part of a picture: what is ``image`` of it, and where that comes from.

    It is ``scale`` times as large; its corner is at ``left``, ``top`` of the picture. Where ``roll`` (radians) is not
    0, it was turned to the left by that, and ``inverse`` (shape (2, 3)) takes places in ``image`` to those before.
    """

    image: GreyImage
    scale: float
    left: float = 0.0
    top: float = 0.0
    roll: float = 0.0
    inverse: npt.NDArray[np.float64] | None = None

    def to_detection(self, box: Box, score: float) -> Detection:
        """Take what was found in ``image`` to the picture; a square that was turned stays upright about its middle."""
        x, y = box.centre if self.inverse is None else (self.inverse @ (*box.centre, 1.0)).tolist()
        width, height = box.width / self.scale, box.height / self.scale
        corner = self.left + x / self.scale - width / 2, self.top + y / self.scale - height / 2
        return Detection(Box(*corner, width, height), score, self.roll)


def prepare_picture(image: Image | GreyImage, scale: float, roll: float = 0.0) -> CascadeCrop:
    """Return a whole picture ``scale`` times as large. Raises ValueError for what is not a picture.

    Its contrast is spread by half as much as around a face: a cascade then takes two thirds of the time, and finds 59
    faces where it found 60.
    """
    return _rotate_crop(CascadeCrop(equalise(resize(brighten(to_grey(image)), scale), tiles=8, limit=1.0), scale), roll)


def prepare_region(
    image: Image | GreyImage, box: Box, grow: float, pixels: float, roll: float = 0.0
) -> CascadeCrop | None:
    """Return what is about ``box``, ``grow`` times as large as it, so scaled that the box is ``pixels`` wide.

    None where nothing of the picture is there. Raises ValueError for what is not a picture.
    """
    rows, columns = window_slices(image.shape, box, grow)
    if box.width <= 0 or image[rows, columns].size == 0:
        return None
    scale = pixels / box.width
    shown = equalise(resize(brighten(to_grey(image[rows, columns])), scale), tiles=2)
    return _rotate_crop(CascadeCrop(shown, scale, columns.start, rows.start), roll)


def _rotate_crop(cut: CascadeCrop, roll: float) -> CascadeCrop:
    """Turn a cut to the left by ``roll``; its corners fall away: to keep them costs as much again."""
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
"""Pixels along the longer side to which a larger picture is shrunk first: for this size the rest was measured."""

MIN_SIDE = 320
"""Pixels along it to which a smaller one is enlarged."""

PICTURE_SEARCH = 1.2, 4
"""Step of sizes, and neighbours that a face must have. With 3, 2 % more faces and 11 false ones instead of 2."""

FILM_SEARCH = 1.2, 3
"""The same where others are asked besides."""

MIN_FACE_PIXELS = 28  # pixels: a face 3.5 m away for a camera of 640 pixels and 60 degrees
CASCADE_WINDOW = 24  # pixels of the smallest face that the cascade knows
MIN_LEANING_FACE_PIXELS = 35  # pixels to which leaning ones are shrunk

ROLL_STEP = radians(22)
"""By how much a head leans that is looked for in a turned picture: the cascade bears with half of it either way."""

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
"""Cascades trained apart from the first, pixels of the face, neighbours, whether they see it in the mirror.

All three agree on 90 of 100 true faces, many of them dark, and on 3 of 100 that the first cascade sees in gravel and
coins; each of them alone on about 92 and on 11 to 23.
"""


class HaarFaceDetector:
    """Finds faces that look towards the camera: upright ones, and where it is asked to, those that lean. One thread.

    A box reaches from ear to ear and from the hairline to the chin; its score is the weight of the cascade's last
    stage (-1..10 for true faces). The contrast is evened out first. Takes pictures in colour or grey.
    """

    newcomer_interval = 40
    search_plan = (
        FaceSearch(0.047),
        FaceSearch(0.0375, 0.07),
        FaceSearch(0.09, roll=ROLL_STEP),
        FaceSearch(0.09, roll=-ROLL_STEP),
    )
    """Faces up to 3.3 m away, for an angle of view of 60 degrees; up to 4.2 m; leaning ones up to 1.7 m."""

    quick_search = FaceSearch(0.09)
    """Upright ones up to 1.7 m: a third of the cost."""

    def __init__(self) -> None:
        self._other_cascades: dict[str, cv2.CascadeClassifier] = {}

    def detect(
        self, image: Image | GreyImage, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> list[Detection]:
        """Return the faces anywhere in the picture, largest first, whose width is about ``smallest``..``largest`` px.

        They lean by about ``roll`` (radians, to the right). To give ``smallest`` is for
        films: then more is found, and more that is none. Raises ValueError for what is not a picture.
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
        """Whether a picture is enlarged or brightened first, which takes two to five times as long."""
        return max(image.shape) < MIN_SIDE or is_dark(image)

    def detect_near(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        """Return the face that is about where and as large as ``box`` and leans by ``roll``, None when there is none.

        Costs a twentieth of ``detect`` and finds more, since it looks at every size in a small region, at a fixed
        scale; where a quick look finds nothing, a more careful one. Raises ValueError for what is not a picture.
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
        """Yield the face that was ``known`` where it leans otherwise by now; raises as ``detect_near``."""
        for roll in sorted((-ROLL_STEP, 0.0, ROLL_STEP), key=lambda roll: abs(roll - known.roll)):
            if roll != known.roll and (found := self.detect_near(image, known.box, roll=roll)) is not None:
                yield found

    def is_turned_aside(self, image: Image | GreyImage, box: Box) -> bool:
        """Whether a face that was at ``box`` is still there, but looks to one side: raises as ``detect_near``."""
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
        """Whether other cascades see a face where this one found ``box``, at other sizes and in the mirror.

        Costs at most as much as two calls of ``detect_near``. Raises ValueError for what is not a picture.
        """
        check_image(image)
        return all(self._is_confirmed_by(image, box, roll, *witness) for witness in CONFIRMING_CASCADES)

    def _is_confirmed_by(
        self, image: Image | GreyImage, box: Box, roll: float, name: str, pixels: int, neighbours: int, mirrored: bool
    ) -> bool:
        """Whether one other cascade sees a face at ``box``."""
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
        """Whether a closer look sees a face there too: half of the false ones fail, and one true one in a hundred."""
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
        """Run a cascade, the first one if none is given, over a cut; return what it finds of these ``sizes``."""
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
        """The trained cascade, read from OpenCV's own folder when the first picture comes."""
        return _read_cascade(CASCADE)

    def _other_cascade(self, name: str) -> cv2.CascadeClassifier:
        """Another cascade, read when it is first asked."""
        if name not in self._other_cascades:
            self._other_cascades[name] = _read_cascade(name)
        return self._other_cascades[name]


def _size_range(pixels: int) -> tuple[int, int]:
    """Return the least and the greatest width of a face that is known to be ``pixels`` wide."""
    return round(pixels * REGION_SIZES[0]), round(pixels * REGION_SIZES[1])


def _read_cascade(name: str) -> cv2.CascadeClassifier:
    path = Path(cv2.data.haarcascades) / name
    if not path.is_file():
        raise FileNotFoundError(f"faces: {path} is missing\n  try: pip install 'opencv-python-headless<5'")
    return cv2.CascadeClassifier(str(path))
