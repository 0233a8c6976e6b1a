"""The rendered camera: a real face detector must find its people, and nothing else."""

from collections.abc import Iterator
from math import pi, radians
from pathlib import Path
from threading import Event, Thread

import cv2
import cv2.data
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.api import Camera, Image
from drivers.clock import ManualClock, SystemClock
from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.rendered_camera import RenderedCamera
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld

LENS = PinholeLens(640, 480, radians(60))
EYES = Viewpoint(z=1.6)
HAAR = cv2.CascadeClassifier(str(Path(cv2.data.haarcascades) / "haarcascade_frontalface_default.xml"))
CLAHE = cv2.createCLAHE(2.0, (8, 8))


def faces(image: Image) -> list[tuple[float, float, float]]:
    """Return the middle (x, y) and the width of every face that the cascade finds, in pixels."""
    grey = CLAHE.apply(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
    found = HAAR.detectMultiScale(grey, scaleFactor=1.2, minNeighbors=4, minSize=(24, 24))
    return [(x + w / 2, y + h / 2, float(w)) for x, y, w, h in found]


def picture(*people: Person, view: Viewpoint = EYES, noise: float = 3.0, seed: int = 0, light: float = 1.0) -> Image:
    return Renderer(SimulatedWorld(people=people, light=light), LENS, noise=noise, seed=seed).draw(view, 0.0)


@pytest.mark.parametrize("look", APPEARANCES)
def test_rendered_face_is_detected_at_its_geometric_place(look: str) -> None:
    walker = Person("p", look, x=0.5, y=0.05, path=((4.5, 0.45),), speed=float(np.hypot(4.0, 0.4)) / 4.0, loop=False)
    renderer = Renderer(SimulatedWorld(people=(walker,)), LENS)
    found = 0
    for distance in (0.6, 1.0, 1.5, 2.2, 3.0):
        for x, y, width in faces(renderer.draw(EYES, distance - 0.5)):  # one metre ahead a second
            pixels_a_metre = LENS.focal / distance
            right_place = abs(x - (319.5 - 0.1 * LENS.focal)) < 0.04 * pixels_a_metre and abs(y - 255) < 60
            found += right_place and 0.10 < width / pixels_a_metre < 0.24
    assert found >= 4  # of 5


@pytest.mark.parametrize("light", [0.25, 1.2])
def test_a_face_is_found_in_poor_and_in_strong_light(light: float) -> None:
    assert len(faces(picture(Person("p", "ben", x=1.2), light=light))) == 1


def test_rendered_face_is_detected_by_a_low_tilted_camera() -> None:
    low = Viewpoint(z=0.7, yaw=radians(15), pitch=radians(-25))
    assert len(faces(picture(Person("p", "emil", x=1.5), view=low))) == 1


def test_the_back_of_a_head_is_no_face() -> None:
    places = ((2.0, -0.8), (1.6, 0.0), (2.0, 0.8))
    for looks in (list(APPEARANCES)[:3], list(APPEARANCES)[3:]):
        for facing, count in ((0.0, 0), (pi, 3)):
            people = (Person(look, look, x=x, y=y, facing=facing) for look, (x, y) in zip(looks, places, strict=True))
            assert len(faces(picture(*people))) == count


def test_no_face_is_found_in_the_empty_room() -> None:
    renderer = Renderer(SimulatedWorld(), LENS)
    for yaw in np.linspace(-pi, pi, 12, endpoint=False):
        for view in (Viewpoint(z=0.4, yaw=yaw, pitch=-0.4), Viewpoint(x=2.0, y=-1.0, z=1.2, yaw=yaw, pitch=0.2)):
            assert faces(renderer.draw(view, 0.0)) == []


def test_the_nearer_person_hides_the_farther() -> None:
    near, far = Person("n", "ben", x=1.2), Person("f", "chidi", x=3.0)
    expected = picture(near, noise=0.0)[300:400, 300:340]
    assert np.array_equal(picture(near, far, noise=0.0)[300:400, 300:340], expected)
    assert np.array_equal(picture(far, near, noise=0.0)[300:400, 300:340], expected)


def test_the_picture_of_a_walker_changes_with_time() -> None:
    renderer = Renderer(SimulatedWorld(people=(Person("p", x=2.0, y=-1.0, path=((2.0, 1.0),)),)), LENS, noise=0.0)
    middles = [x for time in (1.0, 2.0, 3.0) for x, _, _ in faces(renderer.draw(EYES, time))]
    assert len(middles) == 3
    assert middles == sorted(middles, reverse=True)  # from the right to the left


def test_noise_is_seeded_and_of_the_given_strength() -> None:
    clean = picture(noise=0.0).astype(float)
    assert np.array_equal(picture(seed=3), picture(seed=3))
    assert not np.array_equal(picture(seed=3), picture(seed=4))
    assert float(np.std(picture(noise=4.0) - clean)) == pytest.approx(4.0, rel=0.1)


def test_half_the_light_makes_half_the_brightness() -> None:
    assert picture(light=0.5, noise=0.0).mean() == pytest.approx(picture(noise=0.0).mean() / 2, rel=0.02)


def test_camera_outside_the_room_is_clamped_inside() -> None:
    outside, wall = Viewpoint(x=99.0, z=1.0, yaw=pi), Viewpoint(x=4.95, z=1.0, yaw=pi)
    assert np.array_equal(picture(view=outside), picture(view=wall))


RENDERER = Renderer(SimulatedWorld(people=(Person("p", x=1.0), Person("q", "ben", x=2.0, y=0.5))), LENS)


@settings(max_examples=60, deadline=None)
@given(st.floats(-4, 6), st.floats(-4, 4), st.floats(-1, 3), st.floats(-10, 10), st.floats(-1.6, 1.6))
def test_every_viewpoint_renders(x: float, y: float, z: float, yaw: float, pitch: float) -> None:
    image = RENDERER.draw(Viewpoint(x, y, z, yaw, pitch), 0.0)
    assert image.shape == (480, 640, 3)
    assert image.dtype == np.uint8


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(start=5.0)


@pytest.fixture
def camera(clock: ManualClock) -> Iterator[RenderedCamera]:
    camera = RenderedCamera(SimulatedWorld(), lambda time: Viewpoint(z=0.5, yaw=time), clock, rate=20, size=(160, 120))
    camera.open()
    yield camera
    camera.close()


def test_frames_come_at_the_rate_of_the_clock(camera: RenderedCamera, clock: ManualClock) -> None:
    stamps = []
    for _ in range(100):
        frame = camera.read(0.0)
        if frame is not None:
            stamps.append(frame.stamp)
        clock.advance(0.01)
    assert len(stamps) == 20
    assert stamps[:3] == pytest.approx([5.0, 5.05, 5.10])


def test_unread_frames_are_dropped_and_counted(camera: RenderedCamera, clock: ManualClock) -> None:
    first = camera.read(0.0)
    clock.advance(0.52)
    second = camera.read(0.0)
    assert first is not None
    assert second is not None
    assert (first.number, second.number) == (0, 10)
    assert camera.health().counters == {"frames": 2, "dropped": 9}


def test_frame_shows_the_view_at_its_stamp(clock: ManualClock) -> None:
    asked = []

    def viewpoint(time: float) -> Viewpoint:
        asked.append(time)
        return Viewpoint(z=0.5, yaw=time)

    camera: Camera = RenderedCamera(SimulatedWorld(), viewpoint, clock, noise=0.0, size=(160, 120))
    camera.open()
    frame = camera.read(0.0)
    camera.close()
    assert frame is not None
    assert asked == [frame.stamp]
    lens = PinholeLens(160, 120, camera.field_of_view)
    assert np.array_equal(frame.image, Renderer(SimulatedWorld(), lens, noise=0.0).draw(Viewpoint(z=0.5, yaw=5.0), 5.0))


def test_read_times_out_while_simulated_time_stands_still(camera: RenderedCamera) -> None:
    assert camera.read(0.0) is not None
    assert camera.read(0.02) is None


def test_a_read_in_real_time_waits_for_the_next_frame() -> None:
    camera = RenderedCamera(SimulatedWorld(), lambda _: Viewpoint(), SystemClock(), rate=50, size=(160, 120))
    camera.open()
    frames = [camera.read(2.0) for _ in range(4)]
    camera.close()
    stamps = [frame.stamp for frame in frames if frame is not None]
    assert len(stamps) == 4
    assert stamps[3] - stamps[0] >= 0.055


class WatchedClock(ManualClock):
    """A clock that stands still and tells when somebody looks at it."""

    def __init__(self) -> None:
        super().__init__()
        self.looked = Event()

    def now(self) -> float:
        self.looked.set()
        return super().now()


def test_close_ends_a_waiting_read() -> None:
    clock = WatchedClock()
    camera = RenderedCamera(SimulatedWorld(), lambda _: Viewpoint(), clock, size=(160, 120))
    camera.open()
    assert camera.read(0.0) is not None
    clock.looked.clear()
    results: list[object] = []
    thread = Thread(target=lambda: results.append(camera.read(60.0)))
    thread.start()
    assert clock.looked.wait(5.0)
    camera.close()
    thread.join(5.0)
    assert results == [None]
    camera.close()
    camera.rest()


def test_unopened_rendered_camera_is_offline(clock: ManualClock) -> None:
    camera = RenderedCamera(SimulatedWorld(), lambda _: Viewpoint(), clock)
    assert camera.health().detail == "camera: not open"
    assert camera.read(0.0) is None
    camera.open()
    camera.open()
    assert camera.health().online
    camera.close()
    assert not camera.health().online
