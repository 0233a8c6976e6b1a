"""Detection of the eyes in a face, with OpenCV's Haar cascade for eyes."""

from functools import cached_property
from pathlib import Path

import cv2
import cv2.data

from perception.api import Box, Image
from perception.image_preparation import GreyImage, check_image, equalise, resize, to_grey, window_slices

CASCADE = "haarcascade_eye.xml"
FACE_PIXELS = 120
"""Width in pixels to which a face is scaled, so that its eyes are as large as in the training of the cascade."""

EYE_BAND = (0.15, 0.6)
"""Vertical range of the eyes, from the top of a face's box, as shares of its height."""

EYE_WIDTHS = (0.17, 0.4)
"""Smallest and largest width of an eye's box, as shares of the width of the face's box."""


class EyeFinder:
    """Finds up to two open eyes in a face's box. For one thread at a time."""

    def find(self, image: Image | GreyImage, face: Box) -> tuple[Box, ...]:
        """Return the boxes of the eyes in a face, the left one in the picture first.

        At most one in each half of the face: the one with the largest weight. Raises ValueError for an invalid picture.
        """
        check_image(image)
        band = Box(face.x, face.y + EYE_BAND[0] * face.height, face.width, (EYE_BAND[1] - EYE_BAND[0]) * face.height)
        rows, columns = window_slices(image.shape, band, 1.0)
        if face.width <= 0 or image[rows, columns].size == 0:
            return ()
        scale = FACE_PIXELS / face.width
        boxes, _, weights = self._cascade.detectMultiScale3(
            equalise(resize(to_grey(image[rows, columns]), scale), tiles=2),
            scaleFactor=1.15,
            minNeighbors=1,
            minSize=(round(FACE_PIXELS * EYE_WIDTHS[0]), round(FACE_PIXELS * EYE_WIDTHS[0])),
            maxSize=(round(FACE_PIXELS * EYE_WIDTHS[1]), round(FACE_PIXELS * EYE_WIDTHS[1])),
            outputRejectLevels=True,
        )
        best: dict[bool, tuple[float, Box]] = {}
        for box, weight in zip(boxes, weights, strict=True):
            x, y, width, height = (float(value) / scale for value in box)
            eye = Box(columns.start + x, rows.start + y, width, height)
            right = eye.centre[0] > face.centre[0]
            if right not in best or weight > best[right][0]:
                best[right] = (float(weight), eye)
        return tuple(best[right][1] for right in (False, True) if right in best)

    @cached_property
    def _cascade(self) -> cv2.CascadeClassifier:
        """The cascade, loaded from OpenCV's folder for the first face."""
        path = Path(cv2.data.haarcascades) / CASCADE
        if not path.is_file():
            raise FileNotFoundError(f"eyes: {path} is missing\n  try: pip install 'opencv-python-headless<5'")
        return cv2.CascadeClassifier(str(path))
