"""The eyes in a face."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception import eye_finder
from perception.api import Box, Image
from perception.eye_finder import EyeFinder
from perception.haar_faces import HaarFaceDetector

FACE = Box(176, 65, 97, 97)
LEFT, RIGHT = (204.0, 107.0), (245.0, 107.0)
"""The astronaut's pupils, read off the picture."""


def test_both_eyes_of_the_astronaut_are_found_left_first(astronaut: Image) -> None:
    left, right = EyeFinder().find(astronaut, FACE)
    assert left.centre == pytest.approx(LEFT, abs=8)
    assert right.centre == pytest.approx(RIGHT, abs=8)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_pupils_are_found_at_any_picture_size(astronaut: Image, scale: float) -> None:
    picture = np.asarray(cv2.resize(astronaut, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    face = Box(*(value * scale for value in (FACE.x, FACE.y, FACE.width, FACE.height)))
    eyes = EyeFinder().find(picture, face)
    assert [eye.centre for eye in eyes] == [
        pytest.approx(tuple(value * scale for value in place), abs=9 * scale) for place in (LEFT, RIGHT)
    ]


def test_a_wall_has_no_eyes() -> None:
    assert EyeFinder().find(np.full((480, 640, 3), 120, np.uint8), Box(100, 100, 90, 90)) == ()


@pytest.mark.parametrize("face", [Box(-300, 0, 97, 97), Box(0, 0, 0, 0), Box(600, 600, 50, 50)])
def test_a_face_outside_the_picture_has_no_eyes(astronaut: Image, face: Box) -> None:
    assert EyeFinder().find(astronaut, face) == ()


def test_malformed_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="picture: expected"):
        EyeFinder().find(np.zeros((4, 4, 4), np.uint8), FACE)


def test_each_portrait_shows_both_eyes(footage: Path) -> None:
    for name in ("portrait_1.jpg", "portrait_2.jpg"):
        picture = cv2.imread(str(footage / name))
        assert picture is not None
        image = np.asarray(picture, np.uint8)
        (face,) = HaarFaceDetector().detect(image)
        assert len(EyeFinder().find(image, face.box)) == 2, name


def test_missing_cascade_gives_an_install_hint(monkeypatch: pytest.MonkeyPatch, astronaut: Image) -> None:
    monkeypatch.setattr(eye_finder, "CASCADE", "nowhere.xml")
    with pytest.raises(FileNotFoundError, match=r"nowhere.xml is missing\n  try: pip install"):
        EyeFinder().find(astronaut, FACE)
