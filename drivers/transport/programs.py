"""Programs that use a port: their names as the user typed them, and the commands that end them."""

import os
import stat
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from drivers.api.fast_dataclass import dataclass

# Hints for a device that the user may not open: the group to join, or another way to get the permission.

DEVICE_GROUPS = frozenset({"audio", "dialout", "input", "plugdev", "uucp", "video"})
"""Groups that systems create for devices. Joining another one, such as root or disk, grants far more."""


def explain_denied(device: Path, path: str = "", groups: Collection[int] | None = None) -> tuple[str, str]:
    """Return why the user may not open ``device``, and the next command to type.

    ``path`` is the name to show. ``groups`` are the numbers of the groups that the user is in, by default those of this
    process.
    """
    import grp  # noqa: PLC0415 - Python in a browser does not have it

    path = path or str(device)
    try:
        status, group = device.stat(), device.group()
    except (OSError, KeyError):
        return "no permission", f"ls -l {path}"
    if group not in DEVICE_GROUPS or not status.st_mode & stat.S_IRGRP or not status.st_mode & stat.S_IWGRP:
        user = _user_name(status.st_uid)
        not_for_devices = f"it belongs to {user} and group {group}, which is not made for devices"
        owner = f"it belongs to {user} alone" if group in (user, "root") else not_for_devices
        return f"no permission: {owner}", _grant_command(path, group)
    if status.st_gid in (groups if groups is not None else {os.getegid(), *os.getgroups()}):
        return f"no permission, though you are in its group {group}", f"ls -l {path}"
    if _user_name(os.geteuid()) in grp.getgrgid(status.st_gid).gr_mem:
        return f"no permission: you have joined its group {group}, but not in this login", "log out, and in again"
    reason = f"no permission: it belongs to group {group}, which you are not in"
    return reason, f"sudo usermod -a -G {group} $USER  (then log in again)"


def _grant_command(path: str, group: str) -> str:
    """Return the command that lets the user open the device at ``path``, which belongs to ``group``."""
    if group == "tty":  # a Raspberry Pi gives its serial port to the login console
        return "sudo raspi-config  (Interface Options, Serial Port: no login shell, but the port)"
    remark = "until it is plugged in again; permanently: a rule as in `mission robot udev`"
    return f"sudo setfacl -m u:$USER:rw {path}  ({remark})"


def _user_name(number: int) -> str:
    import pwd  # noqa: PLC0415 - as above

    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return str(number)


STOPPABLE_COMMANDS = ("run", "servo", "head", "teleop")
"""Commands that move a robot, and that `mission stop` ends with all actuators at rest."""

TCP_LISTEN = "0A"
"""State of a listening TCP socket in /proc/net/tcp."""

MAX_NAME_LENGTH = 60

PTY_MAJORS = range(136, 144)
"""Major device numbers of pseudo-terminals on Linux."""


@dataclass(frozen=True, slots=True)
class Program:
    """Running program: its process id, and ``name``, which is the typed command for programs of MissionTree."""

    pid: int
    name: str

    def __str__(self) -> str:
        return f"{self.name} (process {self.pid})"

    @property
    def end_command(self) -> str:
        """Command that ends the program; empty if it is not a program of MissionTree."""
        words = self.name.split()
        if words[:1] != ["mission"]:
            return ""
        return f"mission stop --end {self.pid}" if words[1:2] and words[1] in STOPPABLE_COMMANDS else f"kill {self.pid}"


def read_program(pid: int, root: Path = Path("/")) -> Program:
    """Return the program of a process."""
    folder = root / "proc" / str(pid)
    return identify_program(pid, _read(folder / "comm"), _read(folder / "cmdline"))


def identify_program(pid: int, comm: str, cmdline: str) -> Program:
    """Return the program of a process from the contents of ``comm`` and ``cmdline`` in /proc."""
    name, words = comm.strip() or "a program", cmdline.rstrip("\0").split("\0")
    index = next((at for at, word in enumerate(words) if _is_ours(words, at, word)), None)
    if index is not None:
        name = " ".join(["mission", *words[index + 1 :]])
    elif name.startswith("python"):
        name = " ".join([name, *(Path(word).name for word in words[1:] if word.endswith(".py"))][:2])
    return Program(pid, name if len(name) <= MAX_NAME_LENGTH else f"{name[: MAX_NAME_LENGTH - 1]}…")


def _is_ours(words: list[str], at: int, word: str) -> bool:
    return (word == "missions" and words[at - 1] == "-m") or (at < 2 and Path(word).name == "mission")


def end_command(holders: Sequence[Program], otherwise: str) -> str:
    """Return the command that ends the MissionTree programs among ``holders``; ``otherwise`` if there are none."""
    return "; ".join(each.end_command for each in holders if each.end_command) or otherwise


def device_holders(port: str) -> list[Program]:
    """Return the other programs that have a device open, as far as the user may see them (Linux only).

    The program at the other end of a pseudo-terminal is not included.
    """
    try:
        device = Path(port).stat().st_rdev
    except OSError:
        return []
    index = 256 * (os.major(device) - PTY_MAJORS[0]) + os.minor(device)
    own_end = f"tty-index:\t{index}\n" if os.major(device) in PTY_MAJORS else ""

    def holds(descriptor: "os.DirEntry[str]") -> bool:
        status = descriptor.stat()
        return stat.S_ISCHR(status.st_mode) and status.st_rdev == device

    def is_other_end(program: Program) -> bool:
        return any(own_end in _read(each) for each in Path(f"/proc/{program.pid}/fdinfo").glob("*"))

    return [program for program in _holders(holds) if not own_end or not is_other_end(program)]


def tcp_holders(port: int) -> list[Program]:
    """Return the programs that listen on a TCP port of this computer, as far as the user may see them."""
    inodes = set()
    for table in ("tcp", "tcp6"):
        for line in _read(Path("/proc/net") / table).splitlines()[1:]:
            fields = line.split()
            if fields[3] == TCP_LISTEN and int(fields[1].rpartition(":")[2], 16) == port:
                inodes.add(f"socket:[{fields[9]}]")
    return list(_holders(lambda descriptor: str(Path(descriptor).readlink()) in inodes)) if inodes else []


def _holders(holds: Callable[["os.DirEntry[str]"], bool]) -> Iterator[Program]:
    """Yield the other programs with an open file that ``holds`` accepts, in the order of their process ids.

    Speed matters, because this scans all files of all programs whenever a port is opened. ``pathlib`` would take ten
    times as long.
    """
    pids = set()
    for process in _entries("/proc"):
        for descriptor in _entries(f"{process.path}/fd") if process.name.isdecimal() else ():
            with suppress(OSError):
                if holds(descriptor):
                    pids.add(int(process.name))
    yield from (read_program(pid) for pid in sorted(pids - {os.getpid()}))


def _entries(folder: str) -> "list[os.DirEntry[str]]":
    """Return the entries of a folder such as ``/proc/42/fd``; empty if it cannot be read or its process has ended."""
    try:
        with os.scandir(folder) as entries:
            return list(entries)
    except OSError:
        return []


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
