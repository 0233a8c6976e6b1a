"""`--open` leads the browser in by a private file: every user of the computer sees command lines."""

import os
import re
import stat
import webbrowser
from collections.abc import Callable
from pathlib import Path
from threading import Event

import pytest

from missions.library.folders import runtime_folder
from missions.plugins.studio import page_opener as opening
from missions.plugins.studio.access import StudioAccess
from missions.plugins.studio.page_opener import PageOpener, page_opener
from missions.plugins.studio.web_server import StudioAddress
from tests.browser import Browser
from tests.missions.command import command
from tests.missions.studio.serving import Served, studio
from tests.waiting import wait_until

FOLDER = "open"
GONE = 2**22 + 1
"""The number of no process: there are at most 2**22."""


@pytest.fixture(autouse=True)
def runtime(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def files() -> list[Path]:
    return sorted((runtime_folder() / FOLDER).glob("*"))


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses with which a browser is started."""
    found: list[str] = []

    def start(address: str) -> bool:
        found.append(address)
        return True

    monkeypatch.setattr("webbrowser.open", start)
    return found


def link_of(token: str) -> str:
    return StudioAddress().link(token)


def test_the_command_line_of_the_browser_has_no_token(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], started: list[str]
) -> None:
    def serve(place: StudioAddress, sockets: object, begun: Callable[[], None]) -> list[int]:
        del sockets
        begun()
        wait_until(lambda: started)
        [path] = files()
        assert started == [path.as_uri()]
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
        found = re.search(r'url=http://127.0.0.1:\d+/\?token=([\w-]+)"', path.read_text(encoding="utf-8"))
        assert found is not None
        assert found[1] not in (place.access.operator, place.access.viewer)
        assert place.access.by_token(found[1], "") == "operator"
        assert place.access.by_token(found[1], "") is None
        wait_until(lambda: not files())
        return []

    monkeypatch.setattr("missions.plugins.studio.web_server.serve", serve)
    assert command(capsys, "studio", "--port", "0", "--open").code == 0
    assert "token" not in started[0]


def test_the_file_goes_with_the_studio(started: list[str]) -> None:
    with page_opener(StudioAccess(), link_of, print) as opener:
        opener.open()
        wait_until(lambda: started)
        assert len(files()) == 1
    assert files() == []


def test_page_file_of_a_killed_studio_is_removed_by_the_next(started: list[str]) -> None:
    folder = runtime_folder() / FOLDER
    folder.mkdir(parents=True)
    for name in (f"{GONE}.html", f"{os.getppid()}.html", "mine.html"):
        (folder / name).write_text("", encoding="utf-8")
    with page_opener(StudioAccess(), link_of, print) as opener:
        opener.open()
        wait_until(lambda: started)
        assert {each.name for each in files()} == {f"{os.getppid()}.html", f"{os.getpid()}.html", "mine.html"}


def test_browser_that_does_not_open_the_page_is_explained(monkeypatch: pytest.MonkeyPatch, started: list[str]) -> None:
    monkeypatch.setattr(opening, "HINT_DELAY", 0.0)
    told: list[str] = []
    with page_opener(StudioAccess(), link_of, told.append) as opener:
        opener.open()
        wait_until(lambda: told)
    assert "snap" in told[0]
    assert "open the first link" in told[0]
    assert len(started) == 1


def test_page_file_is_removed_when_its_token_expires(monkeypatch: pytest.MonkeyPatch, started: list[str]) -> None:
    monkeypatch.setattr(opening, "ONCE_TOKEN_LIFETIME", 0.0)
    with page_opener(StudioAccess(), link_of, print) as opener:
        opener.open()
        wait_until(lambda: started and not files())


@pytest.mark.parametrize("error", [None, webbrowser.Error("no"), FileNotFoundError(2, "no")])
def test_missing_browser_is_reported(monkeypatch: pytest.MonkeyPatch, error: Exception | None) -> None:
    told: list[str] = []

    def start(_: str) -> bool:
        if error is not None:
            raise error
        return False

    monkeypatch.setattr("webbrowser.open", start)
    with page_opener(StudioAccess(), link_of, told.append) as opener:
        opener.open()
        wait_until(lambda: told)
    assert "no browser found" in told[0]


def test_slow_browser_start_does_not_block(monkeypatch: pytest.MonkeyPatch) -> None:
    ended, begun = Event(), Event()

    def start(_: str) -> bool:
        begun.set()
        return ended.wait()

    monkeypatch.setattr("webbrowser.open", start)
    opener = PageOpener(StudioAccess(), link_of, print)
    opener.open()
    assert begun.wait(30.0)
    opener.close()
    assert files() == []
    ended.set()


@pytest.mark.parametrize("way", ["a file in the way", "a folder of others"])
def test_without_a_private_folder_no_browser_is_started(
    monkeypatch: pytest.MonkeyPatch, started: list[str], way: str
) -> None:
    folder = runtime_folder() / FOLDER
    folder.parent.mkdir(parents=True, exist_ok=True)
    if way == "a file in the way":
        folder.write_text("", encoding="utf-8")
    else:
        folder.mkdir()
        monkeypatch.setattr("os.geteuid", lambda: 12345)
    told: list[str] = []
    with page_opener(StudioAccess(), link_of, told.append) as opener:
        opener.open()
    assert "open the first link" in told[0]
    assert started == []


def test_existing_link_at_the_page_file_is_not_followed(tmp_path: Path, started: list[str]) -> None:
    folder, target = runtime_folder() / FOLDER, tmp_path / "target"
    folder.mkdir(parents=True)
    target.write_text("mine", encoding="utf-8")
    (folder / f"{os.getpid()}.html").symlink_to(target)
    with page_opener(StudioAccess(), link_of, print) as opener:
        opener.open()
        wait_until(lambda: started)
    assert target.read_text(encoding="utf-8") == "mine"


def test_access_link_is_escaped_in_the_page_file(started: list[str]) -> None:
    with page_opener(StudioAccess(), lambda token: f'http://a"><script>/?token={token}', print) as opener:
        opener.open()
        wait_until(lambda: started)
        assert "<script>" not in files()[0].read_text(encoding="utf-8")


def test_the_browser_is_led_in_once_and_the_file_is_gone(browser: Browser, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BROWSER", "true %s")  # it is started, and does nothing
    with studio("--open") as served:
        wait_until(files)
        tab = browser.open(files()[0])
        wait_until(lambda: "operator" in str(tab.evaluate("document.getElementById('link')?.textContent ?? ''")))
        assert tab.evaluate("location.href") == f"http://{served.host}/"
        wait_until(lambda: not files())
        assert not any("token" in line for line in _command_lines(served))


def _command_lines(served: Served) -> list[str]:
    """Return the command lines of the studio and its children."""
    pid = served.process.process.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()
    return [Path(f"/proc/{each}/cmdline").read_text(encoding="utf-8") for each in (str(pid), *children)]
