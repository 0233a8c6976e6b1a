"""The queue's SQLite database, which survives crashes and power cuts.

It has a write-ahead log, and every commit waits for the disk. Triggers and constraints refuse invalid changes from any
program: an ended task never changes, at most one attempt succeeds, one task runs at a time, an unapproved task does not
run, and no repetition or notice is added twice.
"""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from errno import EDQUOT, EIO, ENOSPC, EROFS
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory

from missions.plugins.tasks.task import TaskError

# Error texts of the queue's file: the disk is full, read-only, or failing.

MIN_FREE_BYTES = 128 * 1024
"""Free bytes below which a disk counts as full; SQLite reports a full disk in some cases only as an I/O error."""

STATE_HOME_HINT = "XDG_STATE_HOME selects the folder of the queue"

_FULL, _READ_ONLY = frozenset({ENOSPC, EDQUOT}), frozenset({EROFS})


class DiskFullError(TaskError):
    """The disk of the queue is full."""


def queue_error(path: Path, error: OSError | sqlite3.OperationalError) -> TaskError:
    """Return the TaskError, with a hint, for an error of the queue's file at ``path``."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    number = error.errno if isinstance(error, OSError) else None
    folder, detail = quote(str(path.parent)), str(error)
    if isinstance(error, OSError):
        detail = error.strerror or detail
    if code == sqlite3.SQLITE_FULL or number in _FULL:
        return _disk_full(path)
    if code == sqlite3.SQLITE_READONLY or number in _READ_ONLY:
        return TaskError(
            f"{path}: is read-only ({detail}): a failing disk, or a file of another user",
            hint=f"findmnt -T {folder}, dmesg | tail, ls -l {folder}",
        )
    if code in (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN) and not _has_space(path.parent):
        return _disk_full(path)
    if code == sqlite3.SQLITE_IOERR or number == EIO:
        return TaskError(f"{path}: disk error ({detail})", hint="dmesg | tail  (does it fail?)")
    if code == sqlite3.SQLITE_BUSY:
        return TaskError(f"{path}: locked by another program ({detail})", hint=f"fuser {quote(str(path))}")
    return TaskError(f"{path}: {detail}", hint=STATE_HOME_HINT)


def checkpoint_log(connection: sqlite3.Connection) -> None:
    """Move the write-ahead log into the file, so that further writes on a full disk need no new space.

    SQLite does this by itself only at ``MAX_LOG_PAGES`` pages, and lets the log grow until then.
    """
    with suppress(sqlite3.OperationalError):
        connection.execute("PRAGMA wal_checkpoint (PASSIVE)").fetchone()


def describe_retry(path: Path, error: sqlite3.OperationalError) -> str:
    """Return the text of a database error for the output of a task server that will try again."""
    problem = queue_error(path, error)
    return f"{problem}; retrying\n  try: {problem.hint}"


def _disk_full(path: Path) -> DiskFullError:
    message = f"{path}: the disk is full: the tasks in the queue are safe, and no more can be added"
    return DiskFullError(message, hint=f"df -h {quote(str(path.parent))}, and free some space")


def _has_space(folder: Path) -> bool:
    """Return whether the disk has some free space."""
    try:
        found = os.statvfs(folder)
    except OSError:
        return True  # then the error has another cause
    return found.f_bavail * found.f_frsize >= MIN_FREE_BYTES and (found.f_files == 0 or found.f_favail > 0)


LOCK_TIMEOUT = 30.0
"""Seconds to wait while another program writes to the queue's database."""

MAX_LOG_PAGES = 64
"""Number of pages (4 kB) of the write-ahead log at which SQLite moves them into the database file.

It is small, since on a full disk the database file cannot use the space that the log occupies.
"""

MIN_DATABASE_BYTES = 512
"""Size of the smallest SQLite database in bytes; a smaller file is not a queue."""

ORDER = "priority DESC, max(due, added), id"
"""SQL order of due tasks; a task without a time is due when it was added."""

TABLES = """
CREATE TABLE task (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    mission TEXT NOT NULL, params TEXT NOT NULL, robot TEXT NOT NULL, options TEXT NOT NULL,
    added REAL NOT NULL, due REAL NOT NULL, late REAL, every TEXT NOT NULL,
    state TEXT NOT NULL DEFAULT 'waiting'
        CHECK (state IN ('waiting', 'running', 'done', 'failed', 'cancelled', 'given_up')),
    reason TEXT NOT NULL DEFAULT '',
    attempts INTEGER NOT NULL DEFAULT 0, failures INTEGER NOT NULL DEFAULT 0,
    interruptions INTEGER NOT NULL DEFAULT 0,
    interrupted TEXT NOT NULL CHECK (interrupted IN ('retry', 'give-up')),
    most INTEGER NOT NULL, retries INTEGER NOT NULL,
    cancelling INTEGER NOT NULL DEFAULT 0,
    series INTEGER REFERENCES task,
    priority INTEGER NOT NULL DEFAULT 0, not_before REAL NOT NULL DEFAULT 0, channels TEXT NOT NULL DEFAULT '[]',
    needs_approval INTEGER NOT NULL DEFAULT 0, approved REAL, approved_by TEXT NOT NULL DEFAULT '',
    UNIQUE (series, due)
);
CREATE INDEX waiting ON task (ORDER) WHERE state = 'waiting';
CREATE UNIQUE INDEX one_runs ON task (state) WHERE state = 'running';
CREATE TABLE attempt (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    task INTEGER NOT NULL REFERENCES task, number INTEGER NOT NULL,
    began REAL NOT NULL, ended REAL,
    how TEXT CHECK (how IN ('success', 'failure', 'error', 'interrupted', 'cancelled')),
    reason TEXT NOT NULL DEFAULT '',
    UNIQUE (task, number)
);
CREATE UNIQUE INDEX one_succeeds ON attempt (task) WHERE how = 'success';
CREATE INDEX unended ON attempt (id) WHERE ended IS NULL;
CREATE TABLE outbox (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    key TEXT NOT NULL, task INTEGER NOT NULL REFERENCES task, channel TEXT NOT NULL, body TEXT NOT NULL,
    added REAL NOT NULL, next REAL NOT NULL, tries INTEGER NOT NULL DEFAULT 0,
    delivered REAL, last_error TEXT NOT NULL DEFAULT '',
    UNIQUE (key, channel)
);
CREATE INDEX undelivered ON outbox (next, id) WHERE delivered IS NULL;
CREATE INDEX letters ON outbox (task);
CREATE TRIGGER once BEFORE UPDATE OF state ON task
    WHEN OLD.state IN ('done', 'failed', 'cancelled', 'given_up') AND NEW.state <> OLD.state
    BEGIN SELECT RAISE (ABORT, 'this task has ended already'); END;
CREATE TRIGGER approved_first BEFORE UPDATE OF state ON task
    WHEN NEW.state = 'running' AND NEW.needs_approval AND NEW.approved IS NULL
    BEGIN SELECT RAISE (ABORT, 'nobody has approved this task'); END;
CREATE TABLE errand (
    id TEXT NOT NULL, attempt INTEGER NOT NULL, task INTEGER NOT NULL UNIQUE REFERENCES task,
    again INTEGER NOT NULL, told INTEGER NOT NULL DEFAULT 0,
    PRIMARY KEY (id, attempt)
);
CREATE INDEX untold ON errand (task) WHERE told = 0;
CREATE TRIGGER done_once BEFORE INSERT ON errand
    WHEN EXISTS (
        SELECT 1 FROM errand JOIN task ON task.id = errand.task
        WHERE errand.id = NEW.id AND task.state IN ('waiting', 'running', 'done')
    )
    BEGIN SELECT RAISE (ABORT, 'this robot has this task, or has done it'); END;
CREATE TABLE kept (
    id TEXT PRIMARY KEY, mission TEXT NOT NULL, params TEXT NOT NULL, "on" TEXT NOT NULL, "where" TEXT NOT NULL,
    if_interrupted TEXT NOT NULL CHECK (if_interrupted IN ('retry', 'give-up')), retries INTEGER NOT NULL,
    "by" TEXT NOT NULL, added REAL NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('WAITING', 'INITIALIZING', 'RUNNING', 'PAUSED', 'FINISHED', 'FAILED')),
    robot TEXT NOT NULL, attempt INTEGER NOT NULL, confirmed INTEGER NOT NULL,
    failures INTEGER NOT NULL, interruptions INTEGER NOT NULL, not_before REAL NOT NULL, reason TEXT NOT NULL
);
CREATE INDEX open_kept ON kept (id) WHERE state NOT IN ('FINISHED', 'FAILED');
CREATE TRIGGER kept_once BEFORE UPDATE OF state ON kept
    WHEN OLD.state IN ('FINISHED', 'FAILED') AND NEW.state <> OLD.state
    BEGIN SELECT RAISE (ABORT, 'this task has ended already'); END;
""".replace("(ORDER)", f"({ORDER})")
"""SQL of the tables: the queue, and the fleet tasks that the robot executes and keeps."""

VERSION = 5
"""Version of the queue's tables, stored in ``user_version``; databases of other versions are refused."""


def queue_file(folder: Path) -> Path:
    """Return the path of the queue's file in a folder."""
    return folder / "tasks.db"


def open_db(path: Path, *, any_thread: bool = False) -> sqlite3.Connection:
    """Open the database of the queue; if it is missing, create it, readable for its owner only.

    The connection may be used only on the thread that opens it; with ``any_thread``, on any thread, but only one at a
    time.

    Raises TaskError for a folder that cannot hold it, and for a file that is damaged, empty, no queue, or of another
    version.
    """
    try:
        with queue_errors(path), ExitStack() as undone:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not path.exists():
                _create(path)
            if not path.is_file():
                raise TaskError(f"{path}: not a regular file", hint=f"mv {path} {path}.other  (a new queue begins)")
            if (size := path.stat().st_size) < MIN_DATABASE_BYTES:  # SQLite would create a new database
                raise _damaged_error(path, f"the file is truncated to {size} bytes")
            connection = sqlite3.connect(
                path, timeout=LOCK_TIMEOUT, isolation_level=None, check_same_thread=not any_thread
            )
            undone.callback(connection.close)
            # Before it has any content. Only SQLite may open the file here: closing it would drop the POSIX locks
            # that other connections of this process hold on it, and could corrupt their writes.
            path.chmod(0o600)
            prepare(connection, path)
            undone.pop_all()
            return connection
    except OSError as error:
        raise queue_error(path, error) from error


def _create(path: Path) -> None:
    """Create the file with all its tables atomically: no empty file is valid. Raises TaskError, OSError, sqlite3.Error.

    Another process may create it first; then its file is kept.
    """
    log = path.with_name(f"{path.name}-wal")
    if log.exists() and not path.exists():
        what = f"{path}: is missing, but its log {log.name} is still there"
        raise TaskError(what, hint=f"put {path.name} back; or mv {log} {log}.broken  (a new queue begins)")
    with TemporaryDirectory(dir=path.parent, prefix=".new-") as folder:
        new = Path(folder) / path.name
        with closing(sqlite3.connect(new, timeout=LOCK_TIMEOUT, isolation_level=None)) as connection:
            prepare(connection, path, new=True)
        new.chmod(0o600)
        with suppress(FileExistsError):
            path.hardlink_to(new)
        number = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


@contextmanager
def queue_errors(path: Path) -> Iterator[None]:
    """Convert errors of the queue's file to TaskError; programming errors pass unchanged."""
    try:
        yield
    except sqlite3.OperationalError as error:
        raise queue_error(path, error) from error
    except sqlite3.DatabaseError as error:
        if type(error) is not sqlite3.DatabaseError:  # a subclass, such as a violated constraint
            raise
        raise _damaged_error(path, str(error)) from error


def _damaged_error(path: Path, why: str) -> TaskError:
    return TaskError(
        f"{path}: is damaged, or not a task queue: {why}",
        hint=f"mv {path} {path}.broken  (a new queue begins; sqlite3 {path}.broken .recover shows the remaining data)",
    )


def prepare(connection: sqlite3.Connection, path: Path, *, new: bool = False) -> None:
    """Configure a connection, and create the tables if the file is ``new``. Raises TaskError, sqlite3.Error."""
    connection.row_factory = sqlite3.Row
    if not new:
        _check_version(connection, path)  # before any change
    (journal,) = connection.execute("PRAGMA journal_mode = WAL").fetchone()
    if journal != "wal":
        raise TaskError(
            f"{path}: this disk cannot store a queue safely (journal_mode {journal}); is it a network disk?",
            hint="set XDG_STATE_HOME to a folder on a local disk",
        )
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute(f"PRAGMA wal_autocheckpoint = {MAX_LOG_PAGES}")
    connection.execute("PRAGMA foreign_keys = ON")
    faults = [str(fault) for (fault,) in connection.execute("PRAGMA quick_check (1)")]
    if faults != ["ok"]:
        raise _damaged_error(path, faults[0])
    if new:
        connection.executescript(f"BEGIN; {TABLES} PRAGMA user_version = {VERSION}; COMMIT;")


def _has_tables(connection: sqlite3.Connection) -> bool:
    sql = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('task', 'attempt', 'outbox')"
    return bool(connection.execute(sql).fetchone()[0] == 3)


def _check_version(connection: sqlite3.Connection, path: Path) -> None:
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version > VERSION:
        raise TaskError(
            f"{path}: version {version} was made by a newer MissionTree; this one reads version {VERSION}",
            hint="pip install --upgrade missiontree",
        )
    if 0 < version < VERSION:
        raise TaskError(
            f"{path}: version {version} was made by an older MissionTree; this one reads version {VERSION}",
            hint=f"mv {path} {path}.old  (a new queue begins)",
        )
    if not version or not _has_tables(connection):
        raise _damaged_error(path, "it lacks the tables of a queue")
