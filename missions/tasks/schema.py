"""The file that the queue is kept in: an SQLite database that a crash or a power cut leaves whole.

A write-ahead log, and every commit waited for until it is on the disk. What must never happen is refused by the
database itself, whichever program writes: a task that has ended never changes again, one attempt at most succeeds, one
task runs at a time, no repetition is made twice, and no notice either.
"""

import os
import sqlite3
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from missions.tasks.task import TaskError

VERSION = 1
"""The version of the tables, as the file has it in ``user_version``."""

PATIENCE = 30.0
"""Seconds to wait for another program that writes."""

TABLES = """
CREATE TABLE task (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    mission TEXT NOT NULL, params TEXT NOT NULL, robot TEXT NOT NULL, options TEXT NOT NULL,
    added REAL NOT NULL, due REAL NOT NULL, late REAL, every TEXT NOT NULL,
    state TEXT NOT NULL DEFAULT 'waiting'
        CHECK (state IN ('waiting', 'running', 'done', 'failed', 'cancelled', 'given_up')),
    reason TEXT NOT NULL DEFAULT '',
    attempts INTEGER NOT NULL DEFAULT 0, failures INTEGER NOT NULL DEFAULT 0,
    interrupted TEXT NOT NULL CHECK (interrupted IN ('retry', 'give-up')),
    most INTEGER NOT NULL, retries INTEGER NOT NULL,
    cancelling INTEGER NOT NULL DEFAULT 0,
    series INTEGER REFERENCES task,
    UNIQUE (series, due)
);
CREATE INDEX waiting ON task (due, id) WHERE state = 'waiting';
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
"""


def folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return where the queue is kept: among the user's state, as the XDG base directory specification has it."""
    state = environment.get("XDG_STATE_HOME", "")
    return (Path(state) if Path(state).is_absolute() else Path.home() / ".local/state") / "missiontree"


def open_db(path: Path) -> sqlite3.Connection:
    """Open the database, and make it where there is none, for its owner alone. For the thread that opens it.

    Raises TaskError for a folder that cannot hold it, and a file that is another, or of a newer version.
    """
    elsewhere = "XDG_STATE_HOME says where the queue is kept"
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        connection = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
    except (OSError, sqlite3.OperationalError) as error:
        raise TaskError(f"{path}: {error}", hint=elsewhere) from error
    with ExitStack() as undone:
        undone.callback(connection.close)
        try:
            # Before anything is in it. Nobody but SQLite may open the file here: to close it again would drop the locks
            # that other connections of this process have on it, and with them what they write.
            path.chmod(0o600)
            prepare(connection, path)
        except (OSError, sqlite3.OperationalError) as error:
            raise TaskError(f"{path}: {error}", hint=elsewhere) from error
        except sqlite3.DatabaseError as error:
            raise TaskError(f"{path}: is no queue of tasks: {error}", hint=f"mv {path} {path}.broken") from error
        undone.pop_all()
    return connection


def prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Set a connection up, and make the tables where there are none. Raises TaskError, or an error of sqlite3."""
    connection.row_factory = sqlite3.Row
    (journal,) = connection.execute("PRAGMA journal_mode = WAL").fetchone()
    if journal != "wal":
        raise TaskError(
            f"{path}: this disk cannot keep a queue safe (it gave journal_mode {journal}): is it a network's?",
            hint="XDG_STATE_HOME=... says where the queue is kept: a disk of this machine",
        )
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA foreign_keys = ON")
    if _version(connection, path) == 0:
        # Another program may be at the same: whoever comes second finds them made.
        connection.execute("BEGIN IMMEDIATE")
        if _version(connection, path) == 0:
            for statement in _statements(TABLES):
                connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {VERSION}")
        connection.execute("COMMIT")


def _version(connection: sqlite3.Connection, path: Path) -> int:
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version > VERSION:
        raise TaskError(
            f"{path}: is of version {version}, made by a newer MissionTree; this one knows version {VERSION}",
            hint="pip install --upgrade missiontree",
        )
    return int(version)


def _statements(script: str) -> list[str]:
    """Cut a script into its statements: ``executescript`` would end the transaction."""
    found, begun = [], ""
    for line in script.splitlines(keepends=True):
        begun += line
        if sqlite3.complete_statement(begun):
            found.append(begun)
            begun = ""
    return found
