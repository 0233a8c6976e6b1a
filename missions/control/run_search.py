"""Search for all processes of this user that can move a robot: by socket files, notes and abstract sockets.

A place that cannot be searched yields a warning: an error never means that nothing is running.
"""

import errno
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from drivers.api.fast_dataclass import dataclass
from missions.control import abstract_sockets, sockets
from missions.control.abstract_sockets import SIMULATED_SUFFIX, AbstractName
from missions.control.notes import NOTE_SUFFIX, RobotHolder, read_note
from missions.control.processes import ProcessIdentity, identity_of
from missions.control.run_folders import RunFolder, call_all_with_timeout, run_folders
from missions.control.sockets import Address

MANUAL_STOP_HINT = "pgrep -af mission  (lists processes), then kill PID; or the robot's own switch"
"""Hint how to stop a robot by hand, if no better command is known."""


@dataclass(frozen=True, slots=True)
class StopWarning:
    """Reason why a robot may still move after a stop, with a hint for the user."""

    reason: str
    hint: str = MANUAL_STOP_HINT

    @property
    def message(self) -> str:
        """Reason and hint as text for people."""
        return f"perhaps not stopped: {self.reason}\n  try: {self.hint}"


@dataclass(frozen=True, slots=True)
class FoundProcess:
    """A process that can move a robot, found by a search: a run, or a command without a control socket.

    ``addresses`` are its control sockets. ``holder`` is the content of its note file, and ``abstract_name`` the name of
    its abstract socket; each is None if not found.
    """

    run: str
    addresses: tuple[Address, ...] = ()
    holder: RobotHolder | None = None
    abstract_name: AbstractName | None = None

    @property
    def is_command(self) -> bool:
        """True if the process has no control socket and can only be ended."""
        if self.addresses or (self.holder is not None and self.holder.is_run):
            return False
        return self.holder is not None or (self.abstract_name is not None and not self.abstract_name.is_run)

    @property
    def key(self) -> object:
        """Key that identifies the process; it does not depend on its addresses if the process number is known."""
        return self.run, self.identity or self.addresses

    @property
    def identity(self) -> ProcessIdentity | None:
        """Identity of the process, if known."""
        if self.holder is not None and self.holder.identity is not None:
            return self.holder.identity
        return None if self.abstract_name is None else self.abstract_name.identity

    @property
    def local_identity(self) -> ProcessIdentity | None:
        """Identity of the process in this pid namespace, if known."""
        return (
            self.identity
            if self.abstract_name is None or self.abstract_name.local_identity is None
            else self.abstract_name.local_identity
        )

    def is_process(self, process: int) -> bool:
        """Return False if this process certainly has another number than ``process``, which is connected to its socket.

        True if the numbers are equal, or if the number in this pid namespace is not known.
        """
        return (
            self.abstract_name is None
            or self.abstract_name.local_identity is None
            or self.abstract_name.local_identity.pid == process
        )

    def end_hint(self, peer: ProcessIdentity | None = None) -> str:
        """Return a command for the user that kills the process.

        ``peer`` is the process that listens at its socket, if known.
        """
        for known in (self.local_identity, peer):
            with suppress(OSError):  # the process has no number in this namespace
                if known is not None and known.is_visible:
                    return f"if process {known.pid} still exists: kill -9 {known.pid}"
        return MANUAL_STOP_HINT

    @property
    def uid(self) -> int:
        """User id of the owner of the process."""
        if self.abstract_name is not None:
            return self.abstract_name.uid
        return os.geteuid() if self.holder is None or self.holder.uid is None else self.holder.uid

    def is_alive(self, peer: ProcessIdentity | None) -> bool:
        """Return True if the process still exists. Raises OSError if this is unknown.

        ``peer`` is the process that listens at its socket; it is used if neither a note file nor an abstract socket was
        found.
        """
        if self.abstract_name is not None and self.abstract_name.local_identity is not None:
            return self.abstract_name.local_identity.is_alive()
        if self.holder is not None:
            return self.holder.is_alive()
        identity = peer if self.abstract_name is None else self.abstract_name.identity
        if identity is None:
            raise OSError("its process ID is unknown")
        return identity.is_alive()

    def terminate(self, peer: ProcessIdentity | None) -> None:
        """Send SIGTERM if the process still exists. Raises OSError if it is unknown which process it is.

        ``peer`` is the process that listens at its socket; it is used if neither a note file nor an abstract socket was
        found.
        """
        if self.abstract_name is not None and self.abstract_name.local_identity is not None:
            self.abstract_name.local_identity.terminate()
        elif self.holder is not None:
            self.holder.terminate()
        elif self.abstract_name is None and peer is not None:
            peer.terminate(None if os.geteuid() else self.uid)
        elif self.abstract_name is not None and self.abstract_name.has_its_process():
            self.abstract_name.identity.terminate(None if os.geteuid() else self.abstract_name.uid)
        else:
            raise OSError("its process ID is unknown")

    def as_holder(self) -> RobotHolder:
        """Return the description of a command from its note file, or from the name of its abstract socket.

        Raises OSError if the process is unknown.
        """
        if self.holder is not None:
            return self.holder
        name = self.abstract_name
        if name is None or (name.local_identity is None and not name.has_its_process()):
            raise OSError("its process ID is unknown")
        identity, simulated = (
            name.local_identity or name.identity,
            SIMULATED_SUFFIX[1:] * name.kind.endswith(SIMULATED_SUFFIX),
        )
        return RobotHolder(identity.pid, "a command", "a robot", simulated, self.run, identity=identity, uid=self.uid)

    @property
    def description(self) -> str:
        """Process number, mission or command, and robot, as text for people.

        Without a note file, only the process number and its kind are known.
        """
        if self.holder is not None:
            return self.holder.description
        return f"{self.run}: {'a command' if self.is_command else 'a run'}"

    def matches(self, wanted_names: Sequence[str]) -> bool | None:
        """Return True if a user can mean this process by one of ``wanted_names``; always if there are none.

        None if its note is missing, so that its mission is unknown until it replies.
        """
        if not wanted_names or not self.names.isdisjoint(wanted_names):
            return True
        return None if self.holder is None else False

    @property
    def names(self) -> set[str]:
        """Known names by which a user can select the process."""
        if self.holder is None:
            return {self.run}
        return {self.run, str(self.holder.process), self.holder.name, *self.holder.name.split()[:1]}


@dataclass(slots=True)
class SearchResult:
    """Found processes, and warnings about places that could not be searched."""

    processes: list[FoundProcess] = field(default_factory=list)
    warnings: list[StopWarning] = field(default_factory=list)


def search_runs(*, thorough: bool = True) -> SearchResult:
    """Search all places for runs, and for commands that move a robot, of this user.

    If ``thorough``, each process of this user is inspected too, which takes some milliseconds.
    """
    result = SearchResult()
    holders, files = list[RobotHolder](), list[Path]()
    looked = call_all_with_timeout({place.folder: partial(_read_folder, place) for place in run_folders()})
    for folder, listing in looked.items():
        if isinstance(listing, OSError):
            result.warnings.append(warning_for(f"{folder} cannot be read", listing))
            continue
        holders += listing.holders
        files += listing.files
        result.warnings += listing.warnings
    result.processes = _merge_processes(holders, files, _listed_names(result.warnings, thorough=thorough))
    return result


def listed_runs() -> list[FoundProcess]:
    """Return the runs of this user in the kernel's socket list; a folder that does not respond cannot delay this."""
    return [each for each in _merge_processes([], [], _listed_names([], thorough=False)) if not each.is_command]


class _FolderContents(NamedTuple):
    """Processes, socket files and warnings found in one folder of runs."""

    holders: list[RobotHolder]
    files: list[Path]
    warnings: list[StopWarning]


def _read_folder(place: RunFolder) -> _FolderContents:
    """Return the contents of a folder of runs. Raises OSError if it cannot be read."""
    names = place.file_names()
    found = _FolderContents([], [place.folder / name for name in names if name.endswith(sockets.SOCKET_SUFFIX)], [])
    for name in names:
        if name.endswith(NOTE_SUFFIX) and name.removesuffix(NOTE_SUFFIX).replace("-", "").isdecimal():
            try:
                holder = read_note(place.folder / name)
            except OSError as error:
                found.warnings.append(warning_for(f"{place.folder / name} cannot be read", error))
            else:
                found.holders.extend([] if holder is None else [holder])
    return found


def _listed_names(warnings: list[StopWarning], *, thorough: bool) -> list[AbstractName]:
    """Return the names of the abstract sockets of this user's runs.

    For a run of another user that can move a real robot, an entry is added to ``warnings``. If ``thorough``, the names
    of memory files (memfd) of all processes are searched too.
    """
    names = list[AbstractName]()
    for look, what in (
        (abstract_sockets.listed_names, abstract_sockets.SOCKET_LIST),
        (abstract_sockets.names_in_memory, "/proc"),
    ):
        try:
            names += look() if thorough or look is abstract_sockets.listed_names else ()
        except OSError as error:
            warnings.append(warning_for(f"{what} cannot be read", error))
    mine = []
    for name in names:
        if os.geteuid() in (0, name.uid) or name.local_identity is not None:
            mine.append(name)
        elif not name.kind.endswith(SIMULATED_SUFFIX):
            warnings.append(
                StopWarning(f"process {name.run} of another user ({name.uid}) holds a robot", "sudo mission stop")
            )
    return mine


def _merge_processes(
    holders: Sequence[RobotHolder], files: Sequence[Path], names: Sequence[AbstractName]
) -> list[FoundProcess]:
    """Return each found process once, with all data about it.

    ``holders`` are the contents of note files, ``files`` are socket files, and ``names`` the names of abstract sockets.
    A socket file without a note is a process of its own.
    """
    found: dict[tuple[str, ProcessIdentity | None], FoundProcess] = {}
    for holder in holders:
        key = holder.run, holder.identity
        same = found.get(key)
        if same is not None and same.holder is not None:
            holder = replace(holder, notes=(*same.holder.notes, *holder.notes))  # noqa: PLW2901
        addresses = [each if each.startswith("@") else Path(each) for each in holder.sockets]
        known = () if same is None else same.addresses
        found[key] = FoundProcess(holder.run, tuple(dict.fromkeys([*known, *addresses])), holder)
    for name in names:
        key = name.run, name.identity
        same = found.get(key, FoundProcess(name.run))
        more = [name.address] if name.is_run and name.local_identity is None else []
        if same.abstract_name is not None:  # known by its socket and by its process
            name = replace(  # noqa: PLW2901
                name,
                inode=name.inode or same.abstract_name.inode,
                local_identity=name.local_identity or same.abstract_name.local_identity,
            )
        found[key] = replace(same, addresses=tuple(dict.fromkeys([*same.addresses, *more])), abstract_name=name)
    noted = {address for each in found.values() for address in each.addresses}
    alone = [FoundProcess(sockets.run_of_socket(path), (path,)) for path in dict.fromkeys(files) if path not in noted]
    return [*(_with_files(each, files) for each in found.values()), *alone]


def _with_files(process: FoundProcess, files: Sequence[Path]) -> FoundProcess:
    """Return a run whose note is missing or unreadable, with the addresses of the socket ``files`` of its name.

    Other processes are returned unchanged.
    """
    if process.addresses or process.abstract_name is None or not process.abstract_name.is_run:
        return process
    return replace(process, addresses=tuple(path for path in files if sockets.run_of_socket(path) == process.run))


def warning_for(subject: str, error: OSError) -> StopWarning:
    """Return the warning that ``subject``, a place or process, could not be searched because of ``error``."""
    hints: Mapping[int | None, str] = {
        errno.EMFILE: "mission stop  (in another terminal: no file descriptor is left here; ulimit -n shows the limit)",
        errno.ENFILE: "mission stop  (again: no file descriptor is left on this computer)",
        errno.EACCES: "sudo mission stop",
        errno.EPERM: "sudo mission stop",
    }
    return StopWarning(f"{subject}: {error_text(error)}", hints.get(error.errno, MANUAL_STOP_HINT))


def error_text(error: OSError) -> str:
    """Return the text of an operating system error without its number and path."""
    return error.strerror or str(error)


def is_own_process(process: FoundProcess) -> bool:
    """Return whether a found process is the present one, which must not end itself."""
    if process.holder is not None and process.holder.identity is None:
        return process.holder.process == os.getpid()
    known = process.identity
    return known is not None and known == identity_of(os.getpid())


def addresses_of(run: str) -> list[Address]:
    """Return the addresses of a run; empty if it does not exist. Raises OSError if this is unknown."""
    result = search_runs(thorough=False)
    found = [address for each in result.processes if each.run == run for address in each.addresses]
    if result.warnings and not found:
        raise OSError(result.warnings[0].reason)
    return list(dict.fromkeys(found))


def has_control_socket(run: str) -> bool:
    """Return whether a run has a control socket, as far as this can be seen."""
    return any(each.run == run and each.addresses for each in search_runs(thorough=False).processes)


def may_be_alive(process: FoundProcess) -> bool:
    """Return whether the process lives, or this is unknown; False if only a socket file is left."""
    if process.holder is None and process.abstract_name is None:
        return False
    try:
        return process.is_alive(None)
    except OSError:
        return True
