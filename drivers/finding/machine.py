"""The machine as its files tell of it: /sys, /proc and /dev, of this machine or of a recorded one."""

import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from drivers.transport.programs import Program, explain_denied, named

LARGEST = 4096
"""Bytes that are read of a file: files of /sys are at most a page."""


def _my_groups() -> frozenset[int]:
    return frozenset({os.getegid(), *os.getgroups()})


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine whose files lie under ``root``, seen by the user ``uid`` who is in these ``groups``.

    Paths are those of the machine itself, such as ``/dev/ttyUSB0``. What cannot be read is as if it were not there.
    """

    root: Path = Path("/")
    uid: int = field(default_factory=os.geteuid)
    groups: frozenset[int] = field(default_factory=_my_groups)
    pid: int = field(default_factory=os.getpid)

    def at(self, path: str) -> Path:
        """Return where a file of the machine lies here."""
        return self.root / path.lstrip("/")

    def text(self, path: str) -> str:
        """Return what a file says, without blanks at its ends; nothing where there is none."""
        try:
            # A recorded tree may hold a pipe, which would be waited for.
            with os.fdopen(os.open(self.at(path), os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
                regular = stat.S_ISREG(os.fstat(file.fileno()).st_mode)
                return file.read(LARGEST).decode(errors="replace").strip() if regular else ""
        except OSError:
            return ""

    def names(self, folder: str) -> list[str]:
        """Return what is in a folder: ``tty2`` comes before ``tty10``."""
        try:
            return sorted((each.name for each in self.at(folder).iterdir()), key=lambda name: (len(name), name))
        except OSError:
            return []

    def real(self, path: str) -> str:
        """Return where the links of a path lead, as a path of the machine."""
        try:
            return "/" + str(self.at(path).resolve().relative_to(self.root.resolve()))
        except (OSError, ValueError, RuntimeError):  # links that lead in a circle, too
            return path

    def target(self, path: str) -> str:
        """Return where one link leads, as a path of the machine; nothing for what is no link."""
        try:
            told = self.at(path).readlink()
        except OSError:
            return ""
        return os.path.normpath(Path(path).parent / told)

    def may_open(self, path: str) -> bool | None:
        """Say whether the user may read and write a device; None where there is none."""
        try:
            status = self.at(path).stat()
        except OSError:
            return None
        if self.uid == 0:
            return True
        shift = 6 if status.st_uid == self.uid else 3 if status.st_gid in self.groups else 0
        return (status.st_mode >> shift) & (stat.S_IROTH | stat.S_IWOTH) == stat.S_IROTH | stat.S_IWOTH

    def explain_denied(self, path: str) -> tuple[str, str]:
        """Return why the user may not open a device, and the next command to type."""
        return explain_denied(self.at(path), path, self.groups)

    def processes(self) -> Iterator[Program]:
        """Yield the programs that run."""
        for name in self.names("/proc"):
            if name.isdecimal():
                yield named(int(name), *(self.text(f"/proc/{name}/{each}") for each in ("comm", "cmdline")))

    def holders(self) -> dict[str, list[Program]]:
        """Return who has which device open, but for this program itself, as far as the user may look."""
        found: dict[str, list[Program]] = {}
        for process in self.processes():
            folder = f"/proc/{process.pid}/fd"
            opened = {self.target(f"{folder}/{number}") for number in self.names(folder)}
            for path in opened if process.pid != self.pid else ():
                if path.startswith("/dev/"):
                    found.setdefault(path, []).append(process)
        return found
