"""From looks to names: when one is decided, when it is taken back, and whose faces are looked at."""

from dataclasses import replace

import numpy as np
import pytest

from missions.plugins.testing.recorders import face
from perception.api import UNKNOWN, Box, Face, Frame, Gaze, Image
from perception.geometry import Pinhole
from perception.identity import (
    MAX_CONTRARY_LOOKS,
    MIN_CLEAR_LOOKS,
    MIN_LOOKS,
    FaceMatch,
    FaceNamer,
    NamedFaceSense,
    NameVotes,
    NullRecogniser,
)
from tests.perception.rendered import frame

ANNA, BEN, STRANGER = FaceMatch("Anna", 0.5), FaceMatch("Ben", 0.5), FaceMatch("Anna", -0.5)
FAINT = FaceMatch("Anna", 0.05)


def names(*looks: FaceMatch) -> list[str]:
    """Return the name after each look at one face."""
    votes = NameVotes()
    found = []
    for look in looks:
        votes.vote(7, look)
        found.append(votes.name(7))
    return found


@pytest.mark.parametrize(("look", "name"), [(ANNA, "Anna"), (STRANGER, UNKNOWN), (FaceMatch("", -1.0), UNKNOWN)])
def test_a_clear_name_is_decided_after_three_looks(look: FaceMatch, name: str) -> None:
    assert names(*[look] * 4) == ["", "", name, name]


def test_a_faint_one_is_decided_after_five() -> None:
    assert names(*[FAINT] * MIN_LOOKS) == [""] * (MIN_LOOKS - 1) + ["Anna"]


def test_ambiguous_face_stays_unknown() -> None:
    assert names(*[replace(FAINT, margin=0.0)] * 20)[-1] == UNKNOWN


def test_looks_at_several_people_make_a_stranger() -> None:
    assert names(ANNA, BEN, FaceMatch("Chidi", 0.5), ANNA, BEN, FaceMatch("Chidi", 0.5))[-1] == UNKNOWN


def test_a_name_is_taken_back_after_five_contrary_looks_in_a_row_and_not_before() -> None:
    begin = [ANNA] * MIN_CLEAR_LOOKS
    assert names(*begin, *[BEN] * MAX_CONTRARY_LOOKS)[-2:] == ["Anna", "Ben"]
    assert names(*begin, *[STRANGER] * MAX_CONTRARY_LOOKS)[-2:] == ["Anna", UNKNOWN]
    assert names(*begin, *([BEN] * (MAX_CONTRARY_LOOKS - 1) + [ANNA]) * 5)[-1] == "Anna"
    assert names(*[STRANGER] * MIN_CLEAR_LOOKS, *[ANNA] * MAX_CONTRARY_LOOKS)[-1] == "Anna"


def test_votes_are_per_face_and_dropped_with_the_face() -> None:
    votes = NameVotes()
    for _ in range(MIN_CLEAR_LOOKS):
        votes.vote(1, ANNA)
        votes.vote(2, BEN)
    assert (votes.name(1), votes.name(2), votes.name(3)) == ("Anna", "Ben", "")
    votes.keep_only([2])
    assert (votes.name(1), votes.name(2)) == ("", "Ben")


def placed(number: int, stamp: float) -> Face:
    return replace(face(stamp, number=number), box=Box(100.0 * number, 0.0, 40.0, 40.0))


def test_three_largest_faces_are_identified_at_the_interval() -> None:
    naming, asked = FaceNamer(interval=0.15), list[tuple[float, float]]()

    def look(stamp: float) -> None:
        faces = [placed(1, stamp - 0.1), *(placed(number, stamp) for number in (2, 3, 4, 5))]
        naming.name(faces, stamp, lambda box: asked.append((stamp, box.x)))

    for stamp in (1.0, 1.08, 1.16):
        look(stamp)
    assert asked == [(stamp, x) for stamp in (1.0, 1.16) for x in (200.0, 300.0, 400.0)]


def test_empty_look_does_not_count() -> None:
    naming = FaceNamer(interval=0.0)
    for number in range(10):
        (named,) = naming.name([placed(1, float(number))], float(number), lambda _: None)
        assert named.name == ""


class Seen:
    """A sense that sees one face in each picture."""

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Face, ...]:
        del camera, gaze
        return (placed(1, frame.stamp),)


class Bright:
    """Takes the face in a bright picture for Anna's."""

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        assert face == Box(100.0, 0.0, 40.0, 40.0)
        return ANNA if image.mean() > 128 else STRANGER


@pytest.mark.parametrize(("grey", "name"), [(200, "Anna"), (20, UNKNOWN)])
def test_the_sense_puts_names_on_faces(grey: int, name: str) -> None:
    sense = NamedFaceSense(Seen(), Bright())
    camera = Pinhole(640, 480, 1.0)
    image = np.full((480, 640, 3), grey, np.uint8)
    found = [sense.sense(frame(image, 0.2 * number), camera, None)[0].name for number in range(4)]
    assert found == ["", "", name, name]


def test_null_recogniser_knows_only_strangers() -> None:
    look = NullRecogniser().match(np.zeros((4, 4, 3), np.uint8), Box(0, 0, 2, 2))
    assert look is not None
    assert look.verdict == UNKNOWN
