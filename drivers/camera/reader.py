"""Camera source that is read in a process of its own, which may hang, crash or be killed without ending the run.

OpenCV and FFmpeg block in C, where a thread cannot be ended. A thread that is still there when Python ends crashes the
process with SIGABRT or SIGSEGV. So the run waits for a pipe instead, and pictures arrive through shared memory.
"""

import mmap
import os
import signal
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from select import POLLIN, poll
from struct import Struct
from threading import Event, Lock
from typing import Any

import numpy as np

from drivers.api import Image
from drivers.camera.source import Source, display_name, source_hint
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.pictures.decode import FFMPEG_LOG_LEVEL, FFMPEG_SILENT, NO_PICTURE, SKIPPED_PICTURE
from drivers.transport.worker_process import MessageParser, pack_message

GRAB_TIMEOUT = 0.2
"""Seconds that ``ReaderFeed.grab`` waits for a picture."""

OPEN_TIMEOUT = 12.0
"""Seconds within which a source must open; the slowest USB cameras need half of it."""

STALL_TIMEOUT = 6.0
"""Seconds without a picture after which a stale source is closed and reopened."""

QUIT_TIMEOUT = 0.5
"""Seconds to wait until a reader process exits: first after the command to quit, then again after it was killed."""

START, GRAB, SKIP_TO, RELEASE, QUIT = b"sgfxq"
"""Commands of a reader, one byte each: open the source, return a picture, skip, release the source, quit.

``SKIP_TO`` is followed by the number of the first picture that is needed, counted from the start.
"""

NUMBER = Struct(">I")

_MAX_NUMBER = 2**32 - 1

_MAX_ERROR_OUTPUT = 4000
"""Bytes of a reader's standard error that are kept."""


class ReaderProcess:
    """Process that reads a source, with its shared memory. For one thread. Raises OSError if it cannot be started."""

    def __init__(self, request: Mapping[str, Any]) -> None:
        self.error_output = b""
        self._unframer = MessageParser()
        self._memory = _create_shared_memory()
        self._map: mmap.mmap | None = None
        paths = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), "OPENBLAS_NUM_THREADS": "1"}
        if (
            environment.get(FFMPEG_LOG_LEVEL) == FFMPEG_SILENT
        ):  # silences this process only: the reader's log is needed for the cause
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
                start_new_session=True,  # Ctrl-C is for the run only
            )
        except OSError:
            os.close(self._memory)
            raise
        self._pipes = [pipe for pipe in (self._process.stdin, self._process.stdout, self._process.stderr) if pipe]
        self._poll = poll()
        for pipe in reversed(self._pipes[1:]):  # error output first, so that it is complete when the reply arrives
            self._poll.register(pipe, POLLIN)
        self.send(pack_message({**request, "memory": self._memory}))

    def send(self, data: bytes) -> None:
        """Send commands. Ignores a process that has ended: ``next_reply`` reports that."""
        with suppress(BrokenPipeError):
            os.write(self._pipes[0].fileno(), data)

    def next_reply(self, timeout: float) -> Mapping[str, Any] | None:
        """Return the next reply; None after ``timeout`` seconds. Raises EOFError when the process has ended."""
        out, clock = self._pipes[1].fileno(), SystemClock()
        while (left := timeout - clock.now()) >= 0:
            for pipe, _ in self._poll.poll(1000 * left):
                data = os.read(pipe, 65536)
                if pipe == out:
                    if not data:
                        raise EOFError
                    for message, _ in self._unframer.feed(data):
                        return message
                elif data:
                    self.error_output = (self.error_output + data)[-_MAX_ERROR_OUTPUT:]
                else:
                    self._poll.unregister(pipe)
        return None

    def copy_picture(self, shape: tuple[int, int]) -> Image:
        """Return a copy of the picture in the shared memory, which has ``shape`` (rows, columns)."""
        size = 3 * shape[0] * shape[1]
        if self._map is None or len(self._map) < size:
            self._unmap()
            self._map = mmap.mmap(self._memory, os.fstat(self._memory).st_size)
        return np.frombuffer(self._map, np.uint8, size).reshape(*shape, 3).copy()

    def exit_reason(self) -> str:
        """Return how the process ended, as text."""
        with suppress(subprocess.TimeoutExpired):
            code = self._process.wait(QUIT_TIMEOUT)
            return f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"
        return "has closed its pipe"

    def close(self, *, orderly: bool) -> None:
        """End the process and free its memory; never hangs. If ``orderly``, it may release its source first."""
        if orderly:
            self.send(bytes([QUIT]))
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(QUIT_TIMEOUT)
        self._process.kill()
        with suppress(subprocess.TimeoutExpired):  # blocked in a kernel driver: it ends when the driver returns
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
    """A ``drivers.pictures.capture.CameraFeed`` of any source, read by a ``ReaderProcess``.

    ``name`` is the part in error messages. ``size`` (width, height in pixels) is requested from a device. ``rate`` is
    the number of pictures per second of a folder of pictures.
    """

    def __init__(self, name: str, source: Source, size: tuple[int, int] | None = None, rate: float = 5.0) -> None:
        self._name = name
        self._source = source
        self._request = {"name": name, "source": source if isinstance(source, int) else str(source), "size": size,
                       "rate": rate}  # fmt: skip
        self._clock = SystemClock()
        self._process: ReaderProcess | None = None
        self._lock = Lock()  # guards the process: it must not be closed while another thread sends to it
        self._pending_since: float | None = None  # time of the request without a reply
        self._count = 0  # pictures since the start
        self._first_needed = 0  # number of the first picture that the reader must return
        self._results = deque[Image | None]()  # results that ``grab`` has not returned yet
        self._closing = Event()

    @property
    def source_name(self) -> str:
        """Name of the source: a path, a device, or an address without its password."""
        return display_name(self._source)

    @property
    def hint(self) -> str:
        """Next command that the user can type if the source opens but gives no picture."""
        return source_hint(self._source)

    def start(self, closing: Event) -> float | None:
        self._closing = closing
        try:
            process = self._process = self._process or ReaderProcess(self._request)
        except OSError as error:
            raise NotConnected(
                f"{self._name}: {self.source_name}: cannot start a process to read it: {error}", hint="ulimit -u"
            ) from error
        process.error_output = b""
        self._count = self._first_needed = 0
        self._results.clear()
        process.send(bytes([SKIP_TO, *NUMBER.pack(0), START]))
        self._pending_since = self._clock.now()
        reply = self._wait_for_reply(OPEN_TIMEOUT)
        if reply is None:
            trouble = NotConnected(
                f"{self._name}: {self.source_name}: timed out after {OPEN_TIMEOUT:g} s while opening", hint=self.hint
            )
            raise self._add_cause(trouble, process)
        self._pending_since = None
        if "error" in reply:
            raise self._add_cause(NotConnected(reply["error"], hint=reply["hint"]), process)
        period: float | None = reply["period"]
        return period

    def grab(self, skip_count: Callable[[], int]) -> Image | None:
        if not self._results:
            if (process := self._process) is None:
                return None
            self.skip_next(skip_count())
            if self._pending_since is None:
                process.send(bytes([GRAB]))
                self._pending_since = self._clock.now()
            reply = self._next_reply(process, GRAB_TIMEOUT)
            if reply is None:
                return NO_PICTURE if self._clock.now() - self._pending_since < STALL_TIMEOUT else None
            self._pending_since = None
            if "error" in reply:
                raise NotConnected(reply["error"], hint=reply["hint"])
            self._results += [SKIPPED_PICTURE] * reply["gone_by"]
            if reply["shape"] is not None:
                self._results.append(process.copy_picture(reply["shape"]))
            elif reply["ended"]:
                self._results.append(None)
        self._count += 1
        return self._results.popleft()

    def skip_next(self, pictures: int) -> None:
        """Skip the next ``pictures`` without decoding them; replaces the number set by an earlier call. Thread-safe.

        The reader process counts skipped pictures itself, which saves a request for each picture.
        """
        with self._lock:
            first = min(self._count + pictures, _MAX_NUMBER)
            if (
                self._process is not None
                and max(first, self._first_needed) > self._count
                and first != self._first_needed
            ):
                self._first_needed = first
                self._process.send(bytes([SKIP_TO, *NUMBER.pack(first)]))

    def stop(self) -> None:
        process = self._process
        if process is None:
            return
        if self._closing.is_set() or self._pending_since is not None:
            self._close(process, orderly=self._pending_since is None)
        else:  # reusing the process is faster
            process.send(bytes([RELEASE]))
        self._pending_since = None

    def _close(self, process: ReaderProcess, *, orderly: bool) -> None:
        with self._lock:
            self._process = None
        process.close(orderly=orderly)

    def _add_cause(self, error: NotConnected, process: ReaderProcess) -> NotConnected:
        from drivers.camera.causes import add_cause  # noqa: PLC0415 - it imports ssl and http, for failures alone

        return add_cause(error, process.error_output, self._source)

    def _wait_for_reply(self, timeout: float) -> Mapping[str, Any] | None:
        """Return the next reply; None after ``timeout`` seconds, or when the camera is closed."""
        begin = self._clock.now()
        while self._process is not None and not self._closing.is_set() and self._clock.now() - begin < timeout:
            reply = self._next_reply(self._process, GRAB_TIMEOUT)
            if reply is not None:
                return reply
        return None

    def _next_reply(self, process: ReaderProcess, timeout: float) -> Mapping[str, Any] | None:
        try:
            return process.next_reply(timeout)
        except (EOFError, ValueError) as error:
            how = process.exit_reason()
            self._close(process, orderly=False)
            what = f"{self._name}: {self.source_name}: its reader process {how}"
            raise NotConnected(what, hint=self.hint) from error


def _create_shared_memory() -> int:
    """Return the file descriptor of anonymous memory (memfd), or of an unnamed temporary file if there is no memfd."""
    with suppress(OSError, AttributeError):
        return os.memfd_create("camera")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())
