"""Finding faces over time: a real face on a textured wall, and a detector that keeps count."""

from collections.abc import Sequence
from math import cos, inf, pi, radians
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from perception import face_finder as known
from perception.api import Box, Detection, Face, Image
from perception.face_finder import MAX_ASIDE_SEARCHES, FaceFinder, track_box
from perception.face_search import ANY_FACE
from perception.geometry import Pinhole
from perception.haar_faces import HaarFaceDetector
from perception.image_preparation import GreyImage
from perception.tracks import FaceSighting, Tracker

if TYPE_CHECKING:
    from tests.perception.conftest import Scene

CAMERA = Pinhole(640, 480, radians(60))


class Counting:
    """The real detector; it counts its searches, and can be told to see nothing, or a ghost."""

    def __init__(self) -> None:
        self._haar = HaarFaceDetector()
        self.blind = False
        self.ghost: Detection | None = None
        self.whole = 0
        self.regions = 0

    def detect(
        self, image: Image | GreyImage, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> Sequence[Detection]:
        self.whole += 1
        if self.ghost is not None:
            return [self.ghost]
        return [] if self.blind else self._haar.detect(image, smallest=smallest, largest=largest, roll=roll)

    def detect_near(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        self.regions += 1
        return None if self.blind else self._haar.detect_near(image, box, roll=roll)


def wall() -> Image:
    return np.random.default_rng(2).integers(90, 150, (480, 640, 3), dtype=np.uint8)


def test_a_walking_face_is_covered_in_every_frame(scene: "Scene") -> None:
    detector, sizes = Counting(), (0.8, 1.2)
    finder = FaceFinder(detector)
    for step in range(60):
        turn = 2 * pi * step / 60
        picture, (true,) = scene((320 - 180 * cos(turn), 240), size=sizes[0] + (sizes[1] - sizes[0]) * step / 60)
        (sighting,) = finder.find(picture)
        assert sighting.detection.box.overlap(true) > 0.5, step
    assert detector.whole == 4  # for others: in the next frame, after 4 more and after 16 more
    assert detector.regions <= 12


def test_searches_become_rarer_and_faces_are_carried_between(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector(), confirm_interval=4)
    found = [finder.find(scene((200 + 4 * step, 240))[0])[0].found for step in range(10)]
    assert found == [True, True, False, True, False, True, False, False, False, True]


def test_a_jump_in_the_film_finds_the_face_again_at_once(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector())
    for _ in range(4):
        finder.find(scene((120, 120))[0])
    picture, (true,) = scene((500, 330))
    (sighting,) = finder.find(picture)
    assert sighting.found
    assert sighting.detection.box.overlap(true) > 0.5


def test_departed_face_is_gone_in_the_same_frame(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector())
    for _ in range(4):
        finder.find(scene((320, 240))[0])
    assert finder.find(wall()) == []


def test_averted_face_is_carried_for_a_while(scene: "Scene") -> None:
    detector = Counting()
    finder = FaceFinder(detector, confirm_interval=3, max_misses=2)
    picture, _ = scene((320, 240))
    for _ in range(2):
        finder.find(picture)
    detector.blind = True
    assert [len(finder.find(picture)) for _ in range(8)] == [1, 1, 1, 1, 1, 1, 0, 0]


def test_a_ghost_lasts_for_one_frame(scene: "Scene") -> None:
    detector = Counting()
    finder = FaceFinder(detector)
    detector.ghost = Detection(Box(60, 60, 80, 80), 1.0)
    picture, (true,) = scene((420, 300))
    assert [sighting.detection for sighting in finder.find(picture)] == [detector.ghost]
    detector.ghost = None
    (sighting,) = finder.find(picture)
    assert sighting.detection.box.overlap(true) > 0.5


class Doubtful(Counting):
    """A detector that sees a ghost in one place in each frame; its witnesses say what a test tells them to."""

    newcomer_interval = 40
    search_plan = (ANY_FACE,)
    quick_search = ANY_FACE
    said = costly = False

    def detect_near(self, _: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        return self.ghost or Detection(box, 1.0, roll)

    def is_confirmed(self, _: Image | GreyImage, box: Box, *, roll: float = 0.0) -> bool:
        return self.said and box.width > 0 and roll == 0.0

    def is_expensive(self, _: Image | GreyImage) -> bool:
        return self.costly

    def detect_leaning(self, *_: object) -> tuple[Detection, ...]:
        return ()

    def is_turned_aside(self, *_: object) -> bool:
        return False


def haunted() -> Doubtful:
    detector = Doubtful()
    detector.ghost = Detection(Box(60, 60, 80, 80), 1.0)
    return detector


def test_unconfirmed_detection_is_never_reported() -> None:
    detector, tracker = haunted(), Tracker[Face]()
    finder, picture, told = FaceFinder(detector), wall(), 0
    for step in range(60):
        seen = finder.find(picture)
        assert not any(sighting.found for sighting in seen)
        told += len(tracker.update(seen, camera=CAMERA, gaze=None, stamp=step / 20))
    assert told == 0


def test_confirmed_face_is_reported_in_the_second_frame() -> None:
    detector, tracker = haunted(), Tracker[Face]()
    detector.said = True
    finder, picture = FaceFinder(detector), wall()
    told = [len(tracker.update(finder.find(picture), camera=CAMERA, gaze=None, stamp=step / 20)) for step in range(3)]
    assert told == [0, 1, 1]


def test_accidental_confirmation_is_outvoted() -> None:
    detector = haunted()
    detector.said = True
    finder, picture = FaceFinder(detector), wall()
    assert [sighting.found for sighting in finder.find(picture)] == [True]
    detector.said = False
    assert not any(sighting.found for _ in range(30) for sighting in finder.find(picture))


def test_longer_confirmed_face_is_carried_longer(scene: "Scene") -> None:
    picture, _ = scene((320, 240))
    carried = []
    for frames in (1, 4):
        detector = Counting()
        finder = FaceFinder(detector, confirm_interval=1)
        for _ in range(frames):
            finder.find(picture)
        detector.blind = True
        carried.append(sum(bool(finder.find(picture)) for _ in range(30)))
    assert carried == [0, 10]


def test_search_effort_falls_to_an_eighth_in_an_empty_scene(scene: "Scene") -> None:
    detector = Counting()
    finder = FaceFinder(detector)
    empty = wall()
    for n in range(73):
        finder.find(np.roll(empty, 5 * n, axis=1))  # a camera that turns
    assert detector.whole == 12
    picture, _ = scene((320, 240))
    assert [len(finder.find(picture)) for _ in range(16)][-1] == 1
    before = detector.whole
    for _ in range(4):
        finder.find(empty)
    assert detector.whole >= before + 4


def test_turning_head_is_found_soon(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector())
    empty, (picture, _) = wall(), scene((320, 240))
    assert not any(finder.find(np.roll(empty, 5 * n, axis=1)) for n in range(4))
    assert [len(finder.find(picture)) for _ in range(3)][-1] == 1


def test_costly_searches_are_half_as_frequent_in_an_empty_scene() -> None:
    detector = Doubtful()
    detector.blind = detector.costly = True
    finder, empty = FaceFinder(detector), wall()
    for n in range(73):
        finder.find(np.roll(empty, 5 * n, axis=1))
    assert detector.whole == 5


def test_near_and_far_faces_are_both_found_by_the_second_frame(scene: "Scene") -> None:
    near, _ = scene((150, 240))
    far, _ = scene((500, 240), size=0.4)
    near[:, 330:] = far[:, 330:]
    finder = FaceFinder(HaarFaceDetector())
    assert [len(finder.find(near)) for _ in range(2)][-1] == 2


def test_newcomer_is_found_while_another_face_is_tracked(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector(), newcomer_interval=6)
    for _ in range(3):
        assert len(finder.find(scene((150, 240))[0])) == 1
    picture, (old, new) = scene((150, 240), (480, 260))
    counts = [len(finder.find(picture)) for _ in range(12)]
    assert counts[-1] == 2
    boxes = [sighting.detection.box for sighting in finder.find(picture)]
    assert all(max(box.overlap(true) for box in boxes) > 0.5 for true in (old, new))


def test_meeting_faces_do_not_leave_two_boxes_on_one_face(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector())
    for x in range(0, 161, 8):
        seen = finder.find(scene((160 + x, 240), (480 - x, 240))[0])
        assert x > 100 or len(seen) == 2
    for _ in range(15):
        seen = finder.find(scene((320, 240))[0])
    assert len(seen) == 1


def test_three_walking_faces_are_covered_with_less_flow_for_small_ones(
    scene: "Scene", monkeypatch: pytest.MonkeyPatch
) -> None:
    carried: list[float] = []

    def count(before: Image, after: Image, box: Box) -> Box | None:
        carried.append(box.width)
        return track_box(before, after, box)

    monkeypatch.setattr(known, "track_box", count)
    finder = FaceFinder(Counting())
    for step in range(40):
        places = [(100 + 4 * step, 120), (540 - 4 * step, 240), (100 + 4 * step, 360)]
        seen = finder.find(scene(*places)[0])
        for true in scene(*places)[1] if step > 1 else ():
            assert max(each.detection.box.overlap(true) for each in seen) > 0.5, step
    assert len(carried) < 0.8 * 3 * 39


def test_whole_picture_search_replaces_searches_of_known_faces(scene: "Scene") -> None:
    detector = Counting()
    finder = FaceFinder(detector, confirm_interval=3, newcomer_interval=3)
    picture, _ = scene((150, 240), (480, 260))
    for _ in range(60):
        assert len(finder.find(picture)) <= 2
    assert detector.regions < detector.whole


def test_changed_picture_size_restarts_the_finder(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector())
    picture, _ = scene((320, 240))
    finder.find(picture)
    half = np.ascontiguousarray(picture[::2, ::2])
    (sighting,) = finder.find(half)
    assert sighting.detection.box.centre == pytest.approx((160, 120), abs=8)


@pytest.mark.parametrize("size", [0.4, 1.0])
def test_near_or_far_a_face_is_found_by_the_second_frame(scene: "Scene", size: float) -> None:
    finder = FaceFinder(HaarFaceDetector())
    seen: list[FaceSighting] = []
    for _ in range(2):
        picture, (true,) = scene((320, 240), size=size)
        seen = finder.find(picture)
    assert [sighting.detection.box.overlap(true) > 0.5 for sighting in seen] == [True]


def test_small_face_is_carried_through_a_pan(scene: "Scene") -> None:
    detector = Counting()
    finder = FaceFinder(detector)
    for step in range(12):
        picture, (true,) = scene((100 + 32 * step, 240), size=0.4)
        seen = finder.find(picture)
        if step > 1:
            assert [sighting.detection.box.overlap(true) > 0.4 for sighting in seen] == [True], step
    assert detector.regions <= 11


def test_malformed_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="picture: expected"):
        FaceFinder(HaarFaceDetector()).find(np.zeros((4, 4, 4), dtype=np.uint8))


def test_after_a_reset_nothing_is_remembered(scene: "Scene") -> None:
    detector = Counting()
    finder = FaceFinder(detector)
    finder.find(scene((320, 240))[0])
    finder.reset()
    detector.blind = True
    assert finder.find(scene((320, 240))[0]) == []


def leaning(picture: Image, degrees: float) -> Image:
    """The same, turned to the right about the middle."""
    move = cv2.getRotationMatrix2D((320, 240), -degrees, 1.0)
    return np.asarray(cv2.warpAffine(picture, move, (640, 480), borderMode=cv2.BORDER_REPLICATE), np.uint8)


@pytest.mark.parametrize("degrees", [-30, -15, 15, 30])
def test_leaning_head_is_found_within_four_frames(scene: "Scene", degrees: float) -> None:
    finder = FaceFinder(HaarFaceDetector())
    picture, (true,) = scene((320, 240))
    seen = [finder.find(leaning(picture, degrees)) for _ in range(4)][-1]
    assert [sighting.detection.box.overlap(true) > 0.5 for sighting in seen if sighting.found] == [True]


def test_increasingly_leaning_head_is_tracked(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector())
    picture, (true,) = scene((320, 240))
    for step in range(60):
        seen = finder.find(leaning(picture, 0.5 * step))
        assert [sighting.detection.box.overlap(true) > 0.4 for sighting in seen] == [True], step
    assert seen[0].detection.roll == pytest.approx(radians(22))


class Sideways(Doubtful):
    """A detector whose face turns to one side."""

    turned = False
    asked = 0

    def detect_near(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        return None if self.turned else super().detect_near(image, box, roll=roll)

    def is_turned_aside(self, *_: object) -> bool:
        self.asked += 1
        return True


def test_face_in_profile_is_carried_but_not_found(scene: "Scene") -> None:
    picture, (true,) = scene((320, 240))
    detector = Sideways()
    detector.ghost, detector.said = Detection(true, 1.0), True
    finder = FaceFinder(detector, confirm_interval=2)
    for _ in range(8):
        finder.find(picture)
    detector.turned, detector.blind, detector.ghost = True, True, None
    seen = [finder.find(picture) for _ in range(60)]
    assert [len(each) for each in seen[:30]] == [1] * 30
    assert detector.asked == MAX_ASIDE_SEARCHES
    assert not any(sighting.found for each in seen for sighting in each)
    assert seen[-1] == []


def test_second_newcomer_is_found_soon(scene: "Scene") -> None:
    finder = FaceFinder(HaarFaceDetector())
    finder.find(scene((150, 240))[0])
    both, _ = scene((150, 240), (480, 260))
    assert [len(finder.find(both)) for _ in range(5)][-1] == 2
