"""Runs on a robot are recorded, and the oldest records make room."""

import fcntl
import os
import shutil
from pathlib import Path

import pytest

from config.defaults import DEFAULTS_FILE, config_folder, set_default
from drivers.clock import time_of_day
from missions.plugins.records import options, retention
from missions.plugins.records.options import RecordOptions
from missions.plugins.records.run_recording import record_settings
from missions.request import RunRequest
from tests.missions.command import command
from tests.missions.lone_base import LONE_ROBOT, lone_base

DAY = 24 * 3600.0


def written(folder: Path, name: str, *, age: float, size: int = 10) -> Path:
    path = folder / f"{name}.mcap"
    path.write_bytes(b"x" * size)
    os.utime(path, (1e9 - age, 1e9 - age))
    return path


def test_only_records_older_than_a_month_are_removed(tmp_path: Path) -> None:
    new, old = written(tmp_path, "new", age=DAY), written(tmp_path, "old", age=31 * DAY)
    other = tmp_path / "notes.txt"
    other.touch()
    os.utime(other, (0, 0))
    retention.remove_old_records(tmp_path, 1e9)
    assert (new.exists(), old.exists(), other.exists()) == (True, False, True)


def test_the_oldest_make_room_for_the_newest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retention, "MAX_TOTAL_BYTES", 25)
    files = [written(tmp_path, str(age), age=age * DAY) for age in range(4)]
    retention.remove_old_records(tmp_path, 1e9)
    assert [path.exists() for path in files] == [True, True, False, False]


def test_newest_record_is_kept_at_any_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retention, "MAX_TOTAL_BYTES", 5)
    path = written(tmp_path, "one", age=100 * DAY)
    retention.remove_old_records(tmp_path, 1e9)
    assert path.exists()


NOW = 1e9
YEAR = 365 * DAY


@pytest.mark.parametrize("wrong", [0.0, 1000.0, NOW - YEAR, NOW + 2 * YEAR, NOW + 70 * YEAR, 2.0**31, 2.0**33])
def test_wrong_clock_removes_no_record(tmp_path: Path, wrong: float) -> None:
    files = [written(tmp_path, str(age), age=age * DAY) for age in (1, 5, 20)]
    for hours in range(3):  # runs meanwhile
        assert retention.remove_old_records(tmp_path, wrong + hours * 3600.0) == []
        files.append(written(tmp_path, f"then{hours}", age=NOW - wrong - hours * 3600.0))
    assert retention.remove_old_records(tmp_path, NOW) == []  # the clock is right again
    assert all(path.exists() for path in files)


def test_future_records_are_kept_and_do_not_age_others(tmp_path: Path) -> None:
    ahead = written(tmp_path, "ahead", age=-300 * YEAR)
    near, far = written(tmp_path, "near", age=10 * DAY), written(tmp_path, "far", age=35 * DAY)
    assert retention.remove_old_records(tmp_path, NOW) == ["far.mcap (over 30 days old)"]
    assert (ahead.exists(), near.exists(), far.exists()) == (True, True, False)


def test_first_recorded_is_removed_first_at_any_timestamp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("first", "second", "third", "fourth")
    stamps = (NOW, 60.0, NOW + 70 * YEAR, 30.0)  # a clock that begins in 1970 at each start, until it is set
    for name, stamp in zip(names, stamps, strict=True):
        written(tmp_path, name, age=NOW - stamp)
        retention.remove_old_records(tmp_path, stamp)
    monkeypatch.setattr(retention, "MAX_TOTAL_BYTES", 25)
    removed = retention.remove_old_records(tmp_path, 90.0)
    assert sorted(path.stem for path in retention.list_records(tmp_path)) == ["fourth", "third"]
    assert sorted(each.partition(".")[0] for each in removed) == ["first", "second"]


def test_record_being_written_is_not_removed(tmp_path: Path) -> None:
    written(tmp_path, "new", age=DAY)
    old = written(tmp_path, "old", age=31 * DAY)
    with old.open("ab") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert retention.remove_old_records(tmp_path, NOW) == []
    assert retention.remove_old_records(tmp_path, NOW) == ["old.mcap (over 30 days old)"]


@pytest.mark.parametrize("kind", ["fifo", "folder", "dangling", "binary", "device"])
def test_odd_order_file_does_not_block(tmp_path: Path, kind: str) -> None:
    order = tmp_path / retention.ORDER_FILE
    match kind:
        case "fifo":
            os.mkfifo(order)
        case "folder":
            order.mkdir()
        case "dangling":
            order.symlink_to("nowhere")
        case "binary":
            order.write_bytes(bytes(range(256)))
        case "device":
            order.symlink_to("/dev/zero")
    new, old = written(tmp_path, "new", age=DAY), written(tmp_path, "old", age=31 * DAY)
    assert retention.remove_old_records(tmp_path, NOW) == ["old.mcap (over 30 days old)"]
    assert (new.exists(), old.exists()) == (True, False)


@pytest.mark.parametrize("name", [b"caf\xe9.mcap", b"two\nlines.mcap"])
def test_record_with_an_odd_name_keeps_its_order(tmp_path: Path, name: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    first = tmp_path / os.fsdecode(name)
    first.write_bytes(b"x" * 10)
    os.utime(first, (NOW - 2 * DAY, NOW - 2 * DAY))
    assert retention.remove_old_records(tmp_path, NOW - 2 * DAY) == []
    written(tmp_path, "second", age=3 * DAY)  # made later, by a clock that is behind
    assert retention.remove_old_records(tmp_path, NOW) == []
    written(tmp_path, "third", age=0.0)
    monkeypatch.setattr(retention, "MAX_TOTAL_BYTES", 25)
    retention.remove_old_records(tmp_path, NOW)
    assert not first.exists()


def test_removed_records_are_reported_by_the_run(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = retention.records_folder()
    folder.mkdir(parents=True)
    for name, age in (("new", DAY), ("old", 31 * DAY)):
        path = written(folder, name, age=age)
        now = time_of_day().timestamp()
        os.utime(path, (now - age, now - age))
    monkeypatch.setenv(options.RECORD_ENVIRONMENT_VARIABLE, "yes")
    record_settings(RecordOptions(), RunRequest("m", robot="turtlebot2"))
    told = f"mission: removed old records from {folder}: old.mcap (over 30 days old)"
    assert capsys.readouterr().err.strip() == told
    shutil.rmtree(folder)


def test_unreadable_records_folder_is_an_error(tmp_path: Path) -> None:
    assert retention.list_records(tmp_path / "missing") == []
    (tmp_path / "file").touch()
    with pytest.raises(NotADirectoryError):
        retention.list_records(tmp_path / "file")


def test_record_removed_during_listing_is_omitted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one.mcap", "two.mcap"):
        (tmp_path / name).touch()
    is_file = Path.is_file

    def removed(path: Path) -> bool:
        found = is_file(path)
        if path.name == "one.mcap":
            path.unlink()
        return found

    monkeypatch.setattr(Path, "is_file", removed)
    assert [path.name for path in retention.list_records(tmp_path)] == ["two.mcap"]


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
def test_record_variable_overrides_the_users_default(
    said: str, default: str, robot: bool, simulated: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MISSION_RECORD", said)
    config_folder().mkdir(parents=True, exist_ok=True)
    (config_folder() / DEFAULTS_FILE).write_text(default, encoding="utf-8")
    assert (options.is_recorded_by_default(), options.is_recorded_by_default(simulated=True)) == (robot, simulated)


def test_run_on_a_robot_is_recorded_by_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("MISSION_RECORD")
    mission = tmp_path / "brief.yaml"
    mission.write_text("mission: brief\ntree:\n  sequence:\n    - wait: 100 ms\n    - drive: 1 cm\n", encoding="utf-8")
    with lone_base() as base:
        run = ("run", str(mission), "--robot", LONE_ROBOT, "--port", f"base={base.port}")
        assert command(capsys, *run, "--no-record").code == 0
        set_default("record", "false")
        assert command(capsys, *run).code == 0
        assert command(capsys, "record", "list").out.startswith("no records in ")
        set_default("record", "true")
        assert command(capsys, *run).code == 0
    listed = command(capsys, "record", "list").out
    assert "brief" in listed
    assert "success" in listed
    (path,) = retention.list_records(retention.records_folder())
    assert path.stat().st_mode & 0o077 == 0
