"""Finding faces in one picture, with the Haar cascade that comes with OpenCV."""

from functools import cached_property
from math import inf
from pathlib import Path

import cv2
import cv2.data
import numpy as np

from perception.api import Box, Detection, Image
from perception.light import Grey, check, even_out, grey, resized, window

CASCADE = "haarcascade_frontalface_default.xml"
MAX_SIDE = 640
"""Pixels along the longer side to which a larger picture is shrunk first: for this size the rest was measured."""

NEIGHBOURS = 4  # of 3 to 6, on 272 frames of people: 3 finds 2 % more faces and 11 false ones instead of 2
SMALLEST = 28  # pixels: a face 3.5 m away for a camera of 640 pixels and 60 degrees

SAME = 0.3  # overlap from which on two boxes are one face
REGION = 1.7  # how much of the picture is searched around a known face, in widths of it
REGION_SIZES = (0.75, 1.4)  # times the known width that are searched for there
LOOKS = ((44, 1.15), (64, 1.1))  # pixels to which a known face is scaled and step of sizes: a quick look, a careful one

WITNESSES = (
    ("haarcascade_frontalface_alt.xml", 44, 2, False),
    ("haarcascade_frontalface_alt.xml", 64, 3, False),
    ("haarcascade_frontalface_alt2.xml", 64, 2, True),
)
"""Cascades trained apart from the first, pixels of the face, neighbours, whether they see it in the mirror.

All three agree on 90 of 100 true faces, many of them dark, and on 3 of 100 that the first cascade sees in gravel and
coins; each of them alone on about 92 and on 11 to 23.
"""


class HaarFaces:
    """Finds upright faces that look towards the camera. For one thread at a time.

    A box reaches from ear to ear and from the hairline to the chin; its score is the weight of the cascade's last
    stage (-1..10 for true faces). The contrast is evened out first. Takes pictures in colour or grey.
    """

    newcomers = 40

    def __init__(self) -> None:
        self._witnesses: dict[str, cv2.CascadeClassifier] = {}

    def detect(self, image: Image | Grey, *, smallest: float = 0.0, largest: float = inf) -> list[Detection]:
        """Return the faces anywhere in the picture, largest first, whose width is about ``smallest``..``largest`` px.

        Raises ValueError for what is not a picture.
        """
        whole = grey(image)
        scale = min(1.0, MAX_SIDE / max(whole.shape))
        found = self._search(
            even_out(resized(whole, scale), tiles=8),
            step=1.2,
            neighbours=NEIGHBOURS,
            smallest=max(SMALLEST, round(smallest * scale)),
            largest=round(min(MAX_SIDE, largest * scale)),
        )
        placed = [_placed(detection, scale, 0, 0) for detection in found]
        return [detection for detection in placed if self._confirmed(whole, detection.box)]

    def near(self, image: Image | Grey, box: Box) -> Detection | None:
        """Return the face that is about where and as large as ``box``, None when there is none.

        Costs a twentieth of ``detect`` and finds more, since it looks at every size in a small region, at a fixed
        scale; where a quick look finds nothing, a more careful one. Raises ValueError for what is not a picture.
        """
        check(image)
        rows, columns = window(image.shape, box, REGION)
        if box.width <= 0 or image[rows, columns].size == 0:
            return None
        region = grey(image[rows, columns])
        for pixels, step in LOOKS:
            scale = pixels / box.width
            found = self._search(
                even_out(resized(region, scale), tiles=2),
                step=step,
                neighbours=3,
                smallest=round(pixels * REGION_SIZES[0]),
                largest=round(pixels * REGION_SIZES[1]),
            )
            if found:
                placed = (_placed(detection, scale, columns.start, rows.start) for detection in found)
                return max(placed, key=lambda detection: detection.box.overlap(box))
        return None

    def agrees(self, image: Image | Grey, box: Box) -> bool:
        """Whether other cascades see a face where this one found ``box``, at other sizes and in the mirror.

        Costs at most as much as two calls of ``near``. Raises ValueError for what is not a picture.
        """
        check(image)
        rows, columns = window(image.shape, box, REGION)
        if box.width <= 0 or image[rows, columns].size == 0:
            return False
        region = grey(image[rows, columns])
        there = Box(box.x - columns.start, box.y - rows.start, box.width, box.height)
        return all(self._witnessed(region, there, *witness) for witness in WITNESSES)

    def _witnessed(self, region: Grey, box: Box, name: str, pixels: int, neighbours: int, mirrored: bool) -> bool:
        """Whether one other cascade sees a face at ``box`` of a region."""
        scale = pixels / box.width
        shown = even_out(resized(region, scale), tiles=2)
        if mirrored:
            shown = np.ascontiguousarray(shown[:, ::-1])
            box = Box(region.shape[1] - box.x - box.width, box.y, box.width, box.height)
        smallest, largest = (round(pixels * share) for share in REGION_SIZES)
        found = self._search(
            shown, step=1.1, neighbours=neighbours, smallest=smallest, largest=largest, cascade=self._witness(name)
        )
        return any(_placed(detection, scale, 0, 0).box.overlap(box) > SAME for detection in found)

    def _confirmed(self, picture: Grey, box: Box) -> bool:
        """Whether a closer look sees a face there too: half of the false ones fail, and one true one in a hundred."""
        closer = self.near(picture, box)
        return closer is not None and closer.box.overlap(box) > SAME

    def _search(
        self,
        picture: Grey,
        *,
        step: float,
        neighbours: int,
        smallest: int,
        largest: int,
        cascade: cv2.CascadeClassifier | None = None,
    ) -> list[Detection]:
        """Run a cascade, the first one if none is given, over the picture as it is."""
        boxes, _, weights = (cascade or self._cascade).detectMultiScale3(
            picture,
            scaleFactor=step,
            minNeighbors=neighbours,
            minSize=(smallest, smallest),
            maxSize=(largest, largest),
            outputRejectLevels=True,
        )
        found = [
            Detection(Box(float(x), float(y), float(width), float(height)), float(weight))
            for (x, y, width, height), weight in zip(boxes, weights, strict=True)
        ]
        return sorted(found, key=lambda detection: -detection.box.width)

    @cached_property
    def _cascade(self) -> cv2.CascadeClassifier:
        """The trained cascade, read from OpenCV's own folder when the first picture comes."""
        return _read(CASCADE)

    def _witness(self, name: str) -> cv2.CascadeClassifier:
        """Another cascade, read when it is first asked."""
        if name not in self._witnesses:
            self._witnesses[name] = _read(name)
        return self._witnesses[name]


def _read(name: str) -> cv2.CascadeClassifier:
    path = Path(cv2.data.haarcascades) / name
    if not path.is_file():
        raise FileNotFoundError(f"faces: {path} is missing\n  try: pip install 'opencv-python-headless<5'")
    return cv2.CascadeClassifier(str(path))


def _placed(detection: Detection, scale: float, left: float, top: float) -> Detection:
    """Take a detection from a cut-out that was scaled back to the picture it was cut from."""
    box = detection.box
    return Detection(
        Box(left + box.x / scale, top + box.y / scale, box.width / scale, box.height / scale), detection.score
    )
