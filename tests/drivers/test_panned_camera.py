"""A fixed camera made to pan and tilt: geometry against the renderer, and recorded people."""

from functools import cache
from math import radians
from pathlib import Path

import cv2
import cv2.data
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.api import Camera, Image
from drivers.clock import ManualClock
from drivers.sim.painter import PannedCamera, rotate_view
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.rendered_camera import RenderedCamera
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld
from tests.footage import FOOTAGE

SIXTY = radians(60)
WORLD = SimulatedWorld(people=(Person("p", x=1.5, y=0.2),))
RENDERER = Renderer(WORLD, PinholeLens(640, 480, SIXTY), noise=0.0)


@cache
def straight() -> Image:
    """What is seen straight ahead."""
    return RENDERER.draw(Viewpoint(z=1.5), 0.0)


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (0.2, 0.0), (-0.3, 0.1), (0.1, -0.25)])
def test_rotated_picture_equals_the_view_of_a_rotated_camera(yaw: float, pitch: float) -> None:
    source = np.full_like(straight(), 255)
    within = rotate_view(source, Viewpoint(yaw=yaw, pitch=pitch), SIXTY)  # all white: the border takes the mean too
    assert within.min() >= 254
    seen = RENDERER.draw(Viewpoint(z=1.5, yaw=yaw, pitch=pitch), 0.0)
    made = rotate_view(straight(), Viewpoint(yaw=yaw, pitch=pitch), SIXTY)
    centre = (slice(200, 280), slice(270, 370))  # in the source for all of these angles
    difference = np.abs(seen[centre].astype(int) - made[centre])
    assert float(difference.mean()) < 3.0
    if (yaw, pitch) != (0.0, 0.0):
        assert float(np.abs(seen[centre].astype(int) - straight()[centre]).mean()) > 6.0


def test_looking_left_moves_the_picture_to_the_right_and_leaves_a_dull_edge() -> None:
    marked: Image = np.full((480, 640, 3), 90, np.uint8)
    cv2.circle(marked, (320, 240), 12, (0, 0, 255), -1)
    moved = rotate_view(marked, Viewpoint(yaw=radians(10)), SIXTY)
    rows, columns = np.nonzero(moved[..., 2] > 200)
    assert columns.mean() == pytest.approx(319.5 + PinholeLens(640, 480, SIXTY).focal * np.tan(radians(10)), abs=1.5)
    assert rows.mean() == pytest.approx(240, abs=1.5)
    assert float(moved[:, :60].std()) == pytest.approx(0.0, abs=1.0)


@settings(max_examples=40, deadline=None)
@given(st.floats(-7, 7), st.floats(-1.5, 1.5), st.sampled_from([0.5, 1.05, 1.6, 2.2]))
def test_area_behind_the_camera_is_never_visible(yaw: float, pitch: float, field_of_view: float) -> None:
    marked: Image = np.full((48, 64, 3), 100, np.uint8)
    marked[20:28, 28:36] = 255
    view = Viewpoint(yaw=yaw, pitch=pitch)
    moved = rotate_view(marked, view, field_of_view)
    ahead = (np.array(view.rotation()) @ (1.0, 0.0, 0.0))[2] > 0  # the marked middle is in front of the turned camera
    assert ahead or moved.max() < 200
    assert moved.shape == marked.shape


def test_panned_camera_uses_the_view_at_the_frame_stamp() -> None:
    clock, asked = ManualClock(start=2.0), []

    def look(time: float) -> Viewpoint:
        asked.append(time)
        return Viewpoint(yaw=0.2)

    inner = RenderedCamera(WORLD, lambda _: Viewpoint(z=1.5), clock, noise=0.0, name="eye")
    camera: Camera = PannedCamera(inner, look)
    assert (camera.name, camera.field_of_view) == ("eye", inner.field_of_view)
    assert not camera.health().online
    camera.open()
    frame = camera.read(0.0)
    assert frame is not None
    assert (frame.stamp, frame.number, asked) == (2.0, 0, [2.0])
    assert np.array_equal(frame.image, rotate_view(straight(), Viewpoint(yaw=0.2), SIXTY))
    assert camera.read(0.0) is None
    assert camera.health().online
    camera.rest()
    camera.close()
    assert not inner.health().online


@pytest.mark.skipif(not FOOTAGE.exists(), reason="the recorded clips are not on this machine")
def test_recorded_people_are_still_found_after_a_turn() -> None:
    haar = cv2.CascadeClassifier(str(Path(cv2.data.haarcascades) / "haarcascade_frontalface_default.xml"))
    clip = cv2.VideoCapture(str(FOOTAGE / "again.mkv"))
    _, image = clip.read()
    clip.release()
    for yaw in (-0.3, 0.0, 0.3):
        moved = rotate_view(np.asarray(image, np.uint8), Viewpoint(yaw=yaw), SIXTY)
        found = haar.detectMultiScale(cv2.cvtColor(moved, cv2.COLOR_BGR2GRAY), 1.2, 4, minSize=(40, 40))
        assert len(found) == 1
        ((x, _, width, _),) = found
        assert np.sign(x + width / 2 - 320) == np.sign(yaw) or yaw == 0.0
