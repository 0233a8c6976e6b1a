"""Process that reads a camera source for a run; the module ``drivers.camera.reader`` describes its protocol.

The process exits as soon as its standard input ends, even while a library blocks, so it never outlives its run.
"""

import gc
import mmap
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, Protocol

import numpy as np

from drivers.api import Image
from drivers.camera.reader import GRAB, NUMBER, QUIT, RELEASE, SKIP_TO, START
from drivers.camera.source import PICTURES, SourceKind, source_kind
from drivers.errors import BadRequest, DriverError, NotConnected
from drivers.pictures.decode import SKIPPED_PICTURE, load_picture
from drivers.transport.worker_process import MessageParser, pack_message

REPORT_INTERVAL = 0.5
"""Seconds between two reports of skipped pictures of a live source."""


class BlockingFeed(Protocol):
    """Source of pictures for the reader process. Its methods may block without a time limit."""

    def start(self) -> float | None:
        """Open the source; return the seconds between the pictures of a recording, or None for a live source."""
        ...

    def grab(self, is_needed: Callable[[], bool]) -> Image | None:
        """Return the next picture; ``SKIPPED_PICTURE``, not decoded, if ``is_needed()`` is False; None at the end."""
        ...

    def stop(self) -> None:
        """Release the source. Safe from any state, more than once."""
        ...


def make_feed(request: Mapping[str, Any]) -> BlockingFeed:
    """Return the feed for a request with the keys ``name``, ``source``, ``size`` and ``rate``."""
    name, source, kind = request["name"], request["source"], source_kind(request["source"])
    if kind in {SourceKind.FOLDER, SourceKind.PICTURE}:
        return FolderFeed(name, source, request["rate"])
    scheme = str(source).partition("://")[0].lower() if kind is SourceKind.URL else ""
    if scheme in {"http", "https"}:
        from drivers.camera.web import WebFeed  # noqa: PLC0415 - each process has one kind of source

        return WebFeed(name, source)
    if scheme == "tcp":
        from drivers.camera.jpegs import TcpFeed  # noqa: PLC0415

        return TcpFeed(name, source)
    from drivers.camera.opencv import VideoFeed  # noqa: PLC0415

    return VideoFeed(name, source, request["size"])


class FolderFeed:
    """Pictures of a folder in the order of their names, or one picture.

    Files that cannot be decoded or have more than ``decode.MAX_PIXELS`` pixels are skipped. If no file can be decoded,
    the first error is raised.
    """

    def __init__(self, name: str, path: str | Path, rate: float) -> None:
        self._name = name
        self._path = Path(path)
        self._rate = rate
        self._remaining: Iterator[Path] = iter(())
        self._has_decoded = False
        self._first_error: BadRequest | None = None

    def start(self) -> float:
        """List the folder; return the seconds between pictures. Raises NotConnected if there are none."""
        if not self._path.exists():
            hint = f"`ls {self._path.parent}` lists what is there"
            raise NotConnected(f"{self._name}: {self._path}: no such file or folder", hint=hint)
        if self._path.is_dir():
            found = sorted(path for path in self._path.iterdir() if path.suffix.lower() in PICTURES)
        else:
            found = [self._path]
        if not found:
            kinds = " ".join(sorted(PICTURES))
            raise NotConnected(f"{self._name}: {self._path}: contains no pictures", hint=f"pictures end in {kinds}")
        self._remaining, self._has_decoded, self._first_error = iter(found), False, None
        return 1.0 / self._rate

    def grab(self, is_needed: Callable[[], bool]) -> Image | None:
        """Return the next decodable picture, None after the last. Raises NotConnected if there is none."""
        for path in self._remaining:
            if not is_needed():
                return SKIPPED_PICTURE
            try:
                image = load_picture(path)
            except BadRequest as error:
                self._first_error = self._first_error or error
            else:
                self._has_decoded = True
                return image
        if self._first_error is not None and not self._has_decoded:
            raise NotConnected(
                f"{self._name}: no picture can be decoded: {self._first_error}", hint=self._first_error.hint
            )
        return None

    def stop(self) -> None:
        self._remaining = iter(())


class SourceReader:
    """Reads a source in the reader process: executes the queued ``commands``, and skips unneeded pictures.

    ``first_needed`` is the number of the first picture that the run needs. Another thread sets both. ``memory`` and
    ``out`` are the file descriptors of the shared memory and of the replies.
    """

    def __init__(self, memory: int, out: int) -> None:
        self.commands = SimpleQueue[int]()
        self.first_needed = 0  # the number of the first picture that is needed, counted from the start
        self._memory = memory
        self._out = out
        self._map: mmap.mmap | None = None
        self._count = 0
        self._is_live = True

    def run(self, feed: BlockingFeed) -> None:
        """Execute the queued commands on ``feed`` until the command QUIT."""
        while (command := self.commands.get()) != QUIT:
            try:
                if command == START:
                    feed.stop()
                    self._count = 0
                    period = feed.start()
                    self._is_live = period is None
                    self._send(period=period)
                elif command == RELEASE:
                    feed.stop()
                elif command == GRAB:
                    self._grab(feed)
            except DriverError as error:
                self._send(error=str(error), hint=error.hint)
        feed.stop()

    def _grab(self, feed: BlockingFeed) -> None:
        """Write the next needed picture to the shared memory; send its size and the number of skipped pictures.

        If a live source is skipped for ``REPORT_INTERVAL``, that is reported without a picture. Each skipped picture of
        a recording is reported at once, since the run decides when the next one is due.
        """
        before, report_at = self._count, time.monotonic() + (REPORT_INTERVAL if self._is_live else 0.0)
        while (image := feed.grab(self._is_needed)) is SKIPPED_PICTURE:
            self._count += 1
            if time.monotonic() >= report_at:
                break
        gone_by, shape = self._count - before, None
        if image is not None and image is not SKIPPED_PICTURE:
            self._count += 1
            self._write_to_memory(image)
            shape = image.shape[:2]
        self._send(gone_by=gone_by, shape=shape, ended=image is None)

    def _is_needed(self) -> bool:
        return self._count >= self.first_needed

    def _write_to_memory(self, image: Image) -> None:
        if self._map is None or len(self._map) < image.nbytes:
            os.ftruncate(self._memory, image.nbytes)
            self._map = mmap.mmap(self._memory, image.nbytes)
        np.copyto(np.frombuffer(self._map, np.uint8, image.nbytes).reshape(image.shape), image)

    def _send(self, **message: object) -> None:
        os.write(self._out, pack_message(message))


def main() -> None:
    """Execute the commands from standard input until it ends."""
    out = os.dup(1)
    os.dup2(2, 1)  # output of C libraries must not be taken for a reply
    unframer, order = MessageParser(), None
    while order is None:
        data = os.read(0, 1)  # up to the end of the line: commands may follow it
        if not data:
            return
        for message, _ in unframer.feed(data):
            order = message
    reader = SourceReader(order["memory"], out)
    Thread(target=_read_commands, args=(reader,), daemon=True).start()
    gc.disable()  # while modules are imported, which stay
    feed = make_feed(order)
    gc.freeze()
    gc.enable()
    reader.run(feed)


def _read_commands(reader: SourceReader) -> None:
    """Pass the commands from standard input to ``reader``; exit this process when standard input ends."""
    data = b""
    while more := os.read(0, 64):
        data += more
        while data and (data[0] != SKIP_TO or len(data) > NUMBER.size):
            if data[0] == SKIP_TO:
                (reader.first_needed,) = NUMBER.unpack_from(data, 1)
            else:
                reader.commands.put(data[0])
            data = data[1 + NUMBER.size if data[0] == SKIP_TO else 1 :]
    os._exit(0)


if __name__ == "__main__":
    try:
        main()
    except Exception as error:  # its last words
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)  # a thread is still reading
