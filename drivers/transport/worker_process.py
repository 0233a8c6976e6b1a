"""A program of ours in a process of its own: messages over its pipes, and a new one when it has died.

What crashes, blocks Python or has another licence runs so: synthesiser, sound card, recogniser. Such a program is a
file run by its path, in Python's isolated mode, and imports nothing of ours but what it computes with. It ends when its
standard input does, so none outlives the robot. A message is a line of JSON (an object); where that has ``bytes: N``, N
bytes follow.
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
"""What one line of JSON says."""

MAX_RETRY_DELAY = 30.0
"""Seconds between attempts at most; the first takes 1 s, each further one twice as long."""

MAX_ERROR_LENGTH = 200
"""Characters that are passed on of the last line in which a program complained."""

_READ_SIZE = 65536  # bytes read at a time


def pack_message(message: Message, body: bytes = b"") -> bytes:
    """Return a message as it goes over a pipe; ``bytes`` is added to it where there is a ``body``."""
    head = {**message, "bytes": len(body)} if body else message
    return json.dumps(head, separators=(",", ":")).encode() + b"\n" + body


def last_error_line(stderr: bytes) -> str:
    """Return the last line of what a program wrote to its standard error: the others say how it came to that."""
    lines = stderr.decode("utf-8", "replace").split("\n")
    return next((line.strip()[-MAX_ERROR_LENGTH:] for line in reversed(lines) if line.strip()), "")


class MessageParser:
    """Puts messages together again from bytes that are cut anywhere."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._head: dict[str, Any] | None = None

    def feed(self, data: bytes) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Yield the messages that ``data`` completes, each with its body. Raises ValueError for what is no message."""
        self._data += data
        while True:
            if self._head is None:
                line, found, rest = self._data.partition(b"\n")
                if not found:
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
                head, body = self._head, bytes(view[:size])  # copied once: it may be megabytes
            self._head = None
            del self._data[:size]
            yield head, body


class WorkerHandler(Protocol):
    """Who talks with a worker. All three are called from the worker's reading thread and must return soon."""

    def on_started(self) -> None:
        """A new process runs and knows nothing yet: tell it what it must know."""
        ...

    def on_message(self, message: Message, body: bytes) -> None:
        """It said something."""
        ...

    def on_exit(self, reason: str) -> None:
        """It has died, and whatever it had to do with it; ``on_started`` follows once there is another."""
        ...


class WorkerProcess:
    """Runs ``program`` (a file) with ``arguments``, and again after 1, 2, 4.. s when it dies.

    ``name`` is the part of the robot that it works for, ``hint`` what to type when it does not run. Deaths are
    reported as faults, but not again and again. ``command`` stands for the Python that runs it.
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
        self._writing = Lock()  # over the process: who holds it may write, and nobody lets it go meanwhile
        self._process: Popen[bytes] | None = None
        self._offline_reason = f"{name}: {self._program_name}: not started yet"
        self._exits_in_a_row = 0  # in a row
        self._starts = 0
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self, handler: WorkerHandler) -> None:
        """Start the program, and the thread that reads what it says; returns at once. Safe more than once."""
        if self._thread is None:
            self._ending.clear()
            self._thread = Thread(
                target=self._run, args=(handler,), name=f"{self.name} {self._program_name}", daemon=True
            )
            self._thread.start()

    def close(self) -> None:
        """Kill it and end the thread. Safe from any state, more than once, but not from the talker."""
        self._ending.set()
        self.kill()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()

    def kill(self) -> None:
        """Kill the process now, whatever it does; while the worker is open, another one follows."""
        process = self._process
        if process is not None and process.returncode is None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)

    def health(self) -> Health:
        """Say whether it runs, and if not, how it ended."""
        counters = {"starts": self._starts}
        if self._process is not None:
            return Health(online=True, counters=counters)
        return Health(online=False, detail=self._offline_reason, hint=self._hint, counters=counters)

    def send(self, message: Message, body: bytes = b"", *, timeout: float = 1.0) -> None:
        """Send a message whole. Raises NotConnected when it does not run, NoReply when it does not listen.

        ``timeout`` in seconds is for another sender to end, and for each pause in which the pipe takes nothing. A
        process that has been told half a message is of no more use, so it is killed then.
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
        room = select.poll()
        room.register(pipe, select.POLLOUT)
        left = memoryview(data)
        try:
            while left:
                if not room.poll(timeout * 1000):
                    self.kill()
                    raise NoReply(f"{self.name}: {self._program_name}: took nothing for {timeout:g} s", hint=self._hint)
                left = left[os.write(pipe, left) :]
        except OSError as error:  # a broken pipe: it is dying, which its reader will tell
            if isinstance(error, NoReply):
                raise
            raise NotConnected(f"{self.name}: {self._program_name}: {error.strerror}", hint=self._hint) from error

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self, handler: WorkerHandler) -> None:
        while not self._ending.is_set():
            began = self._clock.now()
            why = self._run_process(handler)
            if self._ending.is_set():
                return
            self._exits_in_a_row = 1 if self._clock.now() - began > MAX_RETRY_DELAY else self._exits_in_a_row + 1
            trouble = f"{self.name}: {self._program_name}: {why}"
            if self._exits_in_a_row == 1 or trouble != self._offline_reason:
                self._report(DeviceStatus(self.name, "fault", trouble, self._hint))
            self._offline_reason = trouble
            guard_callback(handler.on_exit)(self._offline_reason)
            self._ending.wait(min(2.0 ** (self._exits_in_a_row - 1), MAX_RETRY_DELAY))

    def _run_process(self, handler: WorkerHandler) -> str:
        """Run one process from its birth to its death; return how it ended."""
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
            if self._ending.is_set():  # closed while it was being born
                self.kill()
            try:
                complaint = self._serve(process, handler)
            finally:
                self.kill()
                with self._writing:
                    self._process = None
                process.wait()
        return f"ended with {process.returncode}" + (f": {complaint}" if complaint else "")

    def _serve(self, process: "Popen[bytes]", handler: WorkerHandler) -> str:
        """Pass on what the process says until it says no more; return its last words on standard error."""
        if process.stdout is None or process.stderr is None:
            return ""
        complaint, unframer = b"", MessageParser()
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
                    complaint = (complaint + data)[-4 * MAX_ERROR_LENGTH :]  # in UTF-8
                    if not data:
                        ready.unregister(err)
                    continue
                if not data:
                    return last_error_line(_read_rest(err, complaint))
                try:
                    for message, body in unframer.feed(data):
                        received(message, body)
                except (ValueError, RecursionError) as error:  # the latter from brackets in brackets in brackets
                    return f"{error}; {last_error_line(_read_rest(err, complaint))}"


def _read_rest(pipe: int, stderr: bytes) -> bytes:
    """Return a complaint with the rest of it, as far as that has come: both pipes of a program end in the same moment.

    It is not waited for: somebody whom the program has started may hold its end for ever.
    """
    os.set_blocking(pipe, False)
    with suppress(BlockingIOError):
        while data := os.read(pipe, _READ_SIZE):
            stderr = (stderr + data)[-4 * MAX_ERROR_LENGTH :]
    return stderr
