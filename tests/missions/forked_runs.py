"""Processes that each run one ``mission`` command, forked from a program that has imported everything already.

As a program it takes the words of a command from each line of its stdin, and tells the ID of the process that runs it.
"""

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

from missions.cli import run  # noqa: F401 - so that no process has to import it again
from missions.cli.root import guarded, mission


class Forks:
    """The program, as the test sees it."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    def start(self, *arguments: str) -> int:
        """Start a command in a process of its own; return its ID."""
        if self._process.stdin is None or self._process.stdout is None:
            raise RuntimeError("the program cannot be asked")
        self._process.stdin.write(shlex.join(arguments) + "\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())


@contextmanager
def forks() -> Iterator[Forks]:
    """Run the program; whatever it has started is killed by the test, or ends by itself."""
    command = [sys.executable, "-m", "tests.missions.forked_runs"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield Forks(process)


def main() -> None:
    """Fork a process for each line, until the input ends."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for them
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            be_command(shlex.split(line))
        print(child, flush=True)  # noqa: T201 - what the test reads


def be_command(words: list[str]) -> NoReturn:
    """Run a command in silence, and end the process."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1):
        os.dup2(nowhere, number)
    os._exit(guarded(lambda: mission.main(words, standalone_mode=False)))


if __name__ == "__main__":
    main()
