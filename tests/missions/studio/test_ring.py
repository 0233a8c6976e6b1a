"""Runs on a robot are recorded, and the oldest records make room."""

import os
from pathlib import Path

import pytest

from config.defaults import FILE, config_folder, keep_default
from missions.studio import ring
from tests.missions.command import command
from tests.missions.lone_base import LONE_ROBOT, lone_base

DAY = 24 * 3600.0


def written(folder: Path, name: str, *, age: float, size: int = 10) -> Path:
    path = folder / f"{name}.mcap"
    path.write_bytes(b"x" * size)
    os.utime(path, (1e9 - age, 1e9 - age))
    return path


def test_what_is_older_than_a_month_goes_and_nothing_else_in_the_folder(tmp_path: Path) -> None:
    new, old = written(tmp_path, "new", age=DAY), written(tmp_path, "old", age=31 * DAY)
    other = tmp_path / "notes.txt"
    other.touch()
    os.utime(other, (0, 0))
    ring.make_room(tmp_path, 1e9)
    assert (new.exists(), old.exists(), other.exists()) == (True, False, True)


def test_the_oldest_make_room_for_the_newest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring, "ROOM", 25)
    files = [written(tmp_path, str(age), age=age * DAY) for age in range(4)]
    ring.make_room(tmp_path, 1e9)
    assert [path.exists() for path in files] == [True, True, False, False]


def test_the_newest_stays_however_large_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring, "ROOM", 5)
    path = written(tmp_path, "one", age=100 * DAY)
    ring.make_room(tmp_path, 1e9)
    assert path.exists()


def test_a_folder_that_cannot_be_read_is_an_error_and_no_empty_one(tmp_path: Path) -> None:
    assert ring.records_in(tmp_path / "missing") == []
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError):
        ring.records_in(tmp_path / "file")


def test_a_record_that_is_removed_meanwhile_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one.mcap", "two.mcap"):
        (tmp_path / name).touch()
    is_file = Path.is_file

    def removed(path: Path) -> bool:
        found = is_file(path)
        if path.name == "one.mcap":
            path.unlink()
        return found

    monkeypatch.setattr(Path, "is_file", removed)
    assert [path.name for path in ring.records_in(tmp_path)] == ["two.mcap"]


@pytest.mark.parametrize(
    ("said", "default", "robot", "simulated"),
    [
        ("", "# nothing", True, False),
        ("", "record: false", False, False),
        ("yes", "record: false", True, False),
        ("no", "record: true", False, False),
        ("all", "record: false", True, True),
    ],
)
def test_the_users_default_says_whether_runs_are_recorded_and_the_environment_goes_before_it(
    said: str, default: str, robot: bool, simulated: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MISSION_RECORD", said)
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / FILE).write_text(default, encoding="utf-8")
    assert (ring.wanted(), ring.wanted(simulated=True)) == (robot, simulated)


@pytest.mark.real_time
def test_a_run_on_a_robot_is_recorded_unless_somebody_says_no(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("MISSION_RECORD")
    mission = tmp_path / "brief.yaml"
    mission.write_text("mission: brief\ntree:\n  sequence:\n    - wait: 100 ms\n    - drive: 1 cm\n", encoding="utf-8")
    with lone_base() as base:
        run = ("run", str(mission), "--robot", LONE_ROBOT, "--port", f"base={base.port}")
        assert command(capsys, *run, "--no-record").code == 0
        keep_default("record", "false")
        assert command(capsys, *run).code == 0
        assert command(capsys, "record", "list").out.startswith("no records in ")
        keep_default("record", "true")
        assert command(capsys, *run).code == 0
    listed = command(capsys, "record", "list").out
    assert "brief" in listed
    assert "success" in listed
    (path,) = ring.records_in(ring.records_folder())
    assert path.stat().st_mode & 0o077 == 0
