"""Face detection with YuNet, a small network of the OpenCV Zoo, whose file is fetched separately.

It finds faces that are dark, turned or rolled, for a fraction of the cost of the Haar cascade.
"""

from math import inf
from pathlib import Path
from typing import Protocol, cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Detection, Image
from perception.face_search import ANY_FACE
from perception.image_preparation import GreyImage, brighten, check_image, resize, window_slices
from perception.model_files import ModelFileError, check_model_size

MIN_FACE_SHARE = 28 / 640
"""Smallest width of a face, as a share of the picture's longer side."""

MIN_FACE_PIXELS = 14
"""Width in pixels that a face must have for the network; a picture is shrunk until the smallest face has this width."""

MIN_SCORE = 0.6
"""Smallest score (0..1) of a face that YuNet accepts."""

REGION_WIDTHS = 2.0  # how much of the picture is searched around a known face, in widths of it
REGION_FACE_PIXELS = 31  # pixels to which that face is scaled then: its region fits into two steps
CONFIRM_FACE_PIXELS = 47  # the same for a second opinion: three steps
SAME_FACE_OVERLAP = 0.3  # overlap from which on two boxes are one face
LANDMARK_FACE_PIXELS = 112  # the same for landmarks: the size of SFace's input

SIZE_STEP = 32
"""Number of pixels by which the width and height of the network's input must be divisible.

Smaller pictures get a border.
"""

MIN_SIDE = 2 * SIZE_STEP  # pixels of a side at least

MAX_NETWORKS = 4
"""Number of networks of different input sizes that are cached.

Changing the input size of a network takes as long as searching a picture of 90 x 90 pixels.
"""

HAAR_SIDE_RATIO = 0.97
"""Ratio of the side of a face's Haar box to the height of its YuNet box.

It is the median of 53 faces; their ratios differ from it by up to 0.04.
"""

FETCH_HINT = "mission robot models fetch yunet"


class _Network(Protocol):
    """The used part of ``cv2.FaceDetectorYN``."""

    def detect(self, image: Image) -> tuple[int, npt.NDArray[np.float32] | None]:
        """Return one row per face, or None: x, y, width, height, ten coordinates of landmarks, and the score.

        The landmarks are eyes, nose and corners of the mouth.
        """
        ...


class YuNetFaceDetector:
    """A ``perception.face_finder.FaceDetector`` with the network in the file ``model``. For one thread.

    Its boxes are converted to the size of those of the Haar cascade, from which distances are computed. The score of a
    detection is 0..1.
    """

    newcomer_interval = 10
    search_plan = (ANY_FACE,)
    quick_search = ANY_FACE

    def __init__(self, model: Path) -> None:
        self._model = model
        self._networks: dict[tuple[int, int], _Network] = {}  # the one that was used longest ago first

    def detect(
        self, image: Image | GreyImage, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> list[Detection]:
        """Return the faces anywhere in the picture, largest first, whose width is about ``smallest``..``largest`` px.

        Leaning faces are included for any ``roll``. Raises ValueError for an invalid picture, FileNotFoundError
        and ModelFileError for the model's file.
        """
        del roll
        check_image(image)
        scale = min(1.0, MIN_FACE_PIXELS / max(MIN_FACE_SHARE * max(image.shape), smallest))
        found = self._search(image, scale, 0, 0)
        return [detection for detection in found if smallest <= detection.box.width <= largest]

    def is_expensive(self, _: Image | GreyImage) -> bool:
        """Return False: every picture takes the same time, and none is enlarged."""
        return False

    def detect_near(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        """Return the face near ``box``, of similar size, or None; raises as ``detect``."""
        del roll
        check_image(image)
        rows, columns = window_slices(image.shape, box, REGION_WIDTHS)
        region = image[rows, columns]
        if box.width <= 0 or region.size == 0:
            return None
        found = self._search(region, REGION_FACE_PIXELS / box.width, columns.start, rows.start)
        return max(found, key=lambda detection: detection.box.overlap(box), default=None)

    def detect_leaning(self, *_: object) -> tuple[Detection, ...]:
        """Return nothing: ``detect_near`` finds leaning faces, too."""
        return ()

    def is_turned_aside(self, *_: object) -> bool:
        """Return False: ``detect_near`` finds turned faces, too."""
        return False

    def is_confirmed(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> bool:
        """Return whether the network also sees the face in a mirrored and enlarged copy of the picture around ``box``.

        Raises as ``detect``.
        """
        del roll
        check_image(image)
        rows, columns = window_slices(image.shape, box, REGION_WIDTHS)
        region = np.ascontiguousarray(image[rows, columns][:, ::-1])
        if box.width <= 0 or region.size == 0:
            return False
        there = Box(columns.stop - box.x - box.width, box.y - rows.start, box.width, box.height)
        found = self._search(region, CONFIRM_FACE_PIXELS / box.width, 0, 0)
        return any(detection.box.overlap(there) > SAME_FACE_OVERLAP for detection in found)

    def find_landmarks(self, image: Image | GreyImage, box: Box) -> npt.NDArray[np.float32] | None:
        """Return YuNet's result for the face near ``box``, as ``cv2.FaceRecognizerSF`` takes it.

        It is an array of x, y, width, height, (x, y) of right eye, left eye, nose and corners of the mouth, and the
        score, in pixels of the picture. None if there is no face. Raises as ``detect``.
        """
        check_image(image)
        rows, columns = window_slices(image.shape, box, REGION_WIDTHS)
        region = image[rows, columns]
        if box.width <= 0 or region.size == 0:
            return None
        scale = LANDMARK_FACE_PIXELS / box.width
        found = self._run_network(region, scale)
        if not len(found):
            return None
        found[:, :14] /= scale
        found[:, [0, *range(4, 14, 2)]] += columns.start
        found[:, [1, *range(5, 14, 2)]] += rows.start
        overlaps = [Box(*row[:4]).overlap(box) for row in found.tolist()]
        return np.asarray(found[int(np.argmax(overlaps))], np.float32)

    def _run_network(self, picture: Image | GreyImage, scale: float) -> npt.NDArray[np.float32]:
        """Return the result of the network for a picture: one row per face, as of ``find_landmarks``.

        The picture is first scaled by ``scale``; positions are in pixels of the scaled picture.
        """
        colour = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture
        shown = brighten(resize(np.asarray(colour, np.uint8), scale))
        height, width = (max(MIN_SIDE, -(-side // SIZE_STEP) * SIZE_STEP) for side in shown.shape[:2])
        rim = height - shown.shape[0], width - shown.shape[1]
        whole = cv2.copyMakeBorder(shown, 0, rim[0], 0, rim[1], cv2.BORDER_CONSTANT)
        try:
            _, rows = self._network_for(width, height).detect(np.asarray(whole, np.uint8))
        except cv2.error as error:
            raise ModelFileError(f"faces: {self._model} is not the network YuNet\n  try: {FETCH_HINT}") from error
        return np.empty((0, 15), np.float32) if rows is None else rows

    def _search(self, picture: Image | GreyImage, scale: float, left: float, top: float) -> list[Detection]:
        """Return the faces in a part of the picture, scaled by ``scale``; ``left``, ``top`` are its corner."""
        found = []
        for x, y, width, height, *_, score in self._run_network(picture, scale).tolist():
            side = HAAR_SIDE_RATIO * height / scale
            middle_x, middle_y = left + (x + width / 2) / scale, top + (y + height / 2) / scale
            found.append(Detection(Box(middle_x - side / 2, middle_y - side / 2, side, side), score))
        return sorted(found, key=lambda detection: -detection.box.width)

    def _network_for(self, width: int, height: int) -> _Network:
        """Return a network for pictures of ``width`` by ``height`` pixels, from the cache or loaded from the file."""
        found = self._networks.pop((width, height), None) or self._read_network(width, height)
        self._networks[width, height] = found
        if len(self._networks) > MAX_NETWORKS:
            del self._networks[next(iter(self._networks))]
        return found

    def _read_network(self, width: int, height: int) -> _Network:
        if not self._model.is_file():
            raise FileNotFoundError(f"faces: {self._model} is missing\n  try: mission robot models fetch yunet")
        check_model_size(self._model, FETCH_HINT)
        try:
            return cast(_Network, cv2.FaceDetectorYN.create(str(self._model), "", (width, height), MIN_SCORE, 0.3, 50))
        except cv2.error as error:
            raise ModelFileError(f"faces: {self._model} is not a network\n  try: {FETCH_HINT}") from error
