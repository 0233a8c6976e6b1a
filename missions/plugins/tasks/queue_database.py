"""The file that the queue is kept in: an SQLite database that a crash or a power cut leaves whole.

A write-ahead log, and every commit waited for until it is on the disk. What must never happen is refused by the
database itself, whichever program writes: a task that has ended never changes again, one attempt at most succeeds, one
task runs at a time, none that nobody has approved where it needs that, no repetition is made twice, and no notice.
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

# What keeps the queue's file from being used, in words: a disk that is full, can only be read, or fails.

MIN_FREE_BYTES = 128 * 1024
"""Bytes with which a disk counts as full: SQLite tells of some that are only that the disk does not answer."""

STATE_HOME_HINT = "XDG_STATE_HOME says where the queue is kept"

_FULL, _READ_ONLY = frozenset({ENOSPC, EDQUOT}), frozenset({EROFS})


class DiskFullError(TaskError):
    """There is no room for what the queue should keep."""


def queue_error(path: Path, error: OSError | sqlite3.OperationalError) -> TaskError:
    """Return what is to be said of the queue's file at ``path``, which could not be used, and what to type."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    number = error.errno if isinstance(error, OSError) else None
    folder, said = quote(str(path.parent)), str(error)
    if isinstance(error, OSError):
        said = error.strerror or said
    if code == sqlite3.SQLITE_FULL or number in _FULL:
        return _disk_full(path)
    if code == sqlite3.SQLITE_READONLY or number in _READ_ONLY:
        return TaskError(
            f"{path}: can only be read ({said}): so Linux mounts a disk that fails; or it is somebody else's",
            hint=f"findmnt -T {folder}, dmesg | tail, ls -l {folder}",
        )
    if code in (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN) and not _has_space(path.parent):
        return _disk_full(path)
    if code == sqlite3.SQLITE_IOERR or number == EIO:
        return TaskError(f"{path}: its disk does not do what it is told ({said})", hint="dmesg | tail  (does it fail?)")
    if code == sqlite3.SQLITE_BUSY:
        return TaskError(f"{path}: another program writes, and does not end ({said})", hint=f"fuser {quote(str(path))}")
    return TaskError(f"{path}: {said}", hint=STATE_HOME_HINT)


def checkpoint_log(connection: sqlite3.Connection) -> None:
    """Take the log of a queue whose disk is full into its file, so that what is written next takes no more room.

    Of itself SQLite does so when the log has ``schema.LOG`` pages, and until then has it grow.
    """
    with suppress(sqlite3.OperationalError):
        connection.execute("PRAGMA wal_checkpoint (PASSIVE)").fetchone()


def describe_retry(path: Path, error: sqlite3.OperationalError) -> str:
    """Return the same for who watches a server, which goes on trying."""
    told = queue_error(path, error)
    return f"{told}; trying on\n  try: {told.hint}"


def _disk_full(path: Path) -> DiskFullError:
    said = f"{path}: its disk is full: what the queue has is safe, and nothing more can be kept"
    return DiskFullError(said, hint=f"df -h {quote(str(path.parent))}, and make room there")


def _has_space(folder: Path) -> bool:
    """Say whether there is room for a little more."""
    try:
        found = os.statvfs(folder)
    except OSError:
        return True  # then it is something else that is wrong
    return found.f_bavail * found.f_frsize >= MIN_FREE_BYTES and (found.f_files == 0 or found.f_favail > 0)


LOCK_TIMEOUT = 30.0
"""Seconds to wait for another program that writes."""

MAX_LOG_PAGES = 64
"""Pages (of 4 kB) that the log may have: what it has taken of a full disk, the file itself cannot have."""

MIN_DATABASE_BYTES = 512
"""Bytes of the smallest database there is."""

ORDER = "priority DESC, max(due, added), id"
"""The order of tasks that are due; one without a time is due when it was added."""

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
"""The tables: the queue, and what a robot does and keeps for its fleet, by the IDs of the fleet's tasks."""

VERSION = 5
"""The version of the tables, as the file has it in ``user_version``; a file of any other is refused."""


def queue_file(folder: Path) -> Path:
    """Return the file of the queue in a folder."""
    return folder / "tasks.db"


def open_db(path: Path, *, any_thread: bool = False) -> sqlite3.Connection:
    """Open the database, and make it where there is none, for its owner alone. For the thread that opens it.

    With ``any_thread`` another may have it; one at a time.

    Raises TaskError for a folder that cannot hold it, and a file that is another, damaged, emptied, or of another
    version.
    """
    try:
        with queue_errors(path), ExitStack() as undone:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not path.exists():
                _create(path)
            if not path.is_file():
                raise TaskError(
                    f"{path}: is no file, as a queue is", hint=f"mv {path} {path}.other  (a new queue begins)"
                )
            if (size := path.stat().st_size) < MIN_DATABASE_BYTES:  # SQLite would begin anew
                raise _damaged_error(path, f"it was emptied: {size} bytes are left")
            connection = sqlite3.connect(
                path, timeout=LOCK_TIMEOUT, isolation_level=None, check_same_thread=not any_thread
            )
            undone.callback(connection.close)
            # Before anything is in it. Nobody but SQLite may open the file here: to close it again would drop the locks
            # that other connections of this process have on it, and with them what they write.
            path.chmod(0o600)
            prepare(connection, path)
            undone.pop_all()
            return connection
    except OSError as error:
        raise queue_error(path, error) from error


def _create(path: Path) -> None:
    """Make the file with all its tables at once: one that is empty was emptied. Raises TaskError, OSError, sqlite3's.

    Whoever else does so at the same time may come first.
    """
    log = path.with_name(f"{path.name}-wal")
    if log.exists() and not path.exists():
        what = f"{path}: is gone, and its log {log.name} is still there: a queue was here"
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
    """Tell of a file that cannot be used, or is damaged, as a TaskError; of what is a fault of ours as it is."""
    try:
        yield
    except sqlite3.OperationalError as error:
        raise queue_error(path, error) from error
    except sqlite3.DatabaseError as error:
        if type(error) is not sqlite3.DatabaseError:  # one of its kinds, such as a constraint that is broken
            raise
        raise _damaged_error(path, str(error)) from error


def _damaged_error(path: Path, why: str) -> TaskError:
    return TaskError(
        f"{path}: is damaged, or no queue of tasks: {why}",
        hint=f"mv {path} {path}.broken  (a new queue begins; sqlite3 {path}.broken .recover shows what is left)",
    )


def prepare(connection: sqlite3.Connection, path: Path, *, new: bool = False) -> None:
    """Set a connection up, and make the tables of a ``new`` file.

    Raises TaskError, or an error of sqlite3.
    """
    connection.row_factory = sqlite3.Row
    if not new:
        _check_version(connection, path)  # before anything of it is changed
    (journal,) = connection.execute("PRAGMA journal_mode = WAL").fetchone()
    if journal != "wal":
        raise TaskError(
            f"{path}: this disk cannot keep a queue safe (it gave journal_mode {journal}): is it a network's?",
            hint="XDG_STATE_HOME=... says where the queue is kept: a disk of this machine",
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
            f"{path}: is of version {version}, made by a newer MissionTree; this one knows version {VERSION}",
            hint="pip install --upgrade missiontree",
        )
    if 0 < version < VERSION:
        raise TaskError(
            f"{path}: is of version {version}, made by an older MissionTree; this one knows version {VERSION}",
            hint=f"mv {path} {path}.old  (a new queue begins)",
        )
    if not version or not _has_tables(connection):
        raise _damaged_error(path, "it has no tables of a queue")
