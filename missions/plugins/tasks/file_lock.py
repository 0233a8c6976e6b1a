"""One robot, one runner: who holds a file that says so, and what a run inherits of it."""

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
"""Seconds to try for a lock: who asks only whether it is held, holds it for a moment."""

RETRY_INTERVAL = 0.02
"""Seconds from one try to the next."""


class LockHeldError(TaskError):
    """Another program holds the lock."""


def server_lock(folder: Path) -> Path:
    """Return what the server of the queue in ``folder`` holds as long as it lives."""
    return folder / "serve.lock"


def run_lock(folder: Path) -> Path:
    """Return what the server of the queue in ``folder`` holds, and each of its runs as long as that goes on."""
    return folder / "run.lock"


@contextmanager
def hold_lock(path: Path, *, timeout: float = LOCK_TIMEOUT, clock: Clock | None = None) -> Iterator[int]:
    """Hold the lock at ``path``, and give its file descriptor; whoever inherits that holds the lock as well.

    The kernel gives it up with the last process that has it, however that ends. Raises OSError, or Taken where others
    held it for ``patience`` seconds.
    """
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    number = regular_opener(str(path), os.O_RDWR | os.O_CREAT)
    try:
        _acquire(number, path, timeout, SystemClock() if clock is None else clock)
        with suppress(OSError):  # on a full disk nobody reads who it is: it is held all the same
            os.ftruncate(number, 0)
            os.write(number, b"%d\n" % os.getpid())
        yield number
    finally:
        os.close(number)


def _acquire(number: int, path: Path, timeout: float, clock: Clock) -> None:
    """Lock an open file, as soon as nobody else does."""
    until, pause = clock.now() + timeout, Event()
    while True:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            if clock.now() >= until:
                raise LockHeldError(f"{path}: is held by process {lock_holder(path) or 'unknown'}") from error
            pause.wait(RETRY_INTERVAL)
        else:
            return


def is_locked(path: Path) -> bool:
    """Say whether some process holds the lock. Raises OSError where that is not known."""
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
    """Return the number of the process that took the lock last; it may have passed it on to one of its own."""
    try:
        return read_regular_text(path).strip()
    except (OSError, UnicodeDecodeError):
        return ""
