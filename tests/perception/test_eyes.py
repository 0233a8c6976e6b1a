"""The thread that looks."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import radians
from queue import Empty, SimpleQueue
from threading import Event, active_count
from typing import Any

import numpy as np
import pytest

from perception.api import Box, Detection, Face, Gaze, Image, Sight, View
from perception.eyes import Eyes, Vision, VisionEffort
from perception.senses import ActiveSenses, FaceSense
from perception.tracks import FaceSighting, Tracker

PICTURE_TIMEOUT = 10.0


@dataclass(frozen=True)
class Picture:
    stamp: float
    image: Image = field(default_factory=lambda: np.zeros((480, 640, 3), dtype=np.uint8))


class Source:
    """Gives the frames, or raises the errors, that a test puts in."""

    def __init__(self) -> None:
        self.queue: SimpleQueue[Picture | Exception] = SimpleQueue()

    def read(self, timeout: float) -> Picture | None:
        try:
            item = self.queue.get(timeout=timeout)
        except Empty:
            return None
        if isinstance(item, Exception):
            raise item
        return item


class Middle:
    """Finds a face in the middle of each picture; fails on pictures that are all white."""

    def find(self, image: Image) -> list[FaceSighting]:
        if image[0, 0, 0] == 255:
            raise RuntimeError("too bright")
        return [FaceSighting(Detection(Box(280, 200, 80, 80), 5.0), found=True)]


def until(true: Callable[[], object]) -> None:
    """Wait for the eyes' thread to make it so."""
    for _ in range(int(PICTURE_TIMEOUT / 0.01)):
        if true():
            return
        Event().wait(0.01)
    pytest.fail("it did not happen in time")


WHITE = np.full((480, 640, 3), 255, dtype=np.uint8)


class Watch:
    """What the eyes told, in order."""

    def __init__(self) -> None:
        self.source = Source()
        self.percepts: list[tuple[float, tuple[Face, ...]]] = []
        self.troubles: list[Exception] = []
        self.changes = 0
        self.asked: list[float] = []
        self.time = 0.0

    def now(self) -> float:
        self.time += 0.5
        return self.time

    def gaze(self, stamp: float) -> Gaze | None:
        self.asked.append(stamp)
        return Gaze(1.0, 0.0)

    def change(self) -> None:
        self.changes += 1

    def eyes(self, **others: Any) -> Eyes:
        settings: dict[str, Any] = {
            "field_of_view": radians(60),
            "senses": ActiveSenses(faces=FaceSense(Middle(), Tracker())),
            "now": self.now,
            "changed": self.change,
            "on_view": lambda view: self.percepts.append((view.looked, view.faces)),
            "on_trouble": self.troubles.append,
        }
        return Eyes(self.source, Vision(self.gaze, **settings | others))


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def eyes(watch: Watch) -> Iterator[Eyes]:
    eyes = watch.eyes()
    yield eyes
    eyes.close()


def test_before_the_first_frame_nothing_was_looked_at(eyes: Eyes) -> None:
    sight: Sight = eyes.vision
    assert sight.looked() is None
    assert sight.faces() == ()


def test_faces_come_with_the_gaze_at_the_time_of_their_frame(eyes: Eyes, watch: Watch) -> None:
    eyes.open()
    for stamp in (3.0, 3.1):
        watch.source.queue.put(Picture(stamp))
    until(lambda: eyes.looked() == 3.1)
    (face,) = eyes.vision.faces()
    assert watch.asked == [3.0, 3.1]
    assert face.stamp == 3.1
    assert face.yaw == pytest.approx(1.0)


def test_each_frame_calls_back_and_notifies(eyes: Eyes, watch: Watch) -> None:
    eyes.open()
    for stamp in (3.0, 3.1):
        watch.source.queue.put(Picture(stamp))
    until(lambda: watch.changes == 2)
    assert watch.percepts == [(3.0, ()), (3.1, eyes.vision.faces())]


def test_the_effort_is_counted_on_the_clock_handed_in(eyes: Eyes, watch: Watch) -> None:
    eyes.open()
    for stamp in (1.0, 2.0, 3.0):
        watch.source.queue.put(Picture(stamp))
    until(lambda: watch.changes == 3)
    assert eyes.vision.effort == VisionEffort(frames=3, failed=0, seconds=1.5)


def test_a_failing_detector_is_reported_once_and_does_not_blind_the_robot(eyes: Eyes, watch: Watch) -> None:
    eyes.open()
    for stamp in (1.0, 1.1):
        watch.source.queue.put(Picture(stamp, WHITE))
    until(lambda: eyes.vision.effort.failed == 2)
    assert str(eyes.vision.last_error) == "too bright"
    assert [str(trouble) for trouble in watch.troubles] == ["too bright"]
    watch.source.queue.put(Picture(1.2))
    until(lambda: eyes.looked() == 1.2)
    until(lambda: eyes.vision.last_error is None)


def test_a_failing_camera_is_reported_and_read_again(eyes: Eyes, watch: Watch) -> None:
    eyes.open()
    watch.source.queue.put(OSError("camera: unplugged"))
    watch.source.queue.put(Picture(5.0))
    until(lambda: eyes.looked() == 5.0)
    assert [str(trouble) for trouble in watch.troubles] == ["camera: unplugged"]


def test_failing_callback_does_not_stop_the_eyes(watch: Watch) -> None:
    def fail(*_: object) -> None:
        raise ValueError("the listener is ill")

    eyes = watch.eyes(on_view=fail, on_trouble=fail)
    eyes.open()
    try:
        watch.source.queue.put(Picture(5.0))
        watch.source.queue.put(Picture(5.1))
        until(lambda: eyes.looked() == 5.1)
        until(lambda: eyes.vision.effort.failed == 2)
        assert str(eyes.vision.last_error) == "the listener is ill"
    finally:
        eyes.close()


def test_opening_and_closing_twice_leaves_no_thread(watch: Watch) -> None:
    before, eyes = active_count(), watch.eyes()
    eyes.close()
    eyes.open()
    eyes.open()
    assert active_count() == before + 1
    eyes.close()
    eyes.close()
    assert active_count() == before


def test_closed_eyes_can_be_opened_again(eyes: Eyes, watch: Watch) -> None:
    eyes.open()
    eyes.close()
    eyes.open()
    watch.source.queue.put(Picture(8.0))
    until(lambda: eyes.looked() == 8.0)


def test_scene_is_measured_from_the_first_request_on(watch: Watch) -> None:
    views: list[View] = []
    vision = watch.eyes(on_view=views.append).vision
    vision.see(Picture(1.0))
    assert [view.scene for view in views] == [None]
    assert [scene.stamp for _ in range(2) if (scene := vision.scene())] == [1.0, 1.0]
    vision.see(Picture(2.0))
    assert [view.scene.stamp for view in views if view.scene] == [2.0]


def test_scene_has_the_stamp_of_its_frame(eyes: Eyes, watch: Watch) -> None:
    assert eyes.vision.scene() is None
    eyes.open()
    watch.source.queue.put(Picture(3.0, np.full((480, 640, 3), 40, dtype=np.uint8)))
    until(lambda: eyes.looked() == 3.0)
    scene = eyes.vision.scene()
    assert scene is not None
    assert (scene.stamp, scene.brightness, scene.contrast) == (3.0, 40.0, 0.0)
