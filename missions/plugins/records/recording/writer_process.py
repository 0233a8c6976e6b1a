"""The process that writes the record of a run, so that neither JSON nor the disk delays a tick.

It reads batches of items from stdin, each after its length; the first one holds the contents. It writes status lines of
JSON to stdout: ``ready`` or ``failed``, ``lost`` after each loss, ``closed`` at the end or at the size limit, and
``renamed`` if an earlier record keeps its name. It ends with stdin, so a killed run leaves a closed record.
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
"""Maximum seconds until a chunk is written and synced to the disk."""

URGENT_FLUSH_INTERVAL = 0.3
"""Maximum seconds until a chunk with an urgent event is written, instead of ``FLUSH_INTERVAL``.

So the event survives a power cut that happens half a second after it.
"""

URGENT_EVENTS = frozenset(EVENT_TOPICS) - {"CommandSent"}
"""Class names of rare events that are written to the disk early."""

RETRY_INTERVAL = 2.0
"""Seconds between two attempts to write a chunk after a failure."""

POLL_INTERVAL = 1.0
"""Seconds between two checks for the end of the run, once the record reached its size limit."""

NICENESS = 5
"""Niceness of the writer process relative to the run's process."""

UNREADABLE_TOPIC = "(unread)"
"""Topic under which the items of a batch are counted as lost if the batch cannot be decoded."""

REPORTED_PACKAGES = ("missiontree", "py-trees", "opencv-python-headless", "numpy", "mcap")
"""Packages whose versions are stored in the record."""

_READ_BYTES = 1 << 18


class BatchReader:
    """Reads batches of items from a pipe; each batch has its length in front."""

    def __init__(self, number: int) -> None:
        self.is_open = True
        self._number = number
        self._data = bytearray()

    def batches(self, timeout: float) -> Iterator[bytes]:
        """Wait up to ``timeout`` seconds for data, read it, and yield each batch that has arrived completely."""
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
    """Writes the record at ``path`` from the batches of items that ``reader`` yields."""

    def __init__(self, path: Path, reader: BatchReader, clock: Clock, *, limit: float, overwrite: bool) -> None:
        self._path = path
        self._reader = reader
        self._clock = clock
        self._limit = limit
        self._overwrite = overwrite
        self._reported_losses = 0

    def run(self) -> None:
        """Write the record from beginning to end of the run."""
        waiting = deque[bytes]()
        while not waiting and self._reader.is_open:
            waiting += self._reader.batches(FLUSH_INTERVAL)
        if not waiting:
            return
        earlier = self._set_earlier_aside()
        with open(self._path, "xb", buffering=0, opener=open_for_owner) as file:
            _lock(file)  # keeps repairs away
            writer = RecordWriter(ChunkSink(file.fileno()), _unpack_contents(waiting.popleft()), limit=self._limit)
            try:
                writer.begin()
            except OSError:
                self._path.unlink()  # otherwise the next attempt would find an existing file
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
        while self._reader.is_open:  # the size limit was reached: discard further items
            for _ in self._reader.batches(POLL_INTERVAL):
                pass

    def _write(self, writer: RecordWriter, waiting: deque[bytes]) -> WriteResult:
        """Write the batches in ``waiting`` and all later ones, until the input ends or the size limit is reached.

        Return the result after closing the record.
        """
        flush_at = self._clock.now()
        while (self._reader.is_open or waiting) and writer.limit_reached_at is None:
            urgent = [_write_batch(writer, batch) for batch in waiting]
            waiting.clear()
            now = self._clock.now()
            if any(urgent) and not writer.is_failing:
                flush_at = min(flush_at, now + URGENT_FLUSH_INTERVAL)
            if now >= flush_at:
                writer.flush()
                writer.sync()
                flush_at = now + (RETRY_INTERVAL if writer.is_failing else FLUSH_INTERVAL)
                self._report_losses(writer)
            waiting += self._reader.batches(max(0.0, flush_at - self._clock.now()))
        written = writer.close()
        writer.sync()  # "closed" promises that the record survives a power cut
        self._report_losses(writer)
        return written

    def _report_losses(self, writer: RecordWriter) -> None:
        """Send the run the counts of messages lost since the last call."""
        lost = writer.lost.total()
        if lost != self._reported_losses:
            send_status(lost=dict(writer.lost), why=writer.loss_reason)
        self._reported_losses = lost

    def _set_earlier_aside(self) -> EarlierFile | None:
        """Rename an existing record at the requested path, which the new one replaces; return None without one.

        Raises OSError if another run is writing it.
        """
        if not self._overwrite or not self._path.exists():
            return None
        with self._path.open("ab", buffering=0) as file:
            _lock(file)
            return EarlierFile(self._path)

    def _repair(self) -> None:
        """Repair the record by writing its missing index; if the disk is full, the user can repair it later."""
        from missions.plugins.records.recording.repair import RepairError, repair_record  # noqa: PLC0415 - rarely needed

        try:
            repair_record(self._path)
        except (OSError, RepairError) as error:
            why = (error.strerror if isinstance(error, OSError) else None) or str(error)
            send_status(trouble=f"the record could not be closed: {why}")

    def _restore_earlier(self, earlier: EarlierFile) -> None:
        """Give the earlier record its name back, since the new one is incomplete.

        The run is sent the name of the new one.
        """
        with suppress(OSError):
            renamed = earlier.restore()
            if renamed is not None:
                send_status(renamed=renamed.name)
                send_status(trouble=f"{self._path.name} is the earlier record, {renamed.name} the incomplete new one")


def _lock(file: FileIO) -> None:
    """Lock a record against other writers and repairs. Raises OSError if another run writes it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OSError(error.errno, "another run is writing it") from error


def _unpack_contents(batch: bytes) -> RecordContents:
    (contents,) = unpack_items(batch)
    if not isinstance(contents, RecordContents):
        raise TypeError(f"a record begins with its contents, not with {type(contents).__name__}")
    head = contents.header
    return replace(contents, header=replace(head, versions=head.versions or installed_versions()))


def installed_versions() -> dict[str, str]:
    """Return the versions of Python, the platform and ``REPORTED_PACKAGES``; slow, so the run does not do it."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for package in REPORTED_PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # such as missiontree, run from a checkout
            continue
    return found


def _write_batch(writer: RecordWriter, batch: bytes) -> bool:
    """Write the items of a batch, and count those that fail as lost; return whether an urgent event is among them."""
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
    """Send a JSON status line with the given keys to the run; ignored if the run has closed the pipe."""
    try:
        os.write(sys.stdout.fileno(), json.dumps(what).encode() + b"\n")
    except OSError:
        return


def main() -> int:
    """Write a record for the parent process; return the exit code."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the run handles signals; this process ends with its stdin
    os.set_blocking(sys.stdout.fileno(), False)  # never block on a run that does not read
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
