"""The file of the queue: whose it is, what it refuses, and that two programs may begin with it at once."""

import fcntl
import os
import sqlite3
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from missions.plugins.tasks.file_lock import LockHeldError, hold_lock, is_locked
from missions.plugins.tasks.queue_database import VERSION, open_db, prepare, queue_errors
from missions.plugins.tasks.task import TaskError
from tests.missions.service.small_queue import new, shop

ROOT = Path(__file__).parents[3]


def test_queue_file_is_private_and_synced(tmp_path: Path) -> None:
    path = tmp_path / "state" / "missiontree" / "tasks.db"
    with closing(open_db(path)) as connection:
        connection.execute("INSERT INTO task SELECT * FROM task WHERE 0")
        settings = {name: connection.execute(f"PRAGMA {name}").fetchone()[0] for name in PRAGMAS}
        modes = {each.name: stat.S_IMODE(each.stat().st_mode) for each in path.parent.iterdir()}
    assert settings == PRAGMAS
    assert set(modes.values()) == {0o600}
    assert "tasks.db-wal" in modes
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


PRAGMAS = {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1, "user_version": VERSION}


def test_readable_queue_file_becomes_private(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    open_db(path).close()
    path.chmod(0o644)
    open_db(path).close()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize(
    ("version", "words", "hint"),
    [
        (VERSION + 1, "a newer", "pip install --upgrade missiontree"),
        *((version, "an older", "mv ") for version in range(1, VERSION)),
    ],
)
def test_queue_of_another_version_is_refused_and_left_unchanged(
    tmp_path: Path, version: int, words: str, hint: str
) -> None:
    path = tmp_path / "tasks.db"
    with closing(open_db(path)) as connection:
        connection.execute(f"PRAGMA user_version = {version}")
    before = path.read_bytes()
    with pytest.raises(TaskError, match=f"version {version} was made by {words} MissionTree") as raised:
        open_db(path)
    assert raised.value.hint.startswith(hint)
    assert path.read_bytes() == before


def test_file_that_is_not_a_queue_is_refused_and_left_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    path.write_text("my notes" * 1000, encoding="utf-8")
    with pytest.raises(TaskError, match="is damaged, or not a task queue: file is not a database") as raised:
        open_db(path)
    assert raised.value.hint.startswith(f"mv {path} {path}.broken  (")
    assert path.read_text(encoding="utf-8") == "my notes" * 1000


def test_damaged_queue_is_refused_and_left_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    open_db(path).close()
    damaged = path.read_bytes()[:4096] + b"\x5a" * 8192
    path.write_bytes(damaged)
    with pytest.raises(TaskError, match="is damaged, or not a task queue: ") as raised:
        open_db(path)
    assert f"mv {path} {path}.broken" in raised.value.hint
    assert path.read_bytes() == damaged


def test_truncated_queue_is_not_taken_for_a_new_one(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    with shop(path) as opened:
        opened.add(new())
    whole = path.read_bytes()
    for length in (0, 1, 100, 511, 512, 4096, 8192, len(whole) // 2, len(whole) - 4096):
        path.write_bytes(whole[:length])
        with pytest.raises(TaskError, match="is damaged, or not a task queue: ") as raised:
            open_db(path)
        assert f"mv {path} {path}.broken" in raised.value.hint
        assert path.read_bytes() == whole[:length]
    path.write_bytes(whole)
    with shop(path) as opened:
        assert len(opened.queue.tasks()) == 1


def test_a_database_of_something_else_gets_no_tables_of_ours(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("CREATE TABLE songs (name)")
    with pytest.raises(TaskError, match="not a task queue: it lacks the tables of a queue"):
        open_db(path)


def test_missing_queue_with_a_log_is_not_taken_for_a_new_one(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    with closing(open_db(path)) as connection:
        connection.execute("INSERT INTO attempt (task, number, began) SELECT 1, 1, 0 WHERE 0")
        path.unlink()
        with pytest.raises(TaskError, match=r"tasks\.db: is missing, but its log tasks\.db-wal is still there"):
            open_db(path)
    (tmp_path / "tasks.db-wal").unlink(missing_ok=True)
    open_db(path).close()
    assert [each.name for each in tmp_path.iterdir()] == ["tasks.db"]


def test_damage_in_the_middle_of_a_queue_is_found_when_opened(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    with shop(path) as opened:
        for _ in range(200):
            opened.add(new())
    whole = path.read_bytes()
    middle = len(whole) // 8192 * 4096
    path.write_bytes(whole[:middle] + b"\x5a" * 4096 + whole[middle + 4096 :])
    with pytest.raises(TaskError, match="is damaged, or not a task queue: "):
        open_db(path)


@pytest.mark.parametrize("column", ["params", "options", "channels", "due", "added", "not_before"])
def test_damaged_task_is_reported_as_damage(tmp_path: Path, column: str) -> None:
    path = tmp_path / "tasks.db"
    with shop(path) as opened:
        opened.add(new())
        for wrong in ("", "7x", "[" * 100_000):
            with closing(sqlite3.connect(path)) as other, other:
                other.execute(f"UPDATE task SET {column} = ?", (wrong,))  # noqa: S608 - ours
            with pytest.raises(TaskError, match="task 1 is damaged"), queue_errors(path):
                opened.queue.tasks()


@pytest.mark.parametrize("column", ["mission", "robot", "every", "reason", "late", "attempts", "most", "priority"])
def test_bytes_where_a_text_or_a_number_was_are_damage(tmp_path: Path, column: str) -> None:
    path = tmp_path / "tasks.db"
    with shop(path) as opened:
        opened.add(new())
        with closing(sqlite3.connect(path)) as other, other:
            other.execute(f"UPDATE task SET {column} = x'ff00'")  # noqa: S608 - ours
        with pytest.raises(TaskError, match="task 1 is damaged"), queue_errors(path):
            opened.queue.tasks()


@pytest.mark.parametrize(
    ("table", "column", "what"),
    [
        ("attempt", "began", "attempt 1"),
        ("attempt", "ended", "attempt 1"),
        ("outbox", "added", "notice 1"),
        ("outbox", "tries", "notice 1"),
        ("outbox", "delivered", "notice 1"),
        ("outbox", "body", "notice 1"),
    ],
)
def test_damaged_attempts_and_notices_are_reported_as_damage(
    tmp_path: Path, table: str, column: str, what: str
) -> None:
    path = tmp_path / "tasks.db"
    with shop(path) as opened:
        opened.add(new())
        opened.attempt("success")
        for wrong in ("{}", "7x", "7", "[" * 100_000, b"\xff"):
            if wrong == "7" and column != "body":
                continue
            with closing(sqlite3.connect(path)) as other, other:
                other.execute(f"UPDATE {table} SET {column} = ?", (wrong,))  # noqa: S608 - ours
            with pytest.raises(TaskError, match=f"{what} is damaged"), queue_errors(path):
                _ = opened.queue.attempts(1), opened.outbox.notices_of(1)


def test_database_errors_are_translated_except_for_our_own(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    with pytest.raises(TaskError, match="is damaged") as raised, queue_errors(path):
        raise sqlite3.DatabaseError("database disk image is malformed")
    assert raised.value.hint
    with pytest.raises(TaskError, match=r"tasks\.db: disk I/O error"), queue_errors(path):
        raise sqlite3.OperationalError("disk I/O error")
    with pytest.raises(sqlite3.IntegrityError), queue_errors(path):
        raise sqlite3.IntegrityError("UNIQUE constraint failed")


def test_folder_that_cannot_be_created_gives_a_hint(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(TaskError, match="Not a directory") as raised:
        open_db(tmp_path / "file" / "missiontree" / "tasks.db")
    assert "XDG_STATE_HOME" in raised.value.hint


def test_a_disk_without_a_write_ahead_log_is_refused() -> None:
    with (
        closing(sqlite3.connect(":memory:", isolation_level=None)) as connection,
        pytest.raises(TaskError, match="cannot store a queue safely"),
    ):
        prepare(connection, Path("tasks.db"), new=True)


def test_queue_file_can_be_created_concurrently(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"

    def begin(_: int) -> int:
        with closing(open_db(path)) as connection:
            (count,) = connection.execute("SELECT COUNT(*) FROM task").fetchone()
            return int(count)

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(begin, range(16))) == [0] * 16


def test_second_connection_of_this_process_keeps_our_locks(tmp_path: Path) -> None:
    path = tmp_path / "tasks.db"
    look = "import sys; from pathlib import Path; from missions.plugins.tasks.queue_database import open_db; "
    look += "open_db(Path(sys.argv[1])).close()"
    insert = "INSERT INTO attempt (task, number, began) VALUES (1, ?, 0)"
    with closing(open_db(path)) as ours:
        ours.execute("PRAGMA foreign_keys = OFF")
        ours.execute(insert, (1,))
        open_db(path).close()
        # The last to close puts an end to the write-ahead log, and must see that it is not the last.
        subprocess.run([sys.executable, "-c", look, str(path)], cwd=ROOT, check=True)
        ours.execute(insert, (2,))
        with closing(open_db(path)) as other:
            assert other.execute("SELECT COUNT(*) FROM attempt").fetchone()[0] == 2


def test_a_lock_is_held_by_one(tmp_path: Path) -> None:
    path = tmp_path / "new" / "serve.lock"
    assert not is_locked(path)
    with hold_lock(path):
        assert is_locked(path)
        taken = pytest.raises(LockHeldError, match=r"serve\.lock is in use by process \d+")
        with taken, hold_lock(path, timeout=0.1):
            pass
    assert not is_locked(path)
    with hold_lock(path):
        pass
    with pytest.raises(NotADirectoryError):  # a lock that cannot be looked at is not a free one
        is_locked(path / "beneath")


class Prober:
    """Somebody who asks whether the lock is held, and is done with that at the second look at the clock."""

    def __init__(self, path: Path) -> None:
        self._number = os.open(path, os.O_RDONLY | os.O_CREAT, 0o600)
        fcntl.flock(self._number, fcntl.LOCK_SH)
        self.looks = 0

    def now(self) -> float:
        self.looks += 1
        if self.looks == 2:
            os.close(self._number)
        return 0.0


def test_lock_query_does_not_prevent_taking_the_lock(tmp_path: Path) -> None:
    prober = Prober(tmp_path / "serve.lock")
    with hold_lock(tmp_path / "serve.lock", clock=prober):
        assert is_locked(tmp_path / "serve.lock")
    assert prober.looks == 2
