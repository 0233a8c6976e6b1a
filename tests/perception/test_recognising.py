"""Who is it: drawn people and real ones, known and strangers; and which pictures may enrol somebody."""

from pathlib import Path

import numpy as np
import pytest

from perception.api import UNKNOWN, Box, Image
from perception.crops import face_in, portrait
from perception.faces import HaarFaces
from perception.people import NotOneFace, enrol, fisher_people
from tests.benchmarks.identifying import clips, drawn, measure
from tests.perception.people_drawn import crowd, pictures


def test_drawn_people_are_recognised_from_twice_as_far_and_strangers_are_not() -> None:
    rates = measure(*drawn(each=2))
    assert rates.nearest.share >= 0.95
    assert rates.refused.share <= 0.15
    assert rates.accepted.share <= 0.05
    assert rates.voted_refused.share <= 0.15
    assert rates.voted_accepted.share <= 0.05
    assert rates.faces.share <= 0.05


def test_one_person_alone_is_not_everybody() -> None:
    taught, asked = drawn(("dora", "ben", "emil"), each=2)
    people = fisher_people({"dora": taught["dora"]})
    looks = {name: [people.look(each, face_in(each)) for each in each_asked] for name, each_asked in asked.items()}
    names = {name: [look.verdict for look in found if look is not None] for name, found in looks.items()}
    assert names["dora"].count("dora") >= 0.8 * len(names["dora"])
    assert [*names["ben"], *names["emil"]].count(UNKNOWN) >= 0.9 * len([*names["ben"], *names["emil"]])


def test_people_in_films_are_recognised_a_second_later(footage: Path) -> None:
    rates = measure(*clips(footage, step=3))
    assert rates.nearest.share >= 0.95
    assert rates.refused.share <= 0.12
    assert rates.accepted.share <= 0.08


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
