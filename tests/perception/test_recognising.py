"""Who is it: drawn people and real ones, known and strangers; and which pictures may enrol somebody."""

from collections.abc import Sequence
from functools import partial
from itertools import combinations, islice
from pathlib import Path

import numpy as np
import pytest

from perception.api import UNKNOWN, Box, Image
from perception.crops import make_portrait, portrait_face_box
from perception.eye_finder import EyeFinder
from perception.haar_faces import HaarFaceDetector
from perception.identity import FaceMatch
from perception.people import (
    MAX_PICTURES,
    MAX_VARIANTS,
    MIN_PICTURES,
    NotOneFaceError,
    PatchRecogniser,
    describe_portraits,
    enrol,
)
from tests.benchmarks.identifying import Asked, Rates, ask, rates
from tests.benchmarks.portraits import Portraits, clips, drawn, hundred
from tests.perception.people_drawn import crowd, pictures

CHOICES = 4
"""Choices of known people that are tried."""


@pytest.fixture(scope="module")
def portraits() -> tuple[Portraits, Portraits]:
    """The six drawn people: near, where they are enrolled, and about twice as far, where they are asked for."""
    return drawn((1.1, 1.3, 1.5), (2.0, 2.6), teach=1, each=2)


def measured(people: tuple[Portraits, Portraits], count: int, *, cohort: bool) -> Rates:
    """Return how it goes over some choices of ``count`` known people; with or without the others as a cohort."""
    taught, asked = people
    found = list[Asked]()
    for known in islice(combinations(sorted(taught), count), CHOICES):
        others = [taught[name] for name in taught if name not in known] if cohort else []
        found += ask(partial(PatchRecogniser, cohort=others), taught, asked, known)
    return rates(found)


def share(hits: tuple[int, int]) -> float:
    return hits[0] / hits[1]


@pytest.mark.parametrize(("count", "refused"), [(1, 0.1), (2, 0.1), (3, 0.2), (5, 0.45)])
def test_few_known_people_are_recognised_and_strangers_are_not(
    portraits: tuple[Portraits, Portraits], count: int, refused: float
) -> None:
    found = measured(portraits, count, cohort=True)
    assert found.accepted[1] >= 16
    assert share(found.accepted) <= 0.05
    assert found.wrong[0] == 0
    assert share(found.refused) <= refused


def test_faces_of_real_people_are_not_taken_for_drawn_ones(portraits: tuple[Portraits, Portraits]) -> None:
    taught, _ = portraits
    found = rates(ask(PatchRecogniser, taught, hundred(), sorted(taught)))
    assert found.accepted[1] == 100
    assert share(found.accepted) <= 0.02


def verdicts(people: PatchRecogniser, shown: Sequence[Image]) -> list[str]:
    looks: list[FaceMatch | None] = [people.match(each, portrait_face_box(each)) for each in shown]
    return [look.verdict for look in looks if look is not None]


def test_two_known_people_are_named_and_others_unknown(
    portraits: tuple[Portraits, Portraits],
) -> None:
    taught, asked = portraits
    people = PatchRecogniser({name: taught[name] for name in ("dora", "ben")}, [taught["chidi"], taught["farah"]])
    for name in ("dora", "ben"):
        assert verdicts(people, asked[name]).count(name) >= len(asked[name]) - 1
    for name in ("chidi", "farah"):
        assert set(verdicts(people, asked[name])) == {UNKNOWN}


def test_people_in_films_are_recognised_a_second_later(footage: Path) -> None:
    people = clips(footage, step=8)
    for count in (1, 2):
        found = measured(people, count, cohort=False)
        assert share(found.accepted) <= 0.05
        assert found.wrong[0] == 0
        assert share(found.refused) <= 0.25


def test_of_many_portraits_some_are_compared_spread_over_all_and_of_few_all_variants() -> None:
    shown = [np.full((100, 100, 3), grey, np.uint8) for grey in range(100)]
    eyes = EyeFinder()
    for count, each in (
        (MIN_PICTURES, 2),
        (10, 2),
        (20, 1),
        (100, 1),
    ):  # nobody has eyes: by the box, and in the mirror
        found = describe_portraits(shown[:count], MAX_PICTURES, eyes)
        assert [len(picture.templates) for picture in found] == [each] * min(count, MAX_PICTURES)


def test_face_with_detected_eyes_has_an_upright_view(astronaut: Image) -> None:
    eyes = EyeFinder()
    (picture,) = describe_portraits([enrol(astronaut, HaarFaceDetector())], MAX_PICTURES, eyes)
    assert (len(picture.views), len(picture.templates)) == (2, MAX_VARIANTS)


def test_enrol_keeps_only_the_face(astronaut: Image) -> None:
    found = enrol(astronaut, HaarFaceDetector())
    assert found.shape[0] < 200, "the face, and not the picture"


@pytest.mark.parametrize(
    ("image", "count", "says"),
    [
        (np.full((480, 640, 3), 120, np.uint8), 0, "it shows no face"),
        (crowd("anna", "ben"), 2, "there are 2 faces in it"),
    ],
    ids=["nobody", "two"],
)
def test_a_picture_of_no_face_or_two_is_refused(image: Image, count: int, says: str) -> None:
    with pytest.raises(NotOneFaceError, match=says) as refused:
        enrol(image, HaarFaceDetector())
    assert refused.value.face_count == count
    assert refused.value.hint


def test_empty_box_gives_no_look() -> None:
    detector = HaarFaceDetector()
    image = pictures("anna", (1.2,), each=1)[0]
    people = PatchRecogniser({"anna": [make_portrait(image, detector.detect(image)[0].box)] * 3})
    assert people.match(image, Box(900, 900, 50, 50)) is None
