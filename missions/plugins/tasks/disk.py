"""What keeps the queue's file from being used, in words: a disk that is full, can only be read, or fails."""

import os
import sqlite3
from contextlib import suppress
from errno import EDQUOT, EIO, ENOSPC, EROFS
from pathlib import Path
from shlex import quote

from missions.plugins.tasks.task import TaskError

ROOM = 128 * 1024
"""Bytes with which a disk counts as full: SQLite tells of some that are only that the disk does not answer."""

ELSEWHERE = "XDG_STATE_HOME says where the queue is kept"

_FULL, _READ_ONLY = frozenset({ENOSPC, EDQUOT}), frozenset({EROFS})


class DiskFull(TaskError):
    """There is no room for what the queue should keep."""


def trouble(path: Path, error: OSError | sqlite3.OperationalError) -> TaskError:
    """Return what is to be said of the queue's file at ``path``, which could not be used, and what to type."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    number = error.errno if isinstance(error, OSError) else None
    folder, said = quote(str(path.parent)), str(error)
    if isinstance(error, OSError):
        said = error.strerror or said
    if code == sqlite3.SQLITE_FULL or number in _FULL:
        return _full(path)
    if code == sqlite3.SQLITE_READONLY or number in _READ_ONLY:
        return TaskError(
            f"{path}: can only be read ({said}): so Linux mounts a disk that fails; or it is somebody else's",
            hint=f"findmnt -T {folder}, dmesg | tail, ls -l {folder}",
        )
    if code in (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN) and not _room(path.parent):
        return _full(path)
    if code == sqlite3.SQLITE_IOERR or number == EIO:
        return TaskError(f"{path}: its disk does not do what it is told ({said})", hint="dmesg | tail  (does it fail?)")
    if code == sqlite3.SQLITE_BUSY:
        return TaskError(f"{path}: another program writes, and does not end ({said})", hint=f"fuser {quote(str(path))}")
    return TaskError(f"{path}: {said}", hint=ELSEWHERE)


def use_what_there_is(connection: sqlite3.Connection) -> None:
    """Take the log of a queue whose disk is full into its file, so that what is written next takes no more room.

    Of itself SQLite does so when the log has ``schema.LOG`` pages, and until then has it grow.
    """
    with suppress(sqlite3.OperationalError):
        connection.execute("PRAGMA wal_checkpoint (PASSIVE)").fetchone()


def in_a_line(path: Path, error: sqlite3.OperationalError) -> str:
    """Return the same for who watches a server, which goes on trying."""
    told = trouble(path, error)
    return f"{told}; trying on\n  try: {told.hint}"


def _full(path: Path) -> DiskFull:
    said = f"{path}: its disk is full: what the queue has is safe, and nothing more can be kept"
    return DiskFull(said, hint=f"df -h {quote(str(path.parent))}, and make room there")


def _room(folder: Path) -> bool:
    """Say whether there is room for a little more."""
    try:
        found = os.statvfs(folder)
    except OSError:
        return True  # then it is something else that is wrong
    return found.f_bavail * found.f_frsize >= ROOM and (found.f_files == 0 or found.f_favail > 0)
