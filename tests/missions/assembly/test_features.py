"""What dlib's network made of people's portraits: once for each, and nothing is left of whom one removes."""

import json
import stat
from pathlib import Path

import numpy as np
import pytest

from missions.assembly.gallery import FeatureCache
from missions.library.people import FEATURES_FILE, People
from perception.api import Box, Image
from perception.dlib_people import FEATURE_LENGTH, DlibDescriber, DlibRecogniser, Feature
from tests.missions.library.test_people import ANNA, BEN, taken


class Describer(DlibDescriber):
    """Describes a picture by its first pixels, and counts how often it is asked."""

    def __init__(self, model: str = "net") -> None:
        self.model = model
        self.asked = 0

    def __call__(self, image: Image, face: Box) -> Feature:  # noqa: ARG002 - a portrait is its face
        self.asked += 1
        return image.ravel()[:FEATURE_LENGTH] / 255


@pytest.fixture
def people(tmp_path: Path) -> People:
    found = People(tmp_path / "people")
    found.add("Anna", ANNA)
    found.add("Ben", BEN)
    return found


def learn(people: People, describe: Describer) -> int:
    """Learn everybody as at a start, see that all are right, and return how often the network was asked."""
    features = FeatureCache(people, describe)
    for name, pictures in people.portraits(lambda _: None).items():
        for picture, feature in zip(pictures, features(name, pictures), strict=True):
            assert np.array_equal(feature, picture.ravel()[:FEATURE_LENGTH] / 255)
    return describe.asked


def names(people: People) -> list[str]:
    return sorted(str(path.relative_to(people.folder)) for path in people.folder.rglob(FEATURES_FILE))


def test_a_picture_is_described_once_and_not_at_each_start(people: People) -> None:
    assert learn(people, Describer()) == len(ANNA) + len(BEN)
    assert learn(people, Describer()) == 0
    people.add("Anna", [taken(99)])
    assert learn(people, Describer()) == 1
    assert learn(people, Describer("another net")) == len(ANNA) + len(BEN) + 1


def test_dlib_recogniser_uses_cached_features_at_the_first_match(people: People) -> None:
    learn(people, Describer())
    describe = Describer()
    known = DlibRecogniser(people.portraits(lambda _: None), describe, FeatureCache(people, describe))
    look = known.match(ANNA[0], Box(4.0, 4.0, 12.0, 12.0))
    assert look is not None
    assert describe.asked == 1


def test_feature_cache_is_readable_by_its_owner_only(people: People) -> None:
    learn(people, Describer())
    assert stat.S_IMODE((people.folder / "Anna" / FEATURES_FILE).stat().st_mode) == 0o600


def test_removed_person_leaves_no_features(people: People) -> None:
    learn(people, Describer())
    people.remove("Anna")
    assert names(people) == [f"Ben/{FEATURES_FILE}"]
    assert not (people.folder / "Anna").exists()


def test_features_of_a_person_removed_during_a_run_are_not_cached(people: People) -> None:
    pictures = people.portraits(lambda _: None)
    (people.folder / "Anna" / "letter.txt").write_text("of somebody else")
    people.remove("Anna")
    FeatureCache(people, Describer())("Anna", pictures["Anna"])
    assert names(people) == []


def test_features_of_a_picture_deleted_by_hand_are_dropped(people: People) -> None:
    learn(people, Describer())
    people.add("Anna", [taken(98)])
    (people.folder / "Anna" / "001.png").unlink()
    learn(people, Describer())
    told = json.loads((people.folder / "Anna" / FEATURES_FILE).read_text("utf-8"))
    assert len(told["features"]) == len(ANNA)
    for path in (people.folder / "Ben").glob("*.png"):
        path.unlink()
    people.add("Anna", [taken(97)])
    assert names(people) == [f"Anna/{FEATURES_FILE}"]


@pytest.mark.parametrize(
    "damage",
    [
        b"",
        b"\xff\xfe",
        b"[]",
        b'{"model": "net"}',
        b'{"model": "net", "features": [1]}',
        b"[" * 100_000,
        b'{"model": "net", "features": {"ab": [1.0]}}',
        b'{"model": "net", "features": {"ab": %s}}'
        % str([float("nan")] * FEATURE_LENGTH).replace("nan", "NaN").encode(),
    ],
)
def test_damaged_feature_cache_is_rewritten(damage: bytes, people: People) -> None:
    path = people.folder / "Anna" / FEATURES_FILE
    path.write_bytes(damage)
    assert learn(people, Describer()) == len(ANNA) + len(BEN)
    assert learn(people, Describer()) == 0


def test_a_link_is_not_followed(people: People, tmp_path: Path) -> None:
    learn(people, Describer())
    path = people.folder / "Anna" / FEATURES_FILE
    kept = path.rename(tmp_path / "elsewhere.json")
    before = kept.read_bytes()
    path.symlink_to(kept)
    assert learn(people, Describer()) == len(ANNA)
    assert not path.is_symlink()
    assert kept.read_bytes() == before


def test_people_are_recognised_without_a_writable_feature_cache(people: People) -> None:
    (people.folder / "Anna" / FEATURES_FILE).mkdir()
    assert learn(people, Describer()) == len(ANNA) + len(BEN)
    assert learn(people, Describer()) == len(ANNA)
