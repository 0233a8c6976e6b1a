"""Pictures of a body: what is to be seen from which side, by whichever means they are drawn, and what cannot be."""

from collections.abc import Iterator

import numpy as np
import pytest

from drivers.api import Image
from drivers.sim.rigid import body_camera
from drivers.sim.rigid.body_camera import BodyCamera
from drivers.sim.rigid.scene import PhysicsScene
from drivers.sim.rigid.stick_drawing import BACKGROUND, LEFT, MARKS, RIGHT, Stroke, draw_stick_figure
from tests.drivers.toy_humanoid import scene

SIZE = (320, 240)


def coloured(image: Image, colour: tuple[int, int, int]) -> np.ndarray:
    """Return the columns in which a colour is, in a picture of two views beside each other."""
    return np.nonzero((image == colour).all(axis=2))[1]


def line(y: float, *, x: float = 0.0) -> Stroke:
    return Stroke(np.array([x, y, 0.0]), np.array([x, y, 0.4]), 0.02)


def test_front_view_shows_the_left_side_at_the_right() -> None:
    image = draw_stick_figure([line(0.1), line(-0.1)], SIZE, height=0.5)
    middle = 3 * SIZE[0] / 4
    assert min(coloured(image[:, SIZE[0] // 2 :], LEFT)) + SIZE[0] / 2 > middle
    assert max(coloured(image, RIGHT)[coloured(image, RIGHT) > SIZE[0] / 2]) < middle


def test_side_view_faces_right_and_hides_the_left_leg() -> None:
    image = draw_stick_figure([line(-0.1), line(0.1), line(0.1, x=0.2)], SIZE, height=0.5)[:, : SIZE[0] // 2]
    assert min(coloured(image, LEFT)) > max(coloured(image, RIGHT)) > SIZE[0] / 4 - 20


def test_floor_marks_move_back_with_the_walk() -> None:
    one, other = (draw_stick_figure([], SIZE, height=0.5, walked=gone)[:, : SIZE[0] // 2] for gone in (0.0, 0.03))
    assert not np.array_equal(coloured(one, MARKS), coloured(other, MARKS))
    assert np.array_equal(one, draw_stick_figure([], SIZE, height=0.5, walked=0.1)[:, : SIZE[0] // 2])


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e300, -1e12])
def test_non_finite_stroke_is_not_drawn(value: float) -> None:
    gone = Stroke(np.array([value, 0.1, 0.0]), np.array([0.0, 0.1, value]), 0.02)
    assert not len(coloured(draw_stick_figure([gone], SIZE, height=0.5), LEFT))


@pytest.fixture
def robot() -> PhysicsScene:
    found = scene()
    found.advance(0.2)
    return found


@pytest.fixture(params=[True, False], ids=["rendered", "lines"])
def camera(request: pytest.FixtureRequest, robot: PhysicsScene) -> Iterator[BodyCamera]:
    found = BodyCamera(robot, SIZE, render=request.param)
    if found.is_rendered is not request.param:
        pytest.skip("there is no EGL here")
    yield found
    found.close()


def test_a_robot_in_physics_is_to_be_seen_and_the_same_each_time(camera: BodyCamera) -> None:
    image = camera.draw(0.2)
    assert image.shape == (240, 320, 3)
    assert np.array_equal(image, camera.draw(0.2))
    around = image[20:220, 5:150] if not camera.is_rendered else image
    assert (around != BACKGROUND).any(axis=2).mean() > 0.05


def test_fallen_robot_looks_different(camera: BodyCamera, robot: PhysicsScene) -> None:
    stands = camera.draw(0.2)
    for joint in ("l_knee", "r_knee", "l_ank_pitch", "r_ank_pitch", "l_hip_pitch", "r_hip_pitch"):
        robot.switch_torque_off(joint)
    robot.advance(2.0)
    assert robot.has_fallen
    assert np.abs(stands.astype(int) - camera.draw(0.2)).mean() > 3


def test_looking_changes_nothing(camera: BodyCamera, robot: PhysicsScene) -> None:
    alone = scene()
    alone.advance(0.5)
    camera.draw(0.2)
    robot.advance(0.5)
    assert np.array_equal(alone.data.qpos, robot.data.qpos)


def test_missing_egl_falls_back_to_line_drawing(robot: PhysicsScene, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> None:
        raise AttributeError("'NoneType' object has no attribute 'eglQueryString'")  # as PyOpenGL without libEGL

    monkeypatch.setattr(body_camera, "_egl_context_class", broken)
    camera = BodyCamera(robot, SIZE)
    assert not camera.is_rendered
    assert len(coloured(camera.draw(0.0), LEFT))
    camera.close()
