"""Records show people and name them: nobody but their owner can read them, or what is made of them."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.clock import SystemClock
from missions.plugins.records.recording.cut import cut_record
from missions.plugins.records.recording.export import to_csv, to_folder, to_jsonl
from missions.plugins.records.recording.items import PictureItem
from missions.plugins.records.recording.record_header import RecordContents
from missions.plugins.records.recording.recorder import Recorder
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.setup.annotated_pictures import AnnotatedPictures
from tests.missions.command import command
from tests.missions.records.recording.small_record import FILES, HEAD, items, moments, write
from tests.missions.records.report.told_record import picture


@pytest.fixture(autouse=True)
def open_to_all() -> Iterator[None]:
    """Let new files be readable by all, as far as nobody takes care."""
    before = os.umask(0)
    yield
    os.umask(before)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write(tmp_path / "greet.mcap", items())


def rights(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def of_all_in(folder: Path) -> tuple[set[int], set[int]]:
    """Return the rights of the folders and of the files in a folder and below."""
    inside = list(folder.rglob("*"))
    return {rights(each) for each in inside if each.is_dir()}, {rights(each) for each in inside if each.is_file()}


def record(path: Path, *, overwrite: bool = False) -> None:
    with Recorder(path, overwrite=overwrite) as recorder:
        recorder.open(RecordContents(HEAD, FILES), SystemClock(), report=lambda _: None)
        for past in moments():
            recorder.on_tick(past)


def test_record_is_private(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path)
    assert rights(path) == 0o600
    assert open_record(path).is_complete


def test_overwritten_record_is_private(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.touch(0o666)
    record(path, overwrite=True)
    assert rights(path) == 0o600


def test_cut_record_and_jsonl_export_are_private(path: Path, tmp_path: Path) -> None:
    piece, lines = tmp_path / "piece.mcap", tmp_path / "lines.jsonl"
    lines.touch(0o666)
    cut_record(open_record(path), 0.0, 1.0, piece)
    to_jsonl(open_record(path), lines, force=True)
    assert rights(piece) == rights(lines) == 0o600


def test_exported_folders_and_tables_are_private(path: Path, tmp_path: Path) -> None:
    tables, out = tmp_path / "tables", tmp_path / "out"
    to_csv(open_record(path), tables)
    to_folder(open_record(path), out)
    assert rights(tables) == rights(out) == 0o700
    assert of_all_in(tables) == (set(), {0o600})
    assert of_all_in(out)[1] == {0o600}
    assert {rights(out / name) for name in ("pictures", "files", "tables")} == {0o700}


def test_files_exported_into_an_existing_folder_are_private(path: Path, tmp_path: Path) -> None:
    there = tmp_path / "there"
    (there / "tables").mkdir(parents=True)
    (there / "tables/nodes.csv").touch(0o666)
    to_folder(open_record(path), there, force=True)
    assert rights(there) == 0o777, "the folder itself is its owner's business"
    assert of_all_in(there)[1] == {0o600}


def test_reports_events_frames_and_films_are_private(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report, events, frames, film = (tmp_path / name for name in ("r.html", "e.jsonl", "frames", "film.webm"))
    for there in (report, events):
        there.touch(0o666)
    assert (
        command(capsys, "record", "report", str(path), "-o", str(report), "--plots", str(tmp_path / "plots")).code == 0
    )
    assert command(capsys, "show", str(path), "-o", str(tmp_path / "tree.svg")).code == 0
    pictured = write(tmp_path / "pictured.mcap", [
        item._replace(jpeg=picture(9)) if isinstance(item, PictureItem) else item
                                                  for item in items()])  # fmt: skip
    assert command(capsys, "record", "replay", str(pictured), "--frames", str(frames)).code == 0
    run = ("run", "motions/forward", "--events", str(events), "--film", str(film))
    assert command(capsys, *run).code == 0
    AnnotatedPictures(tmp_path / "drawn", ()).write(tmp_path / "a.png", 0, np.zeros((8, 8, 3), np.uint8))
    for given in (path, pictured):  # written by the test itself
        given.unlink()
    folders, files = of_all_in(tmp_path)
    assert folders == {0o700}
    assert files == {0o600}
    assert {each.name for each in (tmp_path / "drawn").iterdir()} == {"a.png"}
    assert len(list(frames.iterdir())) == 4
