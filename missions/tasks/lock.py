"""One robot, one runner: who holds a file that says so, and what a run inherits of it."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from missions.tasks.task import TaskError


class Taken(TaskError):
    """Another program holds the lock."""


@contextmanager
def locked(path: Path) -> Iterator[int]:
    """Hold the lock at ``path``, and give its file descriptor; whoever inherits that holds the lock as well.

    The kernel gives it up with the last process that has it, however that ends. Raises Taken, or OSError.
    """
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    number = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise Taken(f"{path}: is held by process {holder(path) or 'unknown'}") from error
        os.ftruncate(number, 0)
        os.write(number, b"%d\n" % os.getpid())
        yield number
    finally:
        os.close(number)


def is_locked(path: Path) -> bool:
    """Say whether some process holds the lock."""
    try:
        number = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(number)
    return False


def holder(path: Path) -> str:
    """Return the number of the process that took the lock last; it may have passed it on to one of its own."""
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return ""
