"""Notes: files that describe each run, and each command that moves a robot, in all folders that a stop searches.

By its note a process is found even if it hangs. A note has the process number, the start time of the process (which
shows whether the number was reused), and the addresses of its sockets. The process holds a lock on the note. The kernel
releases the lock when the process ends, even if the process is in a container and cannot be seen from outside.
"""

import fcntl
import json
import os
import secrets
import stat
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from functools import partial
from pathlib import Path
from threading import Event
from typing import IO, Any

from config.file_io import parse_object, read_regular_text
from drivers.api.fast_dataclass import dataclass
from drivers.clock import SystemClock
from missions.control import sockets
from missions.control.processes import ProcessIdentity, current_namespace, identity_of
from missions.control.run_folders import (
    FOLDER_TIMEOUT,
    FolderTimeoutError,
    RunFolder,
    call_all_with_timeout,
    call_with_timeout,
    run_folders,
)

# Time of the newest stop of all runs: ends a command that was loading and that no search could find.
#
# A stop writes the stamp before it searches. A command writes its note before it reads the stamp. So either the
# search finds the note, or the command finds the stamp.

STAMP_FILE = "newest.stop"

TICK_TOLERANCE = 2
"""Clock ticks by which a stop may seem earlier than the process that it was meant for, since both times are rounded."""


def write_stamp() -> None:
    """Write the time of a stop into all run folders of this user; root writes into those of all users.

    Raises OSError if it cannot be written to any folder.
    """
    text = json.dumps({"boot": current_namespace()[0], "ticks": _uptime()})
    results = call_all_with_timeout({place.folder: partial(_write_stamp, place, text) for place in run_folders()})
    errors = [each for each in results.values() if each is not None]
    if len(errors) == len(results):
        raise errors[0] if errors else OSError("neither HOME nor XDG_RUNTIME_DIR is set")


def stamp_stop() -> str:
    """Write the time of a stop, for commands that are still loading; return a warning, empty on success."""
    try:
        write_stamp()
    except PermissionError:
        return ""  # commands cannot write their notes there either, and without a note they move no robot
    except OSError as error:
        why = f"commands that are still loading do not see this stop ({error.strerror or error}): perhaps not stopped"
        return f"{why}\n  try: mission stop, once more"
    return ""


def was_stopped_since(process: ProcessIdentity) -> bool:
    """Return True if a stop came after ``process`` started.

    Each stop writes its time into a stamp file in all run folders. Damaged stamps, and stamps of other boots, are
    ignored.
    """
    stamps = call_all_with_timeout({place.folder: partial(_read_stamp, place) for place in run_folders()}).values()
    read = (stamp for stamp in stamps if not isinstance(stamp, OSError))
    return any(
        boot == process.boot and ticks + TICK_TOLERANCE >= process.start for boot, ticks in read if ticks is not None
    )


def _write_stamp(place: RunFolder, text: str) -> None:
    folder = place.prepare() if place.is_own else place.folder
    temporary = folder / f"{STAMP_FILE}.{secrets.token_hex(8)}"  # one studio may write two stops at the same time
    number = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o644)
    try:
        with os.fdopen(number, "w", encoding="utf-8") as file:
            file.write(text)
        temporary.replace(folder / STAMP_FILE)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def _read_stamp(place: RunFolder) -> tuple[str, int | None]:
    """Return boot id and clock tick of the last stop, from the stamp file in a folder of runs.

    The tick is None without a readable stamp file.
    """
    try:
        values = parse_object(read_regular_text(place.folder / STAMP_FILE))
        return str(values["boot"]), int(values["ticks"])
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        # A command needs a folder that it can read for its own note.
        return "", None


def _uptime() -> int:
    """Return the time since boot in clock ticks, the unit of process start times. Raises OSError."""
    seconds = float(Path("/proc/uptime").read_text(encoding="ascii").split()[0])
    return int(seconds * os.sysconf("SC_CLK_TCK"))


NOTE_SUFFIX = ".note"

MAX_NOTE_CHARACTERS = 1 << 16
"""Maximum number of characters of the first line of a note file, which describes the process."""

END_TIMEOUT = 5.0
"""Seconds that a command has to bring its actuators to rest and close them."""

POLL_INTERVAL = 0.02
"""Seconds between two checks whether a command that was sent SIGTERM has ended."""


@dataclass(frozen=True, slots=True)
class RobotHolder:
    """A process that can move a robot, as its note file describes it: a run, or a command such as teleop.

    ``name`` is its mission or command, ``run`` the name of its run. ``identity`` is None if unknown; ``sockets`` are
    the addresses of its control sockets, ``notes`` the paths of its note files.
    """

    process: int
    name: str
    robot: str
    simulated: str
    run: str = ""
    is_run: bool = False
    identity: ProcessIdentity | None = None
    sockets: tuple[str, ...] = ()
    notes: tuple[Path, ...] = field(default=(), compare=False)
    uid: int | None = field(default=None, compare=False)

    @property
    def description(self) -> str:
        """Process number, mission or command, and robot, as text for people."""
        return f"{self.process}: {self.name} on {self.robot}" + (
            f" (simulated, {self.simulated})" * bool(self.simulated)
        )

    def is_alive(self) -> bool:
        """Return whether the process still exists. Raises OSError if this is unknown."""
        if self.identity is not None and (self.identity.is_visible or not self.notes):
            return self.identity.is_alive()
        return any(call_with_timeout(path.parent, partial(read_note, path)) is not None for path in self.notes)

    def terminate(self) -> None:
        """Send SIGTERM if the process still exists. Raises OSError if it is unknown which process it is."""
        if self.identity is None:
            raise OSError("its note has no start time")
        self.identity.terminate(None if os.geteuid() else self.uid)

    def end(self, by: str) -> bool:
        """End a command by SIGTERM on behalf of the person ``by``; return True if it ended within ``END_TIMEOUT``.

        Raises OSError if the process cannot be reached, or its end cannot be detected.
        """
        for path in self.notes:
            with suppress(OSError):  # the line is only for the last message of the run
                call_with_timeout(path.parent, partial(_append_line, path, by))
        self.terminate()
        clock, pause = SystemClock(), Event()
        while self.is_alive():
            if clock.now() > END_TIMEOUT:
                return False
            pause.wait(POLL_INTERVAL)
        return True


class RunNotes:
    """The note files that describe a run or a command to `mission stop`, one in each usable folder. Not thread-safe."""

    def __init__(self, run: str, name: str, robot: str, simulated: str, *, is_run: bool) -> None:
        self._run = run
        identity = identity_of(os.getpid())
        self._content: dict[str, Any] = {"name": name, "robot": robot, "simulated": simulated, "run": run}
        self._content |= {"is_run": is_run, "sockets": [], "computer": os.uname().nodename}
        if identity is not None:
            self._content["process"] = [identity.pid, identity.start, identity.boot, identity.namespace]
        self._files: dict[Path, IO[str]] = {}
        self._folder_timeout = FOLDER_TIMEOUT

    @property
    def paths(self) -> list[Path]:
        """Paths of the note files."""
        return [*self._files]

    def write(self, listening: Sequence[str] = (), seconds: float = FOLDER_TIMEOUT) -> None:
        """Write the note files that are missing, or all of them if the addresses ``listening`` have changed.

        ``seconds`` is the timeout for each folder. Raises OSError if no note file exists afterwards.
        """
        self._folder_timeout = seconds
        changed = [*listening] != self._content["sockets"]
        self._content["sockets"] = [*listening]
        errors = list[OSError]()
        for place in run_folders(seconds=seconds):
            path = place.folder / f"{self._run}{NOTE_SUFFIX}"
            if not place.is_own or (not changed and self._exists(path)):
                continue
            try:
                file = call_with_timeout(place.folder, partial(self._write, place, path), seconds)
            except OSError as error:
                errors.append(error)
            else:
                if path in self._files:
                    self._files.pop(path).close()
                self._files[path] = file
        if not any(map(self._exists, self._files)):
            raise errors[0] if errors else OSError("neither HOME nor XDG_RUNTIME_DIR is set")

    def _write(self, place: RunFolder, path: Path) -> IO[str]:
        """Create a locked note atomically; an unlocked note belongs to a killed process."""
        place.prepare()
        temporary = path.with_suffix(".noting")
        number = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        file = os.fdopen(number, "w", encoding="utf-8")
        try:
            with suppress(OSError):  # a network disk may not support locks: the start time identifies the process too
                fcntl.flock(file, fcntl.LOCK_EX)
            file.write(json.dumps(self._content) + "\n")
            file.flush()
            temporary.replace(path)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            with suppress(OSError):  # the buffered rest does not fit either
                file.close()
            raise
        return file

    def _exists(self, path: Path) -> bool:
        if path not in self._files:
            return False
        try:
            found, own_stat = (
                call_with_timeout(path.parent, path.stat, self._folder_timeout),
                os.fstat(self._files[path].fileno()),
            )
        except FolderTimeoutError:
            return True  # it existed, and nothing can be written there now
        except OSError:
            return False
        return (found.st_dev, found.st_ino) == (own_stat.st_dev, own_stat.st_ino)

    def stop_requesters(self) -> list[str]:
        """Return the names of the people who stopped this command; `mission stop` appends them to its note file."""
        found = list[str]()
        for path in self._files:
            with suppress(OSError):
                found += call_with_timeout(path.parent, partial(path.read_text, encoding="utf-8")).splitlines()[1:]
        return list(dict.fromkeys(found))

    def close(self) -> None:
        """Remove the note files."""
        while self._files:
            path = next(iter(self._files))
            with suppress(OSError):  # the folder is read-only now: the note has no lock
                if self._exists(path):
                    call_with_timeout(path.parent, partial(path.unlink, missing_ok=True))
            self._files.pop(path).close()


def _append_line(path: Path, line: str) -> None:
    number = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_NONBLOCK | os.O_NOFOLLOW)
    with os.fdopen(number, "w", encoding="utf-8") as note:
        note.write(f"{line}\n")


def read_note(path: Path) -> RobotHolder | None:
    """Return the process that a note file describes; None if the process has ended, and then the file is removed.

    Raises OSError if the file cannot be read or parsed, or if it is unknown whether the process lives.
    """
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW), encoding="utf-8") as note:
            status = os.fstat(note.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise OSError(f"{path} is not a regular file")
            line, uid, locked = note.readline(MAX_NOTE_CHARACTERS), status.st_uid, _is_locked(note)
        found, computer = _parse_note(parse_object(line), path, uid)
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        if locked or sockets.process_exists(_pid_in(path)):
            raise OSError(f"{path} cannot be understood ({type(error).__name__})") from error
        _remove(path)
        return None
    identity = found.identity
    # A container has another host name, and a computer can be renamed. Several computers may share a home.
    if computer != os.uname().nodename and (identity is None or not identity.is_of_this_boot):
        return None
    if identity is not None and identity.is_visible:
        locked = identity.is_alive()
    if locked:
        return found
    _remove(path)
    return None


def _parse_note(data: Mapping[str, Any], path: Path, uid: int) -> tuple[RobotHolder, str]:
    """Return the process that the content ``data`` of a note file describes, and the name of its computer.

    Raises ValueError, KeyError, TypeError, OverflowError.
    """
    process, identity = _pid_in(path), None
    if "process" in data:
        pid, start, boot, namespace = data["process"]
        process, identity = int(pid), ProcessIdentity(int(pid), int(start), str(boot), int(namespace))
    found = RobotHolder(
        process,
        str(data["name"]),
        str(data["robot"]),
        str(data["simulated"]),
        run=str(data.get("run", process)),
        is_run=bool(data.get("is_run")),
        identity=identity,
        sockets=tuple(map(str, data.get("sockets", ()))),
        notes=(path,),
        uid=uid,
    )
    return found, str(data.get("computer", os.uname().nodename))


def _pid_in(path: Path) -> int:
    return sockets.pid_of_run(path.name.removesuffix(NOTE_SUFFIX))


def _is_locked(note: IO[str]) -> bool:
    try:
        fcntl.flock(note, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    return False


def _remove(path: Path) -> None:
    """Remove the note file of an ended process, if the folder belongs to this user."""
    if path.parent.stat().st_uid == os.geteuid():
        with suppress(OSError):  # it stays, and is checked again at the next search
            path.unlink(missing_ok=True)
