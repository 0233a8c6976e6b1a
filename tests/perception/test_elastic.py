"""A gallery of people, on patches made up by chance that stand for faces: who is nearest, and from where on."""

import numpy as np
import pytest

from perception.api import UNKNOWN
from perception.elastic_matching import (
    EXTRA_DEVIATIONS,
    MAX_THRESHOLD_DEVIATIONS,
    MIN_COMPARED_PEOPLE,
    SEARCH_REACH,
    STRANGER_DEVIATION,
    STRANGER_MEAN,
    THRESHOLD_DEVIATIONS,
    Gallery,
    PictureDescription,
)
from perception.patches import CELLS, DEPTH, Patches


def seen(patches: Patches) -> PictureDescription:
    """Return a picture with one sight, and no other template."""
    return PictureDescription([patches], [patches])


class People:
    """Persons whose pictures all have something in common, as faces do; ``apart`` is what is a person's own."""

    def __init__(self, count: int, *, apart: float = 1.0, seed: int = 0) -> None:
        self.random = np.random.default_rng(seed)
        self.common = self.random.uniform(1.0, 2.0, (CELLS, CELLS, DEPTH))
        self.own = [apart * self.random.uniform(0.0, 1.0, self.common.shape) for _ in range(count)]

    def picture(self, person: int, *, noise: float = 0.3, aside: int = 0) -> Patches:
        found = np.roll(self.common + self.own[person], aside, axis=1)
        found = found + noise * self.random.uniform(0.0, 1.0, found.shape)
        return np.asarray(found / np.linalg.norm(found, axis=2, keepdims=True), np.float32)

    def pictures(self, person: int, count: int = 3) -> list[PictureDescription]:
        return [seen(self.picture(person)) for _ in range(count)]

    def gallery(self, *persons: int) -> Gallery:
        return Gallery({f"p{person}": self.pictures(person) for person in persons})


@pytest.mark.parametrize("count", [1, 2, 5])
def test_known_person_is_nearer_than_a_stranger(count: int) -> None:
    people = People(count + 1)
    gallery = people.gallery(*range(count))
    stranger = gallery.match([people.picture(count)])
    for person in range(count):
        look = gallery.match([people.picture(person)])
        assert look.name == f"p{person}"
        assert look.margin > stranger.margin + 0.5


def test_face_offset_within_the_search_reach_is_found() -> None:
    people = People(3)
    gallery = people.gallery(0, 1)
    margins = [
        gallery.match([people.picture(0, aside=aside)]).margin
        for aside in (0, SEARCH_REACH, -SEARCH_REACH, SEARCH_REACH + 2)
    ]
    assert margins[1:3] == pytest.approx([margins[0]] * 2, abs=0.3 * (margins[0] - margins[3]))


def test_parts_of_a_face_may_be_found_in_different_pictures() -> None:
    people = People(3)
    left, right = people.picture(0), people.picture(1)
    mixed = np.concatenate([left[:, :10], right[:, 10:]], axis=1)
    whole = Gallery({"both": [seen(left), seen(right)], "other": people.pictures(2)}).match([mixed])
    half = Gallery({"both": [seen(left)], "other": people.pictures(2)}).match([mixed])
    assert whole.name == half.name == "both"
    assert whole.margin > half.margin


LEAST = STRANGER_MEAN + (THRESHOLD_DEVIATIONS + EXTRA_DEVIATIONS) * STRANGER_DEVIATION
"""The threshold where one person is known, and nothing but what is usual."""


def test_the_usual_threshold_holds_for_one_person_with_one_picture() -> None:
    alone = Gallery({"p0": People(1).pictures(0, 1)}).calibration
    assert alone.thresholds == {"p0": pytest.approx(LEAST)}


def test_own_scores_count_more_with_more_pictures() -> None:
    people = People(5)
    many, more = (
        Gallery({name: people.pictures(person, count) for person, name in enumerate("abcd")}).calibration
        for count in (3, 12)
    )
    assert many.acceptance_rate is not None
    assert abs(more.thresholds["a"] - LEAST) > abs(many.thresholds["a"] - LEAST)


def test_a_name_takes_more_where_few_persons_are_compared() -> None:
    people = People(MIN_COMPARED_PEOPLE)
    known = {"p0": people.pictures(0, 1)}  # alone, it has no looks at strangers: the same mean and deviation each time
    few, enough = (
        Gallery(known, [people.pictures(1 + each) for each in range(count)])
        for count in (MIN_COMPARED_PEOPLE - 2, MIN_COMPARED_PEOPLE - 1)
    )
    assert few.calibration.thresholds["p0"] == pytest.approx(
        STRANGER_MEAN + (THRESHOLD_DEVIATIONS + EXTRA_DEVIATIONS / 2) * STRANGER_DEVIATION
    )
    assert enough.calibration.thresholds["p0"] == pytest.approx(
        STRANGER_MEAN + (THRESHOLD_DEVIATIONS + EXTRA_DEVIATIONS / 3) * STRANGER_DEVIATION
    )
    face = [people.picture(0)]
    assert few.match(face).margin < enough.match(face).margin


def test_two_unlike_people_do_not_lower_the_thresholds() -> None:
    two = People(4, apart=4.0).gallery(0, 1).calibration
    assert (
        min(two.thresholds.values())
        >= STRANGER_MEAN + (THRESHOLD_DEVIATIONS + EXTRA_DEVIATIONS / 2) * STRANGER_DEVIATION
    )


def test_similar_pictures_of_a_person_raise_the_threshold() -> None:
    people = People(3)
    varied, alike = ([seen(people.picture(0, noise=noise)) for _ in range(3)] for noise in (1.5, 0.8))
    first, second = (
        Gallery({"p0": mine, "p1": people.pictures(1), "p2": people.pictures(2)}).calibration.thresholds["p0"]
        for mine in (varied, alike)
    )
    assert first < second <= STRANGER_MEAN + 2 * MAX_THRESHOLD_DEVIATIONS * STRANGER_DEVIATION


def test_similar_people_raise_the_refusal_rate() -> None:
    far, near = (People(4, apart=apart).gallery(*range(4)).calibration for apart in (4.0, 0.0))
    assert far.refusal_rate == 0
    assert near.refusal_rate is not None
    assert near.refusal_rate > 0.5


def test_lookalikes_are_reported() -> None:
    people = People(4, apart=2.5)
    apart = {f"p{person}": people.pictures(person) for person in range(3)}
    assert Gallery(apart).calibration.lookalikes == {}
    twins = Gallery(apart | {"twin": people.pictures(0)}).calibration.lookalikes
    assert twins == {"p0": "twin", "twin": "p0"}


def test_face_nearer_to_the_cohort_is_a_stranger() -> None:
    people = People(2)
    gallery = Gallery({"p0": people.pictures(0)}, [people.pictures(1)])
    assert gallery.match([people.picture(0)]).name == "p0"
    assert gallery.match([people.picture(1)]).verdict == UNKNOWN


def test_of_one_picture_nothing_is_known() -> None:
    found = Gallery({"p0": People(1).pictures(0, 1)}).calibration
    assert (found.refusal_rate, found.acceptance_rate, found.look_count) == (None, None, 0)


def test_gallery_without_pictures_is_refused() -> None:
    nobody: list[dict[str, list[PictureDescription]]] = [{}, {"p0": []}]
    for people in nobody:
        with pytest.raises(ValueError, match="without a picture"):
            Gallery(people)
