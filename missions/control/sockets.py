"""The control sockets of the runs of this user: where they are, which of them answer, and how to speak to one.

Each run has one in a folder that only its owner may enter, named after its process, and an abstract one besides. A
socket that nobody answers any more belongs to a run that was killed; who finds it takes it away.
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

from config.reading import parse_object
from drivers.api.quick import dataclass
from drivers.clock import Clock, SystemClock
from missions.control.places import FOLDER_TIMEOUT, places, within

ENDING = ".sock"

LONGEST_PATH = 100
"""Bytes of the path of a Unix socket, at most: Linux takes 107, others 103."""

PATIENCE = 1.0
"""Seconds that a run has to answer."""

TRIES, AGAIN = 4, 0.1
"""How often a run that hangs up at once is called, and how many seconds later each time."""

LARGEST = 1 << 24
"""Bytes of a message of a run, at most."""


Address = Path | str
"""Where a socket is: a file, or an abstract address that begins with "@"."""


def socket_folder() -> Path:
    """Return the folder for the sockets of new runs; it is created. Raises OSError where none can be used."""
    errors = list[OSError]()
    for place in places():
        try:
            return place.prepare()
        except OSError as error:
            errors.append(error)
    raise errors[0] if errors else OSError("neither HOME nor XDG_RUNTIME_DIR says where sockets can be")


_here: set[str] = set()
_lock = Lock()


def new_run() -> str:
    """Return the name of a new run of this process: its number, and for one beside others a number of its own."""
    process = os.getpid()
    names = (f"{process}{more}" for more in ("", *(f"-{number}" for number in range(2, 1000))))
    with _lock:
        _here.add(found := next(name for name in names if name not in _here and not _is_answered(name)))
    return found


def _is_answered(run: str) -> bool:
    """Return whether a run of this name is there already: of a container with the same folders and numbers."""
    for place in places():
        path = place.folder / f"{run}{ENDING}"
        try:
            if within(place.folder, path.exists):
                connect(path).close()
                return True
        except OSError:
            continue  # nobody answers there
    return False


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
def address(where: Address) -> Iterator[str]:
    """Give what to bind or connect a socket to: a path that is too long is shortened by way of its folder."""
    if isinstance(where, str) and where.startswith("@"):
        yield f"\0{where[1:]}"
        return
    path = Path(where)
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


def connect(where: Address) -> socket.socket:
    """Return a socket that is connected to a run. Raises OSError; a socket of a process that is gone is taken away."""
    if isinstance(where, str):
        return _connect(where)
    return within(where.parent, partial(_connect, where), PATIENCE + FOLDER_TIMEOUT)


def _connect(where: Address) -> socket.socket:
    found = socket.socket(socket.AF_UNIX)
    try:
        found.settimeout(PATIENCE)
        with address(where) as target:
            found.connect(target)
        if isinstance(where, str) and os.geteuid() not in (0, peer_of(found)[1]):
            raise PermissionError(f"{where} is a socket of another user")  # who has given it this name
    except ConnectionRefusedError:
        found.close()
        _remove_if_left(where)
        raise
    except BaseException:
        found.close()
        raise
    return found


def _remove_if_left(where: Address) -> None:
    """Remove the socket file of a process that is gone, if this user put it there."""
    if isinstance(where, str) or where.parent.stat().st_uid != os.geteuid():
        return
    with suppress(ValueError):  # it is not named after a process
        if not is_there(process_in(run_of(where))):
            where.unlink(missing_ok=True)


def is_there(process: int) -> bool:
    """Return whether there is a process of this number: another one may have it by now."""
    try:
        os.kill(process, 0)
    except PermissionError:
        return True
    except (ProcessLookupError, OverflowError):
        return False
    return True


def peer_of(connection: socket.socket) -> tuple[int, int]:
    """Return the numbers of the process at the other end, and of its user, as the kernel knows them.

    That of a process in a container which is not seen from here is 0.
    """
    told = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    pid, uid, _ = struct.unpack("3i", told)
    return int(pid), int(uid)


@dataclass(slots=True)
class RunLink:
    """A connection to a run, for one who waits: ``mission stop``. ``told`` is the first message of the run.

    ``process`` and ``uid`` are the process and the user at the other end.
    """

    connection: socket.socket
    process: int
    uid: int
    told: Mapping[str, Any]
    _heard: bytes = b""

    @classmethod
    def open(cls, where: Address) -> Self:
        """Connect, and hear what the run is: nothing where it hangs, or has no room. Raises OSError where none is."""
        for left in reversed(range(TRIES)):
            connection = connect(where)
            link = cls(connection, *peer_of(connection), {})
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
        """Return the next message. Raises OSError, ValueError."""
        while b"\n" not in self._heard:
            data = self.connection.recv(1 << 16)
            if not data or len(self._heard) > LARGEST:
                raise ConnectionError("the run has gone")
            self._heard += data
        line, _, self._heard = self._heard.partition(b"\n")
        return parse_object(line)

    def last_stop(self) -> int:
        """Return the number of the last stop of the run. Raises OSError."""
        self.connection.sendall(b'{"do": "watch"}\n')
        while (told := self.hear()).get("say") != "scene":
            pass
        return int(told["state"]["stops"])

    def close(self) -> None:
        """Hang up."""
        self.connection.close()


@contextmanager
def linked(where: Address) -> Iterator[RunLink]:
    """Give a connection to a run while this is entered. Raises OSError."""
    with closing(RunLink.open(where)) as link:
        yield link
