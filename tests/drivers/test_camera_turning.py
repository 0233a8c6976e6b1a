"""Cameras that are not mounted upright: their pictures, their lens and what comes of that for whoever looks."""

from math import degrees, hypot, pi, radians, tan
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import InvalidFileError
from drivers.api import Image
from drivers.api.image_orientation import ImageOrientation
from drivers.api.sensor_sections import CameraKeys, DistortionKeys
from drivers.camera.make import open_source
from drivers.clock import ManualClock
from drivers.pictures.capture import turn_image, unturn_image
from missions.library.drivers import load_robot
from perception.geometry import Pinhole

TURNS = [
    ImageOrientation(quarters, across, down)
    for quarters in range(4)
    for across in (False, True)
    for down in (False, True)
]

turns = st.sampled_from(TURNS)
shares = st.floats(0.02, 0.98)


def spotted(width: int, height: int, x: float, y: float) -> Image:
    """Return a dark picture with a light spot at shares of its sides."""
    image = np.zeros((height, width, 3), np.uint8)
    cv2.circle(image, (int(x * width), int(y * height)), 2, (255, 255, 255), cv2.FILLED)
    return image


@given(turns, shares, shares)
def test_point_moves_with_the_rotated_picture(turn: ImageOrientation, x: float, y: float) -> None:
    image = turn_image(spotted(160, 120, x, y), turn)
    assert (image.shape[1], image.shape[0]) == turn.size(160, 120)
    rows, columns = np.nonzero(image[:, :, 0])
    expected = turn.point(x, y)
    assert columns.mean() / image.shape[1] == pytest.approx(expected[0], abs=0.03)
    assert rows.mean() / image.shape[0] == pytest.approx(expected[1], abs=0.03)
    assert np.array_equal(unturn_image(image, turn), spotted(160, 120, x, y))


@given(turns, shares, shares, st.floats(0.4, 0.6), st.floats(0.4, 0.6))
def test_ray_of_a_rotated_pixel_is_the_rotated_ray(
    turn: ImageOrientation, x: float, y: float, centre_x: float, centre_y: float
) -> None:
    """Whatever the lens: the ray of a pixel, turned, is that of the turned pixel."""
    keys = CameraKeys(
        rotate=turn.quarter_turns * pi / 2,
        flip={(False, False): "false", (True, False): "horizontal", (False, True): "vertical", (True, True): "both"}[
            turn.flip_horizontal, turn.flip_vertical
        ],
        field_of_view=radians(70),
        width=640,
        height=360,
        centre_x=centre_x,
        centre_y=centre_y,
        distortion=DistortionKeys(k1=-0.05, k2=0.01, p1=0.004, p2=-0.006),
    )
    upright = keys.upright()
    assert upright.orientation == ImageOrientation()
    raw = Pinhole(640, 360, keys.field_of_view, keys.centre, keys.distortion_coefficients)
    lens = Pinhole(
        upright.width, upright.height, upright.field_of_view, upright.centre, upright.distortion_coefficients
    )
    right, down = _ray(raw, x * 640, y * 360)
    turned_x, turned_y = turn.point(x, y)
    assert _ray(lens, turned_x * lens.width, turned_y * lens.height) == pytest.approx(
        turn.vector(right, down), abs=1e-6
    )


def _ray(lens: Pinhole, x: float, y: float) -> tuple[float, float]:
    bearing, elevation = lens.pixel_to_angles(x, y)
    right = -tan(bearing)
    return right, tan(elevation) * hypot(right, 1.0)


def test_quarter_turn_swaps_the_angles_of_view() -> None:
    upright = CameraKeys(rotate="90", field_of_view=radians(60), width=640, height=480).upright()
    assert (upright.width, upright.height) == (480, 640)
    assert degrees(upright.field_of_view) == pytest.approx(46.83, abs=0.01)
    half = CameraKeys(rotate="180", field_of_view=radians(60), centre_x=0.6).upright()
    assert (degrees(half.field_of_view), half.centre_x) == pytest.approx((60, 0.4))


@pytest.mark.parametrize(
    ("written", "turn"),
    [
        ("rotate: 0", ImageOrientation()),
        ("rotate: 90", ImageOrientation(1)),
        ("rotate: 90 deg", ImageOrientation(1)),
        ("rotate: 3.14159 rad", ImageOrientation(2)),
        ("rotate: -90 deg", ImageOrientation(3)),
        ("rotate: 270, flip: true", ImageOrientation(3, flip_horizontal=True)),
        ("flip: false", ImageOrientation()),
        ("flip: horizontal", ImageOrientation(0, flip_horizontal=True)),
        ("flip: vertical", ImageOrientation(0, flip_vertical=True)),
        ("rotate: 180, flip: both", ImageOrientation(2, flip_horizontal=True, flip_vertical=True)),
    ],
)
def test_robot_file_sets_the_camera_orientation(written: str, turn: ImageOrientation, tmp_path: Path) -> None:
    path = tmp_path / "turned.yaml"
    path.write_text(f"robot: turned\ncamera: {{{written}}}\n")
    camera = load_robot(path).camera
    assert camera is not None
    assert camera.orientation == turn


def test_rotation_that_is_not_a_right_angle_is_refused_without_password(tmp_path: Path) -> None:
    path = tmp_path / "turned.yaml"
    path.write_text("robot: turned\ncamera: {source: 'http://me:secret@cam/x', rotate: 45 deg}\n")
    with pytest.raises(InvalidFileError) as caught:
        load_robot(path)
    text = str(caught.value)
    assert "'rotate' must be 0, 90, 180 or 270 deg" in text
    assert "secret" not in text
    excerpt, carets = text.splitlines()[1:3]
    assert excerpt[carets.index("^") :].startswith("45 deg")
    path.write_text("robot: turned\ncamera: http://me:secret@cam/x\n")
    with pytest.raises(InvalidFileError) as caught:
        load_robot(path)
    assert "secret" not in str(caught.value) + "".join(
        fault.message + fault.suggestion for fault in caught.value.diagnostics
    )


def test_pictures_of_every_source_are_rotated(tmp_path: Path) -> None:
    path = tmp_path / "spot.png"
    cv2.imwrite(str(path), spotted(160, 120, 0.1, 0.2))
    camera = open_source(path, ManualClock(), turn=ImageOrientation(1))
    camera.open()
    try:
        frame = camera.read(30.0)
        assert frame is not None
        assert frame.image.shape == (160, 120, 3)
        assert np.array_equal(frame.image, turn_image(spotted(160, 120, 0.1, 0.2), ImageOrientation(1)))
    finally:
        camera.close()
