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
from missions.library.private_files import EarlierFile, open_for_owner
from missions.plugins.records.recording.items import BATCH_HEADER, EVENT_TOPICS, LossItem, unpack_items
from missions.plugins.records.recording.record_header import RecordContents
from missions.plugins.records.recording.writer import ChunkSink, RecordWriter, WriteResult

FLUSH_INTERVAL = 0.6
"""Seconds after which a chunk is written, at the latest, and waited for until the disk has it."""

URGENT_FLUSH_INTERVAL = 0.3
"""The same of one in which something is that is told seldom, so that it outlives a power cut half a second later."""

URGENT_EVENTS = frozenset(EVENT_TOPICS) - {"CommandSent"}
"""What is told seldom, by the names of classes."""

RETRY_INTERVAL = 2.0
"""Seconds to the next try, after a chunk that could not be written."""

POLL_INTERVAL = 1.0
"""Seconds from one look to the next whether the run has ended whose record was closed at its limit."""

NICENESS = 5
"""How far it stands back behind the run."""

UNREADABLE_TOPIC = "(unread)"
"""Under which name a batch is counted of which nobody can tell what was in it."""

REPORTED_PACKAGES = ("missiontree", "py-trees", "opencv-python-headless", "numpy", "mcap")
"""The versions that may make a difference."""

_READ_BYTES = 1 << 18


class BatchReader:
    """Takes batches out of a pipe."""

    def __init__(self, number: int) -> None:
        self.is_open = True
        self._number = number
        self._data = bytearray()

    def batches(self, timeout: float) -> Iterator[bytes]:
        """Wait up to ``timeout`` seconds for what comes; yield the batches that are complete."""
        if self.is_open and select.select([self._number], [], [], timeout)[0]:
            block = os.read(self._number, _READ_BYTES)
            self.is_open = bool(block)
            self._data += block
        while len(self._data) >= BATCH_HEADER.size:
            end = BATCH_HEADER.size + BATCH_HEADER.unpack_from(self._data)[0]
            if len(self._data) < end:
                return
            batch = bytes(self._data[BATCH_HEADER.size : end])
            del self._data[:end]
            yield batch


class WriterProcess:
    """Writes what comes through ``inlet`` to the record at ``path``."""

    def __init__(self, path: Path, reader: BatchReader, clock: Clock, *, limit: float, overwrite: bool) -> None:
        self._path = path
        self._reader = reader
        self._clock = clock
        self._limit = limit
        self._overwrite = overwrite
        self._reported_losses = 0

    def run(self) -> None:
        """Write the record from beginning to end."""
        waiting = deque[bytes]()
        while not waiting and self._reader.is_open:
            waiting += self._reader.batches(FLUSH_INTERVAL)
        if not waiting:
            return
        earlier = self._set_earlier_aside()
        with open(self._path, "xb", buffering=0, opener=open_for_owner) as file:
            _lock(file)  # whoever mends records keeps away
            writer = RecordWriter(ChunkSink(file.fileno()), _unpack_contents(waiting.popleft()), limit=self._limit)
            try:
                writer.begin()
            except OSError:
                self._path.unlink()  # else it would be in the way of the next try
                if earlier is not None:
                    earlier.restore()
                raise
            send_status(ready=True)
            written = self._write(writer, waiting)
        if not written.whole:
            self._repair()
        if earlier is not None:
            earlier.remove() if written.whole else self._restore_earlier(earlier)
        send_status(closed=asdict(written))
        while self._reader.is_open:  # it was closed at its limit
            for _ in self._reader.batches(POLL_INTERVAL):
                pass

    def _write(self, writer: RecordWriter, waiting: deque[bytes]) -> WriteResult:
        """Write what waits and what comes, until there is no more, or no more room."""
        flush_at = self._clock.now()
        while (self._reader.is_open or waiting) and writer.limit_reached_at is None:
            told = [_write_batch(writer, batch) for batch in waiting]
            waiting.clear()
            now = self._clock.now()
            if any(told) and not writer.is_failing:
                flush_at = min(flush_at, now + URGENT_FLUSH_INTERVAL)
            if now >= flush_at:
                writer.flush()
                writer.sync()
                flush_at = now + (RETRY_INTERVAL if writer.is_failing else FLUSH_INTERVAL)
                self._report_losses(writer)
            waiting += self._reader.batches(max(0.0, flush_at - self._clock.now()))
        written = writer.close()
        writer.sync()  # what is told to be closed outlives a power cut
        self._report_losses(writer)
        return written

    def _report_losses(self, writer: RecordWriter) -> None:
        """Tell of what was lost since the last time."""
        lost = writer.lost.total()
        if lost != self._reported_losses:
            send_status(lost=dict(writer.lost), why=writer.loss_reason)
        self._reported_losses = lost

    def _set_earlier_aside(self) -> EarlierFile | None:
        """Set the record aside that is to be overwritten, unless another run is writing it. Raises OSError."""
        if not self._overwrite or not self._path.exists():
            return None
        with self._path.open("ab", buffering=0) as file:
            _lock(file)
            return EarlierFile(self._path)

    def _repair(self) -> None:
        """Give the record the index that it lacks; where the disk has no room for that, the user can do it later."""
        from missions.plugins.records.recording.repair import RepairError, repair_record  # noqa: PLC0415 - rarely needed

        try:
            repair_record(self._path)
        except (OSError, RepairError) as error:
            why = (error.strerror if isinstance(error, OSError) else None) or str(error)
            send_status(trouble=f"the record could not be closed: {why}")

    def _restore_earlier(self, earlier: EarlierFile) -> None:
        """Give the earlier record its name back: of the new one, the disk has lost a part."""
        with suppress(OSError):
            renamed = earlier.restore()
            if renamed is not None:
                send_status(renamed=renamed.name)
                send_status(
                    trouble=f"{self._path.name} is the earlier record, {renamed.name} what was written of the new one"
                )


def _lock(file: FileIO) -> None:
    """Keep others from writing or mending a record. Raises OSError where another run writes it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OSError(error.errno, "another run is writing it just now") from error


def _unpack_contents(batch: bytes) -> RecordContents:
    (contents,) = unpack_items(batch)
    if not isinstance(contents, RecordContents):
        raise TypeError(f"a record begins with its contents, not with {type(contents).__name__}")
    head = contents.header
    return replace(contents, header=replace(head, versions=head.versions or installed_versions()))


def installed_versions() -> dict[str, str]:
    """Return with what a run was made: found out here, where it holds up no start."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for package in REPORTED_PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # as missiontree itself is, run from a checkout
            continue
    return found


def _write_batch(writer: RecordWriter, batch: bytes) -> bool:
    """Write the items of a batch; one that cannot be written costs itself alone. Say whether one is told seldom."""
    try:
        items = unpack_items(batch)
    except (pickle.UnpicklingError, AttributeError, ImportError, LookupError, TypeError, ValueError) as error:
        writer.add(LossItem({UNREADABLE_TOPIC: 1}, f"a batch could not be read: {error}"))
        return True
    for item in items:
        try:
            writer.add(item)
        except (ArithmeticError, LookupError, TypeError, ValueError, RecursionError) as error:
            writer.reject(item, str(error))
    return any(type(item).__name__ in URGENT_EVENTS for item in items)


def send_status(**what: Any) -> None:
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
    os.nice(NICENESS)
    path, limit, overwrite = sys.argv[1:]
    keeper = WriterProcess(
        Path(path),
        BatchReader(sys.stdin.fileno()),
        SystemClock(),
        limit=float(limit),
        overwrite=overwrite == "overwrite",
    )
    try:
        keeper.run()
    except OSError as error:
        send_status(failed=error.strerror or str(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
