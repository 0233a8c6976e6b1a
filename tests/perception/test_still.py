"""Pictures in which nothing is new are not searched again, as long as that is sure."""

import numpy as np
import pytest

from perception.api import Box, Detection, Image
from perception.face_finder import EMPTY_SEARCH_INTERVAL, LONG_EMPTY_SEARCH_INTERVAL, FaceFinder
from perception.face_search import ANY_FACE, MAX_SKIPPED_SEARCHES, FaceSearch, StillPictureDetector

SMALL = FaceSearch(largest=0.06)

NOISE = 5.0
"""Grey levels, one sigma: a webcam indoors."""


def room(seed: int = 0, *, light: float = 1.0) -> Image:
    """A picture of the same room each time, with noise of its own."""
    wall = np.random.default_rng(1).integers(40, 200, (30, 40)).repeat(16, 0).repeat(16, 1).astype(np.float64)
    noise = np.random.default_rng(seed + 100).normal(0.0, NOISE, wall.shape)
    return np.clip(light * wall + noise, 0, 255).astype(np.uint8)[:, :, None].repeat(3, 2)


def with_somebody(image: Image, *, brighter: float, size: int = 28) -> Image:
    """The same with the smallest face that is found."""
    seen = image.astype(np.float64)
    seen[200 : 200 + size, 300 : 300 + size] += brighter
    return np.clip(seen, 0, 255).astype(np.uint8)


def test_the_noise_of_a_camera_is_nothing_new() -> None:
    still = StillPictureDetector()
    assert not still.can_skip(room(0), ANY_FACE)
    assert all(still.can_skip(room(seed), ANY_FACE) for seed in range(1, 1 + MAX_SKIPPED_SEARCHES))


def test_now_and_then_a_search_is_made_all_the_same() -> None:
    still = StillPictureDetector()
    assert [still.can_skip(room(seed), ANY_FACE) for seed in range(2 * (MAX_SKIPPED_SEARCHES + 1))] == [
        False,
        *[True] * MAX_SKIPPED_SEARCHES,
    ] * 2


@pytest.mark.parametrize("light", [1.0, 0.1])
def test_the_smallest_face_is_something_new_also_in_the_dark(light: float) -> None:
    still = StillPictureDetector()
    still.can_skip(room(0, light=light), SMALL)
    assert not still.can_skip(with_somebody(room(1, light=light), brighter=60 * light), SMALL)


def test_search_kinds_keep_separate_pictures() -> None:
    still = StillPictureDetector()
    still.can_skip(room(0), ANY_FACE)
    assert not still.can_skip(room(1), SMALL)


def test_slow_change_is_detected_against_the_searched_picture() -> None:
    still = StillPictureDetector()
    still.can_skip(room(0), ANY_FACE)
    assert [still.can_skip(with_somebody(room(n), brighter=2.0 * n), ANY_FACE) for n in range(1, 4)][-1] is False


class Counting:
    """Finds nobody, and counts how often it was asked."""

    def __init__(self) -> None:
        self.searched = 0

    def detect(self, image: Image, **sizes: float) -> list[Detection]:
        del image, sizes
        self.searched += 1
        return []

    def detect_near(self, image: Image, box: Box, *, roll: float = 0.0) -> Detection | None:
        del image, box, roll
        raise AssertionError("nobody is known")


@pytest.mark.parametrize(("moving", "most"), [(False, 1 / MAX_SKIPPED_SEARCHES), (True, 1.0)])
def test_empty_room_is_searched_rarely_with_a_still_camera(moving: bool, most: float) -> None:
    detector, frames = Counting(), 40 * LONG_EMPTY_SEARCH_INTERVAL
    finder, rooms = FaceFinder(detector), [room(n) for n in range(17)]
    for n in range(frames):
        seen = rooms[n % len(rooms)]
        finder.find(np.roll(seen, 5 * n, axis=1) if moving else seen)
    searches = detector.searched - (LONG_EMPTY_SEARCH_INTERVAL // EMPTY_SEARCH_INTERVAL if moving else 1)
    assert searches <= frames / LONG_EMPTY_SEARCH_INTERVAL * most
    assert searches >= frames / LONG_EMPTY_SEARCH_INTERVAL * most * 0.7
