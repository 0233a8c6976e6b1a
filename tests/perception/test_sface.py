"""SFace: what is around the networks, on ones that know people by the brightness of their faces."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from perception.api import UNKNOWN, Box, Image
from perception.model_files import MAX_MODEL_BYTES, ModelFileError
from perception.sface import MARGIN_PER_COSINE, MIN_SAME_COSINE, SFaceRecogniser
from perception.yunet import YuNetFaceDetector

FACE = Box(200.0, 100.0, 100.0, 100.0)


class Spot:
    """In the place of YuNet: the bright spot in a picture is a face, its points at its corners and in its middle."""

    def setInputSize(self, input_size: tuple[int, int]) -> None:  # noqa: N802 - OpenCV's name
        self.size = input_size

    def detect(self, image: Image) -> tuple[int, npt.NDArray[np.float32] | None]:
        bright = (image[:, :, 0] > 60).astype(np.uint8)
        x, y, width, height = cv2.boundingRect(bright)
        if width == 0:
            return 1, None
        points = [x, y, x + width, y, x + width / 2, y + height / 2, x, y + height, x + width, y + height]
        return 1, np.array([[x, y, width, height, *points, 0.9]], np.float32)


class Brightness:
    """In the place of SFace: a direction that turns with the brightness of the face."""

    def alignCrop(self, image: Image, row: npt.NDArray[np.float32]) -> Image:  # noqa: N802 - OpenCV's name
        x, y, width, height = (round(float(value)) for value in row[:4])
        return image[max(y, 0) : y + height, max(x, 0) : x + width]

    def feature(self, face: Image) -> npt.NDArray[np.float32]:
        angle = float(face.mean()) / 255 * np.pi
        return 7 * np.array([[np.cos(angle), np.sin(angle)]], np.float32)


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Return the files of both networks, in whose places others are read."""
    monkeypatch.setattr(cv2.FaceDetectorYN, "create", lambda *_: Spot())
    monkeypatch.setattr(cv2.FaceRecognizerSF, "create", lambda *_: Brightness())
    paths = tmp_path / "sface.onnx", tmp_path / "yunet.onnx"
    for path in paths:
        path.write_bytes(b"network")
    return paths


def shown(grey: int) -> Image:
    picture = np.zeros((480, 640, 3), np.uint8)
    picture[100:200, 200:300] = grey
    return picture


def portrait(grey: int) -> Image:
    picture = np.zeros((160, 160, 3), np.uint8)
    picture[30:130, 30:130] = grey
    return picture


def test_points_of_a_face_are_in_pixels_of_the_picture(files: tuple[Path, Path]) -> None:
    row = YuNetFaceDetector(files[1]).find_landmarks(shown(200), FACE)
    assert row is not None
    assert row[:4].tolist() == pytest.approx([200, 100, 100, 100], abs=3)
    assert row[8:10].tolist() == pytest.approx([250, 150], abs=3)
    assert YuNetFaceDetector(files[1]).find_landmarks(shown(0), FACE) is None


def test_nearest_person_is_returned_with_the_margin_to_the_published_threshold(files: tuple[Path, Path]) -> None:
    people = SFaceRecogniser(files[0], YuNetFaceDetector(files[1]), {"Anna": [portrait(250)], "Ben": [portrait(70)]})
    look = people.match(shown(250), FACE)
    assert look is not None
    assert look.name == "Anna"
    assert look.margin == pytest.approx(MARGIN_PER_COSINE * (1 - MIN_SAME_COSINE), abs=0.05)
    other = people.match(shown(80), FACE)
    assert other is not None
    assert other.verdict == "Ben"


def test_stranger_is_unknown(files: tuple[Path, Path]) -> None:
    people = SFaceRecogniser(files[0], YuNetFaceDetector(files[1]), {"Anna": [portrait(255)]})
    look = people.match(shown(62), FACE)
    assert look is not None
    assert look.verdict == UNKNOWN


def test_missing_yunet_face_gives_no_look(files: tuple[Path, Path]) -> None:
    people = SFaceRecogniser(files[0], YuNetFaceDetector(files[1]), {"Anna": [portrait(250)]})
    assert people.match(shown(0), FACE) is None


def test_portraits_without_a_face_and_a_missing_file_give_hints(files: tuple[Path, Path]) -> None:
    with pytest.raises(
        ValueError, match="YuNet finds no face in the pictures of Anna\n  try: mission person remove Anna"
    ):
        SFaceRecogniser(files[0], YuNetFaceDetector(files[1]), {"Anna": [portrait(0)]}).match(shown(200), FACE)
    with files[0].open("wb") as file:
        file.truncate(MAX_MODEL_BYTES + 1)  # of holes alone
    with pytest.raises(ModelFileError, match=r"sface.onnx is not a network: 200,000,001 bytes"):
        SFaceRecogniser(files[0], YuNetFaceDetector(files[1]), {"Anna": [portrait(250)]}).match(shown(200), FACE)
    files[0].unlink()
    with pytest.raises(FileNotFoundError, match=r"sface.onnx is missing"):
        SFaceRecogniser(files[0], YuNetFaceDetector(files[1]), {"Anna": [portrait(250)]}).match(shown(200), FACE)
