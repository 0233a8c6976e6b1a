"""Face recognition with SFace, a network of the OpenCV Zoo, whose file the user provides.

The detector YuNet, whose file is also needed, finds five points (eyes, nose, corners of the mouth) to align a face.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Protocol, cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Image
from perception.crops import portrait_face_box
from perception.identity import FaceMatch
from perception.model_files import ModelFileError, check_model_size
from perception.yunet import YuNetFaceDetector

MIN_SAME_COSINE = 0.363
"""Smallest cosine between the features (embeddings) of two faces of one person, as the network's authors specify."""

MARGIN_PER_COSINE = 10.0
"""Margin of a ``FaceMatch`` per unit of cosine; cosines of strangers vary by about a tenth (not measured here)."""


FETCH_HINT = "fetch SFace's file again"


class _Network(Protocol):
    """The methods of ``cv2.FaceRecognizerSF`` that we use."""

    def alignCrop(self, image: Image, row: npt.NDArray[np.float32]) -> Image:  # noqa: N802 - OpenCV's name
        """Return the face that a row of YuNet's result describes, upright, of shape (112, 112, 3)."""
        ...

    def feature(self, face: Image) -> npt.NDArray[np.float32]:
        """Return the features of an aligned face: (1, 128)."""
        ...


class SFaceRecogniser:
    """A ``perception.identity.FaceRecogniser`` with the network in the file ``model``. For one thread.

    ``faces`` is YuNet, ``portraits`` come from ``perception.people.enrol``. Files are read and portraits described at
    the first look. It raises FileNotFoundError and ModelFileError for the files, ValueError for a person in whose
    portraits YuNet finds no face.
    """

    def __init__(self, model: Path, faces: YuNetFaceDetector, portraits: Mapping[str, Sequence[Image]]) -> None:
        self._model = model
        self._faces = faces
        self._portraits = portraits

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return the most similar person and the margin as in ``FaceMatch``; None if YuNet finds no face."""
        people, feature = self._people, self._feature(image, face)
        if feature is None:
            return None
        cosines = {name: float(np.max(features @ feature)) for name, features in people.items()}
        name = max(cosines, key=cosines.__getitem__)
        return FaceMatch(name, MARGIN_PER_COSINE * (cosines[name] - MIN_SAME_COSINE))

    @cached_property
    def _people(self) -> Mapping[str, npt.NDArray[np.float32]]:
        """Features of each person: one row per portrait in which YuNet finds a face."""
        found = {}
        for name, portraits in self._portraits.items():
            features = [self._feature(each, portrait_face_box(each)) for each in portraits]
            rows = [feature for feature in features if feature is not None]
            if not rows:
                hint = f"mission person remove {name}, then add new pictures"
                raise ValueError(f"faces: YuNet finds no face in the pictures of {name}\n  try: {hint}")
            found[name] = np.stack(rows)
        return found

    def _feature(self, image: Image, face: Box) -> npt.NDArray[np.float32] | None:
        """Return the features of a face, normalised to length 1; None if YuNet finds none."""
        row = self._faces.find_landmarks(image, face)
        if row is None:
            return None
        try:
            feature = self._network.feature(self._network.alignCrop(image, row)).ravel()
        except cv2.error as error:
            raise ModelFileError(f"faces: {self._model} is not the network SFace\n  try: {FETCH_HINT}") from error
        return np.asarray(feature / max(float(np.linalg.norm(feature)), 1e-9), np.float32)

    @cached_property
    def _network(self) -> _Network:
        if not self._model.is_file():
            raise FileNotFoundError(f"faces: {self._model} is missing\n  try: `model:` in the identity section of the "
                                    "robot file names SFace's file, from the OpenCV Zoo")  # fmt: skip
        check_model_size(self._model, FETCH_HINT)
        try:
            return cast(_Network, cv2.FaceRecognizerSF.create(str(self._model), ""))
        except cv2.error as error:
            raise ModelFileError(f"faces: {self._model} is not a network\n  try: {FETCH_HINT}") from error
