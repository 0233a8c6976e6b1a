"""The pinhole camera and the gaze, against plain linear algebra."""

from math import cos, degrees, pi, radians, sin

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.api import Box, Gaze
from perception.geometry import FACE_WIDTH, Pinhole, direction_of, wrap_angle

CAMERA = Pinhole(640, 480, radians(60))
pixels = st.tuples(st.floats(0, 640), st.floats(0, 480))
turns = st.floats(-10, 10)
tilts = st.floats(-1.2, 1.2)


def matrix(gaze: Gaze) -> npt.NDArray[np.float64]:
    """The camera's axes in the odometry frame: a turn about z after one about y."""
    c, s = cos(gaze.yaw), sin(gaze.yaw)
    about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = cos(gaze.pitch), sin(gaze.pitch)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return np.asarray(about_z @ about_y, dtype=np.float64)


def direction(left: float, down: float) -> npt.NDArray[np.float64]:
    return np.array([cos(down) * cos(left), cos(down) * sin(left), -sin(down)])


def test_the_middle_of_the_picture_is_straight_ahead() -> None:
    assert CAMERA.pixel_to_angles(320, 240) == (0, 0)


def test_left_and_down_are_positive_angles() -> None:
    bearing, drop = CAMERA.pixel_to_angles(100, 400)
    assert bearing > 0
    assert drop > 0


def test_the_edge_of_the_picture_is_half_the_angle_of_view_away() -> None:
    assert CAMERA.pixel_to_angles(0, 240)[0] == pytest.approx(radians(30))
    assert CAMERA.pixel_to_angles(640, 240)[0] == pytest.approx(-radians(30))


@given(pixels)
def test_pixel_round_trips_through_angles(place: tuple[float, float]) -> None:
    assert CAMERA.angles_to_pixel(*CAMERA.pixel_to_angles(*place)) == pytest.approx(place, abs=1e-6)


@given(pixels)
def test_pixel_angles_match_its_ray(place: tuple[float, float]) -> None:
    ray = np.array([CAMERA.focal, 320 - place[0], 240 - place[1]])
    assert direction(*CAMERA.pixel_to_angles(*place)) == pytest.approx(ray / np.linalg.norm(ray), abs=1e-9)


@given(turns, tilts, pixels)
def test_looking_turns_the_ray_by_the_cameras_rotation(yaw: float, pitch: float, place: tuple[float, float]) -> None:
    gaze, seen = Gaze(yaw, pitch), CAMERA.pixel_to_angles(*place)
    assert direction(*direction_of(gaze, *seen)) == pytest.approx(matrix(gaze) @ direction(*seen), abs=1e-9)


@given(pixels)
def test_a_level_gaze_straight_on_changes_nothing(place: tuple[float, float]) -> None:
    seen = CAMERA.pixel_to_angles(*place)
    assert direction_of(Gaze(0, 0), *seen) == pytest.approx(seen, abs=1e-9)


def test_adding_the_angles_would_not_do() -> None:
    yaw, pitch = direction_of(Gaze(0, radians(20)), radians(20), 0)
    assert degrees(yaw) == pytest.approx(21.17, abs=0.01)
    assert degrees(pitch) == pytest.approx(18.75, abs=0.01)


def test_yaw_continues_past_half_a_turn() -> None:
    assert direction_of(Gaze(7.0, 0), 0.1, 0)[0] == pytest.approx(7.1)


@given(st.floats(-1e4, 1e4))
def test_wrapping_keeps_the_direction_and_stays_within_half_a_turn(angle: float) -> None:
    assert -pi <= wrap_angle(angle) <= pi
    assert (cos(wrap_angle(angle)), sin(wrap_angle(angle))) == pytest.approx((cos(angle), sin(angle)), abs=1e-9)


def test_a_face_twice_as_small_is_twice_as_far() -> None:
    near, far = CAMERA.face_distance(Box(0, 0, 94, 94)), CAMERA.face_distance(Box(300, 200, 47, 47))
    assert near == pytest.approx(FACE_WIDTH * CAMERA.focal / 94)
    assert far == pytest.approx(2 * near)


@pytest.mark.parametrize("size", [(0, 480), (640, 0), (-1, 1)])
def test_a_camera_without_pixels_is_refused(size: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="pixels is impossible"):
        Pinhole(*size, radians(60))


@pytest.mark.parametrize("angle", [0.0, pi, -1.0, float("nan")])
def test_an_impossible_angle_of_view_is_refused(angle: float) -> None:
    with pytest.raises(ValueError, match="angle of view"):
        Pinhole(640, 480, angle)


@pytest.mark.parametrize("seen", [(pi / 2, 0.0), (0.0, -2.0), (float("nan"), 0.0)])
def test_direction_behind_the_camera_has_no_pixel(seen: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="not in front"):
        CAMERA.angles_to_pixel(*seen)


@pytest.mark.parametrize("width", [0.0, -3.0, float("inf")])
def test_a_face_without_a_width_has_no_distance(width: float) -> None:
    with pytest.raises(ValueError, match="has no distance"):
        CAMERA.face_distance(Box(0, 0, width, 10))


BENT = Pinhole(640, 480, radians(60), (0.52, 0.47), (0.09, -0.21, 0.002, -0.001, 0.03))


@given(pixels)
def test_distorted_pixel_round_trips_through_angles(place: tuple[float, float]) -> None:
    assert BENT.angles_to_pixel(*BENT.pixel_to_angles(*place)) == pytest.approx(place, abs=0.02)


@given(pixels)
def test_distortion_matches_opencv(place: tuple[float, float]) -> None:
    focal = BENT.focal
    matrix = np.array(((focal, 0, 0.52 * 640), (0, focal, 0.47 * 480), (0, 0, 1)))
    ((right, down),) = cv2.undistortPoints(np.array([[place]]), matrix, np.array(BENT.distortion))[0]
    ray = np.array([1.0, -right, -down])
    assert direction(*BENT.pixel_to_angles(*place)) == pytest.approx(ray / np.linalg.norm(ray), abs=2e-4)


def test_optical_axis_is_at_the_picture_centre() -> None:
    assert BENT.pixel_to_angles(0.52 * 640, 0.47 * 480) == pytest.approx((0, 0))


@pytest.mark.parametrize("centre", [(0.0, 0.5), (0.5, 1.2), (float("nan"), 0.5)])
def test_a_centre_outside_the_picture_is_refused(centre: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="centre must lie in the picture"):
        Pinhole(640, 480, 1.0, centre)


def test_half_a_distortion_is_refused() -> None:
    with pytest.raises(ValueError, match="k1, k2, p1, p2, k3, not 2 numbers"):
        Pinhole(640, 480, 1.0, distortion=(0.1, 0.2))
