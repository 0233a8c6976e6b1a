"""Client of the process that writes a record: sends items, and receives the status and losses."""

import fcntl
import json
import os
import select
import subprocess
import sys
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import field
from enum import Enum
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from drivers.api.fast_dataclass import dataclass
from drivers.clock import SystemClock
from missions.plugins.records.recording.items import BATCH_HEADER, pack_items
from missions.plugins.records.recording.record_header import RecordContents


@dataclass(frozen=True, slots=True)
class RecordLoss:
    """Messages missing from a record: their number by topic, and the reason.

    ``limit_reached_at`` is the time (s) at which the record reached its size limit, or None.
    """

    counts: Mapping[str, int] = field(default_factory=dict)
    reason: str = ""
    limit_reached_at: float | None = None

    def __bool__(self) -> bool:
        return bool(self.counts or self.reason or self.limit_reached_at is not None)

    def __str__(self) -> str:
        """Describe the loss in one line; empty if nothing is missing."""
        parts = []
        if self.counts:
            counts = ", ".join(f"{count} on {topic}" for topic, count in sorted(self.counts.items()))
            total = sum(self.counts.values())
            noun = "message is" if total == 1 else "messages are"
            parts.append(f"{total} {noun} missing ({self.reason or 'lost'}): {counts}")
        elif self.reason:
            parts.append(self.reason)
        if self.limit_reached_at is not None:
            parts.append(f"the size limit was reached at {self.limit_reached_at:.1f} s, and the record ends there")
        return "; ".join(parts)


class WriterState(Enum):
    """State of a writer process, as its client knows it.

    ABORTED: no record was begun. STOPPED: it accepts no more items. CLOSED: the record is closed. An event that
    TRANSITIONS does not list for the state changes nothing.
    """

    NEW, STARTING, RECORDING, ABORTED, STOPPED, CLOSED = range(6)


class WriterEvent(Enum):
    """Event that changes the state of a writer process.

    READY: the record has begun. CLOSE: the record is complete. END: writing ended for another reason.
    """

    START, READY, END, CLOSE = range(4)


TRANSITIONS: Final = {
    (WriterState.NEW, WriterEvent.START): WriterState.STARTING,
    (WriterState.STARTING, WriterEvent.READY): WriterState.RECORDING,
    (WriterState.STARTING, WriterEvent.END): WriterState.ABORTED,
    (WriterState.RECORDING, WriterEvent.END): WriterState.STOPPED,
    (WriterState.RECORDING, WriterEvent.CLOSE): WriterState.CLOSED,
}

SUPERSEDED = "replaced by a newer picture"
"""Reason of a picture that is missing because the computer was busy; this is no fault."""

POLL_INTERVAL = 0.1
"""Seconds between two checks whether ``abandon`` was called, while the pipe to the writer process is full."""

PIPE_BYTES = 1 << 20
"""Requested capacity in bytes of the pipe to the writer process: more than a picture."""

EXIT_TIMEOUT = 1.0
"""Seconds for which to wait for the exit code of a writer process that has closed its pipes."""

_READ_BYTES = 1 << 16


class CannotRecordError(RuntimeError):
    """A record cannot be started: the message has the reason, ``hint`` the command to try."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class RecordWriterClient:
    """Client of one writer process. ``abandon`` is thread-safe; call all other methods from one thread.

    ``counts`` are the messages in a closed record, ``lost`` those that could not be written, with ``reason``.
    ``limit_reached_at`` is the time (s) at which the record reached its size limit. ``problems`` are still to be
    reported. The process has ``start_timeout`` seconds to start.
    """

    def __init__(self, path: Path, *, limit: float, overwrite: bool, start_timeout: float) -> None:
        self.problems: deque[str] = deque()
        self.counts: Mapping[str, int] = {}
        self.lost: Mapping[str, int] = {}
        self.reason = ""
        self.limit_reached_at: float | None = None
        self.state = WriterState.NEW
        self.path = path
        self._overwrite = overwrite
        self._start_timeout = start_timeout
        self._arguments = [str(path.resolve()), repr(float(limit)), "overwrite" if overwrite else "new"]
        self._process: subprocess.Popen[bytes] | None = None
        self._input_fd = self._output_fd = -1
        self._received = b""
        self._last_output = ""  # last line that is not JSON, such as an interpreter's error
        self._output_closed = False
        self._abandon_reason = ""

    @property
    def accepts_items(self) -> bool:
        """Whether items can be sent: the writer process is starting or recording."""
        return self.state in (WriterState.STARTING, WriterState.RECORDING)

    @property
    def process_id(self) -> int | None:
        """ID of the writer process; None if it does not run."""
        return None if self._process is None else self._process.pid

    def open(self, contents: RecordContents) -> None:
        """Start the writer process, and wait until the contents are in its file. Raises CannotRecordError."""
        if find_spec("mcap") is None:
            raise CannotRecordError("records need mcap, which is missing", hint="pip install 'missiontree[records]'")
        if self.path.exists() and not self.path.is_file():
            raise CannotRecordError(f"{self.path}: not a regular file", hint="name another file")
        if self.path.exists() and not self._overwrite:
            raise CannotRecordError(f"{self.path}: already exists", hint="another name, or --overwrite")
        if not self.path.parent.is_dir():
            folder = self.path.parent
            raise CannotRecordError(f"{self.path}: no folder {folder}", hint=f"mkdir -p {folder}")
        self._start()
        self.send(pack_items([contents]))
        wall = SystemClock()
        while self.state is WriterState.STARTING and wall.now() < self._start_timeout:
            self.receive(POLL_INTERVAL)
        if self.state in (WriterState.STARTING, WriterState.ABORTED):
            why = self.reason or f"its writer process did not start within {self._start_timeout:.0f} s"
            self.abandon(why)
            self.finish()
            raise CannotRecordError(
                f"{self.path}: cannot be written: {why}", hint="another folder, or a disk with free space"
            )

    def _start(self) -> None:
        paths = [str(Path(__file__).parents[4]), os.environ.get("PYTHONPATH", "")]
        self._process = process = subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-P", "-m", "missions.plugins.records.recording.writer_process", *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            bufsize=0,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
            start_new_session=True,  # Ctrl-C must reach only the run
        )
        if process.stdin is None or process.stdout is None:
            raise CannotRecordError(f"{self.path}: its writer process has no pipes")
        self._input_fd, self._output_fd = process.stdin.fileno(), process.stdout.fileno()
        os.set_blocking(self._input_fd, False)
        with suppress(OSError, AttributeError):  # Linux only, and limited by pipe-max-size
            fcntl.fcntl(self._input_fd, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._advance(WriterEvent.START)

    def send(self, batch: bytes) -> bool:
        """Send a batch of items, blocking until the writer process accepts it; return whether it did."""
        left = memoryview(BATCH_HEADER.pack(len(batch)) + batch)
        while left and self.accepts_items and not self._abandon_reason:
            if select.select([], [self._input_fd], [], POLL_INTERVAL)[1]:
                with suppress(BlockingIOError, BrokenPipeError):  # receive() detects a broken pipe
                    left = left[os.write(self._input_fd, left) :]
            self.receive()
        return not left

    def receive(self, timeout: float = 0.0) -> None:
        """Process status lines of the writer, waiting up to ``timeout`` seconds."""
        if self._output_closed or not select.select([self._output_fd], [], [], timeout)[0]:
            return
        data = os.read(self._output_fd, _READ_BYTES)
        *lines, self._received = (self._received + data).split(b"\n")
        for line in lines:
            self._handle_line(line)
        if not data:
            self._output_closed = True
            if self.accepts_items:
                self._stop(f"its writer process ended{self._exit_description()}")

    def _handle_line(self, line: bytes) -> None:
        try:
            status: Any = json.loads(line)
        except ValueError:
            self._last_output = line.decode(errors="replace").strip()
            return
        match status:
            case {"ready": True}:
                self._advance(WriterEvent.READY)
            case {"failed": str(why)}:
                self._stop(why)
            case {"lost": dict(lost), "why": str(why)}:
                if why != SUPERSEDED and (not self.lost or self.reason == SUPERSEDED):
                    self.problems.append(f"{why}: messages are being lost")
                self.lost, self.reason = lost, why
            case {"renamed": str(name)}:
                self.path = self.path.with_name(name)
            case {"trouble": str(why)}:
                self.problems.append(why)
            case {"closed": {"counts": dict(counts), "ended": ended}}:
                self.counts, self.limit_reached_at = counts, ended
                self._advance(WriterEvent.CLOSE)
                if ended is not None:
                    self.problems.append(
                        f"the size limit of the record was reached at {ended:.1f} s, and it ends there"
                    )

    def _stop(self, reason: str) -> None:
        """Store the reason why the writer process accepts no more items, and report it; the run goes on."""
        was_recording, self.reason = self.state is WriterState.RECORDING, reason
        self._advance(WriterEvent.END)
        if was_recording:
            self.problems.append(f"{reason}: recording stopped")

    def _advance(self, event: WriterEvent) -> None:
        self.state = TRANSITIONS.get((self.state, event), self.state)

    def _exit_description(self) -> str:
        code = None
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):  # the kernel closes the pipes before the process has ended
                code = self._process.wait(EXIT_TIMEOUT)
        killed = f", killed by signal {-code}" if code is not None and code < 0 else ""
        return f"{killed}: {self._last_output}" if self._last_output else killed

    def abandon(self, reason: str) -> None:
        """Stop waiting for the writer process: ``send`` returns, ``finish`` kills the process. Idempotent."""
        self._abandon_reason = self._abandon_reason or reason

    def finish(self) -> None:
        """Let the writer process write its queue, and wait for its exit. Idempotent."""
        process, self._process = self._process, None
        if process is None or process.stdin is None or process.stdout is None:
            return
        process.stdin.close()
        while not self._output_closed and not self._abandon_reason:
            self.receive(POLL_INTERVAL)
        self._advance(WriterEvent.END)
        if not self._output_closed:
            self.reason = self._abandon_reason
            process.kill()
        process.wait()
        process.stdout.close()
