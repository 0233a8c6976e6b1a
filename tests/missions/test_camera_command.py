"""The ``mission robot camera`` command."""

from collections.abc import Callable
from dataclasses import astuple
from pathlib import Path

import cv2
import pytest

from drivers.finding.video import CSI_TROUBLE, CameraDevice
from missions.library.drivers import load_robot
from missions.plugins.setup import camera
from perception.geometry import Pinhole
from tests.missions.command import Outcome, command
from tests.perception.boards import LENS, POSES, drawn

Mission = Callable[..., Outcome]
BOARD = ("--board", "9x6", "--square", "25 mm")


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: command(capsys, *arguments)


@pytest.fixture(scope="module")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of pictures of a board."""
    folder = tmp_path_factory.mktemp("boards")
    for number, pose in enumerate(POSES[:11]):
        cv2.imwrite(str(folder / f"{number:02d}.png"), drawn(*pose))
    return folder


def plugged_in(monkeypatch: pytest.MonkeyPatch, *devices: CameraDevice) -> None:
    monkeypatch.setattr(camera, "list_devices", lambda: list(devices))


def test_camera_list_shows_cameras_and_the_next_command(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    plugged_in(monkeypatch, CameraDevice(Path("/dev/video2"), "HD Webcam", ((640, 480), (1280, 720))))
    outcome = mission("robot", "camera", "list")
    assert outcome.code == 0
    assert outcome.out.splitlines()[0] == "/dev/video2  HD Webcam  640x480 1280x720"
    assert "mission run greet --camera 2" in outcome.out


def test_camera_list_hints_at_missing_permission(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    plugged_in(monkeypatch, CameraDevice(Path("/dev/video0"), "HD Webcam", trouble="permission denied"))
    monkeypatch.setattr(camera, "explain_denied", lambda path: ("no permission", f"ls -l {path}"))
    outcome = mission("robot", "camera", "list")
    assert "permission denied" in outcome.out
    assert "try: ls -l /dev/video0" in outcome.err


def test_camera_list_hints_at_reading_a_csi_camera(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    csi = CameraDevice(Path("/dev/video0"), "unicam-image", trouble=CSI_TROUBLE, csi=True)
    plugged_in(monkeypatch, csi)
    outcome = mission("robot", "camera", "list")
    assert "OpenCV cannot read" in outcome.out
    assert "--camera 0" not in outcome.out
    assert "rpicam-vid -t 0 -n --codec mjpeg" in outcome.err
    plugged_in(monkeypatch, csi, CameraDevice(Path("/dev/video8"), "HD Webcam", ((640, 480),)))
    assert "mission run greet --camera 8" in mission("robot", "camera", "list").out


def test_camera_list_fails_with_a_hint_without_a_camera(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    plugged_in(monkeypatch)
    outcome = mission("robot", "camera", "list")
    assert (outcome.code, outcome.out) == (1, "")
    assert "no camera found" in outcome.err
    assert "try: lsusb" in outcome.err


def test_calibration_is_printed_as_yaml_and_saved_on_request(mission: Mission, boards: Path) -> None:
    mine = Path("mine.yaml")
    mine.write_text("robot: mine\ncamera:\n  source: 0  # mine\n")
    outcome = mission("robot", "camera", "calibrate", str(boards), *BOARD)
    assert outcome.code == 0
    assert outcome.out.splitlines()[1] == "camera:"
    Path("pasted.yaml").write_text("robot: pasted\n" + outcome.out)
    outcome = mission("robot", "camera", "calibrate", str(boards), *BOARD, "--keep", "mine.yaml")
    assert outcome.code == 0
    assert "written to mine.yaml" in outcome.err
    assert "source: 0  # mine" in mine.read_text()
    kept, pasted = load_robot(mine).camera, load_robot(Path("pasted.yaml")).camera
    assert kept is not None
    assert pasted is not None
    # OpenCV adds up in several threads: the last digit of a second calibration may be another one.
    assert kept.field_of_view == pytest.approx(pasted.field_of_view, abs=1e-4)
    assert kept.centre == pytest.approx(pasted.centre, abs=1e-4)
    assert kept.distortion is not None
    assert pasted.distortion is not None
    assert astuple(kept.distortion) == pytest.approx(astuple(pasted.distortion), abs=1e-3)
    assert Pinhole(640, 480, kept.field_of_view).focal == pytest.approx(LENS.focal, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("absent", *BOARD), "absent: no such file"),
        (("absent", "--board", "nine", "--square", "25 mm"), "'nine' is not ACROSSxDOWN"),
        (("absent", "--board", "9x6", "--square", "25"), "needs a length such as"),
        (("absent", "--board", "2x2", "--square", "25 mm"), "at least 3 per direction are needed"),
        (("absent", *BOARD, "--keep", "blind.yaml"), "blind has no camera"),
    ],
)
def test_calibrate_refuses_wrong_arguments_first(mission: Mission, arguments: tuple[str, ...], words: str) -> None:
    Path("blind.yaml").write_text("robot: blind\n")
    outcome = mission("robot", "camera", "calibrate", *arguments)
    assert outcome.code == 2
    assert words in outcome.err


def test_wrong_board_fails_with_a_hint(mission: Mission, boards: Path) -> None:
    one = str(boards / "00.png")
    outcome = mission("robot", "camera", "calibrate", one, "--board", "8x5", "--square", "25 mm")
    assert outcome.code == 1
    assert "different views of the board" in outcome.err
    assert "is --board right?" in outcome.err


def test_calibration_with_a_missing_camera_is_a_device_error(mission: Mission) -> None:
    outcome = mission("robot", "camera", "calibrate", "97", *BOARD, "--seconds", "0.5")
    assert outcome.code == 3
    assert "/dev/video97: no such device" in outcome.err
