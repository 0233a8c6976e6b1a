"""Runs a task as `mission run` in a child process, which stops its robot when the server ends.

The child holds the reading end of a pipe, its *leash*. Only the server has the writing end and never writes, so the
pipe closes however the server ends, even by ``kill -9``, and the run stops safely. The child also inherits the server's
lock, so that no other server starts a run before this one has ended.
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
from missions.executive.signals import STOP_SIGNALS
from missions.library.shipped import find_mission
from missions.plugins.tasks.task import AttemptOutcome, Claim, How, Task

# Output of a process on stdout and stderr, line by line, without blocking.


class ProcessOutput:
    """Reads the output pipes of a process line by line, without blocking, while it is entered."""

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
        """Yield the complete lines and their pipes; wait for the first for at most ``seconds``."""
        for key, _ in self._selector.select(seconds):
            pipe: IO[bytes] = key.data
            data = os.read(pipe.fileno(), 1 << 16)
            if not data:
                self._selector.unregister(pipe)
            *whole, self._partial_lines[pipe] = (self._partial_lines[pipe] + data).split(b"\n")
            yield from ((pipe, line.decode(errors="replace")) for line in whole)

    def remaining_lines(self) -> Iterator[tuple[IO[bytes], str]]:
        """Yield all remaining lines, including incomplete last ones."""
        while self._selector.select(0.0):
            yield from self.lines(0.0)
        yield from ((pipe, rest.decode(errors="replace")) for pipe, rest in self._partial_lines.items() if rest)


Stopping = Callable[[], bool]
"""Function that returns whether the task is to be stopped; it is called a few times a second."""

Say = Callable[[str], None]

Work = Callable[[Claim, Stopping, Say], AttemptOutcome]
"""Function that runs the task of a Claim and passes its messages to Say. It ends the run once Stopping returns True."""

STOP_CHECK_INTERVAL = 0.2
"""Seconds between two checks whether to stop a run."""

STOP_TIMEOUT = 10.0
"""Seconds for a run to stop safely after SIGTERM before it is killed; the devices of its robot then stop by themselves.
"""

END_SIGNALS = frozenset({signal.SIGKILL, *STOP_SIGNALS})
"""Signals by which a person ends a run; its lifeline sends SIGKILL to one that did not react to an earlier signal."""

RUN_COMMAND = (sys.executable, "-m", "missions", "run")


def arguments_of(task: Task) -> list[str]:
    """Return the arguments of `mission run` for a task.

    A library name becomes a path, since a file of that name in the server's folder would take precedence.
    """
    mission = task.mission
    with suppress(UnknownNameError):
        mission = str(find_mission(mission, Path(os.devnull)))  # /dev/null is not a folder, so no files are beside it
    params = [f"--param={name}={value}" for name, value in task.params.items()]
    robot = [f"--robot={task.robot}"] if task.robot else []
    return [*params, *robot, *task.options, "--", mission]


class RunProcess:
    """A Work that runs a task in a child process.

    The child inherits the file descriptors ``inherited_files``. ``print_line`` gets its output for people.
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
        """Run the task of ``claim`` to its end; ``say`` receives the messages of the mission.

        If ``stopping`` or ``say`` raises, stop the run safely and raise the exception again. Raises OSError if no
        process can be started.
        """
        with _make_leash() as leash:
            command = [*self._command, "--json", f"--leash={leash}", *arguments_of(claim.task)]
            with subprocess.Popen(  # noqa: S603 - ourselves
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                pass_fds=(leash, *self._inherited_files),
                start_new_session=True,  # Ctrl-C goes to the server, which stops the run
            ) as process:
                try:
                    return self._watch(process, stopping, say)
                finally:
                    _kill(process)

    def _watch(self, process: "subprocess.Popen[bytes]", stopping: Stopping, say: Say) -> AttemptOutcome:
        """Read the output of a run until it ends, and stop it on request."""
        output, end = _RunOutput(say, self._print_line), _Termination(process, self._stop_timeout, self._clock)
        with ProcessOutput(process) as pipes:
            try:
                for line, from_results in _read_lines(process, pipes, stopping, end):
                    output.add_line(line, result=from_results)
            except BaseException:
                # After any error here, the robot must come to rest; its last output must not block.
                for _ in _read_lines(process, pipes, lambda: True, end):
                    pass
                raise
        return output.outcome(process.returncode, end)


def _read_lines(
    process: "subprocess.Popen[bytes]", pipes: ProcessOutput, stopping: Stopping, end: "_Termination"
) -> Iterator[tuple[str, bool]]:
    """Yield each output line of a process, with True if it comes from the standard output, until the process has ended.

    If ``stopping`` returns True, ``end`` stops the process.
    """
    over = False
    while not over:
        over = process.poll() is not None
        for pipe, line in pipes.remaining_lines() if over else pipes.lines(STOP_CHECK_INTERVAL):
            yield line, pipe is process.stdout
        if not over and (end.begun or stopping()):
            end.advance()


class _Termination:
    """Stops a process by SIGTERM, and by SIGKILL after ``grace`` seconds."""

    def __init__(self, process: "subprocess.Popen[bytes]", grace: float, clock: Clock) -> None:
        self._process, self._grace, self._clock = process, grace, clock
        self._kill_at = 0.0
        self.begun = False
        self.killed = ""

    def advance(self) -> None:
        """Send SIGTERM at the first call; later send SIGKILL if the process has not ended after ``grace`` seconds."""
        if not self.begun:
            self.begun = True
            self._process.terminate()
            self._kill_at = self._clock.now() + self._grace
        elif self._clock.now() > self._kill_at:
            self.killed = f"it did not stop within {self._grace:g} s, and was killed"
            _kill(self._process)


class _RunOutput:
    """Handles the output of a run: notices, the result, and lines for people."""

    def __init__(self, say: Say, out: Callable[[str], None]) -> None:
        self._say, self._out = say, out
        self._result: dict[str, Any] | None = None
        self._last = ""

    def add_line(self, line: str, *, result: bool) -> None:
        """Handle a line; with ``result``, it comes from the standard output and may be JSON."""
        answer = _json(line) if result else None
        if answer is not None and "notice" in answer:
            self._say(_replace_surrogates(answer["notice"]))
        elif answer is not None and answer.get("result") in ("success", "failure", "interrupted", "error"):
            self._result = answer
        else:
            self._last = line.strip() or self._last
            self._out(line)

    def outcome(self, code: int, end: "_Termination") -> AttemptOutcome:
        """Return the outcome of a run, given its exit code, and its ``end`` by the server.

        A run that was ended, but not by the server, is cancelled: a person has stopped the robot. Without a result in
        its output, a run that has crashed or was killed by the server counts as interrupted, and any other as an error.
        """
        if self._result is not None:
            how: How = self._result["result"]
            how = "cancelled" if how == "interrupted" and not end.begun else how
            return AttemptOutcome(how, _replace_surrogates(self._result.get("reason", "")))
        if -code in END_SIGNALS and not end.begun:
            return AttemptOutcome("cancelled", f"the run was ended by signal {-code}")
        if end.killed or code < 0:
            return AttemptOutcome("interrupted", end.killed or f"the run died: signal {-code}")
        return AttemptOutcome("error", self._last or f"the run ended with exit code {code} and no output")


@contextmanager
def _make_leash() -> Iterator[int]:
    """Yield the leash of a child: the reading end of a pipe whose writing end closes with this process.

    The writing end also closes at the end of the context.
    """
    reading, writing = os.pipe()
    try:
        yield reading
    finally:
        os.close(reading)
        os.close(writing)


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process and its process group, unless it has ended."""
    if process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def _replace_surrogates(value: object) -> str:
    """Return a text with lone surrogates replaced, which JSON allows but files and terminals refuse."""
    return str(value).encode(errors="replace").decode()


def _json(line: str) -> dict[str, Any] | None:
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None
