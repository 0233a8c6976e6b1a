"""Faces in single pictures."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception import haar_faces as faces
from perception.api import Box, Detection, Image
from perception.haar_faces import ROLL_STEP, HaarFaceDetector

FACE = Box(176, 65, 97, 97)


def test_the_astronaut_has_exactly_one_face(astronaut: Image) -> None:
    (face,) = HaarFaceDetector().detect(astronaut)
    assert face.box.overlap(FACE) > 0.7


def test_a_grey_picture_will_do(astronaut: Image) -> None:
    grey = np.asarray(cv2.cvtColor(astronaut, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    assert HaarFaceDetector().detect(grey) == HaarFaceDetector().detect(astronaut)


def test_a_quarter_of_the_light_is_enough(astronaut: Image) -> None:
    (face,) = HaarFaceDetector().detect(np.asarray(astronaut // 4, dtype=np.uint8))
    assert face.box.overlap(FACE) > 0.6


def test_boxes_of_a_huge_picture_are_in_its_pixels(astronaut: Image) -> None:
    huge = np.asarray(cv2.resize(astronaut, None, fx=5, fy=5, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    (face,) = HaarFaceDetector().detect(huge)
    assert face.box.overlap(Box(FACE.x * 5, FACE.y * 5, FACE.width * 5, FACE.height * 5)) > 0.6


def test_the_largest_face_comes_first(astronaut: Image) -> None:
    small = np.asarray(cv2.resize(astronaut, (256, 256), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    both = np.zeros((512, 768, 3), dtype=np.uint8)
    both[:256, :256], both[:, 256:] = small, astronaut
    widths = [face.box.width for face in HaarFaceDetector().detect(both)]
    assert len(widths) == 2
    assert widths == sorted(widths, reverse=True)


def test_an_empty_wall_has_no_face() -> None:
    assert HaarFaceDetector().detect(np.full((480, 640, 3), 128, dtype=np.uint8)) == []


@pytest.mark.parametrize("name", ["portrait_1.jpg", "portrait_2.jpg"])
def test_each_portrait_has_exactly_one_face(footage: Path, name: str) -> None:
    picture = cv2.imread(str(footage / name))
    assert picture is not None
    assert len(HaarFaceDetector().detect(np.asarray(picture, dtype=np.uint8))) == 1


def test_detect_near_finds_a_slightly_moved_face(astronaut: Image) -> None:
    moved = HaarFaceDetector().detect_near(astronaut, Box(FACE.x + 15, FACE.y - 10, 90, 90))
    assert moved is not None
    assert moved.box.overlap(FACE) > 0.7


@pytest.mark.parametrize(
    "box", [Box(350, 350, 97, 97), Box(-500, 0, 97, 97), Box(510, 510, 40, 40), Box(100, 100, 0, 0)]
)
def test_detect_near_finds_nothing_without_a_face(astronaut: Image, box: Box) -> None:
    assert HaarFaceDetector().detect_near(astronaut, box) is None


def test_confirmation_accepts_a_face_and_rejects_other_boxes(astronaut: Image) -> None:
    assert HaarFaceDetector().is_confirmed(astronaut, FACE)
    assert not HaarFaceDetector().is_confirmed(astronaut, Box(350, 350, 97, 97))
    assert not HaarFaceDetector().is_confirmed(astronaut, Box(-500, 0, 97, 97))
    assert not HaarFaceDetector().is_confirmed(astronaut, Box(100, 100, 0, 0))


@pytest.mark.parametrize("shape", [(0, 0, 3), (10, 10, 4), (10,)])
def test_malformed_picture_is_refused_with_its_shape(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="picture: expected"):
        HaarFaceDetector().detect(np.zeros(shape, dtype=np.uint8))


def test_missing_cascade_gives_an_install_hint(monkeypatch: pytest.MonkeyPatch, astronaut: Image) -> None:
    monkeypatch.setattr(faces, "CASCADE", "nowhere.xml")
    with pytest.raises(FileNotFoundError, match=r"nowhere.xml is missing\n  try: pip install"):
        HaarFaceDetector().detect(astronaut)


def turned(picture: Image, degrees: float) -> Image:
    """The astronaut's portrait, turned to the right about her face."""
    move = cv2.getRotationMatrix2D(FACE.centre, -degrees, 1.0)
    return np.asarray(cv2.warpAffine(picture, move, (512, 512), borderMode=cv2.BORDER_REPLICATE), np.uint8)


@pytest.mark.parametrize("side", [-1, 1])
def test_leaning_head_is_found_with_its_roll(astronaut: Image, side: int) -> None:
    picture, faces = turned(astronaut, side * 30), HaarFaceDetector()
    assert faces.detect(picture, smallest=50) == []
    (face,) = faces.detect(picture, smallest=50, roll=side * ROLL_STEP)
    assert face.roll == side * ROLL_STEP
    assert face.box.overlap(FACE) > 0.6
    assert faces.is_confirmed(picture, face.box, roll=face.roll)
    assert not faces.is_confirmed(picture, face.box)


def test_known_head_is_found_again_when_leaning(astronaut: Image) -> None:
    (again,) = HaarFaceDetector().detect_leaning(turned(astronaut, 30), Detection(FACE, 1.0))
    assert again.roll == ROLL_STEP


def test_a_frontal_face_does_not_look_to_one_side_nor_does_a_wall(astronaut: Image) -> None:
    wall = np.random.default_rng(2).integers(90, 150, (512, 512, 3), dtype=np.uint8)
    assert not HaarFaceDetector().is_turned_aside(wall, FACE)
    assert not HaarFaceDetector().is_turned_aside(astronaut, Box(-500, 0, 97, 97))


def test_a_face_in_eight_percent_of_the_light_is_found_through_the_noise(astronaut: Image) -> None:
    light = astronaut.astype(np.float64) * 0.08
    noise = np.random.default_rng(1).normal(0.0, 1.0, light.shape) * np.sqrt(0.15 * light + 2.0)
    (face,) = HaarFaceDetector().detect(np.clip(np.rint(light + noise), 0, 255).astype(np.uint8))
    assert face.box.overlap(FACE) > 0.6


def test_a_face_is_found_in_a_picture_of_160_pixels(astronaut: Image) -> None:
    small = np.asarray(cv2.resize(astronaut, (128, 128), interpolation=cv2.INTER_AREA), np.uint8)
    (face,) = HaarFaceDetector().detect(small, smallest=0.047 * 128)
    assert face.box.overlap(Box(FACE.x / 4, FACE.y / 4, FACE.width / 4, FACE.height / 4)) > 0.6


def test_sizes_for_which_a_picture_is_too_small_are_not_looked_for(astronaut: Image) -> None:
    assert HaarFaceDetector().detect(astronaut, smallest=5, largest=20) == []
