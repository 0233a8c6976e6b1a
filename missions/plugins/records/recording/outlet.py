"""The way from a run to the process that writes its record, and what that tells in return: also what is lost."""

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

from drivers.api.quick import dataclass
from drivers.clock import SystemClock
from missions.plugins.records.recording.head import Contents
from missions.plugins.records.recording.items import HEADER, packed


@dataclass(frozen=True, slots=True)
class Loss:
    """What is missing in a record: messages by topic, and why. ``ended`` is when it reached its limit (s), or None."""

    counts: Mapping[str, int] = field(default_factory=dict)
    why: str = ""
    ended: float | None = None

    def __bool__(self) -> bool:
        return bool(self.counts or self.why or self.ended is not None)

    def __str__(self) -> str:
        """Say it in a line for people; nothing where nothing is missing."""
        said = []
        if self.counts:
            named = ", ".join(f"{count} on {topic}" for topic, count in sorted(self.counts.items()))
            said.append(f"{sum(self.counts.values())} messages are missing ({self.why or 'lost'}): {named}")
        elif self.why:
            said.append(self.why)
        if self.ended is not None:
            said.append(f"it reached its limit at {self.ended:.1f} s and ends there")
        return "; ".join(said)


class WriterState(Enum):
    """State of a writing process. ABORTED: it never began its file; STOPPED: it takes nothing more; CLOSED: it is done.

    A pair that TRANSITIONS lacks changes nothing.
    """

    NEW, STARTING, RECORDING, ABORTED, STOPPED, CLOSED = range(6)


class WriterEvent(Enum):
    """Event of a writing process; END is any end of its work but that of a complete record."""

    START, READY, END, CLOSE = range(4)


TRANSITIONS: Final = {
    (WriterState.NEW, WriterEvent.START): WriterState.STARTING,
    (WriterState.STARTING, WriterEvent.READY): WriterState.RECORDING,
    (WriterState.STARTING, WriterEvent.END): WriterState.ABORTED,
    (WriterState.RECORDING, WriterEvent.END): WriterState.STOPPED,
    (WriterState.RECORDING, WriterEvent.CLOSE): WriterState.CLOSED,
}

GLANCE = 0.1
"""Seconds within which a pipe that is full sees that its process has been given up."""

PIPE = 1 << 20
"""Bytes that the pipe is to hold, so that a picture does not fill it."""

_BLOCK = 1 << 16


class CannotRecordError(RuntimeError):
    """A record that cannot even be begun: the message says why, ``hint`` what to type next."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class Outlet:
    """One writing process: ``open``, ``send`` and ``hear`` from one thread, then ``finish``; ``give_up`` from any.

    ``counts`` are the messages in a closed record, ``lost`` those that could not be written, and ``why``. ``ended`` is
    the time (s) at which the record reached its limit. ``troubles`` are still to be reported. The process has
    ``start_time`` seconds to begin.
    """

    def __init__(self, path: Path, *, limit: float, overwrite: bool, start_time: float) -> None:
        self.troubles: deque[str] = deque()
        self.counts: Mapping[str, int] = {}
        self.lost: Mapping[str, int] = {}
        self.why = ""
        self.ended: float | None = None
        self.state = WriterState.NEW
        self.path = path
        self._overwrite = overwrite
        self._start_time = start_time
        self._arguments = [str(path.resolve()), repr(float(limit)), "overwrite" if overwrite else "new"]
        self._process: subprocess.Popen[bytes] | None = None
        self._to = self._from = -1
        self._heard = b""
        self._said = ""  # the last words of an interpreter that fails
        self._silent = False  # the process has closed its output
        self._given_up = ""

    @property
    def takes(self) -> bool:
        """Whether the process takes items."""
        return self.state in (WriterState.STARTING, WriterState.RECORDING)

    @property
    def process(self) -> int | None:
        """The number of its process; None where there is none."""
        return None if self._process is None else self._process.pid

    def open(self, contents: Contents) -> None:
        """Start the process, and wait until the beginning of the record is in its file. Raises CannotRecordError."""
        if find_spec("mcap") is None:
            raise CannotRecordError("records need mcap, which is missing", hint="pip install 'missiontree[records]'")
        if self.path.exists() and not self.path.is_file():
            raise CannotRecordError(f"{self.path}: is no file that could be written over", hint="name another file")
        if self.path.exists() and not self._overwrite:
            raise CannotRecordError(f"{self.path}: is there already", hint="another name, or --overwrite")
        if not self.path.parent.is_dir():
            folder = self.path.parent
            raise CannotRecordError(f"{self.path}: there is no folder {folder}", hint=f"mkdir -p {folder}")
        self._start()
        self.send(packed([contents]))
        wall = SystemClock()
        while self.state is WriterState.STARTING and wall.now() < self._start_time:
            self.hear(GLANCE)
        if self.state in (WriterState.STARTING, WriterState.ABORTED):
            why = self.why or f"its process did not begin within {self._start_time:.0f} s"
            self.give_up(why)
            self.finish()
            raise CannotRecordError(f"{self.path}: cannot be written: {why}", hint="another folder or disk, with room")

    def _start(self) -> None:
        paths = [str(Path(__file__).parents[4]), os.environ.get("PYTHONPATH", "")]
        self._process = process = subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-P", "-m", "missions.plugins.records.recording.process", *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            bufsize=0,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
            start_new_session=True,  # a Ctrl-C is the run's to hear
        )
        if process.stdin is None or process.stdout is None:
            raise CannotRecordError(f"{self.path}: its process has no pipes")
        self._to, self._from = process.stdin.fileno(), process.stdout.fileno()
        os.set_blocking(self._to, False)
        with suppress(OSError, AttributeError):  # where the system has such a thing, and allows so much
            fcntl.fcntl(self._to, fcntl.F_SETPIPE_SZ, PIPE)
        self._advance(WriterEvent.START)

    def send(self, batch: bytes) -> bool:
        """Send a batch, however long the process takes to accept it; say whether it has."""
        left = memoryview(HEADER.pack(len(batch)) + batch)
        while left and self.takes and not self._given_up:
            if select.select([], [self._to], [], GLANCE)[1]:
                with suppress(BlockingIOError, BrokenPipeError):  # a broken one is heard of below
                    left = left[os.write(self._to, left) :]
            self.hear()
        return not left

    def hear(self, timeout: float = 0.0) -> None:
        """Take in what the process tells, waiting up to ``timeout`` seconds for it."""
        if self._silent or not select.select([self._from], [], [], timeout)[0]:
            return
        data = os.read(self._from, _BLOCK)
        *lines, self._heard = (self._heard + data).split(b"\n")
        for line in lines:
            self._take(line)
        if not data:
            self._silent = True
            if self.takes:
                self._stop(f"its process has ended{self._last_words()}")

    def _take(self, line: bytes) -> None:
        try:
            told: Any = json.loads(line)
        except ValueError:
            self._said = line.decode(errors="replace").strip()
            return
        match told:
            case {"ready": True}:
                self._advance(WriterEvent.READY)
            case {"failed": str(why)}:
                self._stop(why)
            case {"lost": dict(lost), "why": str(why)}:
                if not self.lost:
                    self.troubles.append(f"{why}: messages are being lost")
                self.lost, self.why = lost, why
            case {"renamed": str(name)}:
                self.path = self.path.with_name(name)
            case {"trouble": str(why)}:
                self.troubles.append(why)
            case {"closed": {"counts": dict(counts), "ended": ended}}:
                self.counts, self.ended = counts, ended
                self._advance(WriterEvent.CLOSE)
                if ended is not None:
                    self.troubles.append(f"the record has reached its limit at {ended:.1f} s, and ends there")

    def _stop(self, why: str) -> None:
        """Note that the process takes no more, though the run goes on."""
        was_recording, self.why = self.state is WriterState.RECORDING, why
        self._advance(WriterEvent.END)
        if was_recording:
            self.troubles.append(f"{why}: nothing more is recorded")

    def _advance(self, event: WriterEvent) -> None:
        self.state = TRANSITIONS.get((self.state, event), self.state)

    def _last_words(self) -> str:
        code = None if self._process is None else self._process.poll()
        killed = f", killed by signal {-code}" if code is not None and code < 0 else ""
        return f"{killed}: {self._said}" if self._said else killed

    def give_up(self, why: str) -> None:
        """Wait for the process no longer: let ``send`` and ``finish`` end it. Safe more than once."""
        self._given_up = self._given_up or why

    def finish(self) -> None:
        """Let the process write what it has, and wait until it has ended. Safe more than once."""
        process, self._process = self._process, None
        if process is None or process.stdin is None or process.stdout is None:
            return
        process.stdin.close()
        while not self._silent and not self._given_up:
            self.hear(GLANCE)
        self._advance(WriterEvent.END)
        if not self._silent:
            self.why = self._given_up
            process.kill()
        process.wait()
        process.stdout.close()
