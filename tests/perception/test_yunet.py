"""Faces by YuNet: what is around the network, on one that takes bright spots for faces; and the network, if there."""

import os
from math import inf
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from perception.api import Box, Image
from perception.face_finder import FaceDetector
from perception.haar_faces import HaarFaceDetector
from perception.model_files import MAX_MODEL_BYTES, ModelFileError
from perception.yunet import (
    HAAR_SIDE_RATIO,
    MAX_NETWORKS,
    MIN_FACE_PIXELS,
    MIN_SCORE,
    MIN_SIDE,
    SIZE_STEP,
    YuNetFaceDetector,
)

MODEL = Path(os.environ.get("MISSION_YUNET", Path.home() / ".local/share/missiontree/models"))


class Spots:
    """In the place of the network: each bright spot is a face, as large as the spot."""

    def __init__(self) -> None:
        self.sizes: list[tuple[int, int]] = []
        self.shown: list[tuple[int, ...]] = []

    def detect(self, image: Image) -> tuple[int, npt.NDArray[np.float32] | None]:
        assert image.shape[:2] in [(height, width) for width, height in self.sizes]
        assert image.ndim == 3
        self.shown.append(image.shape)
        bright = (image[:, :, 0] > 100).astype(np.uint8)
        count, _, stats, _ = cv2.connectedComponentsWithStats(bright)
        if count == 1:
            return 1, None
        rows = [[*stats[spot, :4], *[0.0] * 10, 0.9] for spot in range(1, count)]
        return 1, np.array(rows, np.float32)


@pytest.fixture
def spots(monkeypatch: pytest.MonkeyPatch) -> Spots:
    network = Spots()

    def create(model: str, config: str, size: tuple[int, int], score: float, *_: float) -> Spots:
        assert Path(model).is_file()
        assert (config, score) == ("", MIN_SCORE)
        network.sizes.append(size)
        return network

    monkeypatch.setattr(cv2.FaceDetectorYN, "create", create)
    return network


@pytest.fixture
def faces(tmp_path: Path, spots: Spots) -> YuNetFaceDetector:
    assert spots.shown == []
    path = tmp_path / "net.onnx"
    path.write_bytes(b"network")
    return YuNetFaceDetector(path)


def picture(*spots: tuple[int, int, int, int], size: tuple[int, int] = (640, 480)) -> Image:
    drawn = np.zeros((size[1], size[0], 3), np.uint8)
    for x, y, width, height in spots:
        drawn[y : y + height, x : x + width] = 255
    return drawn


def test_yunet_boxes_are_squares_like_those_of_the_cascade(faces: YuNetFaceDetector) -> None:
    detector: FaceDetector = faces
    (face,) = detector.detect(picture((300, 100, 80, 100)))
    assert face.box.centre == pytest.approx((340, 150), abs=2)
    assert face.box.width == face.box.height == pytest.approx(HAAR_SIDE_RATIO * 100, abs=4)
    assert face.score == pytest.approx(0.9)


def test_the_larger_the_faces_looked_for_the_smaller_the_picture_shown(faces: YuNetFaceDetector, spots: Spots) -> None:
    faces.detect(picture(), smallest=0)
    faces.detect(picture(), smallest=64)
    assert [shape[1] for shape in spots.shown] == [round(640 * MIN_FACE_PIXELS / 28), 5 * SIZE_STEP]
    assert 640 * MIN_FACE_PIXELS / 64 <= 5 * SIZE_STEP


def test_network_is_loaded_once_per_picture_size(faces: YuNetFaceDetector, spots: Spots) -> None:
    seen, face = picture((300, 100, 80, 80)), Box(305, 105, 80, 80)
    for _ in range(3):
        faces.detect(seen)
        faces.detect_near(seen, face)
        faces.is_confirmed(seen, face)
    assert len(spots.sizes) == len(set(spots.sizes)) == 3
    assert all(side % SIZE_STEP == 0 for size in spots.sizes for side in size)
    for width in range(64, 64 * (MAX_NETWORKS + 1), 64):
        faces.detect(picture(size=(2 * width, 128)))
    faces.detect_near(seen, face)
    assert spots.sizes.count(spots.sizes[1]) == 2, "no more than some are kept"


def test_faces_are_filtered_by_size_and_sorted(faces: YuNetFaceDetector) -> None:
    seen = picture((20, 20, 40, 40), (200, 200, 100, 100), (400, 50, 200, 200))
    widths = [face.box.width for face in faces.detect(seen)]
    assert widths == sorted(widths, reverse=True)
    assert len(widths) == 3
    assert len(faces.detect(seen, smallest=60, largest=inf)) == 2
    assert len(faces.detect(seen, largest=60)) == 1


def test_near_shows_the_network_a_small_region_only(faces: YuNetFaceDetector, spots: Spots) -> None:
    found = faces.detect_near(picture((300, 100, 80, 80), (20, 400, 60, 60)), Box(310, 110, 80, 80))
    assert found is not None
    assert found.box.centre == pytest.approx((340, 140), abs=2)
    assert spots.shown[0][:2] == (MIN_SIDE, MIN_SIDE)


def test_near_finds_nothing_outside_the_picture_or_where_nothing_is(faces: YuNetFaceDetector) -> None:
    assert faces.detect_near(picture((300, 100, 80, 80)), Box(500, 350, 60, 60)) is None
    assert faces.detect_near(picture((300, 100, 80, 80)), Box(-500, 0, 60, 60)) is None
    assert faces.detect_near(picture((300, 100, 80, 80)), Box(300, 100, 0, 0)) is None


def test_confirmation_depends_on_the_place_of_the_face(faces: YuNetFaceDetector) -> None:
    seen = picture((300, 100, 80, 80))
    assert faces.is_confirmed(seen, Box(305, 105, 80, 80))
    assert not faces.is_confirmed(seen, Box(400, 300, 80, 80))
    assert not faces.is_confirmed(seen, Box(-500, 0, 60, 60))
    assert not faces.is_confirmed(seen, Box(300, 100, 0, 0))


def test_a_grey_picture_will_do_and_a_huge_one_too(faces: YuNetFaceDetector) -> None:
    (face,) = faces.detect(picture((300, 100, 80, 80))[:, :, 0])
    assert face.box.centre == pytest.approx((340, 140), abs=2)
    (face,) = faces.detect(picture((1500, 500, 400, 400), size=(3200, 2400)))
    assert face.box.centre == pytest.approx((1700, 700), abs=8)


def test_missing_model_file_gives_a_fetch_hint(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"absent.onnx is missing\n  try: mission robot models fetch yunet"):
        YuNetFaceDetector(tmp_path / "absent.onnx").detect(picture())


def test_invalid_model_file_gives_a_fetch_hint(tmp_path: Path) -> None:
    path = tmp_path / "broken.onnx"
    path.write_bytes(b"no network")
    with pytest.raises(ValueError, match=r"broken.onnx is not a network\n  try: mission robot models fetch yunet"):
        YuNetFaceDetector(path).detect(picture())


def test_oversized_model_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "vast.onnx"
    with path.open("wb") as file:
        file.truncate(MAX_MODEL_BYTES + 1)  # of holes alone
    with pytest.raises(
        ModelFileError, match=r"vast.onnx is not a network: 200,000,001 bytes, above the limit of 200,000,000"
    ):
        YuNetFaceDetector(path).detect(picture())


def test_different_network_gives_a_fetch_hint(
    faces: YuNetFaceDetector, spots: Spots, monkeypatch: pytest.MonkeyPatch
) -> None:
    def detect(_: Image) -> None:
        raise cv2.error("(-215:Assertion failed) outputs.size() == 12")

    monkeypatch.setattr(spots, "detect", detect)
    with pytest.raises(
        ModelFileError, match=r"net.onnx is not the network YuNet\n  try: mission robot models fetch yunet"
    ):
        faces.detect(picture())


def test_yunet_finds_the_same_face_as_the_cascade(astronaut: Image) -> None:
    found = sorted(MODEL.glob("*yunet*.onnx")) if MODEL.is_dir() else []
    if not found:
        pytest.skip("the YuNet model is not on this machine: mission robot models fetch yunet")
    (face,) = YuNetFaceDetector(found[0]).detect(astronaut)
    (haar,) = HaarFaceDetector().detect(astronaut)
    assert face.box.overlap(haar.box) > 0.6
    near = YuNetFaceDetector(found[0]).detect_near(astronaut, haar.box)
    assert near is not None
    assert near.box.overlap(haar.box) > 0.6
