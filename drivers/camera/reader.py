"""A feed that is read in a process of its own: that may hang, crash and be killed, and the run goes on.

OpenCV and FFmpeg wait in C, where no thread can be ended: one that is left there as Python ends takes the process down
with SIGABRT or SIGSEGV. So the run waits for a pipe instead, and the pictures come through shared memory.
"""

import mmap
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from select import POLLIN, poll
from threading import Event
from typing import Any

import numpy as np

from drivers.api import Image
from drivers.camera.source import PICTURES, Source, advice, shown
from drivers.clock import SystemClock
from drivers.errors import BadRequest, NotConnected
from drivers.pictures.decode import FFMPEG_LOG_LEVEL, NOTHING, SILENT, UNWANTED, load
from drivers.transport.pipe import Unframer, frame

# The pictures of a folder, or one picture, at a steady rate.


class FolderFeed:
    """The pictures of a folder in the order of their names, or one picture. Files that do not decode are skipped.

    So are those with too many pixels (``decode.MOST_PIXELS``). Where nothing else is there, the first one is told.
    """

    def __init__(self, name: str, path: str | Path, rate: float) -> None:
        self._name = name
        self._path = Path(path)
        self._rate = rate
        self._left: Iterator[Path] = iter(())
        self._shown = False
        self._trouble: BadRequest | None = None

    def start(self) -> float:
        """List the folder anew; return the seconds between pictures. Raises NotConnected when it holds none."""
        if not self._path.exists():
            hint = f"`ls {self._path.parent}` lists what is there"
            raise NotConnected(f"{self._name}: {self._path}: no such file or folder", hint=hint)
        if self._path.is_dir():
            found = sorted(path for path in self._path.iterdir() if path.suffix.lower() in PICTURES)
        else:
            found = [self._path]
        if not found:
            kinds = " ".join(sorted(PICTURES))
            raise NotConnected(f"{self._name}: {self._path}: holds no pictures", hint=f"pictures end in {kinds}")
        self._left, self._shown, self._trouble = iter(found), False, None
        return 1.0 / self._rate

    def grab(self, wanted: Callable[[], bool]) -> Image | None:
        """Return the next picture that decodes, None after the last: see Feed. Raises NotConnected where none does."""
        for path in self._left:
            if not wanted():
                return UNWANTED
            try:
                image = load(path)
            except BadRequest as error:
                self._trouble = self._trouble or error
            else:
                self._shown = True
                return image
        if self._trouble is not None and not self._shown:
            raise NotConnected(f"{self._name}: gives no picture: {self._trouble}", hint=self._trouble.hint)
        return None

    def stop(self) -> None:
        """Forget the list."""
        self._left = iter(())


GLANCE = 0.1
"""Seconds that ``grab`` waits at most."""

OPEN_TIMEOUT = 12.0
"""Seconds that a source has to open, after its own timeouts: the slowest USB cameras take half of that."""

STALL_TIMEOUT = 6.0
"""Seconds without a picture after which a source is closed, and opened again."""

QUIT_TIMEOUT = 0.5
"""Seconds that a reader has to release its source."""

START, GRAB, TAKE, PASS, RELEASE, QUIT = b"sgtpxq"
"""The commands of a reader, a byte each: open the source, wait for the next picture, hand it over or let it go by,
release the source, end."""

_KEPT_COMPLAINT = 4000
"""Bytes that are kept of what a reader writes to its standard error."""


class ReaderProcess:
    """A process that reads a source, and the memory that it shares with us. For one thread. Raises OSError."""

    def __init__(self, order: Mapping[str, Any]) -> None:
        self.complaint = b""
        self._unframer = Unframer()
        self._memory = _shared_memory()
        self._map: mmap.mmap | None = None
        paths = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), "OPENBLAS_NUM_THREADS": "1"}
        if environment.get(FFMPEG_LOG_LEVEL) == SILENT:  # of this process; from the reader it is to be heard
            del environment[FFMPEG_LOG_LEVEL]
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "drivers.camera.reader_process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                pass_fds=(self._memory,),
                env=environment,
                start_new_session=True,  # a Ctrl-C is the run's
            )
        except OSError:
            os.close(self._memory)
            raise
        self._pipes = [pipe for pipe in (self._process.stdin, self._process.stdout, self._process.stderr) if pipe]
        self._ready = poll()
        for pipe in reversed(self._pipes[1:]):  # first what it complains of, then what comes of it
            self._ready.register(pipe, POLLIN)
        self.send(frame({**order, "memory": self._memory}))

    def send(self, data: bytes) -> None:
        """Send commands; a reader that has ended does not mind, for ``reply`` tells."""
        with suppress(BrokenPipeError):
            os.write(self._pipes[0].fileno(), data)

    def reply(self, patience: float) -> Mapping[str, Any] | None:
        """Return the next reply; None if there is none after ``patience`` seconds. Raises EOFError at its end."""
        out, clock = self._pipes[1].fileno(), SystemClock()
        while (left := patience - clock.now()) >= 0:
            for pipe, _ in self._ready.poll(1000 * left):
                data = os.read(pipe, 65536)
                if pipe == out:
                    if not data:
                        raise EOFError
                    for message, _ in self._unframer.feed(data):
                        return message
                elif data:
                    self.complaint = (self.complaint + data)[-_KEPT_COMPLAINT:]
                else:
                    self._ready.unregister(pipe)
        return None

    def picture(self, shape: tuple[int, int]) -> Image:
        """Return a copy of the picture that lies in the shared memory, of so many rows and columns."""
        size = 3 * shape[0] * shape[1]
        if self._map is None or len(self._map) < size:
            self._unmap()
            self._map = mmap.mmap(self._memory, os.fstat(self._memory).st_size)
        return np.frombuffer(self._map, np.uint8, size).reshape(*shape, 3).copy()

    def ending(self) -> str:
        """Return how it ended, in words."""
        with suppress(subprocess.TimeoutExpired):
            code = self._process.wait(QUIT_TIMEOUT)
            return f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"
        return "has closed its pipe"

    def close(self, *, orderly: bool) -> None:
        """End it; an ``orderly`` one, which waits for a command, releases its source before. Never hangs."""
        if orderly:
            self.send(bytes([QUIT]))
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(QUIT_TIMEOUT)
        self._process.kill()
        with suppress(subprocess.TimeoutExpired):  # stuck in a driver of the system: it ends when that does
            self._process.wait(QUIT_TIMEOUT)
        for pipe in self._pipes:
            pipe.close()
        self._unmap()
        os.close(self._memory)

    def _unmap(self) -> None:
        if self._map is not None:
            self._map.close()
            self._map = None


class ReaderFeed:
    """A ``drivers.pictures.capture.Feed`` of any source: of a device, an address, a film, or pictures.

    ``size`` (width, height in pixels) is asked of a device; ``rate`` is that of pictures without a film, a second.
    """

    def __init__(self, name: str, source: Source, size: tuple[int, int] | None = None, rate: float = 5.0) -> None:
        self._name = name
        self._source = source
        self._order = {"name": name, "source": source if isinstance(source, int) else str(source), "size": size,
                       "rate": rate}  # fmt: skip
        self._clock = SystemClock()
        self._process: ReaderProcess | None = None
        self._asked: float | None = None  # when the picture was asked for that has not come
        self._ending = Event()

    @property
    def what(self) -> str:
        """The path, the device, or the address without its password."""
        return shown(self._source)

    @property
    def hint(self) -> str:
        """What to type next when it opens and yet gives no picture."""
        return advice(self._source)

    def start(self, ending: Event) -> float | None:
        """Open the source; return the seconds between the pictures of a recording, None for a live source.

        Raises NotConnected with the reason.
        """
        self._ending = ending
        try:
            process = self._process = self._process or ReaderProcess(self._order)
        except OSError as error:
            raise NotConnected(
                f"{self._name}: {self.what}: no process to read it: {error}", hint="ulimit -u"
            ) from error
        process.complaint = b""
        process.send(bytes([START]))
        self._asked = self._clock.now()
        reply = self._wait(OPEN_TIMEOUT)
        if reply is None:
            trouble = NotConnected(
                f"{self._name}: {self.what}: does not open within {OPEN_TIMEOUT:g} s", hint=self.hint
            )
            raise self._with_cause(trouble, process)
        self._asked = None
        if "error" in reply:
            raise self._with_cause(NotConnected(reply["error"], hint=reply["hint"]), process)
        period: float | None = reply["period"]
        return period

    def grab(self, wanted: Callable[[], bool]) -> Image | None:
        """Return the next picture, NOTHING if none comes for a moment, None when there is no more: see Feed."""
        process = self._process
        if process is None:
            return None
        if self._asked is None:
            process.send(bytes([GRAB]))
            self._asked = self._clock.now()
        reply = self._reply(process, GLANCE)
        if reply is None:
            return NOTHING if self._clock.now() - self._asked < STALL_TIMEOUT else None
        if "came" in reply:
            if not wanted():
                process.send(bytes([PASS]))
                self._asked = None
                return UNWANTED
            process.send(bytes([TAKE]))
            return NOTHING  # it is being decoded
        self._asked = None
        if "error" in reply:
            raise NotConnected(reply["error"], hint=reply["hint"])
        return process.picture(reply["shape"]) if "shape" in reply else None

    def stop(self) -> None:
        """Release the source. Safe from any state, more than once."""
        process = self._process
        if process is None:
            return
        if self._ending.is_set() or self._asked is not None:
            self._process = None
            process.close(orderly=self._asked is None)
        else:  # it is quicker to go on with the same process
            process.send(bytes([RELEASE]))
        self._asked = None

    def _with_cause(self, trouble: NotConnected, process: ReaderProcess) -> NotConnected:
        from drivers.camera.causes import with_cause  # noqa: PLC0415 - it imports ssl and http, for failures alone

        return with_cause(trouble, process.complaint, self._source)

    def _wait(self, seconds: float) -> Mapping[str, Any] | None:
        """Return the next reply; None if there is none in time, or when the camera is closed meanwhile."""
        begin = self._clock.now()
        while self._process is not None and not self._ending.is_set() and self._clock.now() - begin < seconds:
            reply = self._reply(self._process, GLANCE)
            if reply is not None:
                return reply
        return None

    def _reply(self, process: ReaderProcess, patience: float) -> Mapping[str, Any] | None:
        try:
            return process.reply(patience)
        except (EOFError, ValueError) as error:
            how = process.ending()
            self._process = None
            process.close(orderly=False)
            what = f"{self._name}: {self.what}: the process that reads it {how}"
            raise NotConnected(what, hint=self.hint) from error


def _shared_memory() -> int:
    """Return a file in memory, or a nameless one where the system has no such thing."""
    with suppress(OSError, AttributeError):
        return os.memfd_create("camera")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())
