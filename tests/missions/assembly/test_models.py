"""Fetching models, from a server on this machine."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from missions.assembly import models
from missions.assembly.models import YUNET, FetchError, ModelFile, fetch, is_fetched, models_folder
from missions.plugins.setup import models as cli
from tests.missions.command import Outcome, command

CONTENT = bytes(range(256)) * 1000
MODEL = ModelFile("small", "A test.", "small.onnx", "", hashlib.sha256(CONTENT).hexdigest(), len(CONTENT))


class Handler(BaseHTTPRequestHandler):
    """Serves the model, another file, half of the file, or nothing."""

    def do_GET(self) -> None:
        if self.path == "/moved":
            self.send_response(302)
            self.send_header("Location", "/good")
            self.end_headers()
            return
        if self.path == "/absent":
            self.send_error(404)
            return
        sent = {"/good": CONTENT, "/other": CONTENT[::-1], "/endless": CONTENT * 20, "/half": CONTENT[:1000]}[self.path]
        self.send_response(200)
        self.send_header("Content-Length", str(len(CONTENT) if self.path == "/half" else len(sent)))
        self.end_headers()
        try:
            self.wfile.write(sent)
        except ConnectionError:  # the client has had enough of an endless file
            return

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the name that the base class has
        """Print nothing."""


@pytest.fixture
def server() -> Iterator[str]:
    """The address of a server on the loopback."""
    served = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = Thread(target=served.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{served.server_port}"
    served.shutdown()
    served.server_close()
    thread.join(5.0)


@pytest.mark.parametrize("place", ["good", "moved"])
def test_model_is_fetched_into_a_new_folder(server: str, tmp_path: Path, place: str) -> None:
    counts: list[int] = []
    path = fetch(MODEL, tmp_path / "a/b", url=f"{server}/{place}", on_progress=counts.append)
    assert path == tmp_path / "a/b/small.onnx"
    assert path.read_bytes() == CONTENT
    assert counts[-1] == len(CONTENT)
    assert is_fetched(MODEL, tmp_path / "a/b")


@pytest.mark.parametrize(
    ("place", "complaint"),
    [
        ("other", f"is not the file that was published: {len(CONTENT)} bytes with SHA-256 [0-9a-f]{{64}}, not"),
        ("endless", "is not the file that was published"),
        ("half", "is not the file that was published: 1000 bytes|broke off"),
        ("absent", "the server says 404 Not Found"),
    ],
)
def test_wrong_download_leaves_no_file(server: str, tmp_path: Path, place: str, complaint: str) -> None:
    with pytest.raises(FetchError, match=complaint) as raised:
        fetch(MODEL, tmp_path, url=f"{server}/{place}")
    assert f"{server}/{place}" in str(raised.value)
    assert raised.value.hint
    assert list(tmp_path.iterdir()) == []


def test_failed_download_keeps_the_existing_file(server: str, tmp_path: Path) -> None:
    (tmp_path / MODEL.file).write_bytes(b"my own")
    with pytest.raises(FetchError):
        fetch(MODEL, tmp_path, url=f"{server}/other")
    assert (tmp_path / MODEL.file).read_bytes() == b"my own"
    assert not is_fetched(MODEL, tmp_path)


def test_unreachable_model_server_is_named(tmp_path: Path) -> None:
    with pytest.raises(FetchError, match=r"small: http://127.0.0.1:9/x: cannot be reached"):
        fetch(MODEL, tmp_path, url="http://127.0.0.1:9/x")


def test_models_are_fetched_only_from_web_servers(tmp_path: Path) -> None:
    with pytest.raises(FetchError, match="not the address of a web server"):
        fetch(MODEL, tmp_path, url="file:///etc/passwd")


def test_models_folder_that_cannot_be_created_is_named(server: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FetchError, match="file"):
        fetch(MODEL, tmp_path / "file", url=f"{server}/good")


def test_models_folder_is_in_the_users_data_folder() -> None:
    assert models_folder({"XDG_DATA_HOME": "/data"}) == Path("/data/missiontree/models")
    assert models_folder({"XDG_DATA_HOME": "relative"}) == Path.home() / ".local/share/missiontree/models"
    assert models_folder({}) == Path.home() / ".local/share/missiontree/models"


def test_yunet_has_the_published_checksum() -> None:
    assert YUNET.url.startswith("https://github.com/opencv/opencv_zoo/")
    assert YUNET.url.endswith(YUNET.file)
    assert (len(YUNET.sha256), YUNET.size) == (64, 232_589)


Mission = Callable[..., Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    known = {"yunet": replace(MODEL, name="yunet")}
    monkeypatch.setattr(models, "MODELS", known)
    monkeypatch.setattr(cli, "MODELS", known)
    return lambda *arguments: command(capsys, *arguments)


def test_the_command_lists_fetches_and_lists_again(mission: Mission, server: str, tmp_path: Path) -> None:
    assert "mission robot models fetch yunet" in mission("robot", "models").out
    outcome = mission("robot", "models", "fetch", "yunet", "--from", f"{server}/good")
    assert outcome.code == 0
    assert "detector: yunet" in outcome.err
    path = tmp_path / "missiontree/models/small.onnx"
    assert path.read_bytes() == CONTENT
    assert f"in {path}" in mission("robot", "models", "list").out
    assert "already exists" in mission("robot", "models", "fetch", "yunet", "--from", f"{server}/absent").out


def test_models_fetch_command_reports_error_and_hint(mission: Mission, server: str) -> None:
    outcome = mission("robot", "models", "fetch", "yunet", "--from", f"{server}/other")
    assert outcome.code == 1
    assert "is not the file that was published" in outcome.err
    assert "try: " in outcome.err


def test_an_unknown_model_is_a_usage_error(mission: Mission) -> None:
    outcome = mission("robot", "models", "fetch", "yolo")
    assert outcome.code == 2
    assert "'yolo'" in outcome.err
