"""Finding faces with YuNet, a small network of the OpenCV Zoo, where its file was fetched.

It finds faces that are dark, turned or rolled, for a fraction of what the Haar cascade costs.
"""

from math import inf
from pathlib import Path
from typing import Protocol, cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Detection, Image
from perception.faults import BadModel, check_size
from perception.light import Grey, check, lightened, resized, window
from perception.turns import ANY

SMALLEST = 28 / 640
"""Width of a face, as a share of the picture's longer side, from which on it is looked for."""

ENOUGH = 14
"""Pixels of a face's width that the network needs: a picture is shrunk until the smallest face looked for has them."""

SURE = 0.6
"""Score (0..1) from which on a face counts."""

REGION = 2.0  # how much of the picture is searched around a known face, in widths of it
REGION_FACE = 31  # pixels to which that face is scaled then: its region fits into two steps
WITNESS_FACE = 47  # the same for a second opinion: three steps
SAME = 0.3  # overlap from which on two boxes are one face
POINTS_FACE = 112  # the same where eyes, nose and mouth are asked for: as large as SFace has faces

STEP = 32
"""Pixels of which the sides of a picture are multiples for the network: what is smaller has a rim."""

LEAST = 2 * STEP  # pixels of a side at least

SIZES = 4
"""Sizes of pictures for which a network of its own is kept: to change its size costs as much as to search 90 x 90."""

HAAR = 0.97
"""Side of a face's Haar box over the height of its YuNet box: median of 53 faces, give or take 0.04."""

CURE = "mission robot models fetch yunet"


class _Network(Protocol):
    """``cv2.FaceDetectorYN``, as far as it is used."""

    def detect(self, image: Image) -> tuple[int, npt.NDArray[np.float32] | None]:
        """Return rows of x, y, width, height, ten places of eyes, nose and mouth, and the score; None for none."""
        ...


class YuNetFaces:
    """Finds faces with the network in the file ``model``: a ``perception.finder.FaceDetector``. For one thread.

    Its boxes are those that the Haar cascade would draw, so that distances come out alike; the score is 0..1.
    """

    newcomers = 10
    turns = (ANY,)
    quickly = ANY

    def __init__(self, model: Path) -> None:
        self._model = model
        self._networks: dict[tuple[int, int], _Network] = {}  # the one that was used longest ago first

    def detect(
        self, image: Image | Grey, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> list[Detection]:
        """Return the faces anywhere in the picture, largest first, whose width is about ``smallest``..``largest`` px.

        Those that lean are among them, by whatever ``roll``. Raises ValueError for what is not a picture,
        FileNotFoundError and BadModel for the model's file.
        """
        del roll
        check(image)
        scale = min(1.0, ENOUGH / max(SMALLEST * max(image.shape), smallest))
        found = self._search(image, scale, 0, 0)
        return [detection for detection in found if smallest <= detection.box.width <= largest]

    def dear(self, _: Image | Grey) -> bool:
        """Return False: it takes as long for every picture, however dark, and enlarges none."""
        return False

    def near(self, image: Image | Grey, box: Box, *, roll: float = 0.0) -> Detection | None:
        """Return the face about where and as large as ``box``, None when there is none; raises as ``detect``."""
        del roll
        check(image)
        rows, columns = window(image.shape, box, REGION)
        region = image[rows, columns]
        if box.width <= 0 or region.size == 0:
            return None
        found = self._search(region, REGION_FACE / box.width, columns.start, rows.start)
        return max(found, key=lambda detection: detection.box.overlap(box), default=None)

    def leaning(self, *_: object) -> tuple[Detection, ...]:
        """Return nothing: ``near`` has seen it, however it leans."""
        return ()

    def aside(self, *_: object) -> bool:
        """Return False: ``near`` has seen it, wherever it looks."""
        return False

    def agrees(self, image: Image | Grey, box: Box, *, roll: float = 0.0) -> bool:
        """Whether the network sees the face at ``box`` in the mirror too, and larger; raises as ``detect``."""
        del roll
        check(image)
        rows, columns = window(image.shape, box, REGION)
        region = np.ascontiguousarray(image[rows, columns][:, ::-1])
        if box.width <= 0 or region.size == 0:
            return False
        there = Box(columns.stop - box.x - box.width, box.y - rows.start, box.width, box.height)
        found = self._search(region, WITNESS_FACE / box.width, 0, 0)
        return any(detection.box.overlap(there) > SAME for detection in found)

    def points(self, image: Image | Grey, box: Box) -> npt.NDArray[np.float32] | None:
        """Return what the network says of the face about where ``box`` is: one row as ``cv2.FaceRecognizerSF`` has it.

        That is x, y, width, height, (x, y) of right eye, left eye, nose and corners of the mouth, and the score, in
        pixels of the picture. None when there is no face; raises as ``detect``.
        """
        check(image)
        rows, columns = window(image.shape, box, REGION)
        region = image[rows, columns]
        if box.width <= 0 or region.size == 0:
            return None
        scale = POINTS_FACE / box.width
        found = self._shown(region, scale)
        if not len(found):
            return None
        found[:, :14] /= scale
        found[:, [0, *range(4, 14, 2)]] += columns.start
        found[:, [1, *range(5, 14, 2)]] += rows.start
        overlaps = [Box(*row[:4]).overlap(box) for row in found.tolist()]
        return np.asarray(found[int(np.argmax(overlaps))], np.float32)

    def _shown(self, picture: Image | Grey, scale: float) -> npt.NDArray[np.float32]:
        """Show a picture to the network, ``scale`` times as large, and return its rows in pixels of what was shown."""
        colour = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture
        shown = lightened(resized(np.asarray(colour, np.uint8), scale))
        height, width = (max(LEAST, -(-side // STEP) * STEP) for side in shown.shape[:2])
        rim = height - shown.shape[0], width - shown.shape[1]
        whole = cv2.copyMakeBorder(shown, 0, rim[0], 0, rim[1], cv2.BORDER_CONSTANT)
        try:
            _, rows = self._network(width, height).detect(np.asarray(whole, np.uint8))
        except cv2.error as error:
            raise BadModel(f"faces: {self._model} is another network than YuNet\n  try: {CURE}") from error
        return np.empty((0, 15), np.float32) if rows is None else rows

    def _search(self, picture: Image | Grey, scale: float, left: float, top: float) -> list[Detection]:
        """Show a part of the picture to the network, ``scale`` times as large; ``left``, ``top`` are its corner."""
        found = []
        for x, y, width, height, *_, score in self._shown(picture, scale).tolist():
            side = HAAR * height / scale
            middle_x, middle_y = left + (x + width / 2) / scale, top + (y + height / 2) / scale
            found.append(Detection(Box(middle_x - side / 2, middle_y - side / 2, side, side), score))
        return sorted(found, key=lambda detection: -detection.box.width)

    def _network(self, width: int, height: int) -> _Network:
        """Return the network for pictures of a size, read when the first one comes."""
        found = self._networks.pop((width, height), None) or self._read(width, height)
        self._networks[width, height] = found
        if len(self._networks) > SIZES:
            del self._networks[next(iter(self._networks))]
        return found

    def _read(self, width: int, height: int) -> _Network:
        if not self._model.is_file():
            raise FileNotFoundError(f"faces: {self._model} is missing\n  try: mission robot models fetch yunet")
        check_size(self._model, CURE)
        try:
            return cast(_Network, cv2.FaceDetectorYN.create(str(self._model), "", (width, height), SURE, 0.3, 50))
        except cv2.error as error:
            raise BadModel(f"faces: {self._model} is no network\n  try: {CURE}") from error
