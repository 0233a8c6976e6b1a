"""What a power cut leaves: writes of a program are recorded, and played again without what was not synced.

``strace`` records them, so it is the system calls of the real program that are played: of SQLite, of the recorder's
process, of whatever it starts. What is in a file is on the disk once it was synced; names of files are, in the order in
which they were given, as of any sync (as ext4, XFS and Btrfs have it). Of what came after, chance keeps some sectors.
"""

import re
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from shutil import which
from typing import NamedTuple

NAMING = {"openat": "made", "open": "made", "creat": "made"} | dict.fromkeys(("unlink", "unlinkat"), "gone")
NAMING |= dict.fromkeys(("rename", "renameat", "renameat2"), "renamed") | dict.fromkeys(("link", "linkat"), "linked")
"""Calls that change the names of files, and what they do."""

CALLS = ("write", "pwrite64", "ftruncate", "fsync", "fdatasync", *NAMING)
SECTOR = 512
ACKNOWLEDGED = "acknowledged"

LINE = re.compile(r"\d+\s+(\w+)\((.*)\)\s+= (-?\d+)(?:<.*>)?$")
FILE = re.compile(r"^\d+<((?:\\x[0-9a-f]{2})*)>")
TEXT = re.compile(r'"((?:\\x[0-9a-f]{2})*)"')


def recordable() -> bool:
    """Say whether this machine lets one program look at what another one writes."""
    trace = which("strace")
    return (
        trace is not None and subprocess.run([trace, "-qq", "true"], capture_output=True, check=False).returncode == 0
    )


class Call(NamedTuple):
    """What was done: ``what`` with the file at ``path``, at ``place`` with ``data``, or to the name ``to``."""

    what: str
    path: str
    data: bytes = b""
    place: int = 0
    to: str = ""


@dataclass
class Content:
    """What is in one file: as programs see it, as it was when it was synced, and what was done since."""

    seen: bytearray = field(default_factory=bytearray)
    synced: bytes = b""
    since: list[tuple[int, bytes | None]] = field(default_factory=list)

    def write(self, place: int, data: bytes) -> None:
        """Write."""
        _put(self.seen, place, data)
        self.since += [(place + at, data[at : at + SECTOR]) for at in range(0, len(data), SECTOR)]

    def cut(self, size: int) -> None:
        """Make it that long."""
        _cut(self.seen, size)
        self.since.append((size, None))

    def sync(self) -> None:
        """Bring it to the disk."""
        self.synced, self.since = bytes(self.seen), []

    def left(self, chance: Random | None) -> bytes:
        """Return what a power cut leaves: what was synced, and of what came later whatever chance keeps."""
        found = bytearray(self.synced)
        share = 0.0 if chance is None else chance.choice([0.0, 0.5, 0.9])
        for place, data in self.since:
            if chance is not None and chance.random() < share:
                _cut(found, place) if data is None else _put(found, place, data)
        return bytes(found)


def _put(found: bytearray, place: int, data: bytes) -> None:
    found.extend(bytes(max(0, place - len(found))))
    found[place : place + len(data)] = data


def _cut(found: bytearray, size: int) -> None:
    found.extend(bytes(max(0, size - len(found))))
    del found[size:]


def recorded(command: Sequence[str], folder: Path, trace: Path) -> list[Call]:
    """Run a program, and return what it did in ``folder``, and when it said on its output that it acknowledges."""
    subprocess.run(
        [
            "strace",
            "-f",
            "-y",
            "-xx",
            "-qq",
            "-s",
            "16000000",
            "-e",
            f"trace={','.join(CALLS)}",
            "-o",
            str(trace),
            *command,
        ],
        check=True,
        stdout=subprocess.PIPE,
    )
    return list(calls(trace.read_text("ascii").splitlines(), str(folder)))


def calls(lines: Sequence[str], folder: str) -> Iterator[Call]:
    """Yield what was done in ``folder``, of the lines of a trace."""
    places: dict[str, int] = {}  # as far as each file was written: who appends writes at its end
    for line in _whole(lines):
        match = LINE.match(line)
        if match is None or int(match[3]) < 0:
            continue
        what, given, came = match[1], match[2], int(match[3])
        file, texts = FILE.match(given), [bytes.fromhex(each.replace("\\x", "")) for each in TEXT.findall(given)]
        path = bytes.fromhex(file[1].replace("\\x", "")).decode() if file else ""
        if what == "write" and given.startswith("1<") and texts[0].startswith(ACKNOWLEDGED.encode()):
            yield Call(ACKNOWLEDGED, texts[0].decode().split()[1])
        elif path.startswith(folder) and what not in NAMING:
            yield _within(what, path, given, texts, came, places)
        elif what in NAMING and (names := [each.decode() for each in texts])[0].startswith(folder):
            if NAMING[what] != "made" or "O_CREAT" in given:
                emptied = NAMING[what] == "made" and "O_TRUNC" in given
                yield Call("emptied" if emptied else NAMING[what], names[0], to=names[-1])
            places[names[-1]] = places.get(names[0], 0)


def _within(what: str, path: str, given: str, texts: Sequence[bytes], came: int, places: dict[str, int]) -> Call:
    """Return what was done with the content of a file."""
    last = given.rpartition(", ")[2]
    if what == "pwrite64":
        return Call("wrote", path, texts[0][:came], int(last))
    if what == "write":
        place = places.get(path, 0)
        places[path] = place + came
        return Call("wrote", path, texts[0][:came], place)
    if what == "ftruncate":
        places[path] = int(last)
        return Call("cut", path, place=int(last))
    return Call("synced", path)


def _whole(lines: Sequence[str]) -> Iterator[str]:
    """Put together the lines of calls during which another thread made one."""
    begun: dict[str, str] = {}
    for line in lines:
        thread = line.split(maxsplit=1)[0]
        if line.endswith("<unfinished ...>"):
            begun[thread] = line.removesuffix(" <unfinished ...>")
        elif " resumed>" in line:
            yield begun.pop(thread, "") + line.partition(" resumed>")[2]
        else:
            yield line


class Disk:
    """A disk, as programs see it (``now``), and the names that are safe on it (``kept``), or may be (``later``)."""

    def __init__(self) -> None:
        self.now: dict[str, Content] = {}
        self.kept: dict[str, Content] = {}
        self.later: list[dict[str, Content]] = []

    def do(self, call: Call) -> None:
        """Do what was done."""
        now = self.now
        if call.what == ACKNOWLEDGED:
            return
        content = now.get(call.path) or Content()
        if call.what == "synced":
            content.sync()
            self.kept, self.later = dict(now), []
        elif call.what == "wrote":
            content.write(call.place, call.data)
        elif call.what in ("cut", "emptied"):
            content.cut(call.place)
        if call.what in ("renamed", "gone"):
            now.pop(call.path, None)
        if call.what in ("renamed", "linked"):
            now[call.to] = content
        elif call.what in ("made", "wrote", "cut", "emptied"):
            now[call.path] = content
        if call.what in NAMING.values():
            self.later.append(dict(now))


def after_cut(done: Sequence[Call], chance: Random | None) -> Mapping[str, bytes]:
    """Return what is on the disk, by path, if the power fails after all of ``done``."""
    disk = Disk()
    for call in done:
        disk.do(call)
    kept = disk.kept if chance is None else chance.choice([disk.kept, *disk.later])
    return {path: content.left(chance) for path, content in kept.items()}
