"""The control sockets of the runs of this user: where they are, which of them answer, and how to speak to one.

Each run has one, named after its process, in a folder that only its owner may enter. A socket that nobody answers any
more belongs to a run that was killed; who finds it takes it away.
"""

import json
import os
import socket
import struct
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from threading import Event, Lock
from typing import Any, Self

from drivers.api.quick import dataclass
from drivers.clock import Clock, SystemClock
from missions.library.folders import runtime_folder

ENDING = ".sock"

LONGEST_PATH = 100
"""Bytes of the path of a Unix socket, at most: Linux takes 107, others 103."""

PATIENCE = 1.0
"""Seconds that a run has to answer."""

TRIES, AGAIN = 4, 0.1
"""How often a run that hangs up at once is called, and how many seconds later each time."""

LARGEST = 1 << 24
"""Bytes of a message of a run, at most."""


def socket_folder() -> Path:
    """Return the folder of the sockets; it is made where it is not there. Raises OSError where it is another's."""
    folder = runtime_folder() / "runs"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.stat()
    if found.st_uid != os.geteuid():
        raise PermissionError(f"{folder} belongs to another user")
    if found.st_mode & 0o077:
        folder.chmod(0o700)
    return folder


_here: set[str] = set()
_lock = Lock()


def new_run() -> str:
    """Return the name of a new run of this process: its number, and for one beside others a number of its own."""
    process = os.getpid()
    names = (f"{process}{more}" for more in ("", *(f"-{number}" for number in range(2, 1000))))
    with _lock:
        _here.add(found := next(name for name in names if name not in _here))
    return found


def forget_run(run: str) -> None:
    """A run of this process is over."""
    _here.discard(run)


def process_in(run: str) -> int:
    """Return the number of the process that the name of a run begins with. Raises ValueError."""
    return int(run.partition("-")[0])


def run_of(path: Path) -> str:
    """Return the run whose socket this is."""
    return path.name.removesuffix(ENDING)


def path_of(run: str) -> Path:
    """Return where the socket of a run is."""
    return socket_folder() / f"{run}{ENDING}"


@contextmanager
def address(path: Path) -> Iterator[str]:
    """Give what to bind or connect a socket to: a path that is too long is shortened by way of its folder."""
    if len(os.fsencode(path)) <= LONGEST_PATH:
        yield str(path)
        return
    number = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{number}/{path.name}"
    finally:
        os.close(number)


def listen(path: Path) -> socket.socket:
    """Return a socket that listens at ``path``, for this user alone. Raises OSError.

    It is put there once it listens, in one move: who asks at any moment before is not refused, which would mean that
    the run is gone. What a killed process of this number has left goes by that.
    """
    begun = path.with_suffix(".begun")
    begun.unlink(missing_ok=True)
    found = socket.socket(socket.AF_UNIX)
    try:
        with address(begun) as where:
            found.bind(where)
        begun.chmod(0o600)
        found.listen(64)
        begun.replace(path)
    except BaseException:
        found.close()
        raise
    return found


def sockets() -> list[Path]:
    """Return the sockets that there are, in no order."""
    with suppress(OSError):
        return [each for each in socket_folder().iterdir() if each.name.endswith(ENDING)]
    return []


def connect(path: Path) -> socket.socket:
    """Return a socket that is connected to a run. Raises OSError; a socket of a process that is gone is taken away."""
    found = socket.socket(socket.AF_UNIX)
    try:
        found.settimeout(PATIENCE)
        with address(path) as where:
            found.connect(where)
    except ConnectionRefusedError:
        found.close()
        if not _lives(run_of(path)):
            path.unlink(missing_ok=True)
        raise
    except BaseException:
        found.close()
        raise
    return found


def _lives(run: str) -> bool:
    """Say whether the process of a run is there: another one may have its number by now, and begin to listen."""
    try:
        os.kill(process_in(run), 0)
    except PermissionError:
        return True
    except (ProcessLookupError, ValueError, OverflowError):
        return False
    return True


def process_of(connection: socket.socket) -> int:
    """Return the number of the process at the other end, as the kernel knows it."""
    told = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    pid, _, _ = struct.unpack("3i", told)
    return int(pid)


@dataclass(slots=True)
class RunLink:
    """A connection to a run, for one who waits: ``mission stop``. ``told`` is the first message of the run."""

    connection: socket.socket
    process: int
    told: Mapping[str, Any]
    _heard: bytes = b""

    @classmethod
    def open(cls, path: Path) -> Self:
        """Connect, and hear what the run is: nothing where it hangs, or has no room. Raises OSError where none is."""
        for left in reversed(range(TRIES)):
            connection = connect(path)
            link = cls(connection, process_of(connection), {})
            try:
                link.told = link.hear()
            except (TimeoutError, ConnectionError) as error:
                if left == 0 or isinstance(error, TimeoutError):
                    break
                connection.close()
                Event().wait(AGAIN)  # one that ends has gone by then
            except BaseException:
                connection.close()
                raise
            else:
                break
        return link

    def ask(self, command: Mapping[str, object], *, clock: Clock | None = None) -> Mapping[str, Any]:
        """Send a command and return its answer. Raises OSError; TimeoutError after ``PATIENCE``."""
        clock = SystemClock() if clock is None else clock
        until = clock.now() + PATIENCE
        self.connection.sendall(json.dumps({**command, "id": 1}).encode() + b"\n")
        while clock.now() < until:
            told = self.hear()
            if told.get("say") == "answer" and told.get("id") == 1:
                return told
        raise TimeoutError("it does not answer")

    def hear(self) -> Mapping[str, Any]:
        """Return the next message. Raises OSError."""
        while b"\n" not in self._heard:
            data = self.connection.recv(1 << 16)
            if not data or len(self._heard) > LARGEST:
                raise ConnectionError("the run has gone")
            self._heard += data
        line, _, self._heard = self._heard.partition(b"\n")
        found: Mapping[str, Any] = json.loads(line)
        return found

    def close(self) -> None:
        """Hang up."""
        self.connection.close()


@contextmanager
def linked(path: Path) -> Iterator[RunLink]:
    """Give a connection to a run while this is entered. Raises OSError."""
    with closing(RunLink.open(path)) as link:
        yield link
