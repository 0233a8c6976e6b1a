"""Processes that a stop may have to end: told from others that have got their number since, and ended by a signal."""

import errno
import os
import signal
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from threading import Event

from drivers.api.fast_dataclass import dataclass
from drivers.clock import SystemClock

POLL_INTERVAL = 0.02
"""Seconds from one look whether a process has ended to the next."""


@dataclass(frozen=True, slots=True)
class ProcessIdentity:
    """A process: its number among the processes of a ``namespace``, and its ``start`` in clock ticks after ``boot``."""

    pid: int
    start: int
    boot: str
    namespace: int

    @property
    def is_visible(self) -> bool:
        """Whether it is a process of this computer, since its start, and has the same number here as there."""
        return (self.boot, self.namespace) == current_namespace()

    @property
    def is_of_this_boot(self) -> bool:
        """Whether it is a process of this computer, since its start, perhaps in a container. Raises OSError."""
        return self.boot == current_namespace()[0]

    def is_alive(self) -> bool:
        """Return whether it has not ended. Raises OSError where that cannot be known."""
        if not self.is_visible:
            raise OSError(errno.ESRCH, f"process {self.pid} is in another container, or on another computer")
        return start_tick_of(self.pid) == self.start

    def terminate(self, uid: int | None = None) -> None:
        """Send it SIGTERM, unless it has ended; never another process that has got its number.

        With a ``uid``, it must be a process of that user. Raises OSError.
        """
        with ExitStack() as closing:
            number = _open_pidfd(self.pid, closing)
            if not self.is_alive():
                return
            if uid is not None and Path(f"/proc/{self.pid}").stat().st_uid != uid:
                raise PermissionError(errno.EPERM, f"process {self.pid} is not of user {uid}")
            try:
                if number is None:
                    os.kill(self.pid, signal.SIGTERM)
                else:
                    signal.pidfd_send_signal(number, signal.SIGTERM)
            except ProcessLookupError:
                return

    def has_ended_within(self, seconds: float) -> bool:
        """Wait until it has ended, ``seconds`` at most, and return whether it has. Raises OSError as ``is_alive`` does."""
        clock, pause = SystemClock(), Event()
        while self.is_alive():
            if clock.now() > seconds:
                return False
            pause.wait(POLL_INTERVAL)
        return True


def _open_pidfd(pid: int, closing: ExitStack) -> int | None:
    """Return a descriptor of a process, by which a signal cannot reach another one; None where there can be none."""
    try:
        number = os.pidfd_open(pid)
    except OSError:  # it has ended, or no descriptor is left: the start of the process is compared in any case
        return None
    closing.callback(os.close, number)
    return number


@cache
def current_namespace() -> tuple[str, int]:
    """Return which boot of which computer this is, and which namespace of processes. Raises OSError without /proc."""
    boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    return boot, Path("/proc/self/ns/pid").stat().st_ino


def identity_of(pid: int) -> ProcessIdentity | None:
    """Return the process that has a number now; None where there is none. Raises OSError where that is unknown."""
    start = start_tick_of(pid)
    boot, namespace = current_namespace()
    return None if start is None else ProcessIdentity(pid, start, boot, namespace)


def start_tick_of(pid: int) -> int | None:
    """Return the clock tick in which a process has begun; None where none of this number lives. Raises OSError."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        Path("/proc/self/stat").stat()  # where /proc is not there, nothing is known
        return None
    state, *fields = text.rpartition(")")[2].split()
    return None if state in ("Z", "X") else int(fields[18])
