"""Identity of processes, so that a signal never reaches another process with a reused number."""

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
"""Seconds between two checks whether a process has ended."""


@dataclass(frozen=True, slots=True)
class ProcessIdentity:
    """Identity of a process, which stays unique if its number is reused: the number ``pid`` and the start time.

    ``start`` is in clock ticks since boot, ``boot`` the id of that boot, ``namespace`` the pid namespace of the number.
    """

    pid: int
    start: int
    boot: str
    namespace: int

    @property
    def is_visible(self) -> bool:
        """True if the process is of this boot and of this pid namespace."""
        return (self.boot, self.namespace) == current_namespace()

    @property
    def is_of_this_boot(self) -> bool:
        """True if the process is of this boot, perhaps in a container. Raises OSError."""
        return self.boot == current_namespace()[0]

    def is_alive(self) -> bool:
        """Return whether the process still exists. Raises OSError if this is unknown."""
        if not self.is_visible:
            raise OSError(errno.ESRCH, f"process {self.pid} is in another container, or on another computer")
        return start_tick_of(self.pid) == self.start

    def terminate(self, uid: int | None = None) -> None:
        """Send SIGTERM if the process still exists, and never to another process with its number.

        With a ``uid``, the process must belong to that user. Raises OSError.
        """
        with ExitStack() as closing:
            number = _open_pidfd(self.pid, closing)
            if not self.is_alive():
                return
            if uid is not None and Path(f"/proc/{self.pid}").stat().st_uid != uid:
                raise PermissionError(errno.EPERM, f"process {self.pid} does not belong to user {uid}")
            try:
                if number is None:
                    os.kill(self.pid, signal.SIGTERM)
                else:
                    signal.pidfd_send_signal(number, signal.SIGTERM)
            except ProcessLookupError:
                return

    def has_ended_within(self, seconds: float) -> bool:
        """Wait up to ``seconds`` for the end of the process; return whether it ended. Raises OSError."""
        clock, pause = SystemClock(), Event()
        while self.is_alive():
            if clock.now() > seconds:
                return False
            pause.wait(POLL_INTERVAL)
        return True


def _open_pidfd(pid: int, closing: ExitStack) -> int | None:
    """Return a pidfd, through which a signal cannot reach another process; None if none can be opened."""
    try:
        number = os.pidfd_open(pid)
    except OSError:  # ended, or no descriptor is free: the start time is compared anyway
        return None
    closing.callback(os.close, number)
    return number


@cache
def current_namespace() -> tuple[str, int]:
    """Return the boot id and the inode of the pid namespace. Raises OSError without /proc."""
    boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    return boot, Path("/proc/self/ns/pid").stat().st_ino


def identity_of(pid: int) -> ProcessIdentity | None:
    """Return the identity of the process with a number; None if there is none. Raises OSError if unknown."""
    start = start_tick_of(pid)
    boot, namespace = current_namespace()
    return None if start is None else ProcessIdentity(pid, start, boot, namespace)


def start_tick_of(pid: int) -> int | None:
    """Return the clock tick at which a process started; None if no such process lives. Raises OSError."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        Path("/proc/self/stat").stat()  # raises if there is no /proc: the state is unknown then
        return None
    state, *fields = text.rpartition(")")[2].split()
    return None if state in ("Z", "X") else int(fields[18])
