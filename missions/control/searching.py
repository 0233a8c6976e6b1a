"""The search for all that can move a robot of this user: by socket files, notes, and abstract sockets.

What cannot be looked at is a `Doubt`: an error while looking is never taken for "nothing runs".
"""

import errno
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from drivers.api.quick import dataclass
from missions.control import abstract, sockets
from missions.control.abstract import SIMULATED, AbstractName
from missions.control.notes import ENDING, Holder, read_note
from missions.control.places import Place, all_within, places
from missions.control.processes import ProcessIdentity, identity_of
from missions.control.sockets import Address

BY_HAND = "pgrep -af mission  (what runs), and kill its process; or the robot's own switch"
"""What to type where nothing better is known."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """A reason why something may move on, and what to type."""

    why: str
    hint: str = BY_HAND

    @property
    def words(self) -> str:
        """What people are told."""
        return f"perhaps not stopped: {self.why}\n  try: {self.hint}"


@dataclass(frozen=True, slots=True)
class Found:
    """A run, or a command without a control socket: the ``addresses`` where it may answer, and what its notes tell."""

    run: str
    addresses: tuple[Address, ...] = ()
    holder: Holder | None = None
    by_name: AbstractName | None = None

    @property
    def is_command(self) -> bool:
        """Whether it can only be ended."""
        if self.addresses or (self.holder is not None and self.holder.is_run):
            return False
        return self.holder is not None or (self.by_name is not None and not self.by_name.is_run)

    @property
    def key(self) -> object:
        """What tells it from all others, wherever its sockets are."""
        return self.run, self.identity or self.addresses

    @property
    def identity(self) -> ProcessIdentity | None:
        """The process, as far as it is known."""
        if self.holder is not None and self.holder.identity is not None:
            return self.holder.identity
        return None if self.by_name is None else self.by_name.identity

    @property
    def visible(self) -> ProcessIdentity | None:
        """The process by its number on this side of a container, if that is known."""
        return self.identity if self.by_name is None or self.by_name.here is None else self.by_name.here

    def is_at(self, process: int) -> bool:
        """Return whether the process at the other end of a connection may be this one: another may have its name."""
        return self.by_name is None or self.by_name.here is None or self.by_name.here.pid == process

    def way_to_end(self, peer: ProcessIdentity | None = None) -> str:
        """Return what to type if it does not end. ``peer`` is the process that listens at its socket, if known."""
        for known in (self.visible, peer):
            with suppress(OSError):  # its number is not known from here
                if known is not None and known.is_visible:
                    return f"if process {known.pid} is there still: kill -9 {known.pid}"
        return BY_HAND

    @property
    def uid(self) -> int:
        """Whose it is."""
        if self.by_name is not None:
            return self.by_name.uid
        return os.geteuid() if self.holder is None or self.holder.uid is None else self.holder.uid

    def lives(self, peer: ProcessIdentity | None) -> bool:
        """Return whether its process has not ended. Raises OSError where that is not known.

        ``peer`` is who has listened at its socket, for one that has left no note and no name.
        """
        if self.by_name is not None and self.by_name.here is not None:
            return self.by_name.here.lives()
        if self.holder is not None:
            return self.holder.lives()
        identity = peer if self.by_name is None else self.by_name.identity
        if identity is None:
            raise OSError("it is not known which process it is")
        return identity.lives()

    def terminate(self, peer: ProcessIdentity | None) -> None:
        """Send its process SIGTERM, if it has not ended. Raises OSError where it cannot be told from another one."""
        if self.by_name is not None and self.by_name.here is not None:
            self.by_name.here.terminate()
        elif self.holder is not None:
            self.holder.terminate()
        elif self.by_name is None and peer is not None:
            peer.terminate(None if os.geteuid() else self.uid)
        elif self.by_name is not None and self.by_name.has_its_process():
            self.by_name.identity.terminate(None if os.geteuid() else self.by_name.uid)
        else:
            raise OSError("it is not known which process it is")

    def as_holder(self) -> Holder:
        """Return the command, also where it could leave no note."""
        if self.holder is not None:
            return self.holder
        name = self.by_name
        if name is None or (name.here is None and not name.has_its_process()):
            raise OSError("it is not known which process it is")
        identity, simulated = name.here or name.identity, SIMULATED[1:] * name.kind.endswith(SIMULATED)
        return Holder(identity.pid, "a command", "a robot", simulated, self.run, identity=identity, uid=self.uid)

    @property
    def words(self) -> str:
        """What it is, as people are told."""
        if self.holder is not None:
            return self.holder.words
        return f"{self.run}: {'a command' if self.is_command else 'a run'}"

    def is_meant(self, which: Sequence[str]) -> bool | None:
        """Return whether one of these names is its own; None where that is not known before it answers."""
        if not which or not self.names.isdisjoint(which):
            return True
        return None if self.holder is None else False

    @property
    def names(self) -> set[str]:
        """The names by which it can be meant, as far as they are known."""
        if self.holder is None:
            return {self.run}
        return {self.run, str(self.holder.process), self.holder.name, *self.holder.name.split()[:1]}


@dataclass(slots=True)
class Search:
    """What was found, and what could not be looked at. ``files`` are the socket files among the addresses."""

    found: list[Found] = field(default_factory=list)
    doubts: list[Doubt] = field(default_factory=list)


def search(*, thorough: bool = True) -> Search:
    """Look in every place where a run, or a command that moves a robot, of this user can be.

    Where it is ``thorough`` each process of this user is looked at, too, which takes some milliseconds.
    """
    result = Search()
    holders, files = list[Holder](), list[Path]()
    looked = all_within({place.folder: partial(_look_in, place) for place in places()})
    for folder, seen in looked.items():
        if isinstance(seen, OSError):
            result.doubts.append(doubt_of(f"{folder} cannot be read", seen))
            continue
        holders += seen.holders
        files += seen.files
        result.doubts += seen.doubts
    result.found = _together(holders, files, _listed(result.doubts, thorough=thorough))
    return result


def runs_by_name() -> list[Found]:
    """Return the runs of this user that the kernel lists by name: no folder is looked at, so none can delay this."""
    return [each for each in _together([], [], _listed([], thorough=False)) if not each.is_command]


class _Folder(NamedTuple):
    """What is in one folder of runs."""

    holders: list[Holder]
    files: list[Path]
    doubts: list[Doubt]


def _look_in(place: Place) -> _Folder:
    """Return what is in a folder of runs. Raises OSError where it cannot be read."""
    names = place.names()
    found = _Folder([], [place.folder / name for name in names if name.endswith(sockets.ENDING)], [])
    for name in names:
        if name.endswith(ENDING) and name.removesuffix(ENDING).replace("-", "").isdecimal():
            try:
                holder = read_note(place.folder / name)
            except OSError as error:
                found.doubts.append(doubt_of(f"{place.folder / name} cannot be read", error))
            else:
                found.holders.extend([] if holder is None else [holder])
    return found


def _listed(doubts: list[Doubt], *, thorough: bool) -> list[AbstractName]:
    """Return the names that the kernel has of this user's runs; of others only that there is one is told."""
    names = list[AbstractName]()
    for look, what in ((abstract.names, abstract.LISTED), (abstract.held, "/proc")):
        try:
            names += look() if thorough or look is abstract.names else ()
        except OSError as error:
            doubts.append(doubt_of(f"{what} cannot be read", error))
    mine = []
    for name in names:
        if os.geteuid() in (0, name.uid) or name.here is not None:
            mine.append(name)
        elif not name.kind.endswith(SIMULATED):
            doubts.append(Doubt(f"process {name.run} of another user ({name.uid}) has a robot", "sudo mission stop"))
    return mine


def _together(holders: Sequence[Holder], files: Sequence[Path], names: Sequence[AbstractName]) -> list[Found]:
    """Return each process once, with all that is known of it. A file that is in no note is one of its own."""
    found: dict[tuple[str, ProcessIdentity | None], Found] = {}
    for holder in holders:
        key = holder.run, holder.identity
        same = found.get(key)
        if same is not None and same.holder is not None:
            holder = replace(holder, notes=(*same.holder.notes, *holder.notes))  # noqa: PLW2901
        addresses = [each if each.startswith("@") else Path(each) for each in holder.sockets]
        known = () if same is None else same.addresses
        found[key] = Found(holder.run, tuple(dict.fromkeys([*known, *addresses])), holder)
    for name in names:
        key = name.run, name.identity
        same = found.get(key, Found(name.run))
        more = [name.address] if name.is_run and name.here is None else []
        if same.by_name is not None:  # it is told by its socket and by its process
            name = replace(name, inode=name.inode or same.by_name.inode, here=name.here or same.by_name.here)  # noqa: PLW2901
        found[key] = replace(same, addresses=tuple(dict.fromkeys([*same.addresses, *more])), by_name=name)
    noted = {address for each in found.values() for address in each.addresses}
    alone = [Found(sockets.run_of(path), (path,)) for path in dict.fromkeys(files) if path not in noted]
    return [*(_with_files(each, files) for each in found.values()), *alone]


def _with_files(found: Found, files: Sequence[Path]) -> Found:
    """Return a run that has no address with the socket files of its name: its note may be missing, or be refused."""
    if found.addresses or found.by_name is None or not found.by_name.is_run:
        return found
    return replace(found, addresses=tuple(path for path in files if sockets.run_of(path) == found.run))


def doubt_of(what: str, error: OSError) -> Doubt:
    """Return the doubt that an error leaves."""
    hints: Mapping[int | None, str] = {
        errno.EMFILE: "mission stop  (in another terminal: no file descriptor is left here; ulimit -n tells how many)",
        errno.ENFILE: "mission stop  (again: no file descriptor is left on this computer)",
        errno.EACCES: "sudo mission stop",
        errno.EPERM: "sudo mission stop",
    }
    return Doubt(f"{what}: {reason_of(error)}", hints.get(error.errno, BY_HAND))


def reason_of(error: OSError) -> str:
    """Return an error in words."""
    return error.strerror or str(error)


def is_own(found: Found) -> bool:
    """Return whether it is of this process: who stops all others does not end itself."""
    if found.holder is not None and found.holder.identity is None:
        return found.holder.process == os.getpid()
    known = found.identity
    return known is not None and known == identity_of(os.getpid())


def addresses_of(run: str) -> list[Address]:
    """Return where a run may answer; none for one that is not there. Raises OSError where that is not known."""
    result = search(thorough=False)
    found = [address for each in result.found if each.run == run for address in each.addresses]
    if result.doubts and not found:
        raise OSError(result.doubts[0].why)
    return list(dict.fromkeys(found))


def is_listed(run: str) -> bool:
    """Return whether a run has a control socket, as far as can be seen."""
    return any(each.run == run and each.addresses for each in search(thorough=False).found)


def may_live(found: Found) -> bool:
    """Return whether a process is there, or that is not known; not where only the file of a socket was left."""
    if found.holder is None and found.by_name is None:
        return False
    try:
        return found.lives(None)
    except OSError:
        return True
