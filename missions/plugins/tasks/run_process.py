"""Doing a task: `mission run` in a process of its own, which brings its robot to rest when the server goes.

The run has a *leash*, the reading end of a pipe that only the server can write to: nobody ever does, so whatever ends
the server, ``kill -9`` above all, ends the pipe, and the run stops safely. The run also inherits the server's lock, so
that no other server starts a run before this one is over.
"""

import json
import os
import selectors
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Self

from config.library import UnknownNameError
from drivers.clock import Clock, SystemClock
from missions.library.shipped import find_mission
from missions.plugins.tasks.task import AttemptOutcome, Claim, Task

# What a process says on its two outputs, line by line, without waiting for either.


class ProcessOutput:
    """While it is entered, reads the two outputs of a process; they must be pipes."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._partial_lines = {pipe: b"" for pipe in (process.stdout, process.stderr) if pipe is not None}
        self._selector: selectors.BaseSelector

    def __enter__(self) -> Self:
        self._selector = selectors.DefaultSelector()
        for pipe in self._partial_lines:
            os.set_blocking(pipe.fileno(), False)
            self._selector.register(pipe, selectors.EVENT_READ, pipe)
        return self

    def __exit__(self, *_: object) -> None:
        self._selector.close()

    def lines(self, seconds: float) -> Iterator[tuple[IO[bytes], str]]:
        """Yield the lines that have come, and of which pipe; wait for the first of them for so many seconds."""
        for key, _ in self._selector.select(seconds):
            pipe: IO[bytes] = key.data
            data = os.read(pipe.fileno(), 1 << 16)
            if not data:
                self._selector.unregister(pipe)
            *whole, self._partial_lines[pipe] = (self._partial_lines[pipe] + data).split(b"\n")
            yield from ((pipe, line.decode(errors="replace")) for line in whole)

    def remaining_lines(self) -> Iterator[tuple[IO[bytes], str]]:
        """Yield all lines that there are, the last of a pipe even where it is not ended."""
        while self._selector.select(0.0):
            yield from self.lines(0.0)
        yield from ((pipe, rest.decode(errors="replace")) for pipe, rest in self._partial_lines.items() if rest)


Stopping = Callable[[], bool]
"""Says whether the task is to be stopped; asked a few times a second."""

Say = Callable[[str], None]

Work = Callable[[Claim, Stopping, Say], AttemptOutcome]
"""Does a task, and says what its mission wants to be told; with the first True of ``Stopping`` it ends, interrupted."""

STOP_CHECK_INTERVAL = 0.2
"""Seconds from one question whether to stop to the next."""

STOP_TIMEOUT = 10.0
"""Seconds that a run has to stop safely; then it is killed, and the devices stop by themselves."""

RUN_COMMAND = (sys.executable, "-m", "missions", "run")


def arguments_of(task: Task) -> list[str]:
    """Return the words behind `mission run` for a task.

    A name of the library becomes its path: a file of that name in the server's folder would go before it.
    """
    mission = task.mission
    with suppress(UnknownNameError):
        mission = str(find_mission(mission, Path(os.devnull)))  # nothing is beside in what is no folder
    params = [f"--param={name}={value}" for name, value in task.params.items()]
    robot = [f"--robot={task.robot}"] if task.robot else []
    return [*params, *robot, *task.options, "--", mission]


class RunProcess:
    """A Work: runs a task in a child process.

    The child inherits the file descriptors ``hold``. What it tells people goes to ``out``, line by line.
    """

    def __init__(
        self,
        inherited_files: Sequence[int],
        print_line: Callable[[str], None],
        *,
        command: Sequence[str] = RUN_COMMAND,
        stop_timeout: float = STOP_TIMEOUT,
        clock: Clock | None = None,
    ) -> None:
        self._inherited_files, self._print_line, self._command, self._stop_timeout = (
            inherited_files,
            print_line,
            command,
            stop_timeout,
        )
        self._clock = SystemClock() if clock is None else clock

    def __call__(self, claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        """Run it to its end; where that is not to be, since ``stopping`` or ``say`` raises, until it is at rest.

        Raises OSError where no process can be started, and what those two raise.
        """
        with _make_leash() as leash:
            command = [*self._command, "--json", f"--leash={leash}", *arguments_of(claim.task)]
            with subprocess.Popen(  # noqa: S603 - ourselves
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                pass_fds=(leash, *self._inherited_files),
                start_new_session=True,  # a Ctrl-C is for the server, which tells the run
            ) as process:
                try:
                    return self._watch(process, stopping, say)
                finally:
                    _kill(process)

    def _watch(self, process: "subprocess.Popen[bytes]", stopping: Stopping, say: Say) -> AttemptOutcome:
        """Listen to a run until it ends, and stop it where that is wanted."""
        heard, end = _RunOutput(say, self._print_line), _Termination(process, self._stop_timeout, self._clock)
        with ProcessOutput(process) as pipes:
            try:
                for line, from_results in _read_lines(process, pipes, stopping, end):
                    heard.add_line(line, result=from_results)
            except BaseException:
                # Whatever goes wrong here, the robot comes to rest. To be heard no more must not block its last words.
                for _ in _read_lines(process, pipes, lambda: True, end):
                    pass
                raise
        return heard.outcome(process.returncode, end.killed)


def _read_lines(
    process: "subprocess.Popen[bytes]", pipes: ProcessOutput, stopping: Stopping, end: "_Termination"
) -> Iterator[tuple[str, bool]]:
    """Yield what a run says, and whether it comes from where results do, until it has ended, or was brought to it."""
    over = False
    while not over:
        over = process.poll() is not None
        for pipe, line in pipes.remaining_lines() if over else pipes.lines(STOP_CHECK_INTERVAL):
            yield line, pipe is process.stdout
        if not over and (end.begun or stopping()):
            end.advance()


class _Termination:
    """Brings a process to its end: asks it to stop and, once ``grace`` seconds are over, kills it."""

    def __init__(self, process: "subprocess.Popen[bytes]", grace: float, clock: Clock) -> None:
        self._process, self._grace, self._clock = process, grace, clock
        self._kill_at = 0.0
        self.begun = False
        self.killed = ""

    def advance(self) -> None:
        """Do what is to be done by now."""
        if not self.begun:
            self.begun = True
            self._process.terminate()
            self._kill_at = self._clock.now() + self._grace
        elif self._clock.now() > self._kill_at:
            self.killed = f"it did not stop within {self._grace:g} s, and was killed"
            _kill(self._process)


class _RunOutput:
    """What a run has said: notices at once, in the end a result, and lines for people."""

    def __init__(self, say: Say, out: Callable[[str], None]) -> None:
        self._say, self._out = say, out
        self._result: dict[str, Any] | None = None
        self._last = ""

    def add_line(self, line: str, *, result: bool) -> None:
        """Take in a line: of JSON, where it comes from where results do."""
        told = _json(line) if result else None
        if told is not None and "notice" in told:
            self._say(_replace_surrogates(told["notice"]))
        elif told is not None and told.get("result") in ("success", "failure", "interrupted", "error"):
            self._result = told
        else:
            self._last = line.strip() or self._last
            self._out(line)

    def outcome(self, code: int, killed: str) -> AttemptOutcome:
        """Return how the run ended, which had this exit code. One that could not tell its result was interrupted."""
        if self._result is not None:
            return AttemptOutcome(self._result["result"], _replace_surrogates(self._result.get("reason", "")))
        if killed or code < 0:
            return AttemptOutcome("interrupted", killed or f"the run died: signal {-code}")
        return AttemptOutcome("error", self._last or f"the run ended with exit code {code}, and said nothing")


@contextmanager
def _make_leash() -> Iterator[int]:
    """Give the end of a pipe that ends when this process does, or when this is over."""
    reading, writing = os.pipe()
    try:
        yield reading
    finally:
        os.close(reading)
        os.close(writing)


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process, and those that it has started; nothing where it has ended."""
    if process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def _replace_surrogates(told: object) -> str:
    """Return a text without the halves of signs that JSON lets through, and that no file or terminal takes."""
    return str(told).encode(errors="replace").decode()


def _json(line: str) -> dict[str, Any] | None:
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None
