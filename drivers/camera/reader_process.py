"""The process that reads a camera for a run; what they tell each other is in ``drivers.camera.reader``.

It ends at once when its standard input does, also while it is stuck in C: none outlives its run.
"""

import mmap
import os
import sys
from collections.abc import Callable, Mapping
from queue import Queue
from threading import Thread
from typing import Any, Protocol

import numpy as np

from drivers.api import Image
from drivers.camera.reader import GRAB, QUIT, RELEASE, START, TAKE
from drivers.camera.source import Kind, kind_of
from drivers.errors import DriverError
from drivers.pictures.decode import UNWANTED
from drivers.transport.pipe import Unframer, frame


class BlockingFeed(Protocol):
    """A source of pictures as ``drivers.pictures.capture.Feed`` has it, that waits as long as it likes."""

    def start(self) -> float | None:
        """Open it; return the seconds between the pictures of a recording, or None for one that is live."""
        ...

    def grab(self, wanted: Callable[[], bool]) -> Image | None:
        """Return the next picture, waiting for it if it is live; None when there is no more."""
        ...

    def stop(self) -> None:
        """Release it. Safe from any state, more than once."""
        ...


def feed_of(order: Mapping[str, Any]) -> BlockingFeed:
    """Return what reads the source of an order."""
    name, source, kind = order["name"], order["source"], kind_of(order["source"])
    if kind in {Kind.FOLDER, Kind.PICTURE}:
        from drivers.camera.reader import FolderFeed  # noqa: PLC0415 - each process has one kind of source

        return FolderFeed(name, source, order["rate"])
    scheme = str(source).partition("://")[0].lower() if kind is Kind.URL else ""
    if scheme in {"http", "https"}:
        from drivers.camera.web import WebFeed  # noqa: PLC0415

        return WebFeed(name, source)
    if scheme == "tcp":
        from drivers.camera.tcp import TcpFeed  # noqa: PLC0415

        return TcpFeed(name, source)
    from drivers.camera.opencv import VideoFeed  # noqa: PLC0415

    return VideoFeed(name, source, order["size"])


class Reader:
    """Does what it is told, command by command."""

    def __init__(self, feed: BlockingFeed, memory: int, out: int, commands: "Queue[int]") -> None:
        self._feed = feed
        self._memory = memory
        self._out = out
        self._commands = commands
        self._map: mmap.mmap | None = None

    def run(self) -> None:
        """Obey until it is told to end."""
        while (command := self._commands.get()) != QUIT:
            try:
                if command == START:
                    self._feed.stop()
                    self._tell(period=self._feed.start())
                elif command == RELEASE:
                    self._feed.stop()
                elif command == GRAB:
                    self._grab()
            except DriverError as error:
                self._tell(error=str(error), hint=error.hint)
        self._feed.stop()

    def _grab(self) -> None:
        image = self._feed.grab(self._wanted)
        if image is None:
            self._tell(end=True)
        elif image is not UNWANTED:
            self._share(image)
            self._tell(shape=image.shape[:2])

    def _wanted(self) -> bool:
        self._tell(came=True)
        return self._commands.get() == TAKE

    def _share(self, image: Image) -> None:
        if self._map is None or len(self._map) < image.nbytes:
            os.ftruncate(self._memory, image.nbytes)
            self._map = mmap.mmap(self._memory, image.nbytes)
        np.copyto(np.frombuffer(self._map, np.uint8, image.nbytes).reshape(image.shape), image)

    def _tell(self, **message: object) -> None:
        os.write(self._out, frame(message))


def main() -> None:
    """Read what the standard input says, and obey, until that ends."""
    out = os.dup(1)
    os.dup2(2, 1)  # what libraries in C print is no reply
    unframer, order = Unframer(), None
    while order is None:
        data = os.read(0, 1)  # up to the end of the line: commands may follow it
        if not data:
            return
        for message, _ in unframer.feed(data):
            order = message
    commands = Queue[int]()
    Thread(target=_listen, args=(commands,), daemon=True).start()
    Reader(feed_of(order), order["memory"], out, commands).run()


def _listen(commands: "Queue[int]") -> None:
    """Pass commands on; the end of the input, and so of the run, ends this process, whatever it does."""
    while data := os.read(0, 64):
        for command in data:
            commands.put(command)
    os._exit(0)


if __name__ == "__main__":
    try:
        main()
    except Exception as error:  # its last words
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)  # a thread is still reading
