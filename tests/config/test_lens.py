"""The lens of the camera in robot files: read, and kept after a calibration."""

from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from config.library import shipped_files
from config.units import si_value
from config.yaml_edit import NotEditableError
from drivers.api.sensor_sections import CameraKeys
from missions.library.drivers import load_robot
from missions.plugins.setup.camera import lens_entries, write_lens

ENTRIES = lens_entries(1.0123, (0.515, 0.48), (0.08, -0.2, 0.001, -0.0015, 0.0))
PLAIN = """\
robot: mine
camera:            # on the head
  source: 2
  field_of_view: 60 deg   # a guess
voice: {}
"""


def camera_in(path: Path) -> CameraKeys:
    camera = load_robot(path).camera
    assert camera is not None
    return camera


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.yaml"
    path.write_text(PLAIN)
    return path


def test_without_a_calibration_the_lens_is_ideal_and_faces_are_found_by_haar(file: Path) -> None:
    camera = camera_in(file)
    assert (camera.centre, camera.distortion_coefficients) == ((0.5, 0.5), ())
    assert (camera.detector, camera.model) == ("haar", "")


def test_written_lens_is_read_again_and_the_rest_is_unchanged(file: Path) -> None:
    write_lens(file, ENTRIES)
    camera = camera_in(file)
    assert camera.field_of_view == pytest.approx(1.0123, abs=1e-5)
    assert camera.centre == pytest.approx((0.515, 0.48))
    assert camera.distortion_coefficients == (0.08, -0.2, 0.001, -0.0015, 0.0)
    lines = file.read_text().splitlines()
    assert set(PLAIN.splitlines()) - set(lines) == {"  field_of_view: 60 deg   # a guess"}
    assert any(line.endswith("# a guess") for line in lines)


def test_a_second_calibration_takes_the_place_of_the_first(file: Path) -> None:
    write_lens(file, ENTRIES)
    write_lens(file, lens_entries(0.9, (0.5, 0.51), (0.1, 0.0, 0.0, 0.0, 0.0)))
    assert camera_in(file).distortion_coefficients == (0.1, 0.0, 0.0, 0.0, 0.0)
    assert camera_in(file).field_of_view == pytest.approx(0.9, abs=1e-5)
    assert file.read_text().count("distortion") == 1


def test_a_camera_in_braces_can_be_changed_too(tmp_path: Path) -> None:
    path = tmp_path / "short.yaml"
    path.write_text("robot: short\ncamera: {source: 1}\n")
    write_lens(path, ENTRIES)
    assert camera_in(path).source == "1"
    assert camera_in(path).centre == pytest.approx((0.515, 0.48))


def test_shipped_robot_must_be_copied_before_writing_the_lens() -> None:
    path = shipped_files("robots")["turtlebot2_arm"]
    before = path.read_text()
    with pytest.raises(NotEditableError, match=r"(?s)ships with MissionTree.*cp .*--keep my_turtlebot2_arm.yaml"):
        write_lens(path, ENTRIES)
    assert path.read_text() == before


def test_robot_without_a_camera_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "blind.yaml"
    path.write_text("robot: blind\n")
    with pytest.raises(NotEditableError, match="blind has no camera"):
        write_lens(path, ENTRIES)


def test_shared_anchor_is_not_overwritten_by_the_lens(tmp_path: Path) -> None:
    path = tmp_path / "anchored.yaml"
    path.write_text(
        "robot: anchored\nhead: {driver: arduino, port: /dev/nano, pan: {limits: [-10 deg, &wide 60 deg]}, tilt: {}}\n"
        "camera: {field_of_view: *wide}\n"
    )
    before = path.read_text()
    with pytest.raises((NotEditableError, InvalidFileError)):
        write_lens(path, ENTRIES)
    assert path.read_text() == before


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("detector: yolo", "'detector' cannot be 'yolo'"),
        ("centre_x: 320", "'centre_x' needs a share such as '20 %'"),
        ("centre_y: 99 %", "'centre_y' must be at most 90 %"),
        ("distortion: {k1: 0.1, k4: 0.2}", "has no key 'k4'"),
    ],
)
def test_mistakes_in_the_camera_section_are_named(tmp_path: Path, line: str, complaint: str) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(f"robot: wrong\ncamera:\n  {line}\n")
    with pytest.raises(InvalidFileError, match=complaint):
        load_robot(path)


def test_entries_are_written_with_their_units() -> None:
    assert si_value(ENTRIES["field_of_view"], "angle") == pytest.approx(1.0123, abs=1e-5)
    assert ENTRIES["centre_x"] == "51.5 %"
    assert ENTRIES["distortion"].startswith("{k1: 0.08000, k2: -0.20000")
