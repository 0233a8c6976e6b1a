"""Worker process of MissionTree, with messages over its pipes. It is restarted after it has exited.

Code that may crash, holds the GIL, or has another licence runs in a worker: synthesiser, sound card, recogniser. A
worker is a file run by its path, in Python's isolated mode. It imports no other module of MissionTree, unless its
computations need one. It exits when its standard input ends, so it never outlives the robot. A message is a line of
JSON (an object). If the object has ``bytes: N``, N bytes follow the line.
"""

import json
import os
import select
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import PIPE, Popen
from threading import Event, Lock, Thread
from typing import Any, Protocol

from drivers.api import DeviceStatus, Health, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import NoReply, NotConnected
from drivers.transport.loop import guard_callback

Message = Mapping[str, Any]
"""Content of one line of JSON."""

MAX_RETRY_DELAY = 30.0
"""Maximum seconds between two starts; the first delay is 1 s, and each is twice the previous one."""

MAX_ERROR_LENGTH = 200
"""Maximum characters of the last error line that are reported."""

_READ_SIZE = 65536  # bytes of a read


def pack_message(message: Message, body: bytes = b"") -> bytes:
    """Return the bytes of a message; if there is a ``body``, its length is added to the message as ``bytes``."""
    head = {**message, "bytes": len(body)} if body else message
    return json.dumps(head, separators=(",", ":")).encode() + b"\n" + body


def last_error_line(stderr: bytes) -> str:
    """Return the last line of a program's standard error: the lines before it are the traceback."""
    lines = stderr.decode("utf-8", "replace").split("\n")
    return next((line.strip()[-MAX_ERROR_LENGTH:] for line in reversed(lines) if line.strip()), "")


class MessageParser:
    """Parses messages from a stream of bytes, which may arrive in chunks of any size."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._head: dict[str, Any] | None = None

    def feed(self, data: bytes) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Add received bytes; yield each complete message with its body. Raises ValueError for an invalid message."""
        self._data += data
        while True:
            if self._head is None:
                line, separator, rest = self._data.partition(b"\n")
                if not separator:
                    return
                head = json.loads(line)
                if not isinstance(head, dict):
                    raise ValueError(f"not a message: {bytes(line[:60])!r}")
                self._head, self._data = head, rest
            size = self._head.get("bytes", 0)
            if not isinstance(size, int) or size < 0:
                raise ValueError(f"not a number of bytes: {size!r:.60}")
            if len(self._data) < size:
                return
            with memoryview(self._data) as view:
                head, body = self._head, bytes(view[:size])  # one copy only: it may have megabytes
            self._head = None
            del self._data[:size]
            yield head, body


class WorkerHandler(Protocol):
    """Handler of a worker's messages. All methods are called from the thread that reads them, and must return soon."""

    def on_started(self) -> None:
        """Send the initial messages: a new process has started."""
        ...

    def on_message(self, message: Message, body: bytes) -> None:
        """Handle a message from the worker."""
        ...

    def on_exit(self, reason: str) -> None:
        """Drop pending requests, since the process has exited; ``reason`` says how. A new process is started later."""
        ...


class WorkerProcess:
    """Runs the Python file ``program`` with ``arguments``, and restarts it after 1, 2, 4.. s when it exits.

    ``name`` is the part in messages. ``hint`` is the hint if the program does not run. An exit is reported as a fault;
    the same exit is reported only once. ``command`` is the Python that runs the program.
    """

    def __init__(
        self,
        name: str,
        program: Path,
        clock: Clock,
        *,
        arguments: Sequence[str] = (),
        hint: str = "",
        report: StatusCallback = ignore,
        command: Sequence[str] = (sys.executable, "-I"),
    ) -> None:
        self.name = name
        self._command = (*command, str(program), *arguments)
        self._program_name = program.stem
        self._clock = clock
        self._hint = hint
        self._report = guard_callback(report)
        self._writing = Lock()  # held while writing to the process, and while dropping it
        self._process: Popen[bytes] | None = None
        self._offline_reason = f"{name}: {self._program_name}: not started yet"
        self._exits_in_a_row = 0  # in a row
        self._starts = 0
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self, handler: WorkerHandler) -> None:
        """Start the program, and a thread that calls ``handler`` with its messages; returns at once.

        Safe more than once.
        """
        if self._thread is None:
            self._ending.clear()
            self._thread = Thread(
                target=self._run, args=(handler,), name=f"{self.name} {self._program_name}", daemon=True
            )
            self._thread.start()

    def close(self) -> None:
        """Kill the process and end the thread. Safe from any state, more than once. The handler must not call it."""
        self._ending.set()
        self.kill()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()

    def kill(self) -> None:
        """Kill the process now; while the worker is open, it is restarted."""
        process = self._process
        if process is not None and process.returncode is None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)

    def health(self) -> Health:
        """Return whether the process runs, and if not, how it ended."""
        counters = {"starts": self._starts}
        if self._process is not None:
            return Health(online=True, counters=counters)
        return Health(online=False, detail=self._offline_reason, hint=self._hint, counters=counters)

    def send(self, message: Message, body: bytes = b"", *, timeout: float = 1.0) -> None:
        """Send a message completely. Raises NotConnected if the process does not run, NoReply if it does not read.

        ``timeout`` is the time in seconds to wait for another thread that is sending, and for each pause in which the
        pipe is full. If only part of a message could be sent, the process is killed.
        """
        if not self._writing.acquire(timeout=timeout):
            raise NoReply(f"{self.name}: {self._program_name}: busy for {timeout:g} s", hint=self._hint)
        try:
            process = self._process
            if process is None or process.stdin is None:
                raise NotConnected(self._offline_reason, hint=self._hint)
            self._write(process.stdin.fileno(), pack_message(message, body), timeout)
        finally:
            self._writing.release()

    def _write(self, pipe: int, data: bytes, timeout: float) -> None:
        poll = select.poll()
        poll.register(pipe, select.POLLOUT)
        remaining = memoryview(data)
        try:
            while remaining:
                if not poll.poll(timeout * 1000):
                    self.kill()
                    raise NoReply(
                        f"{self.name}: {self._program_name}: accepted no data for {timeout:g} s", hint=self._hint
                    )
                remaining = remaining[os.write(pipe, remaining) :]
        except OSError as error:  # a broken pipe: the reading thread will report the exit
            if isinstance(error, NoReply):
                raise
            raise NotConnected(f"{self.name}: {self._program_name}: {error.strerror}", hint=self._hint) from error

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self, handler: WorkerHandler) -> None:
        while not self._ending.is_set():
            began = self._clock.now()
            reason = self._run_process(handler)
            if self._ending.is_set():
                return
            self._exits_in_a_row = 1 if self._clock.now() - began > MAX_RETRY_DELAY else self._exits_in_a_row + 1
            trouble = f"{self.name}: {self._program_name}: {reason}"
            if self._exits_in_a_row == 1 or trouble != self._offline_reason:
                self._report(DeviceStatus(self.name, "fault", trouble, self._hint))
            self._offline_reason = trouble
            guard_callback(handler.on_exit)(self._offline_reason)
            self._ending.wait(min(2.0 ** (self._exits_in_a_row - 1), MAX_RETRY_DELAY))

    def _run_process(self, handler: WorkerHandler) -> str:
        """Run one process from start to exit; return how it ended."""
        try:
            process = Popen(  # noqa: S603 - no shell; a program of ours
                self._command, stdin=PIPE, stdout=PIPE, stderr=PIPE, bufsize=0, start_new_session=True
            )
        except OSError as error:
            return str(error)
        with process:
            if process.stdin is not None:
                os.set_blocking(process.stdin.fileno(), False)
            self._starts += 1
            self._process = process
            if self._ending.is_set():  # closed during the start
                self.kill()
            try:
                error_line = self._serve(process, handler)
            finally:
                self.kill()
                with self._writing:
                    self._process = None
                process.wait()
        return f"ended with {process.returncode}" + (f": {error_line}" if error_line else "")

    def _serve(self, process: "Popen[bytes]", handler: WorkerHandler) -> str:
        """Pass messages to the handler until the process closes its output; return its last error line."""
        if process.stdout is None or process.stderr is None:
            return ""
        stderr, unframer = b"", MessageParser()
        out, err = process.stdout.fileno(), process.stderr.fileno()
        ready = select.poll()
        ready.register(out, select.POLLIN)
        ready.register(err, select.POLLIN)
        guard_callback(handler.on_started)()
        received = guard_callback(handler.on_message)
        while True:
            for pipe, _ in ready.poll():
                data = os.read(pipe, _READ_SIZE)
                if pipe == err:
                    stderr = (stderr + data)[-4 * MAX_ERROR_LENGTH :]  # in UTF-8
                    if not data:
                        ready.unregister(err)
                    continue
                if not data:
                    return last_error_line(_read_rest(err, stderr))
                try:
                    for message, body in unframer.feed(data):
                        received(message, body)
                except (ValueError, RecursionError) as error:  # RecursionError from deeply nested brackets
                    return f"{error}; {last_error_line(_read_rest(err, stderr))}"


def _read_rest(pipe: int, stderr: bytes) -> bytes:
    """Return ``stderr`` with the bytes added that ``pipe`` has now; call it after the program has ended its output.

    It does not wait for the end of the pipe, because a child of the program may keep it open.
    """
    os.set_blocking(pipe, False)
    with suppress(BlockingIOError):
        while data := os.read(pipe, _READ_SIZE):
            stderr = (stderr + data)[-4 * MAX_ERROR_LENGTH :]
    return stderr
