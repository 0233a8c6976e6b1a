"""Cameras that go on giving pictures, and yet are ill."""

from collections.abc import Callable, Iterator
from itertools import cycle, pairwise, repeat
from pathlib import Path
from queue import Queue
from threading import Event, Thread

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import DeviceStatus, Image
from drivers.camera.make import open_source
from drivers.clock import ManualClock
from drivers.pictures.capture import FROZEN_TIMEOUT, FreshnessMonitor, ThreadedCamera
from drivers.pictures.decode import SKIPPED_PICTURE
from tests.waiting import wait_until

STILL = np.random.default_rng(1).integers(90, 150, (48, 64, 3), dtype=np.uint8)


def noisy(seed: int, base: Image = STILL) -> Image:
    """A still scene as a camera sees it: every pixel off by a grey level or two."""
    noise = np.random.default_rng(seed).normal(0, 1.0, base.shape)
    return np.clip(np.rint(base + noise), 0, 255).astype(np.uint8)


class Watched:
    """A camera that is watched, on a clock of its own."""

    def __init__(self) -> None:
        self.notices: list[DeviceStatus] = []
        self.time = 0.0
        self.freshness = FreshnessMonitor("camera", self.notices.append)

    def show(self, pictures: Iterator[Image], seconds: float, *, rate: float = 20.0) -> None:
        for _ in range(round(seconds * rate)):
            self.freshness.check(next(pictures), self.time)
            self.time += 1 / rate

    def told(self) -> list[tuple[str, str]]:
        return [(notice.kind, notice.message) for notice in self.notices]


@pytest.fixture
def watched() -> Watched:
    return Watched()


def fresh() -> Iterator[Image]:
    return cycle(map(noisy, range(7)))


def test_still_scene_with_sensor_noise_is_fresh(watched: Watched) -> None:
    watched.show(fresh(), 8.0)
    assert watched.notices == []
    assert watched.freshness.problem == ("", "")


def test_frozen_camera_is_reported_once_with_a_hint_and_so_is_its_return(watched: Watched) -> None:
    watched.show(fresh(), 1.0)
    watched.show(repeat(STILL), FROZEN_TIMEOUT - 0.2)
    assert watched.notices == []
    watched.show(repeat(STILL), 5.0)
    assert watched.told() == [("fault", "camera: the same picture for 3 s")]
    assert "mission robot camera list" in watched.notices[0].hint
    assert watched.freshness.problem == ("camera: the same picture for 3 s", watched.notices[0].hint)
    watched.show(fresh(), 0.1)
    assert watched.told()[1:] == [("online", "camera: fresh pictures again")]
    watched.show(repeat(STILL), 5.0)
    assert [notice.kind for notice in watched.notices] == ["fault", "online", "fault"]


def test_covered_lens_is_not_frozen(watched: Watched) -> None:
    watched.show(repeat(np.zeros((48, 64, 3), np.uint8)), 8.0)
    assert watched.notices == []


def test_slow_pictures_are_reported_once_and_so_is_their_end(watched: Watched) -> None:
    watched.show(fresh(), 6.0, rate=3.0)
    watched.show(fresh(), 6.0, rate=2.0)
    assert watched.told() == [("fault", "camera: fewer than 4 pictures per second")]
    assert "light" in watched.notices[0].hint
    watched.show(fresh(), 5.0, rate=15.0)
    assert [notice.kind for notice in watched.notices] == ["fault", "online"]


@given(st.lists(st.floats(0.0, 0.2), min_size=50, max_size=80))
def test_any_rhythm_of_five_pictures_per_second_is_fast_enough(gaps: list[float]) -> None:
    watched, pictures = Watched(), fresh()
    for gap in gaps:
        watched.time += gap
        watched.freshness.check(next(pictures), watched.time)
    assert watched.notices == []


def test_freshness_restarts_after_a_disconnect(watched: Watched) -> None:
    watched.show(repeat(STILL), 5.0)
    watched.freshness.restart()
    assert watched.freshness.problem == ("", "")
    watched.time += 60.0
    watched.show(repeat(STILL), FROZEN_TIMEOUT - 0.2)
    assert [notice.kind for notice in watched.notices] == ["fault"]


class Live:
    """A live feed of what the test puts into its queue; None unplugs it."""

    source_name, hint = "/dev/eye", "plug it in"

    def __init__(self) -> None:
        self.pictures: Queue[Image | None] = Queue()

    def start(self, closing: Event) -> float | None:  # noqa: ARG002 - it waits for nothing
        return None

    def grab(self, skip_count: Callable[[], int]) -> Image | None:
        image = self.pictures.get()
        return SKIPPED_PICTURE if image is not None and skip_count() else image

    def stop(self) -> None:
        """Hold nothing that would have to be let go."""


def opened(feed: Live, clock: ManualClock, report: Callable[[DeviceStatus], None]) -> ThreadedCamera:
    camera = ThreadedCamera(lambda: feed, clock, name="eye", field_of_view=1.0, loop=True, retry=0.02, report=report)
    camera.open()
    return camera


def until_shown(camera: ThreadedCamera, count: int) -> None:
    wait_until(lambda: camera.health().counters["frames"] == count)


def test_frozen_live_camera_is_online_and_gives_the_reason() -> None:
    feed, clock, notices = Live(), ManualClock(), list[DeviceStatus]()
    camera = opened(feed, clock, notices.append)
    try:
        for count in range(1, 50):
            feed.pictures.put(STILL)
            until_shown(camera, count)
            clock.advance(0.1)
        wait_until(lambda: [notice.kind for notice in notices] == ["online", "fault"])
        health = camera.health()
        assert (health.online, health.detail) == (True, "eye: the same picture for 3 s")
        assert health.hint
    finally:
        feed.pictures.put(None)
        camera.close()


def test_silent_camera_is_reported_once_to_its_reader() -> None:
    feed, clock, notices = Live(), ManualClock(), list[DeviceStatus]()
    camera = opened(feed, clock, notices.append)
    try:
        feed.pictures.put(noisy(1))
        assert camera.read(60.0) is not None
        clock.advance(2.5)
        assert [camera.read(0.01) for _ in range(3)] == [None] * 3
        assert [(notice.kind, notice.message) for notice in notices[1:]] == [
            ("offline", "eye: /dev/eye: no picture for 2.5 s")
        ]
        feed.pictures.put(noisy(2))
        assert camera.read(60.0) is not None
        wait_until(lambda: [notice.kind for notice in notices] == ["online", "offline", "online"])
        assert camera.health().online
    finally:
        feed.pictures.put(None)
        camera.close()


@pytest.mark.real_time
def test_recording_may_be_still(tmp_path: Path) -> None:
    path, clock, notices = tmp_path / "still.png", ManualClock(), list[DeviceStatus]()
    cv2.imwrite(str(path), STILL)
    camera = open_source(path, clock, rate=10.0, report=notices.append)
    camera.open()
    try:
        stamps = []
        for _ in range(45):
            frame = camera.read(60.0)
            assert frame is not None
            stamps.append(frame.stamp)
            clock.advance(0.1)
        assert all(later > earlier for earlier, later in pairwise(stamps))
        assert stamps[-1] > FROZEN_TIMEOUT + 1
        assert [notice.kind for notice in notices] == ["online"]
    finally:
        camera.close()


class Counting(Live):
    """A live feed that counts what is decoded and what goes by."""

    def __init__(self) -> None:
        super().__init__()
        self.decoded = self.gone_by = 0

    def grab(self, skip_count: Callable[[], int]) -> Image | None:
        image = super().grab(skip_count)
        self.decoded += image is not None and image is not SKIPPED_PICTURE
        self.gone_by += image is SKIPPED_PICTURE
        return image


def test_unread_pictures_are_not_decoded_and_the_camera_stays_online() -> None:
    feed, clock = Counting(), ManualClock()
    camera = opened(feed, clock, lambda _: None)
    try:
        feed.pictures.put(STILL)
        wait_until(lambda: camera.read(0.1) is not None)
        clock.advance(5.0)
        decoded = feed.decoded
        feed.pictures.put(STILL)
        wait_until(lambda: feed.gone_by == 1)
        for _ in range(3):
            feed.pictures.put(STILL)
        wait_until(lambda: feed.gone_by == 4)
        assert feed.decoded == decoded
        assert camera.health().online
        assert camera.read(0.0) is None  # none of before
        feed.pictures.put(STILL)
        wait_until(lambda: camera.read(0.1) is not None)
    finally:
        feed.pictures.put(None)
        camera.close()


def test_reader_waiting_over_a_second_gets_the_next_picture() -> None:
    feed, clock = Counting(), ManualClock()
    camera = opened(feed, clock, lambda _: None)
    found = list[object]()
    reader = Thread(target=lambda: found.append(camera.read(60.0)))
    try:
        reader.start()
        wait_until(lambda: camera._capture is not None and camera._capture._condition._waiters)  # type: ignore[attr-defined]
        clock.advance(5.0)
        feed.pictures.put(STILL)
        reader.join(30.0)
        assert len(found) == feed.decoded == 1
    finally:
        feed.pictures.put(None)
        camera.close()
        reader.join()


def test_skipped_pictures_are_not_decoded_and_not_counted_as_slow() -> None:
    feed, clock, notices = Counting(), ManualClock(), list[DeviceStatus]()
    camera = opened(feed, clock, notices.append)
    try:
        for number in range(0, 60, 6):
            feed.pictures.put(noisy(number))
            wait_until(lambda: (frame := camera.read(0.1)) is not None and frame.number == number)  # noqa: B023
            camera.skip(5)
            for step in range(1, 6):
                clock.advance(0.1)
                feed.pictures.put(noisy(number + step))
                until_shown(camera, number + step + 1)
            clock.advance(0.1)
        health = camera.health()
        assert (feed.decoded, feed.gone_by) == (10, 50)
        assert (health.counters["dropped"], health.detail) == (0, "")
        assert [notice.kind for notice in notices] == ["online"]
    finally:
        feed.pictures.put(None)
        camera.close()


def test_closed_camera_skips_nothing() -> None:
    ThreadedCamera(Counting, ManualClock(), name="eye", field_of_view=1.0, loop=True, retry=1.0, report=print).skip(3)
