"""Control sockets of this user's runs: their paths, and connections to them.

Each run has a socket in a folder that only its owner can enter, named after its process, and an abstract one. A socket
without a listener belongs to a killed run; it is removed when a connection to it fails.
"""

import json
import os
import socket
import struct
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Event, Lock
from typing import Any, Self

from config.file_io import parse_object
from drivers.api.fast_dataclass import dataclass
from drivers.clock import Clock, SystemClock
from missions.control.run_folders import FOLDER_TIMEOUT, call_with_timeout, run_folders

SOCKET_SUFFIX = ".sock"

MAX_PATH_BYTES = 100
"""Maximum length of a Unix socket path; Linux allows 107 bytes, other systems 103."""

REPLY_TIMEOUT = 1.0
"""Seconds to wait for a reply of a run."""

CONNECT_TRIES, RETRY_INTERVAL = 4, 0.1
"""Connection attempts to a run that disconnects at once, and the seconds between them."""

MAX_MESSAGE_BYTES = 1 << 24
"""Maximum length of a message of a run."""


Address = Path | str
"""Address of a socket: a path, or an abstract address that begins with "@"."""


def socket_folder() -> Path:
    """Return the folder for sockets of new runs, created if missing. Raises OSError if none can be used."""
    errors = list[OSError]()
    for place in run_folders():
        try:
            return place.prepare()
        except OSError as error:
            errors.append(error)
    raise errors[0] if errors else OSError("neither HOME nor XDG_RUNTIME_DIR is set")


_own_runs: set[str] = set()
_lock = Lock()


def new_run_name() -> str:
    """Return the name of a new run of this process: the process number, with a suffix if the name is taken."""
    process = os.getpid()
    names = (f"{process}{more}" for more in ("", *(f"-{number}" for number in range(2, 1000))))
    with _lock:
        _own_runs.add(found := next(name for name in names if name not in _own_runs and not _is_taken(name)))
    return found


def _is_taken(run: str) -> bool:
    """Return True if another run listens under the name ``run``.

    This can be a run in a container that shares the folders of this user and has the same process number.
    """
    for place in run_folders():
        path = place.folder / f"{run}{SOCKET_SUFFIX}"
        try:
            if call_with_timeout(place.folder, path.exists):
                connect(path).close()
                return True
        except OSError:
            continue  # it has no listener
    return False


def release_run_name(run: str) -> None:
    """Free the name of a run that has ended."""
    _own_runs.discard(run)


def pid_of_run(run: str) -> int:
    """Return the process number in the name of a run. Raises ValueError."""
    return int(run.partition("-")[0])


def run_of_socket(path: Path) -> str:
    """Return the name of the run that a socket file belongs to."""
    return path.name.removesuffix(SOCKET_SUFFIX)


def socket_path(run: str) -> Path:
    """Return the path of the socket of a run."""
    return socket_folder() / f"{run}{SOCKET_SUFFIX}"


@contextmanager
def bindable_address(where: Address) -> Iterator[str]:
    """Yield the address to pass to ``bind`` or ``connect``, within the context.

    A path that is too long for a socket is replaced by a short one through the descriptor of its folder.
    """
    if isinstance(where, str) and where.startswith("@"):
        yield f"\0{where[1:]}"
        return
    path = Path(where)
    if len(os.fsencode(path)) <= MAX_PATH_BYTES:
        yield str(path)
        return
    number = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{number}/{path.name}"
    finally:
        os.close(number)


def listen(path: Path) -> socket.socket:
    """Return a socket that listens at ``path``, for this user only. Raises OSError.

    The file is moved to its path once the socket listens. Otherwise a client could be refused for a moment, which means
    that the run has ended. A socket file of a killed process with the same number is replaced.
    """
    temporary = path.with_suffix(".begun")
    temporary.unlink(missing_ok=True)
    found = socket.socket(socket.AF_UNIX)
    try:
        with bindable_address(temporary) as where:
            found.bind(where)
        temporary.chmod(0o600)
        found.listen(64)
        temporary.replace(path)
    except BaseException:
        found.close()
        raise
    return found


def connect(where: Address) -> socket.socket:
    """Return a socket connected to a run. Raises OSError; the socket file of a process that has ended is removed."""
    if isinstance(where, str):
        return _connect(where)
    return call_with_timeout(where.parent, partial(_connect, where), REPLY_TIMEOUT + FOLDER_TIMEOUT)


def _connect(where: Address) -> socket.socket:
    found = socket.socket(socket.AF_UNIX)
    try:
        found.settimeout(REPLY_TIMEOUT)
        with bindable_address(where) as target:
            found.connect(target)
        if isinstance(where, str) and os.geteuid() not in (0, peer_credentials(found)[1]):
            raise PermissionError(f"{where} is a socket of another user")  # it may have any name
    except ConnectionRefusedError:
        found.close()
        _remove_if_left(where)
        raise
    except BaseException:
        found.close()
        raise
    return found


def _remove_if_left(where: Address) -> None:
    """Remove the socket file of a process that has ended, if it belongs to this user."""
    if isinstance(where, str) or where.parent.stat().st_uid != os.geteuid():
        return
    with suppress(ValueError):  # its name has no process number
        if not process_exists(pid_of_run(run_of_socket(where))):
            where.unlink(missing_ok=True)


def process_exists(process: int) -> bool:
    """Return whether a process with this number exists; it may be another one that reuses the number."""
    try:
        os.kill(process, 0)
    except PermissionError:
        return True
    except (ProcessLookupError, OverflowError):
        return False
    return True


def peer_credentials(connection: socket.socket) -> tuple[int, int]:
    """Return process number and user id of the peer, from the kernel.

    The number is 0 for a process in a container that cannot be seen from here.
    """
    credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    pid, uid, _ = struct.unpack("3i", credentials)
    return int(pid), int(uid)


@dataclass(slots=True)
class RunConnection:
    """Blocking connection to a run, for ``mission stop``; ``run_info`` is the first message of the run.

    ``process`` and ``uid`` are the number and the user id of the process at the other end.
    """

    connection: socket.socket
    process: int
    uid: int
    run_info: Mapping[str, Any]
    _received: bytes = b""

    @classmethod
    def open(cls, where: Address) -> Self:
        """Connect to the run at the address ``where``, and receive its first message. Raises OSError.

        ``run_info`` is empty if the run hangs or accepts no more clients.
        """
        for tries_left in reversed(range(CONNECT_TRIES)):
            connection = connect(where)
            link = cls(connection, *peer_credentials(connection), {})
            try:
                link.run_info = link.receive()
            except (TimeoutError, ConnectionError) as error:
                if tries_left == 0 or isinstance(error, TimeoutError):
                    break
                connection.close()
                Event().wait(RETRY_INTERVAL)  # a process that is ending has ended by then
            except BaseException:
                connection.close()
                raise
            else:
                break
        return link

    def request(self, command: Mapping[str, object], *, clock: Clock | None = None) -> Mapping[str, Any]:
        """Send a command and return its answer. Raises OSError; TimeoutError after ``REPLY_TIMEOUT``."""
        clock = SystemClock() if clock is None else clock
        until = clock.now() + REPLY_TIMEOUT
        self.connection.sendall(json.dumps({**command, "id": 1}).encode() + b"\n")
        while clock.now() < until:
            answer = self.receive()
            if answer.get("say") == "answer" and answer.get("id") == 1:
                return answer
        raise TimeoutError("it does not answer")

    def receive(self) -> Mapping[str, Any]:
        """Return the next message. Raises OSError, ValueError."""
        while b"\n" not in self._received:
            data = self.connection.recv(1 << 16)
            if not data or len(self._received) > MAX_MESSAGE_BYTES:
                raise ConnectionError("the run closed the connection")
            self._received += data
        line, _, self._received = self._received.partition(b"\n")
        return parse_object(line)

    def scene_state(self) -> Mapping[str, Any]:
        """Subscribe to the run, and return the ``state`` in the scene, its first message with the complete state.

        Raises OSError.
        """
        self.connection.sendall(b'{"do": "watch"}\n')
        while (message := self.receive()).get("say") != "scene":
            pass
        state: Mapping[str, Any] = message["state"]
        return state

    def close(self) -> None:
        """Close the connection."""
        self.connection.close()


@contextmanager
def open_connection(where: Address) -> Iterator[RunConnection]:
    """Yield a connection to a run, and close it at the end. Raises OSError."""
    with closing(RunConnection.open(where)) as link:
        yield link
