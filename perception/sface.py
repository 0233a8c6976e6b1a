"""Knowing people with SFace, a network of the OpenCV Zoo, where the user gives its file.

It is cut to the face by five points (eyes, nose, corners of the mouth), which YuNet finds: so it needs its file too.
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
"""Cosine of two faces' features from which on they are of one person, as the network's authors have it."""

MARGIN_PER_COSINE = 10.0
"""What a difference of 1 in the cosine is as a margin: looks at strangers vary by about a tenth (not measured here)."""


FETCH_HINT = "fetch SFace's file again"


class _Network(Protocol):
    """``cv2.FaceRecognizerSF``, as far as it is used."""

    def alignCrop(self, image: Image, row: npt.NDArray[np.float32]) -> Image:  # noqa: N802 - OpenCV's name
        """Return the face of a row of YuNet's, upright, (112, 112, 3)."""
        ...

    def feature(self, face: Image) -> npt.NDArray[np.float32]:
        """Return what describes such a face: (1, 128)."""
        ...


class SFaceRecogniser:
    """Knows people by the network in the file ``model``: a ``perception.identity.FaceRecogniser``. For one thread.

    ``faces`` is YuNet, ``portraits`` are those of ``perception.people.enrol``. Files are read and people learnt at the
    first look: it raises FileNotFoundError and BadModel for the files, ValueError for somebody whose portraits do not
    show a face to YuNet.
    """

    def __init__(self, model: Path, faces: YuNetFaceDetector, portraits: Mapping[str, Sequence[Image]]) -> None:
        self._model = model
        self._faces = faces
        self._portraits = portraits

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return who is nearest, and by how much; None where YuNet sees no face there."""
        people, feature = self._people, self._feature(image, face)
        if feature is None:
            return None
        cosines = {name: float(np.max(features @ feature)) for name, features in people.items()}
        name = max(cosines, key=cosines.__getitem__)
        return FaceMatch(name, MARGIN_PER_COSINE * (cosines[name] - MIN_SAME_COSINE))

    @cached_property
    def _people(self) -> Mapping[str, npt.NDArray[np.float32]]:
        """The features of each person, a row for each portrait that YuNet sees a face in."""
        found = {}
        for name, portraits in self._portraits.items():
            features = [self._feature(each, portrait_face_box(each)) for each in portraits]
            rows = [feature for feature in features if feature is not None]
            if not rows:
                hint = f"mission person remove {name}, then add new pictures"
                raise ValueError(f"faces: no portrait of {name} shows YuNet a face\n  try: {hint}")
            found[name] = np.stack(rows)
        return found

    def _feature(self, image: Image, face: Box) -> npt.NDArray[np.float32] | None:
        """Return what describes a face, of length 1; None where YuNet sees none."""
        row = self._faces.find_landmarks(image, face)
        if row is None:
            return None
        try:
            feature = self._network.feature(self._network.alignCrop(image, row)).ravel()
        except cv2.error as error:
            raise ModelFileError(f"faces: {self._model} is another network than SFace\n  try: {FETCH_HINT}") from error
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
            raise ModelFileError(f"faces: {self._model} is no network\n  try: {FETCH_HINT}") from error
