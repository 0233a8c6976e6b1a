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

from drivers.api import DeviceStatus, Health, Report, ignore
from drivers.clock import Clock
from drivers.errors import NoReply, NotConnected
from drivers.transport.loop import guarded

Message = Mapping[str, Any]
"""What one line of JSON says."""

LONGEST_DELAY = 30.0
"""Seconds between attempts at most; the first takes 1 s, each further one twice as long."""

LAST_WORDS = 200
"""Characters that are passed on of the last line in which a program complained."""

_PIECE = 65536  # bytes read at a time


def frame(message: Message, body: bytes = b"") -> bytes:
    """Return a message as it goes over a pipe; ``bytes`` is added to it where there is a ``body``."""
    head = {**message, "bytes": len(body)} if body else message
    return json.dumps(head, separators=(",", ":")).encode() + b"\n" + body


def last_words(complaint: bytes) -> str:
    """Return the last line of what a program wrote to its standard error: the others say how it came to that."""
    lines = complaint.decode("utf-8", "replace").split("\n")
    return next((line.strip()[-LAST_WORDS:] for line in reversed(lines) if line.strip()), "")


class Unframer:
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


class Talker(Protocol):
    """Who talks with a worker. All three are called from the worker's reading thread and must return soon."""

    def started(self) -> None:
        """A new process runs and knows nothing yet: tell it what it must know."""
        ...

    def received(self, message: Message, body: bytes) -> None:
        """It said something."""
        ...

    def lost(self, why: str) -> None:
        """It has died, and whatever it had to do with it; ``started`` follows once there is another."""
        ...


class Worker:
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
        report: Report = ignore,
        command: Sequence[str] = (sys.executable, "-I"),
    ) -> None:
        self.name = name
        self._command = (*command, str(program), *arguments)
        self._what = program.stem
        self._clock = clock
        self._hint = hint
        self._report = guarded(report)
        self._writing = Lock()  # over the process: who holds it may write, and nobody lets it go meanwhile
        self._process: Popen[bytes] | None = None
        self._trouble = f"{name}: {self._what}: not started yet"
        self._deaths = 0  # in a row
        self._starts = 0
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self, talker: Talker) -> None:
        """Start the program, and the thread that reads what it says; returns at once. Safe more than once."""
        if self._thread is None:
            self._ending.clear()
            self._thread = Thread(target=self._run, args=(talker,), name=f"{self.name} {self._what}", daemon=True)
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
        return Health(online=False, detail=self._trouble, hint=self._hint, counters=counters)

    def send(self, message: Message, body: bytes = b"", *, timeout: float = 1.0) -> None:
        """Send a message whole. Raises NotConnected when it does not run, NoReply when it does not listen.

        ``timeout`` in seconds is for another sender to end, and for each pause in which the pipe takes nothing. A
        process that has been told half a message is of no more use, so it is killed then.
        """
        if not self._writing.acquire(timeout=timeout):
            raise NoReply(f"{self.name}: {self._what}: busy for {timeout:g} s", hint=self._hint)
        try:
            process = self._process
            if process is None or process.stdin is None:
                raise NotConnected(self._trouble, hint=self._hint)
            self._write(process.stdin.fileno(), frame(message, body), timeout)
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
                    raise NoReply(f"{self.name}: {self._what}: took nothing for {timeout:g} s", hint=self._hint)
                left = left[os.write(pipe, left) :]
        except OSError as error:  # a broken pipe: it is dying, which its reader will tell
            if isinstance(error, NoReply):
                raise
            raise NotConnected(f"{self.name}: {self._what}: {error.strerror}", hint=self._hint) from error

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self, talker: Talker) -> None:
        while not self._ending.is_set():
            began = self._clock.now()
            why = self._live(talker)
            if self._ending.is_set():
                return
            self._deaths = 1 if self._clock.now() - began > LONGEST_DELAY else self._deaths + 1
            trouble = f"{self.name}: {self._what}: {why}"
            if self._deaths == 1 or trouble != self._trouble:
                self._report(DeviceStatus(self.name, "fault", trouble, self._hint))
            self._trouble = trouble
            guarded(talker.lost)(self._trouble)
            self._ending.wait(min(2.0 ** (self._deaths - 1), LONGEST_DELAY))

    def _live(self, talker: Talker) -> str:
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
                complaint = self._serve(process, talker)
            finally:
                self.kill()
                with self._writing:
                    self._process = None
                process.wait()
        return f"ended with {process.returncode}" + (f": {complaint}" if complaint else "")

    def _serve(self, process: "Popen[bytes]", talker: Talker) -> str:
        """Pass on what the process says until it says no more; return its last words on standard error."""
        if process.stdout is None or process.stderr is None:
            return ""
        complaint, unframer = b"", Unframer()
        out, err = process.stdout.fileno(), process.stderr.fileno()
        ready = select.poll()
        ready.register(out, select.POLLIN)
        ready.register(err, select.POLLIN)
        guarded(talker.started)()
        received = guarded(talker.received)
        while True:
            for pipe, _ in ready.poll():
                data = os.read(pipe, _PIECE)
                if pipe == err:
                    complaint = (complaint + data)[-4 * LAST_WORDS :]  # in UTF-8
                    if not data:
                        ready.unregister(err)
                    continue
                if not data:
                    return last_words(_drained(err, complaint))
                try:
                    for message, body in unframer.feed(data):
                        received(message, body)
                except (ValueError, RecursionError) as error:  # the latter from brackets in brackets in brackets
                    return f"{error}; {last_words(_drained(err, complaint))}"


def _drained(pipe: int, complaint: bytes) -> bytes:
    """Return a complaint with the rest of it, as far as that has come: both pipes of a program end in the same moment.

    It is not waited for: somebody whom the program has started may hold its end for ever.
    """
    os.set_blocking(pipe, False)
    with suppress(BlockingIOError):
        while data := os.read(pipe, _PIECE):
            complaint = (complaint + data)[-4 * LAST_WORDS :]
    return complaint
