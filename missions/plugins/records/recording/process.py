"""The process that writes the record of a run, so that neither JSON nor a disk ever holds up a tick.

It gets batches of items on stdin, each behind its length, the first of which holds the contents; and tells on stdout, a
line of JSON each, what becomes of them: ``ready`` or ``failed``, ``lost`` each time that something was, ``closed`` in
the end, or at the limit; ``renamed`` where an earlier record keeps its name. The end of stdin ends it, so that a run
that is killed leaves a record that is closed.
"""

import fcntl
import json
import os
import pickle
import platform
import select
import signal
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from importlib.metadata import PackageNotFoundError, version
from io import FileIO
from pathlib import Path
from typing import Any

from drivers.clock import Clock, SystemClock
from missions.library.private_files import EarlierFile, private
from missions.plugins.records.recording.head import Contents
from missions.plugins.records.recording.items import EVENTS, HEADER, Missed, unpacked
from missions.plugins.records.recording.writer import RecordWriter, Sink, Written

FLUSH = 0.6
"""Seconds after which a chunk is written, at the latest, and waited for until the disk has it."""

SOON = 0.3
"""The same of one in which something is that is told seldom, so that it outlives a power cut half a second later."""

SELDOM = frozenset(EVENTS) - {"CommandSent"}
"""What is told seldom, by the names of classes."""

RETRY = 2.0
"""Seconds to the next try, after a chunk that could not be written."""

GLANCE = 1.0
"""Seconds from one look to the next whether the run has ended whose record was closed at its limit."""

NICE = 5
"""How far it stands back behind the run."""

UNREAD = "(unread)"
"""Under which name a batch is counted of which nobody can tell what was in it."""

PACKAGES = ("missiontree", "py-trees", "opencv-python-headless", "numpy", "mcap")
"""The versions that may make a difference."""

_BLOCK = 1 << 18


class Inlet:
    """Takes batches out of a pipe."""

    def __init__(self, number: int) -> None:
        self.open = True
        self._number = number
        self._data = bytearray()

    def batches(self, timeout: float) -> Iterator[bytes]:
        """Wait up to ``timeout`` seconds for what comes; yield the batches that are complete."""
        if self.open and select.select([self._number], [], [], timeout)[0]:
            block = os.read(self._number, _BLOCK)
            self.open = bool(block)
            self._data += block
        while len(self._data) >= HEADER.size:
            end = HEADER.size + HEADER.unpack_from(self._data)[0]
            if len(self._data) < end:
                return
            batch = bytes(self._data[HEADER.size : end])
            del self._data[:end]
            yield batch


class Keeper:
    """Writes what comes through ``inlet`` to the record at ``path``."""

    def __init__(self, path: Path, inlet: Inlet, clock: Clock, *, limit: float, overwrite: bool) -> None:
        self._path = path
        self._inlet = inlet
        self._clock = clock
        self._limit = limit
        self._overwrite = overwrite
        self._lost = 0

    def run(self) -> None:
        """Write the record from beginning to end."""
        waiting = deque[bytes]()
        while not waiting and self._inlet.open:
            waiting += self._inlet.batches(FLUSH)
        if not waiting:
            return
        earlier = self._earlier()
        with open(self._path, "xb", buffering=0, opener=private) as file:
            _lock(file)  # whoever mends records keeps away
            writer = RecordWriter(Sink(file.fileno()), _contents(waiting.popleft()), limit=self._limit)
            try:
                writer.begin()
            except OSError:
                self._path.unlink()  # else it would be in the way of the next try
                if earlier is not None:
                    earlier.restore()
                raise
            tell(ready=True)
            written = self._write(writer, waiting)
        if not written.whole:
            self._mend()
        if earlier is not None:
            earlier.remove() if written.whole else self._keep_earlier(earlier)
        tell(closed=asdict(written))
        while self._inlet.open:  # it was closed at its limit
            for _ in self._inlet.batches(GLANCE):
                pass

    def _write(self, writer: RecordWriter, waiting: deque[bytes]) -> Written:
        """Write what waits and what comes, until there is no more, or no more room."""
        flush_at = self._clock.now()
        while (self._inlet.open or waiting) and writer.ended is None:
            told = [_take(writer, batch) for batch in waiting]
            waiting.clear()
            now = self._clock.now()
            if any(told) and not writer.failing:
                flush_at = min(flush_at, now + SOON)
            if now >= flush_at:
                writer.flush()
                writer.sync()
                flush_at = now + (RETRY if writer.failing else FLUSH)
                self._notice(writer)
            waiting += self._inlet.batches(max(0.0, flush_at - self._clock.now()))
        written = writer.close()
        writer.sync()  # what is told to be closed outlives a power cut
        self._notice(writer)
        return written

    def _notice(self, writer: RecordWriter) -> None:
        """Tell of what was lost since the last time."""
        lost = writer.lost.total()
        if lost != self._lost:
            tell(lost=dict(writer.lost), why=writer.why)
        self._lost = lost

    def _earlier(self) -> EarlierFile | None:
        """Set the record aside that is to be overwritten, unless another run is writing it. Raises OSError."""
        if not self._overwrite or not self._path.exists():
            return None
        with self._path.open("ab", buffering=0) as file:
            _lock(file)
            return EarlierFile(self._path)

    def _mend(self) -> None:
        """Give the record the index that it lacks; where the disk has no room for that, the user can do it later."""
        from missions.plugins.records.recording.mend import NotMendedError, mend  # noqa: PLC0415 - rarely needed

        try:
            mend(self._path)
        except (OSError, NotMendedError) as error:
            why = (error.strerror if isinstance(error, OSError) else None) or str(error)
            tell(trouble=f"the record could not be closed: {why}")

    def _keep_earlier(self, earlier: EarlierFile) -> None:
        """Give the earlier record its name back: of the new one, the disk has lost a part."""
        with suppress(OSError):
            renamed = earlier.restore()
            if renamed is not None:
                tell(renamed=renamed.name)
                tell(trouble=f"{self._path.name} is the earlier record, {renamed.name} what was written of the new one")


def _lock(file: FileIO) -> None:
    """Keep others from writing or mending a record. Raises OSError where another run writes it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OSError(error.errno, "another run is writing it just now") from error


def _contents(batch: bytes) -> Contents:
    (contents,) = unpacked(batch)
    if not isinstance(contents, Contents):
        raise TypeError(f"a record begins with its contents, not with {type(contents).__name__}")
    head = contents.head
    return replace(contents, head=replace(head, versions=head.versions or versions()))


def versions() -> dict[str, str]:
    """Return with what a run was made: found out here, where it holds up no start."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # as missiontree itself is, run from a checkout
            continue
    return found


def _take(writer: RecordWriter, batch: bytes) -> bool:
    """Write the items of a batch; one that cannot be written costs itself alone. Say whether one is told seldom."""
    try:
        items = unpacked(batch)
    except (pickle.UnpicklingError, AttributeError, ImportError, LookupError, TypeError, ValueError) as error:
        writer.add(Missed({UNREAD: 1}, f"a batch could not be read: {error}"))
        return True
    for item in items:
        try:
            writer.add(item)
        except (ArithmeticError, LookupError, TypeError, ValueError, RecursionError) as error:
            writer.refuse(item, str(error))
    return any(type(item).__name__ in SELDOM for item in items)


def tell(**what: Any) -> None:
    """Tell the run something, unless there is nobody any more to hear it."""
    try:
        os.write(sys.stdout.fileno(), json.dumps(what).encode() + b"\n")
    except OSError:
        return


def main() -> int:
    """Write a record for the process that has started this one."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the run hears them, ends, and so ends this
    os.set_blocking(sys.stdout.fileno(), False)  # a run that does not listen is not waited for
    os.nice(NICE)
    path, limit, overwrite = sys.argv[1:]
    keeper = Keeper(
        Path(path), Inlet(sys.stdin.fileno()), SystemClock(), limit=float(limit), overwrite=overwrite == "overwrite"
    )
    try:
        keeper.run()
    except OSError as error:
        tell(failed=error.strerror or str(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
