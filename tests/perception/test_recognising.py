"""Who is it: drawn people and real ones, known and strangers; and which pictures may enrol somebody."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from perception.api import UNKNOWN, Box, Image
from perception.crops import face_in, portrait
from perception.faces import HaarFaces
from perception.identity import Look
from perception.people import FisherPeople, NotOneFace, enrol, fisher_people
from tests.benchmarks.identifying import Portraits, Rates, Shown, clips, drawn
from tests.perception.people_drawn import crowd, pictures


@pytest.fixture(scope="module")
def portraits() -> tuple[Portraits, Portraits]:
    """The six drawn people: near, where they are enrolled, and about twice as far, where they are asked for."""
    return drawn((1.1, 1.5), (2.0, 2.6), teach=2, each=2)


@pytest.fixture(scope="module")
def six(portraits: tuple[Portraits, Portraits]) -> Shown:
    return Shown(*portraits)


def rates(people: Shown, count: int) -> Rates:
    """Return how it goes over all choices of ``count`` known people."""
    found = Rates()
    for choice in people.choices(count):
        found += people.measure(choice)
    return found


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_however_few_are_known_they_are_recognised_from_afar_and_strangers_are_not(six: Shown, count: int) -> None:
    found = rates(six, count)
    assert found.accepted.of >= 20
    assert found.accepted.share <= 0.03
    assert found.faces.share <= 0.01
    assert found.wrong.hits == 0
    assert found.refused.share <= 0.2


def verdicts(people: FisherPeople, shown: Sequence[Image]) -> list[str]:
    looks: list[Look | None] = [people.look(each, face_in(each)) for each in shown]
    return [look.verdict for look in looks if look is not None]


def test_of_two_who_are_known_each_is_called_by_name_and_the_others_are_unknown(
    portraits: tuple[Portraits, Portraits],
) -> None:
    taught, asked = portraits
    people = fisher_people({name: taught[name] for name in ("dora", "ben")})
    for name in ("dora", "ben"):
        assert verdicts(people, asked[name]).count(name) >= len(asked[name]) - 1
    for name in ("chidi", "farah"):
        assert set(verdicts(people, asked[name])) == {UNKNOWN}


def test_people_in_films_are_recognised_a_second_later(footage: Path) -> None:
    people = Shown(*clips(footage, step=8))
    for count in (1, 2, 3):
        found = rates(people, count)
        assert found.accepted.share <= 0.03
        assert found.faces.share <= 0.01
        assert found.wrong.hits == 0
        assert found.refused.share <= 0.25


def test_a_picture_of_one_face_enrols_somebody(astronaut: Image) -> None:
    found = enrol(astronaut, HaarFaces())
    assert found.shape[0] < 200, "the face, and not the picture"


@pytest.mark.parametrize(
    ("image", "count", "says"),
    [
        (np.full((480, 640, 3), 120, np.uint8), 0, "there is no face in it"),
        (crowd("anna", "ben"), 2, "there are 2 faces in it"),
    ],
    ids=["nobody", "two"],
)
def test_a_picture_of_no_face_or_two_is_refused(image: Image, count: int, says: str) -> None:
    with pytest.raises(NotOneFace, match=says) as refused:
        enrol(image, HaarFaces())
    assert refused.value.found == count
    assert refused.value.hint


def test_a_box_that_shows_nothing_is_no_look() -> None:
    detector = HaarFaces()
    image = pictures("anna", (1.2,), each=1)[0]
    people = fisher_people({"anna": [portrait(image, detector.detect(image)[0].box)] * 3})
    assert people.look(image, Box(900, 900, 50, 50)) is None
