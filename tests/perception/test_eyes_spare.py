"""Eyes that see nobody let pictures go by that would not be searched, and miss nobody by it."""

import itertools
from collections.abc import Iterator
from math import inf, radians
from threading import Event

import numpy as np
import pytest

from perception.api import Box, Detection, Frame, Gaze, Image, Thing
from perception.delay import CameraDelay
from perception.eyes import MAX_PICTURE_INTERVAL, Eyes, Vision
from perception.face_finder import LONG_EMPTY_SEARCH_INTERVAL, FaceFinder
from perception.geometry import Pinhole
from perception.image_preparation import GreyImage
from perception.senses import ActiveSenses, FaceSense, FrameSource, SightingSource
from perception.tracks import Tracker
from tests.perception.test_finder import Counting, wall
from tests.waiting import wait_until

RATE = 30.0

EAGER = 1
"""Frames that are searched one after the other at first: one for each kind of search."""


class Picture:
    def __init__(self, number: int, image: Image, rate: float) -> None:
        self.stamp = 5.0 + number / rate
        self.image = image


class Film:
    """A source of so many pictures of one wall, at a rate by their stamps; keeps those that were read."""

    def __init__(self, length: int, rate: float = RATE) -> None:
        self.length, self.rate = length, rate
        self.next = 0
        self.read_of: list[int] = []
        self.image = wall()

    def read(self, timeout: float) -> Picture | None:
        if self.next >= self.length:
            Event().wait(timeout)
            return None
        self.read_of.append(self.next)
        self.next += 1
        return Picture(self.read_of[-1], self.image, self.rate)


class Skippable(Film):
    """One that can let pictures go by."""

    def skip(self, pictures: int) -> None:
        self.next += pictures


class NoThings:
    """Looks for things, and sees none."""

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Thing, ...]:
        del frame, camera, gaze
        return ()


def nobody() -> Counting:
    detector = Counting()
    detector.blind = True
    return detector


class Looker:
    """Eyes on a film; ``seen`` are the numbers of the pictures that were searched for faces."""

    def __init__(
        self, film: FrameSource, finder: SightingSource, *, turning: bool = False, wanted: bool = False
    ) -> None:
        self.seen: list[int] = []
        self._turning = turning
        senses = ActiveSenses(faces=FaceSense(finder, Tracker()))
        if wanted:
            senses = ActiveSenses(senses.faces, things=NoThings())
        vision = Vision(
            self.gaze,
            field_of_view=radians(60),
            senses=senses,
            now=lambda: 0.0,
            delay=CameraDelay() if turning else None,
            on_frame=lambda frame, _: self.seen.append(round((frame.stamp - 5.0) * RATE)),
        )
        self.eyes = Eyes(film, vision)

    def gaze(self, stamp: float) -> Gaze:
        return Gaze(stamp if self._turning else 0.0, 0.0)


@pytest.fixture
def opened() -> Iterator[list[Eyes]]:
    """Eyes to close in the end."""
    eyes: list[Eyes] = []
    yield eyes
    for each in eyes:
        each.close()


def watch(looker: Looker, film: Film, opened: list[Eyes]) -> list[int]:
    """Have a film seen to its end; return the numbers of the pictures that were searched."""
    opened.append(looker.eyes)
    looker.eyes.open()
    wait_until(lambda: film.next >= film.length)
    looker.eyes.close()
    return looker.seen


def test_every_fourth_picture_is_read_in_an_empty_scene(opened: list[Eyes]) -> None:
    film = Skippable(EAGER + 8 * LONG_EMPTY_SEARCH_INTERVAL)
    seen = watch(Looker(film, FaceFinder(nobody())), film, opened)
    assert seen[:EAGER] == list(range(EAGER))
    later = seen[-6:]
    assert [after - before for before, after in itertools.pairwise(later)] == [4] * 5
    assert film.read_of == seen


def test_unskippable_source_is_read_without_extra_searches(opened: list[Eyes]) -> None:
    skippable, plain = Skippable(EAGER + 8 * LONG_EMPTY_SEARCH_INTERVAL), Film(EAGER + 8 * LONG_EMPTY_SEARCH_INTERVAL)
    seen = watch(Looker(skippable, FaceFinder(nobody())), skippable, opened)
    assert watch(Looker(plain, FaceFinder(nobody())), plain, opened) == seen
    assert plain.read_of == list(range(plain.length))


def test_skipped_pictures_miss_no_search(opened: list[Eyes]) -> None:
    shown, spared = nobody(), nobody()
    film = Skippable(EAGER + 8 * LONG_EMPTY_SEARCH_INTERVAL)
    watch(Looker(film, FaceFinder(spared)), film, opened)
    finder = FaceFinder(shown)
    for _ in range(film.length):
        finder.find(film.image)
    assert spared.whole == shown.whole


def test_of_a_slow_camera_every_picture_is_read(opened: list[Eyes]) -> None:
    film = Skippable(EAGER + 4 * LONG_EMPTY_SEARCH_INTERVAL, rate=0.9 / MAX_PICTURE_INTERVAL)
    watch(Looker(film, FaceFinder(nobody())), film, opened)
    assert film.read_of == list(range(film.length))


def test_no_picture_is_skipped_while_the_delay_is_learnt(opened: list[Eyes]) -> None:
    film = Skippable(EAGER + 4 * LONG_EMPTY_SEARCH_INTERVAL)
    watch(Looker(film, FaceFinder(nobody()), turning=True), film, opened)
    assert film.read_of == list(range(film.length))


def test_no_picture_is_skipped_while_objects_are_searched(opened: list[Eyes]) -> None:
    film = Skippable(EAGER + 4 * LONG_EMPTY_SEARCH_INTERVAL)
    watch(Looker(film, FaceFinder(nobody()), wanted=True), film, opened)
    assert film.read_of == list(range(film.length))


def test_scene_measurement_is_reused_for_0_2_seconds() -> None:
    vision = Looker(Film(0), FaceFinder(nobody())).eyes.vision
    vision.see(Picture(0, np.full((48, 64, 3), 10, np.uint8), 10.0))
    scenes = [vision.scene()]
    for number, level in enumerate((20, 30, 40), start=1):
        vision.see(Picture(number, np.full((48, 64, 3), level, np.uint8), 10.0))
        scenes.append(vision.scene())
    assert [scene and round(scene.brightness) for scene in scenes] == [10, 20, 20, 40]


class Walker:
    """Finds one face, wherever it has walked to: so many pixels to the right for each frame."""

    def __init__(self, step: float) -> None:
        self.step, self.number, self.searches = step, 0, 0

    @property
    def picture(self) -> Image:
        return np.asarray(np.roll(wall(), round(self.step * self.number), axis=1), np.uint8)

    def detect(
        self, image: Image | GreyImage, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> list[Detection]:
        del image, smallest, largest, roll
        self.searches += 1
        return [Detection(Box(100.0 + self.step * self.number, 200.0, 80.0, 80.0), 5.0)]

    def detect_near(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        del box, roll
        return self.detect(image)[0]

    def watched(self, frames: int, most: int) -> list[int]:
        """Have so many frames seen; return how many were spared after each that was."""
        finder, spared = FaceFinder(self), list[int]()
        while self.number < frames:
            finder.find(self.picture)
            spared.append(finder.skip_frames(most))
            self.number += 1 + spared[-1]
        return spared


def test_every_other_frame_of_a_still_face_is_skipped() -> None:
    plain, spared = Walker(0.0), Walker(0.0)
    assert set(plain.watched(120, 0)) == {0}
    found = spared.watched(120, 3)
    assert set(found) == {0, 1}
    assert found.count(1) > 40
    assert spared.searches == plain.searches


def test_no_frame_of_a_walking_face_is_skipped() -> None:
    assert set(Walker(5.0).watched(40, 3)) == {0}


def test_of_a_face_at_twenty_frames_a_second_none_is_spared() -> None:
    assert set(Walker(0.0).watched(40, 2)) == {0}
