"""The ``mission see`` command: faces with their eyes, things, markers, and the picture as a whole."""

import socket
from collections.abc import Callable, Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
import skimage.data

from drivers.api import Image
from missions.plugins.setup.camera_page.server import CameraPage
from tests.drivers.web_cameras import WebCamera, answer
from tests.missions.command import Outcome, command, events_of
from tests.perception.people_drawn import pictures

Mission = Callable[..., Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    cv2.imwrite("astronaut.png", cv2.cvtColor(skimage.data.astronaut(), cv2.COLOR_RGB2BGR))
    room = np.full((480, 640, 3), 150, np.uint8)
    cv2.circle(room, (450, 300), 60, (40, 40, 200), cv2.FILLED)
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, 90)
    room[100:220, 100:220] = 255
    room[115:205, 115:205] = marker[:, :, None]
    cv2.imwrite("room.png", room)
    return lambda *arguments: command(capsys, *arguments)


def test_see_reports_face_eyes_and_brightness(mission: Mission) -> None:
    (seen,) = events_of(mission("see", "--json", "astronaut.png").out.splitlines())
    ((x, y, width, height),) = seen["faces"]
    ((left, right),) = seen["eyes"]
    assert x < left[0] < right[0] < x + width
    assert y < left[1] < y + height / 2
    assert 100 < seen["brightness"] < 130
    assert seen["contrast"] > 10
    words = mission("see", "astronaut.png").out
    assert f"1 face: {width} x {height} at ({x}, {y}), both eyes; brightness" in words


def test_things_and_markers_are_looked_for_on_request(mission: Mission) -> None:
    (plain,) = events_of(mission("see", "--json", "room.png").out.splitlines())
    assert (plain["faces"], plain["things"], plain["markers"]) == ([], [], [])
    (seen,) = events_of(mission("see", "--json", "--things", "small red ball", "--markers", "4x4_50", "room.png")
                        .out.splitlines())  # fmt: skip
    (ball,), (marker,) = seen["things"], seen["markers"]
    assert ball["name"] == "small red ball"
    assert ball["box"] == pytest.approx([390, 240, 120, 120], abs=4)
    assert ball["distance"] == pytest.approx(0.46, abs=0.05)
    assert marker["number"] == 7
    assert marker["box"] == pytest.approx([115, 115, 90, 90], abs=3)
    assert abs(marker["heading"]) < 0.3


def test_see_tracks_things_in_a_film(mission: Mission) -> None:
    room = cv2.imread("room.png")
    assert room is not None
    film = cv2.VideoWriter("film.avi", cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (640, 480))
    for shift in range(4):
        film.write(np.roll(room, 5 * shift, axis=1))
    film.release()
    seen = events_of(mission("see", "--json", "--things", "red thing", "film.avi").out.splitlines())
    assert [len(frame["things"]) for frame in seen] == [0, 1, 1, 1]
    assert [frame["things"][0]["box"][0] for frame in seen[1:]] == pytest.approx([395, 400, 405], abs=3)


def test_see_annotates_things_and_markers(mission: Mission) -> None:
    assert mission("see", "--annotate", "out", "--things", "red ball", "--markers", "4x4_50", "room.png").code == 0
    drawn, plain = cv2.imread("out/room.png"), cv2.imread("room.png")
    assert drawn is not None
    assert plain is not None
    changed = (drawn != plain).any(axis=2)
    for rows, columns in ((slice(230, 370), slice(380, 520)), (slice(105, 215), slice(105, 215))):
        assert changed[rows, columns].any()


def test_an_unknown_object_and_an_unknown_family_are_usage_errors(mission: Mission) -> None:
    outcome = mission("see", "--things", "redd ball", "room.png")
    assert outcome.code == 2
    assert "red" in outcome.err
    assert mission("see", "--markers", "qr", "room.png").code == 2


def test_see_uses_the_robots_lens_and_detector(mission: Mission) -> None:
    Path("wide.yaml").write_text("robot: wide\ncamera: {field_of_view: 90 deg}\n")
    narrow, wide = (
        events_of(mission("see", "--json", "--things", "small red ball", *robot, "room.png").out.splitlines())[0]
        for robot in ((), ("--robot", "wide.yaml"))
    )
    assert wide["things"][0]["distance"] < 0.7 * narrow["things"][0]["distance"]
    Path("net.yaml").write_text("robot: net\ncamera: {detector: yunet}\n")
    outcome = mission("see", "--robot", "net.yaml", "room.png")
    assert outcome.code == 2
    assert "mission robot models fetch yunet" in outcome.err


def test_see_names_people_on_request(mission: Mission) -> None:
    nobody = mission("see", "--people", "astronaut.png")
    assert "1 face: unknown, " in nobody.out
    assert "mission person add NAME" in nobody.err
    for number, photo in enumerate(pictures("anna", (1.0, 1.3), each=2)):
        cv2.imwrite(f"anna{number}.png", photo)
    for number, photo in enumerate(pictures("ben", (1.0, 1.3), each=2)):
        cv2.imwrite(f"ben{number}.png", photo)
    for name in ("anna", "ben"):
        assert mission("person", "add", name.title(), *(f"{name}{number}.png" for number in range(3))).code == 0
    seen = events_of(mission("see", "--people", "--json", "anna3.png", "ben3.png").out.splitlines())
    assert [each["names"] for each in seen] == [["Anna"], ["Ben"]]
    assert mission("see", "anna3.png").out.startswith("anna3.png frame 0: 1 face: ")


def filmed(name: str) -> None:
    """Write a film in which a face goes by."""
    face = cv2.imread("astronaut.png")
    assert face is not None
    film = cv2.VideoWriter(name, cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (512, 512))
    for shift in range(12):
        film.write(np.roll(face, 5 * shift, axis=1))
    film.release()


def test_see_annotates_a_camera_stream_into_a_film(mission: Mission, tmp_path: Path) -> None:
    filmed("street.avi")
    camera = f"file://{tmp_path}/street.avi"  # an address, as that of a camera in the network
    outcome = mission("see", camera, "--annotate", "seen.webm")
    assert outcome.out.startswith(f"{camera} frame 0: 1 face")
    assert " pictures to seen.webm" in outcome.out.splitlines()[-1]
    assert cv2.VideoCapture("seen.webm").get(cv2.CAP_PROP_FRAME_COUNT) > 0
    frames = events_of(mission("see", "--json", camera).out.splitlines())
    assert [frame["frame"] for frame in frames] == list(range(len(frames))), "each is told, as they come"
    assert all(len(frame["faces"]) <= 1 for frame in frames)


def test_a_robot_s_camera_is_looked_through_where_no_picture_is_named(mission: Mission, tmp_path: Path) -> None:
    filmed("street.avi")
    Path("eye.yaml").write_text(f"robot: eye\ncamera: {{source: 'file://{tmp_path}/street.avi'}}\n")
    assert f"file://{tmp_path}/street.avi frame 0: 1 face" in mission("see", "--robot", "eye.yaml").out
    Path("blind.yaml").write_text("robot: blind\nvoice: {}\n")
    assert "blind.yaml has no camera" in mission("see", "--robot", "blind.yaml").err
    assert "try: mission see 0" in mission("see").err


def test_see_reports_a_missing_camera(mission: Mission) -> None:
    outcome = mission("see", "/dev/video987", "--seconds", "0.5")
    assert outcome.code == 3
    assert "/dev/video987: no such device" in outcome.err


def test_see_shows_the_camera_live_on_a_page(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    pages: list[CameraPage] = []
    begun = CameraPage.open

    def opened(page: CameraPage) -> None:
        begun(page)
        pages.append(page)

    def through(*_: object) -> Iterator[tuple[float, Image]]:
        """Show the astronaut, to nobody at first, until a page has got the picture."""
        image = skimage.data.astronaut()
        yield 0.0, image
        for page in pages:
            with closing(HTTPConnection("127.0.0.1", urlsplit(page.link).port, timeout=30)) as connection:
                connection.request("GET", urlsplit(page.link).path + "events")
                for line in iter(connection.getresponse().readline, b""):
                    if "jpeg" in line.decode():
                        told.append(line.decode())
                        return
                    yield 0.1, image

    told: list[str] = []
    monkeypatch.setattr(CameraPage, "open", opened)
    monkeypatch.setattr("missions.plugins.setup.see.camera_frames", through)
    assert mission("see", "0").err == "", "no page where nobody sits at the terminal"
    outcome = mission("see", "0", "--view")
    assert outcome.code == 0
    assert outcome.err.startswith("live: http://127.0.0.1:")
    assert "1 face: " in told[-1]
    assert len(pages) == 1


def test_see_uses_the_camera_driver_of_the_robot(mission: Mission) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
    Path("far.yaml").write_text(f"robot: far\nros2: {{router: 'tcp/127.0.0.1:{port}'}}\ncamera: {{driver: ros2}}\n")
    outcome = mission("see", "--robot", "far.yaml", "--seconds", "1")
    assert outcome.code == 3
    assert "/dev/video" not in outcome.err, "it does not look through another camera"


def test_the_page_is_for_cameras(mission: Mission) -> None:
    outcome = mission("see", "astronaut.png", "--view")
    assert outcome.code == 2
    assert "--view needs a camera" in outcome.err


def test_pictures_are_turned_and_mirrored_on_request(mission: Mission) -> None:
    room = cv2.imread("room.png")
    assert room is not None
    cv2.imwrite("turned.png", cv2.flip(cv2.rotate(room, cv2.ROTATE_90_COUNTERCLOCKWISE), 0))
    look = ("see", "--json", "--things", "small red ball")
    (plain,) = events_of(mission(*look, "room.png").out.splitlines())
    (seen,) = events_of(mission(*look, "--flip", "horizontal", "--rotate", "90", "turned.png").out.splitlines())
    assert seen["things"][0]["box"] == pytest.approx(plain["things"][0]["box"], abs=4)
    outcome = mission(*look, "--rotate", "45", "turned.png")
    assert (outcome.code, "90" in outcome.err) == (2, True)


def test_network_camera_is_rotated_and_its_password_hidden(mission: Mission) -> None:
    room = cv2.imread("room.png")
    assert room is not None
    body = cv2.imencode(".jpg", cv2.rotate(room, cv2.ROTATE_180))[1].tobytes()
    with WebCamera(lambda connection: connection.send(answer(body))) as web:
        place = web.url.removeprefix("http://")
        source = f"http://me:secret@{place}/capture?pwd=secret"
        Path("far.yaml").write_text(f"robot: far\ncamera: {{source: '{source}', rotate: 180, field_of_view: 90 deg}}\n")
        look = ("see", "--robot", "far.yaml", "--things", "red ball", "--seconds", "1")
        *_, seen = events_of(mission(*look, "--json").out.splitlines())
        assert seen["things"][0]["box"] == pytest.approx([390, 240, 120, 120], abs=6)
        assert seen["file"] == f"http://***@{place}/capture?pwd=***"
        for outcome in (
            mission(*look, "--annotate", "out"),
            mission("robot", "show", "far.yaml"),
            mission("see", source, "--seconds", "1"),
        ):
            assert "secret" not in outcome.out + outcome.err
        assert not [path for path in Path("out").iterdir() if "secret" in path.name]
    lost = mission(*look)
    assert (lost.code, "secret" in lost.out + lost.err) == (3, False)
