"""Where a run can be stopped: its listening sockets, and the notes that name them, looked after while it goes on."""

import errno
import os
import selectors
import socket
from contextlib import suppress
from functools import partial
from pathlib import Path

from drivers.api.quick import dataclass
from missions.studio import abstract, sockets
from missions.studio.messages import Run
from missions.studio.notes import Notes
from missions.studio.places import Place, places
from missions.studio.slow_folders import CHECK_TIMEOUT, FOLDER_TIMEOUT, FolderTimeoutError, within

CHECK_INTERVAL = 1.0
"""Seconds from one look whether the sockets can be reached to the next."""

BREATH = 0.1
"""Seconds for which nobody is let in where the process has no descriptor left for one more."""

LISTENER = object()
"""The data of the sockets among all that the selector waits for."""

BUSY = {errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOBUFS, errno.EAGAIN}
"""Errors of a connection that say nothing of the socket: this process has no descriptor left, or many ask at once."""


@dataclass(slots=True)
class Listener:
    """A socket that listens at an ``address``; of a file, ``inode`` tells it from one that was put in its place."""

    address: sockets.Address
    socket: socket.socket
    inode: int = 0


class Endpoint:
    """The sockets and notes of a run, for one thread, which waits for ``selector``: its key has the data ``LISTENER``.

    ``trouble`` says why no stop can reach the run; empty where one can.
    """

    def __init__(self, selector: selectors.BaseSelector, of_run: Run) -> None:
        self.trouble = ""
        self.due = 0.0
        """When something is to be done, in seconds of the clock whose time ``turn`` is given."""
        self._selector, self._of_run = selector, of_run
        self._notes: Notes | None = None
        self._file: Listener | None = None
        self._abstract: Listener | None = None
        self._registered: list[socket.socket] = []
        self._probes: set[object] = set()
        self._errors: list[str] = []
        self._held: int | None = None
        self._check_at = 0.0
        self._seconds = FOLDER_TIMEOUT

    @property
    def listeners(self) -> list[socket.socket]:
        """Those that there are now."""
        return [each.socket for each in (self._file, self._abstract) if each is not None]

    def turn(self, now: float) -> None:
        """Look after sockets and notes, if it is time; and let people in again after a rest."""
        if now < self.due:
            return
        if now >= self._check_at:
            self._check_at = now + CHECK_INTERVAL
            self.check()
            self._seconds = CHECK_TIMEOUT  # from now on stops are heard by this thread
        self.due = self._check_at
        for each in self._registered:
            with suppress(KeyError, ValueError):  # it is closed, or at rest
                self._selector.unregister(each)
        self._registered = self.listeners
        for each in self._registered:
            self._selector.register(each, selectors.EVENT_READ, LISTENER)

    def rest(self, listener: socket.socket, now: float) -> None:
        """Let nobody in for a moment."""
        self._selector.unregister(listener)
        self.due = min(self.due, now + BREATH)

    def check(self) -> None:
        """Listen where no socket can be reached, or not any more, and write the notes that are missing."""
        self._errors = []
        self._probes.clear()
        self._file = self._kept(self._file) or self._listen_in_a_folder()
        self._abstract = self._kept(self._abstract) or self._listen_by_name()
        found = [each for each in (self._file, self._abstract) if each is not None]
        noted = self._note([str(each.address) for each in found])
        self.trouble = "" if found and noted else "; ".join(self._errors)

    def is_probe(self, peer: object) -> bool:
        """Return whether a connection that has come from there is this endpoint's own look at itself."""
        return peer in self._probes

    def close(self) -> None:
        """Remove sockets and notes."""
        if self._notes is not None:
            self._notes.close()  # before the sockets: without those the run would be taken for one that hangs
        for each in (self._file, self._abstract):
            if each is not None:
                if isinstance(each.address, Path):
                    with suppress(OSError):  # the folder cannot be written any more: nobody answers there
                        if _inode(each.address) == each.inode:
                            within(each.address.parent, partial(each.address.unlink, missing_ok=True))
                each.socket.close()
        self._file = self._abstract = None
        if self._held is not None:
            os.close(self._held)
            self._held = None

    def _listen_in_a_folder(self) -> Listener | None:
        """Listen in the first folder that can be used."""
        for place in places(seconds=self._seconds):
            if place.is_own:
                path = place.folder / f"{self._of_run.run}{sockets.ENDING}"
                try:
                    return within(place.folder, partial(_listen, place, path), self._seconds)
                except OSError as error:
                    self._errors.append(f"no control socket in {place.folder}: {error.strerror or error}")
        return None

    def _listen_by_name(self) -> Listener | None:
        try:
            name = abstract.name_of(self._of_run.run, "run", simulated=bool(self._of_run.simulated))
            with suppress(OSError):  # an old kernel: that is one way of several
                self._held = abstract.hold(name) if self._held is None else self._held
            found = abstract.listen(name)
        except OSError as error:
            self._errors.append(f"no abstract control socket: {error.strerror or error}")
            return None
        found.setblocking(False)
        return Listener(name.address, found)

    def _note(self, listening: list[str]) -> bool:
        """Leave notes of the sockets; return whether there is one."""
        try:
            if self._notes is None:
                about = self._of_run
                self._notes = Notes(about.run, about.mission, about.robot, about.simulated, is_run=True)
            self._notes.write(listening, self._seconds)
        except OSError as error:
            self._errors.append(f"no note of the run: {error.strerror or error}")
            return False
        return True

    def _kept(self, listener: Listener | None) -> Listener | None:
        """Return a listener that can be reached; else close it."""
        if listener is None or self._can_be_reached(listener):
            return listener
        with suppress(OSError):  # something else may have closed it
            listener.socket.close()
        return None

    def _can_be_reached(self, listener: Listener) -> bool:
        """Return whether who connects to the address of a listener reaches it, as far as that can be seen now."""
        try:
            if isinstance(listener.address, str):
                self._probe(listener)
            else:
                within(listener.address.parent, partial(self._probe, listener), self._seconds)
        except FolderTimeoutError:
            return True  # nothing can be put in its place either
        except OSError as error:
            return error.errno in BUSY
        return True

    def _probe(self, listener: Listener) -> None:
        """Connect to the address of a listener. Raises OSError where another socket is there, or none."""
        if isinstance(listener.address, Path) and listener.address.stat().st_ino != listener.inode:
            raise FileNotFoundError(f"{listener.address} is another one")
        with socket.socket(socket.AF_UNIX) as probe, sockets.address(listener.address) as target:
            probe.setblocking(False)
            probe.bind("")  # the kernel gives it a name, by which the connection is known
            self._probes.add(probe.getsockname())
            probe.connect(target)


def _listen(place: Place, path: Path) -> Listener:
    """Return a listener in a folder. Raises OSError."""
    place.prepare()
    found = sockets.listen(path)
    found.setblocking(False)
    return Listener(path, found, path.stat().st_ino)


def _inode(path: Path) -> int:
    """Return the inode at a path; 0 where there is none, or its folder hangs."""
    try:
        return within(path.parent, path.stat).st_ino
    except OSError:
        return 0
