"""A disk that is full, can only be read, or fails: told in words, and nothing that the queue has taken is lost."""

import json
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from errno import EIO, ENOSPC, EROFS
from pathlib import Path

import pytest

from missions.plugins.tasks.file_lock import hold_lock, is_locked
from missions.plugins.tasks.queue_database import DiskFullError, open_db, queue_error
from missions.plugins.tasks.task import TaskError
from tests.missions.service.small_disk import MOUNT

ROOT = Path(__file__).parents[3]
PATIENCE = 60.0


def of_code(code: int, said: str) -> sqlite3.OperationalError:
    error = sqlite3.OperationalError(said)
    error.sqlite_errorcode = code
    return error


def test_sqlite_full_error_becomes_a_disk_full_error_with_a_hint(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    with closing(open_db(path)) as connection:
        connection.execute("PRAGMA max_page_count = 1")
        with pytest.raises(sqlite3.OperationalError) as raised:
            connection.execute("CREATE TABLE more AS SELECT zeroblob(100000)")
    told = queue_error(path, raised.value)
    assert isinstance(told, DiskFullError)
    assert "tasks.db: the disk is full: the tasks in the queue are safe" in str(told)
    assert told.hint == f"df -h {tmp_path}, and free some space"


@pytest.mark.parametrize(
    ("error", "said", "hint"),
    [
        (OSError(ENOSPC, os.strerror(ENOSPC)), "the disk is full", "df -h "),
        (OSError(EROFS, os.strerror(EROFS)), "is read-only (Read-only file system)", "findmnt -T "),
        (OSError(EIO, os.strerror(EIO)), "disk error (Input/output error)", "dmesg | tail"),
        (of_code(sqlite3.SQLITE_READONLY, "attempt to write"), "is read-only (attempt to write)", "findmnt -T "),
        (of_code(sqlite3.SQLITE_IOERR_FSYNC, "disk I/O error"), "disk error", "dmesg | tail"),
        (of_code(sqlite3.SQLITE_BUSY, "database is locked"), "locked by another program", "fuser "),
        (of_code(sqlite3.SQLITE_ERROR, "no such thing"), "no such thing", "XDG_STATE_HOME"),
    ],
)
def test_disk_errors_have_a_hint(
    tmp_path: Path, error: OSError | sqlite3.OperationalError, said: str, hint: str
) -> None:
    told = queue_error(tmp_path / "tasks.db", error)
    assert said in str(told)
    assert told.hint.startswith(hint)


def test_io_error_without_free_space_is_a_disk_full_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for blocks, files, full in ((0, 1000, True), (10**6, 0, True), (10**6, 1000, False)):
        found = os.statvfs_result((4096, 4096, 10**6, blocks, blocks, 1000, files, files, 0, 255))
        with monkeypatch.context() as patch:
            patch.setattr(os, "statvfs", lambda _, found=found: found)
            told = queue_error(tmp_path / "tasks.db", of_code(sqlite3.SQLITE_IOERR_SHMSIZE, "disk I/O error"))
        assert isinstance(told, DiskFullError) == full


def test_lock_is_held_even_if_its_holder_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(ENOSPC, os.strerror(ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", full)
        with hold_lock(tmp_path / "serve.lock"):
            patch.undo()
            assert is_locked(tmp_path / "serve.lock")


def test_a_folder_in_the_place_of_the_queue_is_no_emptied_queue(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    path.mkdir()
    with pytest.raises(TaskError, match=r"tasks\.db: not a regular file") as raised:
        open_db(path)
    assert raised.value.hint.startswith(f"mv {path} ")
    path.rmdir()
    path.symlink_to("/dev/zero")
    with pytest.raises(TaskError, match="not a regular file"):
        open_db(path)


def test_foreign_database_is_refused_and_left_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("CREATE TABLE songs (name)")
        other.execute("PRAGMA user_version = 5")
    before = path.read_bytes()
    with pytest.raises(TaskError, match="not a task queue: it lacks the tables of a queue"):
        open_db(path)
    assert path.read_bytes() == before


def test_full_disk_loses_no_task_and_the_queue_continues(tmp_path: Path) -> None:
    apart = ["unshare", "-Umr"]
    try:
        subprocess.run([*apart, *MOUNT, str(tmp_path)], check=True, capture_output=True, timeout=PATIENCE)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no disk can be mounted here, not even in a name space of its own (unshare -Umr)")
    command = [*apart, sys.executable, "-m", "tests.missions.service.small_disk", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    refused, hint = told["refused"]
    assert "the disk is full: the tasks in the queue are safe" in refused
    assert hint.startswith(f"df -h {tmp_path}")
    (waited,) = told["waited"]
    assert "the disk is full" in waited
    assert "waiting for free space" in waited
    first, trouble_, again = told["served"]
    assert first == "task 1: first begins"
    assert "the queue cannot be used: " in trouble_
    assert "the disk is full" in trouble_
    assert "df -h" in trouble_
    assert again == "the queue can be used again"
    assert told["states"] == ["done"]
    assert told["said"] == 202  # all that it said, and that it is done
