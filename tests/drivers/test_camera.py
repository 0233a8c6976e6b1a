"""Cameras over OpenCV: videos, pictures and devices that are absent, break off or hang."""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from queue import Queue
from threading import Event, Thread
from threading import enumerate as threads
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.api import Camera, CameraFrame, DeviceStatus, Image
from drivers.camera.make import open_source
from drivers.camera.picture_files import iter_pictures
from drivers.camera.source import Source, SourceKind, source_kind
from drivers.clock import Clock, ManualClock, SystemClock
from drivers.errors import BadRequest, NotConnected
from drivers.pictures.capture import CaptureThread, ThreadedCamera
from drivers.pictures.decode import SKIPPED_PICTURE
from tests.waiting import wait_until


def grey(level: int) -> Image:
    return np.full((48, 64, 3), level, np.uint8)


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Five pictures at 10 a second, of brightness 20, 60, 100, 140, 180."""
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 48))
    for number in range(5):
        writer.write(grey(20 + 40 * number))
    writer.release()
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "stills"
    path.mkdir()
    for name, level in (("b.png", 150), ("a.jpg", 50)):
        cv2.imwrite(str(path / name), grey(level))
    (path / "notes.txt").write_text("no picture")
    return path


def until_shown(camera: Camera, count: int) -> None:
    wait_until(lambda: camera.health().counters["frames"] == count)


Opener = Callable[[Camera], Camera]


@pytest.fixture
def opened() -> Iterator[Opener]:
    """Open cameras, and close them after the test."""
    cameras: list[Camera] = []

    def open_it(camera: Camera) -> Camera:
        cameras.append(camera)
        camera.open()
        return camera

    yield open_it
    for camera in cameras:
        camera.close()
        camera.close()
    wait_until(lambda: not any(thread.name.startswith("camera") for thread in threads()))


def play(camera: Camera, clock: ManualClock, count: int, step: float) -> list[CameraFrame]:
    """Read ``count`` frames, moving the clock on by ``step`` seconds after each."""
    frames = []
    for _ in range(count):
        frame = camera.read(60.0)
        assert frame is not None, camera.health()
        frames.append(frame)
        clock.advance(step)
    return frames


def levels(frames: list[CameraFrame]) -> list[int]:
    return [round(float(frame.image.mean()) / 10) * 10 for frame in frames]


def test_video_plays_at_its_own_rate_and_repeats(video: Path, opened: Opener) -> None:
    clock = ManualClock(start=7.0)
    frames = play(opened(open_source(video, clock)), clock, 7, 0.1)
    assert levels(frames) == [20, 60, 100, 140, 180, 20, 60]
    assert [frame.number for frame in frames] == list(range(7))
    assert [frame.stamp for frame in frames] == pytest.approx([7.0 + 0.1 * number for number in range(7)])


def test_no_frame_arrives_while_the_clock_stands_still(video: Path, opened: Opener) -> None:
    camera = opened(open_source(video, ManualClock()))
    assert camera.read(60.0) is not None
    assert camera.read(0.05) is None


def test_video_without_loop_reports_its_end(video: Path, opened: Opener) -> None:
    clock, notices = ManualClock(), Queue[DeviceStatus]()
    camera = opened(open_source(video, clock, loop=False, report=notices.put))
    play(camera, clock, 5, 0.1)
    wait_until(lambda: "has ended after 5 pictures" in camera.health().detail)
    assert camera.read(0.02) is None
    assert [notices.get(timeout=5).kind for _ in range(2)] == ["online", "offline"]


def test_late_reader_gets_the_newest_frame_and_the_rest_is_dropped(video: Path, opened: Opener) -> None:
    clock = ManualClock()
    camera = opened(open_source(video, clock))
    assert camera.read(60.0) is not None
    for count in (2, 3, 4):
        clock.advance(0.1)
        until_shown(camera, count)
    newest = camera.read(60.0)
    assert newest is not None
    assert (newest.number, levels([newest])) == (3, [140])
    assert camera.health().counters["dropped"] == 2


def test_absent_file_is_named_and_found_when_it_appears(video: Path, tmp_path: Path, opened: Opener) -> None:
    path = tmp_path / "later.avi"
    camera = opened(open_source(path, SystemClock(), retry=0.02))
    wait_until(lambda: f"{path}: no such file" in camera.health().detail)
    assert camera.health().hint == f"`ls {tmp_path}` lists what is there"
    assert camera.read(0.0) is None
    video.rename(path)
    assert camera.read(60.0) is not None
    assert camera.health().online


def test_file_that_is_not_a_video_is_named(tmp_path: Path, opened: Opener) -> None:
    path = tmp_path / "broken.avi"
    path.write_bytes(b"this was never a video" * 50)
    camera = opened(open_source(path, SystemClock(), retry=0.02))
    wait_until(lambda: f"{path}: cannot be opened as a video" in camera.health().detail)
    assert "ffprobe" in camera.health().hint


@pytest.mark.parametrize("source", [97, "97", "/dev/video97"])
def test_unplugged_camera_gives_a_hint(source: Source, opened: Opener) -> None:
    camera = opened(open_source(source, SystemClock(), retry=0.02))
    wait_until(lambda: camera.health().detail == "camera: /dev/video97: no such device")
    assert "mission ports" in camera.health().hint
    assert not camera.health().online


def test_stream_password_is_not_shown(opened: Opener) -> None:
    camera = opened(open_source("rtsp://me:secret@127.0.0.1:9/x", SystemClock(), retry=0.02))
    wait_until(lambda: "rtsp://***@127.0.0.1:9/x: cannot be opened as a stream" in camera.health().detail)
    assert "secret" not in camera.health().hint


class Webcam:
    """A live feed that does what the test puts into its queue: a picture, None for unplugged."""

    source_name, hint = "/dev/eye", "plug it in"

    def __init__(self) -> None:
        self.pictures: Queue[Image | None] = Queue()
        self.present = Event()
        self.stopped = Event()

    def start(self, closing: Event) -> float | None:  # noqa: ARG002 - it waits for nothing
        if not self.present.is_set():
            raise NotConnected("eye: /dev/eye: no such device", hint="plug it in")
        return None

    def grab(self, skip_count: Callable[[], int]) -> Image | None:
        image = self.pictures.get()
        return SKIPPED_PICTURE if image is not None and skip_count() else image

    def stop(self) -> None:
        self.stopped.set()


def live(feed: Webcam, clock: Clock, report: Callable[[DeviceStatus], None] = lambda _: None) -> ThreadedCamera:
    return ThreadedCamera(lambda: feed, clock, name="eye", field_of_view=1.0, loop=True, retry=0.02, report=report)


def test_unplugged_camera_reconnects_by_itself() -> None:
    feed, clock, notices = Webcam(), ManualClock(), Queue[DeviceStatus]()
    camera = live(feed, clock, notices.put)
    camera.open()
    wait_until(lambda: camera.health().detail == "eye: /dev/eye: no such device")
    feed.present.set()
    feed.pictures.put(grey(1))
    assert camera.read(60.0) is not None
    feed.present.clear()
    feed.pictures.put(None)
    assert [notices.get(timeout=5).kind for _ in range(2)] == ["online", "offline"]
    assert not camera.health().online
    feed.present.set()
    feed.pictures.put(grey(2))
    frame = camera.read(60.0)
    assert frame is not None
    assert (frame.number, int(frame.image[0, 0, 0])) == (1, 2)
    assert notices.get(timeout=5).kind == "online"
    feed.present.clear()
    feed.pictures.put(None)
    camera.close()


def test_failing_source_is_reported_and_restarted(caplog: pytest.LogCaptureFixture) -> None:
    class Broken(Webcam):
        def grab(self, skip_count: Callable[[], int]) -> Image | None:
            if not self.pictures.qsize():
                raise ValueError("not a picture")
            return super().grab(skip_count)

    feed = Broken()
    feed.present.set()
    with closing(live(feed, ManualClock())) as camera:
        camera.open()
        wait_until(lambda: camera.health().detail == "eye: /dev/eye: ValueError: not a picture")
        feed.pictures.put(grey(1))
        assert camera.read(60.0) is not None
    assert "ValueError: not a picture" in caplog.text


def test_silent_camera_is_offline() -> None:
    feed, clock = Webcam(), ManualClock()
    feed.present.set()
    feed.pictures.put(grey(1))
    camera = live(feed, clock)
    camera.open()
    assert camera.read(60.0) is not None
    assert camera.health().online
    clock.advance(3.2)
    assert camera.health().detail == "eye: /dev/eye: no picture for 3.2 s"
    assert camera.health().hint == "plug it in"
    feed.present.clear()
    feed.pictures.put(None)
    camera.close()


def test_close_does_not_wait_for_a_hanging_driver() -> None:
    feed = Webcam()
    feed.present.set()
    camera = live(feed, ManualClock())
    camera.open()
    closer = Thread(target=camera.close)
    closer.start()
    closer.join(10.0)
    assert not closer.is_alive()  # though grab is still stuck
    assert not feed.stopped.is_set()
    feed.pictures.put(grey(1))  # the driver wakes up: the thread left behind releases it and ends
    assert feed.stopped.wait(5.0)


def test_close_ends_a_waiting_read() -> None:
    feed, results = Webcam(), list[CameraFrame | None]()
    capture = CaptureThread("eye", feed, ManualClock(), loop=True, retry=0.02, report=lambda _: None)
    capture.start()
    reader = Thread(target=lambda: results.append(capture.read(60.0)))
    reader.start()
    capture.stop()
    reader.join(10.0)
    assert results == [None]


def test_folder_shows_its_pictures_by_name_repeatedly(folder: Path, opened: Opener) -> None:
    clock = ManualClock()
    assert levels(play(opened(open_source(folder, clock, rate=2.0)), clock, 4, 0.5)) == [50, 150, 50, 150]


def test_single_picture_is_a_camera(folder: Path, opened: Opener) -> None:
    clock = ManualClock()
    assert levels(play(opened(open_source(folder / "b.png", clock)), clock, 3, 0.2)) == [150, 150, 150]


def test_folder_without_pictures_and_broken_picture_are_named(tmp_path: Path, opened: Opener) -> None:
    camera = opened(open_source(tmp_path, SystemClock(), retry=0.02))
    wait_until(lambda: f"{tmp_path}: contains no pictures" in camera.health().detail)
    (tmp_path / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n nothing")
    wait_until(lambda: "no picture can be decoded: " in camera.health().detail)
    assert "broken.png: cannot be decoded, 16 bytes" in camera.health().detail
    gone = opened(open_source(tmp_path / "gone.png", SystemClock(), retry=0.02))
    wait_until(lambda: "gone.png: no such file or folder" in gone.health().detail)


def test_source_kind_depends_on_its_form(folder: Path, video: Path) -> None:
    sources: tuple[Source, ...] = (
        0,
        "1",
        "/dev/video0",
        "rtsp://host/x",
        folder,
        folder / "a.jpg",
        video,
        "absent.mp4",
    )
    kinds = (
        *[SourceKind.DEVICE] * 3,
        SourceKind.URL,
        SourceKind.FOLDER,
        SourceKind.PICTURE,
        SourceKind.VIDEO,
        SourceKind.VIDEO,
    )
    assert tuple(map(source_kind, sources)) == kinds


def test_non_ascii_digits_are_not_a_device_number() -> None:
    assert [source_kind(text) for text in ("٢", "1²", "9" * 30)] == [SourceKind.VIDEO] * 3


def test_camera_can_be_opened_and_closed_in_any_order(video: Path) -> None:
    with closing(open_source(video, SystemClock())) as camera:
        assert camera.read(0.0) is None
        assert camera.health().detail == "camera: not open"
        camera.close()
        for _ in range(2):
            camera.open()
            camera.open()
            frame = camera.read(60.0)
            assert frame is not None
            assert frame.number < 5, "it begins anew; on a busy machine its first pictures have gone by"
            camera.rest()
            camera.close()
            camera.close()


@pytest.mark.parametrize("wrong", [{"field_of_view": 0.0}, {"field_of_view": 4.0}, {"retry": 0.0}, {"rate": 0.0}])
def test_impossible_settings_are_refused(wrong: dict[str, Any], folder: Path) -> None:
    with pytest.raises(BadRequest, match="above 0"):
        open_source(folder, ManualClock(), **wrong)


def test_offline_every_frame_is_iterated_once(video: Path, folder: Path) -> None:
    seen = [(path.name, number) for path, number, _ in iter_pictures([video, folder, folder / "b.png"])]
    assert seen == [*(("clip.avi", number) for number in range(5)), ("a.jpg", 0), ("b.png", 0), ("b.png", 0)]


def test_offline_all_absent_paths_are_named_at_once(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match=r"one.jpg: no such file; .*two.avi: no such file; .*contains no pictures"):
        iter_pictures([tmp_path / "one.jpg", tmp_path / "two.avi", tmp_path])


@pytest.mark.parametrize("name", ["broken.png", "broken.avi"])
def test_offline_undecodable_file_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"nonsense")
    with pytest.raises(BadRequest, match=f"{name}: cannot be decoded, 8 bytes"):
        list(iter_pictures([tmp_path]))
