"""Files of a computer in /sys, /proc and /dev: of this computer, or of a copied file tree for tests."""

import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from drivers.transport.programs import Program, explain_denied, identify_program

MAX_FILE_BYTES = 4096
"""Maximum bytes that are read of a file: files of /sys have one page at most."""


def _my_groups() -> frozenset[int]:
    return frozenset({os.getegid(), *os.getgroups()})


@dataclass(frozen=True, slots=True)
class HostMachine:
    """Computer whose files are under ``root``, as seen by the user ``uid``, a member of these ``groups``.

    Paths in arguments and results are those of the computer itself, such as ``/dev/ttyUSB0``. Unreadable files count as
    missing.
    """

    root: Path = Path("/")
    uid: int = field(default_factory=os.geteuid)
    groups: frozenset[int] = field(default_factory=_my_groups)
    pid: int = field(default_factory=os.getpid)

    def local_path(self, path: str) -> Path:
        """Return the path under ``root``."""
        return self.root / path.lstrip("/")

    def read_text(self, path: str) -> str:
        """Return the text of a file without leading and trailing spaces; empty if it is missing or not readable."""
        try:
            # A recorded tree may contain a pipe, which would block.
            with os.fdopen(os.open(self.local_path(path), os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
                regular = stat.S_ISREG(os.fstat(file.fileno()).st_mode)
                return file.read(MAX_FILE_BYTES).decode(errors="replace").strip() if regular else ""
        except OSError:
            return ""

    def list_names(self, folder: str) -> list[str]:
        """Return the names in a folder, ``tty2`` before ``tty10``."""
        try:
            return sorted((each.name for each in self.local_path(folder).iterdir()), key=lambda name: (len(name), name))
        except OSError:
            return []

    def resolve(self, path: str) -> str:
        """Return a path with all links resolved, as a path of the machine."""
        try:
            return "/" + str(self.local_path(path).resolve().relative_to(self.root.resolve()))
        except (OSError, ValueError, RuntimeError):  # also circular links
            return path

    def read_link(self, path: str) -> str:
        """Return the target of one link, as a path of the machine; empty if the path is no link."""
        try:
            target = self.local_path(path).readlink()
        except OSError:
            return ""
        return os.path.normpath(Path(path).parent / target)

    def can_open(self, path: str) -> bool | None:
        """Return whether the user may read and write a device file; None if the file does not exist."""
        try:
            status = self.local_path(path).stat()
        except OSError:
            return None
        if self.uid == 0:
            return True
        shift = 6 if status.st_uid == self.uid else 3 if status.st_gid in self.groups else 0
        return (status.st_mode >> shift) & (stat.S_IROTH | stat.S_IWOTH) == stat.S_IROTH | stat.S_IWOTH

    def explain_denied(self, path: str) -> tuple[str, str]:
        """Return why the user may not open a device, and the next command to type."""
        return explain_denied(self.local_path(path), path, self.groups)

    def processes(self) -> Iterator[Program]:
        """Yield the running programs."""
        for name in self.list_names("/proc"):
            if name.isdecimal():
                yield identify_program(
                    int(name), *(self.read_text(f"/proc/{name}/{each}") for each in ("comm", "cmdline"))
                )

    def device_holders(self) -> dict[str, list[Program]]:
        """Return the other programs that have each device open, as far as the user may see them."""
        holders: dict[str, list[Program]] = {}
        for process in self.processes():
            folder = f"/proc/{process.pid}/fd"
            opened = {self.read_link(f"{folder}/{number}") for number in self.list_names(folder)}
            for path in opened if process.pid != self.pid else ():
                if path.startswith("/dev/"):
                    holders.setdefault(path, []).append(process)
        return holders
