"""Running the ``mission`` command in a test: in this process, or as a process of its own."""

import json
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import Any, ClassVar

import pytest

from missions.cli.root import mission, run_guarded
from tests.forked import Forked

PATIENCE = 60.0
"""Seconds that a test waits for a process or for another thread before it fails: machines are shared."""


@dataclass(frozen=True)
class Outcome:
    """What a command left behind."""

    code: int
    out: str
    err: str


def command(capsys: pytest.CaptureFixture[str], *arguments: str) -> Outcome:
    """Run ``mission`` with these arguments here and now."""
    capsys.readouterr()
    code = run_guarded(lambda: mission.main(list(arguments), standalone_mode=False))
    printed = capsys.readouterr()
    return Outcome(code, printed.out, printed.err)


class Process:
    """A ``mission`` process whose lines on stdout are gathered as they come.

    ``running`` are those that nobody has ended yet.
    """

    running: ClassVar[set["Process"]] = set()

    def __init__(self, *arguments: str, folder: Path | None = None) -> None:
        self.lines: list[str] = []
        self._more = Event()
        self.process = Forked("missions", *arguments, folder=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self._threads = [Thread(target=self._read, daemon=True), Thread(target=self._read_errors, daemon=True)]
        self.errors: list[str] = []
        for thread in self._threads:
            thread.start()
        self.running.add(self)

    def wait_for_line(self, wanted: Callable[[str], bool], *, seconds: float = PATIENCE) -> str:
        """Return the first line that ``wanted`` likes; fail the test when none comes in time."""
        for _ in range(int(seconds / 0.05)):
            found = next((line for line in self.lines if wanted(line)), None)
            if found is not None:
                return found
            if self.process.poll() is not None and not self._threads[0].is_alive():
                break
            self._more.wait(0.05)
            self._more.clear()
        pytest.fail(f"no such line among {self.lines}, {self.errors}")

    def end(self, number: int | None = None) -> int:
        """Send a signal, if any, wait for the process, and return its exit code."""
        if number is not None:
            self.process.send_signal(number)
        try:
            code = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            pytest.fail("the process did not end")
        finally:
            self.running.discard(self)
            for thread in self._threads:
                thread.join(5.0)
            for stream in (self.process.stdout, self.process.stderr):
                if stream is not None:
                    stream.close()
        return code

    def _read(self) -> None:
        for line in self.process.stdout or ():
            self.lines.append(line.rstrip("\n"))
            self._more.set()

    def _read_errors(self) -> None:
        for line in self.process.stderr or ():
            self.errors.append(line)


def events_of(lines: Sequence[str]) -> list[dict[str, Any]]:
    """Read JSON lines."""
    return [json.loads(line) for line in lines if line.strip()]
