"""The pictures of a report: which are chosen, how large they are, and what is marked in them."""

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from missions.plugins.records.report.sightings import (
    MAX_PICTURE_WIDTH,
    choose_frames,
    spread_evenly,
    summarise_sightings,
)
from missions.plugins.records.report.summary import RecordStudy
from perception.annotate import INK
from perception.api import UNKNOWN, Box, Face, View


def test_picture_is_scaled_and_has_a_caption(found: RecordStudy) -> None:
    assert [picture.time for picture in found.pictures] == [1.0, 4.0, 5.0]
    for picture in found.pictures:
        image = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        assert image.shape == (picture.height, picture.width, 3) == (240, MAX_PICTURE_WIDTH, 3)
        assert picture.caption == "face 1, 1.5 m, 11° left"
        frame = image[25 : 25 + 30, 50].mean(axis=0)  # the left side of the box, at half its size
        assert np.abs(frame - INK).max() < 60


def test_followed_face_is_one_sighting_with_its_nearest_distance(found: RecordStudy) -> None:
    assert [(each.name, each.first, each.last, each.views, each.nearest) for each in found.sightings] == [
        ("face 1", 1.01, 5.01, 5, 1.5)
    ]


def test_named_people_are_one_sighting_each_with_a_count() -> None:
    def view(t: float, *seen: tuple[int, str]) -> tuple[float, View]:
        faces = tuple(Face(n, t, Box(0, 0, 9, 9), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0 - t / 10, who) for n, who in seen)
        return t, View(looked=t, faces=faces)

    known = [view(1, (1, ""), (2, "Ben")), view(2, (1, "Anna")), view(3, (1, ""))]
    found = summarise_sightings([*known, view(4, (3, "Anna"), (4, UNKNOWN)), view(5, (5, "Anna"))])
    assert [(each.name, each.count, each.views, each.first, each.last, each.nearest) for each in found] == [
        ("Anna", 3, 5, 1, 5, 1.5),
        ("Ben", 1, 1, 1, 1, 1.9),
        ("face 4", 1, 1, 4, 4, 1.6),
    ]
    assert [(each.person, each.face) for each in found] == [(True, False), (True, False), (False, True)]


def test_pictures_before_failures_are_chosen_first() -> None:
    stamps = [float(second) for second in range(100)]
    assert {41, 60} <= choose_frames(stamps, 10, [41.5, 60.0])
    assert choose_frames(stamps, 0, [41.5]) == set()
    assert choose_frames([], 10, [1.0]) == set()
    assert choose_frames(stamps, 3, [-1.0]) == {0, 50, 99}  # there was none before it


@given(
    st.lists(st.floats(0, 100), max_size=60, unique=True).map(sorted),
    st.integers(0, 20),
    st.lists(st.floats(0, 100), max_size=30),
)
def test_chosen_frames_fill_the_allowed_number(stamps: list[float], most: int, failures: list[float]) -> None:
    assert len(choose_frames(stamps, most, failures)) == min(most, len(stamps))


@given(st.integers(0, 500), st.integers(0, 100))
def test_even_numbers_are_different_and_have_both_ends(count: int, most: int) -> None:
    numbers = spread_evenly(count, most)
    assert len(set(numbers)) == len(numbers) == min(count, most)
    if min(count, most) > 1:
        assert (numbers[0], numbers[-1]) == (0, count - 1)
