"""Films: what plays them, who can read them, and what is said where the disk has no room for them."""

import resource
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
import cv2
import numpy as np
import pytest

from drivers.api import Image
from missions.plugins.pictures import movie
from missions.plugins.pictures.movie import CODECS, PICTURES_PER_CHECK, Movie
from tests.browser import Browser
from tests.missions.command import command

RATE = 12.5


def picture(number: int) -> Image:
    """Return noise, which cannot be packed well."""
    return np.random.default_rng(number).integers(0, 255, (120, 160, 3), dtype=np.uint8)


def filmed(path: Path, pictures: int) -> Movie:
    with Movie(path, rate=RATE, option="--film") as film:
        for number in range(pictures):
            film.write(picture(number))
    return film


def frames(path: Path) -> int:
    """Return how many pictures of a film can be read."""
    video, count = cv2.VideoCapture(str(path)), 0
    while video.grab():
        count += 1
    video.release()
    return count


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """Let no file grow larger, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("ending", CODECS)
def test_film_is_complete_and_readable_by_its_owner_only(
    tmp_path: Path, ending: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"film{ending}"
    path.touch(0o666)
    film = filmed(path, 30)
    assert (film.error, film.pictures, frames(path)) == ("", 30, 30)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert capfd.readouterr().err == "", "OpenCV's own remarks are no news"


@pytest.mark.parametrize("ending", [".webm", ".mp4"])
def test_browser_plays_the_film(browser: Browser, tmp_path: Path, ending: str) -> None:
    filmed(tmp_path / f"film{ending}", 25)
    page = tmp_path / "page.html"
    page.write_text(f"<title>film</title><video src='film{ending}' muted></video>")
    played = """new Promise(done => {
        const film = document.querySelector("video");
        film.onended = () => done([film.videoWidth, film.duration]);
        film.onerror = () => done(film.error.message);
        film.play().catch(error => done(String(error)));
    })"""
    found = browser.open(page).evaluate(played)
    assert found == [160, pytest.approx(2.0, abs=0.2)]


def test_a_film_ends_in_time_where_the_disk_gets_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rooms = iter([10**9, 10**9])
    monkeypatch.setattr(movie, "_free_bytes", lambda _: next(rooms, 1000))
    path = tmp_path / "film.webm"
    film = filmed(path, 3 * PICTURES_PER_CHECK)
    assert film.error.startswith(f"{path}: ends after 50 pictures, 4.0 s, or before: the disk is full")
    assert frames(path) == 2 * PICTURES_PER_CHECK, "what is there can be seen"


@pytest.mark.parametrize("ending", CODECS)
def test_damaged_film_is_reported(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"film{ending}"
    with files_of_at_most(100_000):
        film = filmed(path, 60)
    assert "the written file is damaged" in film.error


def test_failed_film_keeps_the_earlier_file(tmp_path: Path) -> None:
    path = tmp_path / "film.webm"
    path.write_bytes(b"mine")
    with files_of_at_most(100_000):
        film = filmed(path, 60)
    assert film.error.endswith(f"{path} is the earlier film; the new one was removed")
    assert not film.is_written
    assert path.read_bytes() == b"mine"
    assert list(tmp_path.iterdir()) == [path]


def test_a_film_without_a_picture_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(movie, "_free_bytes", lambda _: 1000)
    assert not filmed(tmp_path / "film.webm", 1).is_written
    assert list(tmp_path.iterdir()) == []


def test_pictures_in_a_folder_end_where_the_disk_is_full(tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    with Movie(folder, rate=RATE, option="--film") as film:
        film.write(picture(0))
        with files_of_at_most(1000):
            film.write(picture(1))
        film.write(picture(2))
    assert film.error.startswith(f"{folder}: ends after 1 pictures or before: File too large")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}


def test_film_at_an_unwritable_path_is_refused() -> None:
    with pytest.raises(click.UsageError, match=r"--film: /proc/film\.webm: No such file"):
        filmed(Path("/proc/film.webm"), 1)


def test_film_without_disk_space_is_not_reported_as_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(movie, "_free_bytes", lambda _: 1000)
    done = command(capsys, "run", "look_around", "--simulate", "fast", "--film", str(tmp_path / "film.webm"))
    assert (done.code, "wrote" in done.err) == (0, False)
    assert "film.webm: ends after 0 pictures" in done.err


def test_film_in_a_missing_folder_is_refused_with_a_hint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = command(capsys, "run", "look_around", "--film", str(tmp_path / "films" / "film.webm"))
    assert done.code == 2
    assert f"try: mkdir -p {tmp_path / 'films'}" in done.err
