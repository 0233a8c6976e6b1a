"""File locks of the task server: one server for a queue, and one run for a robot."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event

from config.file_io import read_regular_text, regular_opener
from drivers.clock import Clock, SystemClock
from missions.plugins.tasks.task import TaskError

LOCK_TIMEOUT = 1.0
"""Seconds to try to take a lock, since a check by ``is_locked`` holds it for a moment."""

RETRY_INTERVAL = 0.02
"""Seconds between two tries to take a lock."""


class LockHeldError(TaskError):
    """Error: another program holds the lock file that a task server or run needs."""


def server_lock(folder: Path) -> Path:
    """Return the lock file of the server of the queue in ``folder``."""
    return folder / "serve.lock"


def run_lock(folder: Path) -> Path:
    """Return the lock file that the server of the queue in ``folder`` and each of its runs hold."""
    return folder / "run.lock"


@contextmanager
def hold_lock(path: Path, *, timeout: float = LOCK_TIMEOUT, clock: Clock | None = None) -> Iterator[int]:
    """Hold the lock at ``path`` and yield its file descriptor; processes that inherit the descriptor hold the lock too.

    The kernel releases it when the last of them ends. Raises OSError, or LockHeldError after ``timeout`` seconds.
    """
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    number = regular_opener(str(path), os.O_RDWR | os.O_CREAT)
    try:
        _acquire(number, path, timeout, SystemClock() if clock is None else clock)
        with suppress(OSError):  # on a full disk the process id is missing, but the lock holds
            os.ftruncate(number, 0)
            os.write(number, b"%d\n" % os.getpid())
        yield number
    finally:
        os.close(number)


def _acquire(number: int, path: Path, timeout: float, clock: Clock) -> None:
    """Lock the open file with descriptor ``number``, retrying until the timeout. Raises LockHeldError."""
    until, pause = clock.now() + timeout, Event()
    while True:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            if clock.now() >= until:
                holder = lock_holder(path)
                by = f"process {holder}" if holder else "another process"
                raise LockHeldError(f"{path} is in use by {by}: end that one first") from error
            pause.wait(RETRY_INTERVAL)
        else:
            return


def is_locked(path: Path) -> bool:
    """Return whether a process holds the lock file at ``path``. Raises OSError if that is unknown."""
    try:
        number = regular_opener(str(path), os.O_RDONLY)
    except FileNotFoundError:
        return False
    try:
        fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(number)
    return False


def lock_holder(path: Path) -> str:
    """Return the ID of the process that last took the lock file at ``path``; it may have passed the lock to a child."""
    try:
        return read_regular_text(path).strip()
    except (OSError, UnicodeDecodeError):
        return ""
