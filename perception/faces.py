"""Finding faces in one picture, with the Haar cascade that comes with OpenCV."""

from functools import cached_property
from pathlib import Path

import cv2
import cv2.data

from perception.api import Box, Detection, Image
from perception.light import Grey, even_out, grey, resized, window

CASCADE = "haarcascade_frontalface_default.xml"
LONGEST = 640
"""Pixels along the longer side to which a larger picture is shrunk first: for this size the rest was measured."""

NEIGHBOURS = 4  # of 3 to 6, on 272 frames of people: 3 finds 2 % more faces and 11 false ones instead of 2
SMALLEST = 28  # pixels: a face 3.5 m away for a camera of 640 pixels and 60 degrees

SAME = 0.3  # overlap from which on two boxes are one face
REGION = 2.0  # how much of the picture is searched around a known face, in widths of it
REGION_FACE = 64  # pixels to which a known face is scaled before its region is searched


class HaarFaces:
    """Finds upright faces that look towards the camera: a ``Detector``. For one thread at a time.

    A box reaches from ear to ear and from the hairline to the chin; its score is the weight of the cascade's last
    stage (-1..10 for true faces). The contrast is evened out first. Takes pictures in colour or grey.
    """

    def detect(self, image: Image | Grey) -> list[Detection]:
        """Return the faces anywhere in the picture, largest first. Raises ValueError for what is not a picture."""
        whole = grey(image)
        scale = min(1.0, LONGEST / max(whole.shape))
        found = self._search(
            even_out(resized(whole, scale), tiles=8),
            step=1.2,
            neighbours=NEIGHBOURS,
            smallest=SMALLEST,
            largest=LONGEST,
        )
        placed = [_placed(detection, scale, 0, 0) for detection in found]
        return [detection for detection in placed if self._confirmed(whole, detection.box)]

    def near(self, image: Image | Grey, box: Box) -> Detection | None:
        """Return the face that is about where and as large as ``box``, None when there is none.

        Costs a tenth of ``detect`` and finds more, since it looks at every size in a small region, at a fixed scale.
        Raises ValueError for what is not a picture.
        """
        whole = grey(image)
        rows, columns = window(whole.shape, box, REGION)
        region = whole[rows, columns]
        if box.width <= 0 or region.size == 0:
            return None
        scale = REGION_FACE / box.width
        found = self._search(
            even_out(resized(region, scale), tiles=2),
            step=1.1,
            neighbours=3,
            smallest=round(REGION_FACE * 0.7),
            largest=round(REGION_FACE * 1.5),
        )
        placed = [_placed(detection, scale, columns.start, rows.start) for detection in found]
        return max(placed, key=lambda detection: detection.box.overlap(box), default=None)

    def _confirmed(self, picture: Grey, box: Box) -> bool:
        """Whether a closer look sees a face there too: half of the false ones fail, and one true one in a hundred."""
        closer = self.near(picture, box)
        return closer is not None and closer.box.overlap(box) > SAME

    def _search(self, picture: Grey, *, step: float, neighbours: int, smallest: int, largest: int) -> list[Detection]:
        """Run the cascade over the picture as it is."""
        boxes, _, weights = self._cascade.detectMultiScale3(
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
        path = Path(cv2.data.haarcascades) / CASCADE
        if not path.is_file():
            raise FileNotFoundError(f"faces: {path} is missing\n  try: pip install 'opencv-python-headless<5'")
        return cv2.CascadeClassifier(str(path))


def _placed(detection: Detection, scale: float, left: float, top: float) -> Detection:
    """Take a detection from a cut-out that was scaled back to the picture it was cut from."""
    box = detection.box
    return Detection(
        Box(left + box.x / scale, top + box.y / scale, box.width / scale, box.height / scale), detection.score
    )
