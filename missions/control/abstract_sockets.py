"""Abstract Unix sockets and memory files (memfd) whose names identify a run, until its process ends.

They work even if the folder for socket files is full, missing or emptied. The name contains the user and the process of
a run.

- ``/proc/net/unix`` lists abstract sockets, also those of other users, but only of one network namespace. Any user can
  bind any name, so run and client each check the user of the other process.
- Memory files are listed in ``/proc/PID/fd``. A user who may end the process can read this, also for another container.
"""

import hashlib
import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from drivers.api.fast_dataclass import dataclass
from missions.control.processes import ProcessIdentity, identity_of
from missions.control.run_folders import SYSTEM_ROOT

SOCKET_LIST = Path("/proc/net/unix")

LISTENING, STREAM, DATAGRAM = 1 << 16, 1, 2
"""Flag of a listening socket, and two socket types, as in ``/proc/net/unix``."""

SIMULATED_SUFFIX = "-simulated"
"""Text appended to the kind ("run" or "command") in the name of a process that moves no real robot."""


@dataclass(frozen=True, slots=True)
class AbstractName:
    """Parsed name of the abstract socket of a run, or of a command that moves a robot.

    ``uid`` is its user, ``run`` the name of the run, ``kind`` "run" or "command", ``inode`` that of the socket.
    """

    uid: int
    run: str
    identity: ProcessIdentity
    kind: str
    inode: int = 0
    local_identity: ProcessIdentity | None = None
    """The process with its number in our own pid namespace; None if only the socket, and no memory file, was found."""

    @property
    def is_run(self) -> bool:
        """True for a run, which listens at the socket; False for a command, which can only be ended by a signal."""
        return self.kind.startswith("run")

    @property
    def address(self) -> str:
        """The address of the abstract socket in text form, with "@" for its leading NUL byte."""
        return f"@{self.text}"

    @property
    def text(self) -> str:
        """The name of the abstract socket, without the "@"."""
        about = (self.uid, self.run, self.identity.start, self.identity.namespace, self.kind)
        return f"{_prefix()}{'/'.join(map(str, about))}"

    def has_its_process(self) -> bool:
        """Return whether the process in this name has the socket open; another process could have bound the name.

        Raises OSError.
        """
        return f"socket:[{self.inode}]" in _link_targets(Path(f"/proc/{self.identity.pid}/fd"))


def _prefix() -> str:
    root = os.environ.get(SYSTEM_ROOT, "")
    return f"missiontree{root and '.' + hashlib.sha256(root.encode()).hexdigest()[:8]}/"


def make_name(run: str, kind: str, *, simulated: bool) -> AbstractName:
    """Return the name for the abstract socket of a run or a command of this process; ``kind`` is "run" or "command".

    Raises OSError if /proc is missing.
    """
    identity = identity_of(os.getpid())
    if identity is None:
        raise OSError("/proc does not show this process")
    return AbstractName(os.geteuid(), run, identity, kind + SIMULATED_SUFFIX * simulated)


def listen(name: AbstractName) -> socket.socket:
    """Return an abstract socket with this name that listens for connections. Raises OSError."""
    return _bind(name, socket.SOCK_STREAM)


def bind_marker(name: AbstractName) -> socket.socket:
    """Return a socket bound to ``name`` that only shows that a command is running; it takes no connections.

    Raises OSError.
    """
    return _bind(name, socket.SOCK_DGRAM)


def _bind(name: AbstractName, kind: socket.SocketKind) -> socket.socket:
    found = socket.socket(socket.AF_UNIX, kind)
    try:
        found.bind(f"\0{name.address[1:]}")
        if kind is socket.SOCK_STREAM:
            found.listen(64)
    except BaseException:
        found.close()
        raise
    return found


def hold_name(name: AbstractName) -> int:
    """Create a memory file (memfd) with this name, by which `mission stop` finds the process; return its descriptor.

    Raises OSError.
    """
    return os.memfd_create(name.text)


def names_in_memory() -> list[AbstractName]:
    """Return the names of the memory files (memfd) of all runs and commands that this user may see.

    Raises OSError if no file descriptor is free.
    """
    prefix, found = f"/memfd:{_prefix()}", list[AbstractName]()
    for process in os.listdir("/proc"):  # noqa: PTH208 - some hundreds
        if process.isdecimal():
            try:
                texts = {text for text in _link_targets(Path("/proc", process, "fd")) if text.startswith(prefix)}
                here = identity_of(int(process)) if texts else None
            except (FileNotFoundError, ProcessLookupError, PermissionError):
                continue  # ended, or a process of another user
            for text in texts if here is not None else ():
                name = _parse_name(text.removeprefix(prefix).removesuffix(" (deleted)"), 0, here.boot if here else "")
                if name is not None and here is not None and name.identity.start == here.start:  # no fork
                    found.append(replace(name, local_identity=here))
    return found


def _link_targets(folder: Path) -> Iterator[str]:
    for each in folder.iterdir():
        with suppress(FileNotFoundError):  # closed meanwhile
            yield os.readlink(each)  # noqa: PTH115 - it is no path


def listed_names() -> list[AbstractName]:
    """Return the names of MissionTree's sockets in ``/proc/net/unix``, of all users. Raises OSError."""
    prefix, found = f"@{_prefix()}", list[AbstractName]()
    here = identity_of(os.getpid())
    for line in SOCKET_LIST.read_text(encoding="utf-8", errors="replace").splitlines():
        fields = line.split()
        if len(fields) == 8 and fields[7].startswith(prefix) and here is not None:
            listens = bool(int(fields[3], 16) & LISTENING)
            name = _parse_name(fields[7].removeprefix(prefix), int(fields[6]), here.boot)
            if (
                name is not None
                and int(fields[4], 16) == (STREAM if name.is_run else DATAGRAM)
                and (
                    listens or not name.is_run  # both ends of a connection have the name
                )
            ):
                found.append(name)
    return found


def _parse_name(text: str, inode: int, boot: str) -> AbstractName | None:
    """Return the parsed name of a socket; None if the text is not in our format, as any process can choose its name."""
    fields = text.split("/")
    if len(fields) != 5 or not fields[4].startswith(("run", "command")):
        return None
    try:
        uid, start, namespace = int(fields[0]), int(fields[2]), int(fields[3])
        pid = int(fields[1].partition("-")[0])
    except ValueError:
        return None
    return AbstractName(uid, fields[1], ProcessIdentity(pid, start, boot, namespace), fields[4], inode)
