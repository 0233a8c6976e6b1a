"""Faces in single pictures."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception import faces
from perception.api import Box, Image
from perception.faces import HaarFaces

FACE = Box(176, 65, 97, 97)


def test_the_astronaut_has_exactly_one_face(astronaut: Image) -> None:
    (face,) = HaarFaces().detect(astronaut)
    assert face.box.overlap(FACE) > 0.7


def test_a_grey_picture_will_do(astronaut: Image) -> None:
    grey = np.asarray(cv2.cvtColor(astronaut, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    assert HaarFaces().detect(grey) == HaarFaces().detect(astronaut)


def test_a_quarter_of_the_light_is_enough(astronaut: Image) -> None:
    (face,) = HaarFaces().detect(np.asarray(astronaut // 4, dtype=np.uint8))
    assert face.box.overlap(FACE) > 0.6


def test_a_huge_picture_gives_its_boxes_in_its_own_pixels(astronaut: Image) -> None:
    huge = np.asarray(cv2.resize(astronaut, None, fx=5, fy=5, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    (face,) = HaarFaces().detect(huge)
    assert face.box.overlap(Box(FACE.x * 5, FACE.y * 5, FACE.width * 5, FACE.height * 5)) > 0.6


def test_the_largest_face_comes_first(astronaut: Image) -> None:
    small = np.asarray(cv2.resize(astronaut, (256, 256), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    both = np.zeros((512, 768, 3), dtype=np.uint8)
    both[:256, :256], both[:, 256:] = small, astronaut
    widths = [face.box.width for face in HaarFaces().detect(both)]
    assert len(widths) == 2
    assert widths == sorted(widths, reverse=True)


def test_an_empty_wall_has_no_face() -> None:
    assert HaarFaces().detect(np.full((480, 640, 3), 128, dtype=np.uint8)) == []


@pytest.mark.parametrize("name", ["portrait_1.jpg", "portrait_2.jpg"])
def test_each_portrait_has_exactly_one_face(footage: Path, name: str) -> None:
    picture = cv2.imread(str(footage / name))
    assert picture is not None
    assert len(HaarFaces().detect(np.asarray(picture, dtype=np.uint8))) == 1


def test_near_finds_a_face_that_moved_a_little(astronaut: Image) -> None:
    moved = HaarFaces().near(astronaut, Box(FACE.x + 15, FACE.y - 10, 90, 90))
    assert moved is not None
    assert moved.box.overlap(FACE) > 0.7


@pytest.mark.parametrize(
    "box", [Box(350, 350, 97, 97), Box(-500, 0, 97, 97), Box(510, 510, 40, 40), Box(100, 100, 0, 0)]
)
def test_near_finds_nothing_where_there_is_no_face(astronaut: Image, box: Box) -> None:
    assert HaarFaces().near(astronaut, box) is None


def test_other_cascades_bear_a_face_out_and_not_what_is_none(astronaut: Image) -> None:
    assert HaarFaces().agrees(astronaut, FACE)
    assert not HaarFaces().agrees(astronaut, Box(350, 350, 97, 97))
    assert not HaarFaces().agrees(astronaut, Box(-500, 0, 97, 97))
    assert not HaarFaces().agrees(astronaut, Box(100, 100, 0, 0))


@pytest.mark.parametrize("shape", [(0, 0, 3), (10, 10, 4), (10,)])
def test_what_is_no_picture_is_refused_with_its_shape(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="picture: expected"):
        HaarFaces().detect(np.zeros(shape, dtype=np.uint8))


def test_a_missing_cascade_says_what_to_install(monkeypatch: pytest.MonkeyPatch, astronaut: Image) -> None:
    monkeypatch.setattr(faces, "CASCADE", "nowhere.xml")
    with pytest.raises(FileNotFoundError, match=r"nowhere.xml is missing\n  try: pip install"):
        HaarFaces().detect(astronaut)
